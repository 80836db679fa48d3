//! Models of the alpha-blend law in every command that reads a model: a tiny one of the sample,
//! untrained.

use crate::common::{fails, listing, particlegs, sample};
use crate::models::tiny;
use particlegs::codec::{self, Precision};
use particlegs::model::{LawKind, Model};
use particlegs::particles::Particles;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Writes the model of some runs; its path and bytes.
fn write(dir: &Path, name: &str, runs: std::ops::Range<usize>, law: LawKind) -> PathBuf {
    let particles = Particles::open_raw(&[sample()]).unwrap();
    let path = dir.join(name);
    let bytes = codec::encode(&tiny(&particles, runs, law), &Precision::BALANCED).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path
}

fn decode(path: &Path) -> Model {
    codec::decode(&std::fs::read(path).unwrap(), "file").unwrap()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn stdout(command: &mut assert_cmd::Command) -> String {
    String::from_utf8_lossy(&command.assert().success().get_output().stdout).into_owned()
}

#[test]
fn info_and_verify_say_what_it_is() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), "m.pgs", 0..64, LawKind::AlphaBlend);
    let text = stdout(particlegs().arg("info").arg(&path));
    assert!(text.contains("1.0, image law alpha-blend"), "{text}");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        words.contains(
            "layers of 4, 64, 64, 2 values, 4610 parameters in 4812 bytes; scale within 0.1, opacity within 0.3"
        ),
        "{text}"
    );
    assert!(text.contains("4352 bytes as PLY, 68 a Gaussian"), "{text}");
    let out = dir.path().join("info.json");
    particlegs().arg("info").arg(&path).arg("--json").arg(&out).assert().success();
    let info = json(&out);
    assert_eq!((info["metadata"]["law"].as_str(), info["published_bytes"].as_u64()), (Some("alpha-blend"), Some(4352)));
    assert_eq!((&info["vizmapper"]["parameters"], &info["vizmapper"]["ranges"]["floor"]), (&4610.into(), &0.4.into()));
    let text = stdout(particlegs().arg("verify").arg(&path));
    assert!(text.contains("64 Gaussians whose counts sum to 262144 particles"), "{text}");
    // Measured as any other: pictures by its own law, densities and particles by its counts.
    let again = dir.path().join("again.json");
    let mut verify = particlegs();
    verify.arg("verify").arg(&path).arg(sample()).arg("--quiet").arg("--json").arg(&again).assert().success();
    let measured = &json(&again)["measured_again"];
    assert!(measured["orbits"][0]["expected"]["masked_psnr"].is_number(), "{measured}");
    let correlation = measured["density"]["correlation"].as_f64().unwrap();
    assert!(correlation > 0.0 && correlation < 1.0, "{measured}");
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[700] ^= 1;
    std::fs::write(dir.path().join("bad.pgs"), bytes).unwrap();
    fails(particlegs().arg("verify").arg(dir.path().join("bad.pgs")), 4, "VIZM");
}

#[test]
fn it_is_drawn_and_scored() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), "m.pgs", 0..64, LawKind::AlphaBlend);
    let out = dir.path().join("pictures");
    let render = |more: &[&str]| {
        let mut c = particlegs();
        c.arg("render").arg(&path).arg("--out").arg(&out).args(["--size", "160x90", "--quiet"]).args(more);
        c
    };
    for style in ["paraview", "paraview-no-fxaa", "expected"] {
        render(&["--style", style]).assert().success();
    }
    assert_eq!(listing(&out), ["view.png"]);
    std::fs::remove_dir_all(&out).unwrap();
    fails(&mut render(&["--style", "density"]), 2, "no surface density");
    assert!(!out.exists());
    let mut eval = particlegs();
    eval.arg("eval").arg(&path).arg(sample()).args(["--frames", "1", "--size", "96x54", "--quiet", "--json", "-"]);
    let scores: Value = serde_json::from_str(&stdout(&mut eval)).unwrap();
    for style in ["paraview", "paraview_no_fxaa", "expected"] {
        assert!(scores["mean"][style]["masked_psnr"].is_number(), "{scores}");
    }
}

