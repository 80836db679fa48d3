//! Smoothed surface densities, and models scored against them, as a user runs it.

use crate::common::{fails, listing, particlegs, snapshot};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Pixels are float32: sums of them are off by less.
const NEARLY: f64 = 1e-4;

/// A clump and an even background in an open box, and a model of them.
fn subjects(dir: &Path) -> [PathBuf; 2] {
    // Additive recurrences fill a cube evenly (Roberts 2018).
    let along = |step: f64| -> Vec<f32> {
        let at = |i: u32| (0.5 + step * f64::from(i)).fract();
        (0..6000).map(|i| if i % 2 == 0 { 0.4 + 0.1 * at(i) } else { at(i) } as f32).collect()
    };
    let columns = [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9].map(along);
    let (particles, model) = (dir.join("cloud"), dir.join("cloud.pgs"));
    snapshot(&particles, &columns);
    let mut c = particlegs();
    c.arg("compress").arg(&particles).arg("-o").arg(&model);
    c.args(["--gaussians", "60", "--certificate=none", "--quiet"]).assert().success();
    [model, particles]
}

const WINDOW: [&str; 7] = ["--style", "density", "--projection", "orthographic", "--size", "80x80", "--quiet"];

fn drawn(verb: &str, subject: &Path, out: &Path, more: &[&str]) -> Value {
    let mut c = particlegs();
    c.arg(verb).arg(subject).args(WINDOW).args(more).args(["--json", "-", "-o"]).arg(out);
    let done = c.assert().success();
    serde_json::from_slice(&done.get_output().stdout).unwrap()
}

/// Particles in a folder of values with 40 pixels a unit.
fn mass(folder: &Path) -> f64 {
    let bytes = std::fs::read(folder.join("view.f32")).unwrap();
    bytes.as_chunks::<4>().0.iter().map(|v| f64::from(f32::from_le_bytes(*v))).sum::<f64>() / 1600.0
}

#[test]
fn a_model_is_scored_against_the_smoothed_truth() {
    let dir = tempfile::tempdir().unwrap();
    let [model, particles] = subjects(dir.path());
    let at = |name: &str| dir.path().join(name);
    let report = drawn("reference", &particles, &at("truth"), &["--smooth", "32", "--raw"]);
    assert_eq!(report["smooth"], 32);
    assert!(report["smooth_seconds"].as_f64().unwrap() >= 0.0);
    drawn("reference", &particles, &at("points"), &["--raw"]);
    drawn("render", &model, &at("model"), &["--raw"]);
    drawn("reference", &particles, &at("whole"), &["--smooth", "32", "--raw", "--width", "2"]);
    assert!((mass(&at("whole")) / 6000.0 - 1.0).abs() < NEARLY, "{}", mass(&at("whole")));
    let said: Value = serde_json::from_slice(&std::fs::read(at("truth").join("view.json")).unwrap()).unwrap();
    assert_eq!((said["smooth"].as_u64(), said["width"].as_u64()), (Some(32), Some(80)));

    let compared = |truth: &str| {
        let mut c = particlegs();
        c.arg("compare").arg(at("model")).arg(at(truth)).args(["--json", "-"]);
        let c: Value = serde_json::from_slice(&c.assert().success().get_output().stdout).unwrap();
        c["densities"][0].clone()
    };
    let (smooth, points) = (compared("truth"), compared("points"));
    let of = |scores: &Value, key: &str| scores[key].as_f64().unwrap();
    assert_eq!(smooth["name"], "view");
    assert!(of(&smooth, "rms_dex") < 0.7 * of(&points, "rms_dex"), "{smooth} {points}");
    assert!(of(&smooth, "correlation") > 0.9 && of(&smooth, "mean_dex").abs() < 0.3, "{smooth}");
    assert!(of(&smooth, "pixels") > 2.0 * of(&points, "pixels"));
    let same = particlegs().arg("compare").args([at("truth"), at("truth")]).assert().success();
    let table = String::from_utf8_lossy(&same.get_output().stdout).into_owned();
    assert!(table.contains("0.0000 dex") && table.contains("1.0000") && !table.contains("PSNR"), "{table}");
}

/// Of a periodic box that has not the picture's shape, from a side.
#[test]
fn a_model_has_the_window_of_its_particles() {
    let dir = tempfile::tempdir().unwrap();
    let [_, particles] = subjects(dir.path());
    let at = |name: &str| dir.path().join(name);
    let model = at("periodic.pgs");
    std::fs::write(particles.join("meta.json"), r#"{"box": [1.0, 2.0, 1.0], "periodic": true}"#).unwrap();
    let mut c = particlegs();
    c.arg("compress").arg(&particles).args(["--gaussians", "60", "--certificate=none", "--quiet", "-o"]);
    c.arg(&model).assert().success();
    drawn("reference", &particles, &at("truth"), &["--raw"]);
    drawn("reference", &particles, &at("smooth"), &["--raw", "--smooth", "32"]);
    drawn("render", &model, &at("model"), &["--raw"]);
    for truth in ["truth", "smooth"] {
        particlegs().arg("compare").arg(at("model")).arg(at(truth)).assert().success();
    }
    for (map, off) in [("truth", 1e-6), ("model", 1e-5), ("smooth", 2e-5)] {
        assert!((mass(&at(map)) / 6000.0 - 1.0).abs() < off, "{map}: {}", mass(&at(map)) / 6000.0 - 1.0);
    }
}

#[test]
fn smoothed_pictures_are_the_same_whatever_the_threads() {
    let dir = tempfile::tempdir().unwrap();
    let [_, particles] = subjects(dir.path());
    let files = ["1", "3"].map(|threads| {
        let out = dir.path().join(format!("{threads}.png"));
        drawn("reference", &particles, &out, &["--smooth", "8", "--depth", "0.5", "--threads", threads]);
        std::fs::read(out).unwrap()
    });
    assert!(files[0] == files[1]);
}

#[test]
fn what_cannot_be_smoothed_or_compared_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let [model, particles] = subjects(dir.path());
    let reference = |more: &[&str]| {
        let mut c = particlegs();
        c.arg("reference").arg(&particles).args(more).arg("-o").arg(dir.path().join("out"));
        c
    };
    fails(&mut reference(&["--style", "density", "--smooth", "6000"]), 2, "there are 6000");
    fails(&mut reference(&["--smooth", "16"]), 2, "--smooth does nothing here");
    reference(&["--style", "density", "--smooth", "1"]).assert().failure().code(2);
    let at = |name: &str| dir.path().join(name);
    drawn("reference", &particles, &at("a"), &["--smooth", "16", "--raw"]);
    drawn("render", &model, &at("b"), &["--raw", "--center", "0.5,0.5,0.6"]);
    let compare = || {
        let mut c = particlegs();
        c.arg("compare").arg(at("b")).arg(at("a"));
        c.output().unwrap()
    };
    let out = compare();
    assert_eq!(out.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&out.stderr).contains("different windows"));
    // Files that were cut or are no numbers are said in their place.
    let path = at("b").join("view.f32");
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - 5]).unwrap();
    assert!(String::from_utf8_lossy(&compare().stderr).contains("80x80 pixels take 25600"));
    std::fs::write(&path, vec![0xff; whole.len()]).unwrap();
    assert!(String::from_utf8_lossy(&compare().stderr).contains("not finite"));
    std::fs::write(at("b").join("view.json"), "{}").unwrap();
    assert!(String::from_utf8_lossy(&compare().stderr).contains("not what --raw writes"));
    assert_eq!(listing(&at("b")), ["view.f32", "view.json"]);
}
