//! What needs much memory, under a shell's limit: an error that says so, never an abort.
#![cfg(target_os = "linux")]

mod common;

use common::particlegs;
use particlegs::codec::{self, Precision};
use particlegs::math::Sym3;
use particlegs::model::{Block, LawKind, Layer, Mass, Metadata, Mixture, Model};
use particlegs::particles::Bounds;
use std::path::Path;
use std::process::{Command, Output};

/// A file of `n` equal Gaussians.
fn equal_gaussians(n: usize, path: &Path) {
    let mut gaussians = Mixture::default();
    (0..n).for_each(|_| gaussians.push([1.0; 3], Sym3::scaled_identity(0.01), 1.0, 1.0));
    let bounds = Bounds { min: [0.0; 3], max: [2.0; 3] };
    let (count, mass) = (n as u64, n as f64);
    let metadata = Metadata {
        law: LawKind::OpticalDepth,
        count,
        mass,
        bounds,
        cell: None,
        default_radius: 0.01,
        default_opacity: 0.05,
        source: "equal".into(),
        source_hash: [0; 32],
        length_unit: None,
        mass_unit: None,
        comoving: None,
        scale_factor: None,
        hubble: None,
        time: None,
        command: "a test".into(),
        tool_version: "0".into(),
    };
    let blocks = vec![Block { bounds, count, mass, gaussians }];
    let layers = vec![Layer { name: "particles".into(), mass: Mass::Unknown, content: blocks }];
    let model = Model { metadata, layers, vizmapper: None, certificate: None };
    let bytes = codec::encode(&model, &Precision::BALANCED).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// Runs the command with so much address space.
fn limited(folder: &Path, mebibytes: u64, arguments: &str) -> Output {
    let binary = particlegs().get_program().to_owned();
    let script = format!("ulimit -v {}; exec \"$0\" {arguments} --threads 1 -q", mebibytes * 1024);
    Command::new("sh").current_dir(folder).args(["-c", &script]).arg(binary).output().unwrap()
}

#[test]
fn pictures_that_do_not_fit_say_so() {
    let dir = tempfile::tempdir().unwrap();
    equal_gaussians(3, &dir.path().join("m.pgs"));
    for style in ["paraview", "density"] {
        let out = limited(dir.path(), 1024, &format!("render m.pgs --out p --size 32768x32768 --style {style}"));
        let text = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(7), "{style}: {text}");
        assert!(
            text.contains("needs about") && text.lines().filter(|l| l.starts_with("error:")).count() == 1,
            "{text}"
        );
    }
}

/// A small file may stand for many Gaussians: what they take is asked for before they are decoded.
#[test]
#[ignore = "slow"]
fn models_that_do_not_fit_say_so() {
    let dir = tempfile::tempdir().unwrap();
    equal_gaussians(1_000_000, &dir.path().join("m.pgs"));
    let bytes = std::fs::metadata(dir.path().join("m.pgs")).unwrap().len();
    assert!(bytes < 1_000_000, "{bytes} bytes");
    for arguments in [
        "verify m.pgs",
        "render m.pgs -o p --size 64x64",
        "simplify m.pgs -o s.pgs --gaussians 9",
        "merge m.pgs -o n.pgs",
    ] {
        let out = limited(dir.path(), 128, arguments);
        let text = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(7), "{arguments}: {text}");
        assert!(text.contains("bytes of memory"), "{arguments}: {text}");
    }
    assert_eq!(limited(dir.path(), 2048, "verify m.pgs").status.code(), Some(0));
}