#[test]
fn merging_takes_the_network_of_the_first_block() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b] =
        [("a.pgs", 0..30), ("b.pgs", 30..64)].map(|(name, runs)| write(dir.path(), name, runs, LawKind::AlphaBlend));
    let merged = |parts: [&Path; 2], name: &str| {
        let out = dir.path().join(name);
        let done = particlegs().arg("merge").args(parts).arg("-o").arg(&out).assert().success();
        let said = String::from_utf8_lossy(&done.get_output().stderr).into_owned();
        assert!(said.contains("note: the VizMapper is that of the part with the first block"), "{said}");
        std::fs::read(out).unwrap()
    };
    assert_eq!(merged([&a, &b], "ab.pgs"), merged([&b, &a], "ba.pgs"));
    let whole = decode(&dir.path().join("ab.pgs"));
    assert_eq!((whole.gaussians(), whole.metadata.count, whole.vizmapper().is_some()), (64, 262_144, true));
    particlegs().arg("verify").arg(dir.path().join("ab.pgs")).assert().success();
    let other = write(dir.path(), "c.pgs", 30..64, LawKind::OpticalDepth);
    let out = dir.path().join("no.pgs");
    fails(particlegs().arg("merge").args([&a, &other]).arg("-o").arg(&out), 3, "its image law is optical-depth");
    assert!(!out.exists());
}

#[test]
fn particles_are_recovered_by_opacity() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), "m.pgs", 0..64, LawKind::AlphaBlend);
    for method in ["count", "volume", "ellipsoid", "grid", "stratified", "spaced"] {
        let out = dir.path().join(method);
        let mut c = particlegs();
        c.arg("recover").arg(&path).arg("-o").arg(&out).args(["--method", method, "--quiet"]).assert().success();
        let p = Particles::open_raw(std::slice::from_ref(&out)).unwrap();
        assert_eq!(p.len(), 262_144);
        let from = &json(&out.join("meta.json"))["recovered_from"];
        let own = !["volume", "grid"].contains(&method);
        assert_eq!((&from["law"], &from["each_gaussian_has_its_own_count"]), (&"alpha-blend".into(), &own.into()));
    }
    let meta = json(&dir.path().join("count/meta.json"));
    let supports: Vec<&str> = meta["supports"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(supports.last().unwrap().contains("opacities"), "{supports:?}");
    particlegs()
        .arg("recover")
        .arg(&path)
        .arg("-o")
        .arg(dir.path().join("wide"))
        .args(["--scale", "1.5", "--particles", "1000", "--quiet"])
        .assert()
        .success();
}

#[test]
fn statistics_are_labelled_and_reduction_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), "m.pgs", 0..64, LawKind::AlphaBlend);
    let out = dir.path().join("stats");
    let mut c = particlegs();
    c.arg("stats").arg(sample()).arg(&path).arg("-o").arg(&out);
    c.args(["--only", "density", "--grid", "16", "--no-plots"]).assert().success();
    let stats = json(&out.join("stats.json"));
    let notes: Vec<&str> = stats["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(notes.iter().any(|n| n.contains("density of an alpha-blend model follows its opacities")), "{notes:?}");
    let small = dir.path().join("small.pgs");
    fails(
        particlegs().arg("simplify").arg(&path).arg("-o").arg(&small).args(["--gaussians", "10"]),
        2,
        "a model of the alpha-blend law cannot be simplified",
    );
    assert!(!small.exists());
}

#[test]
fn splats_are_written_as_published() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), "m.pgs", 0..64, LawKind::AlphaBlend);
    let out = dir.path().join("m.ply");
    let convert = |model: &Path, out: &Path, more: &[&str]| {
        let mut c = particlegs();
        c.arg("convert").arg(model).arg("-o").arg(out).args(more);
        c
    };
    let text = stdout(&mut convert(&path, &out, &[]));
    assert!(text.contains("64 splats"), "{text}");
    let bytes = std::fs::read(&out).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    assert_eq!(bytes.len() - end, 64 * 68);
    // A snapshot of 64 points to the other commands, which take an alpha-blend model's frame.
    let points = dir.path().join("points");
    convert(&out, &points, &["--quiet"]).assert().success();
    let (model, points) = (decode(&path), Particles::open_raw(&[points]).unwrap());
    let frame = particlegs::camera::Normalisation::of(&model.metadata.bounds);
    let g = &model.layers[0].content[0].gaussians;
    for i in 0..64 {
        let p = points.position(i);
        let signs = [-1.0, -1.0, 1.0];
        assert!((0..3).all(|k| (signs[k] * p[k] / frame.scale + frame.center[k] - g.mean[k][i]).abs() < 1e-4));
    }
    let no = dir.path().join("no.ply");
    fails(&mut convert(&path, &dir.path().join("no"), &[]), 2, "ends in .ply");
    fails(&mut convert(&path, &no, &["--tile", "2,1,1"]), 2, "converted to splats");
    let depth = write(dir.path(), "depth.pgs", 0..64, LawKind::OpticalDepth);
    fails(&mut convert(&depth, &no, &[]), 2, "has no opacities");
    assert!(!no.exists());
}
