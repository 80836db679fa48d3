//! What needs much memory, under a shell's limit: an error that says so, never an abort.
#![cfg(target_os = "linux")]

use crate::common::particlegs;
use crate::models::equal_gaussians;
use particlegs::codec::{self, Precision};
use std::path::Path;
use std::process::{Command, Output};

/// A file of so many equal Gaussians.
fn write(n: usize, path: &Path) {
    std::fs::write(path, codec::encode(&equal_gaussians(n), &Precision::BALANCED).unwrap()).unwrap();
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
    write(3, &dir.path().join("m.pgs"));
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
    write(1_000_000, &dir.path().join("m.pgs"));
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
