//! `render`, `reference`, `info` and `verify` as a user runs them.
#![allow(missing_docs)]

mod common;

use common::{fails, listing, particlegs, sample};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// VTK's pictures of the bundled sample and their views.
fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs/tests/golden/nbody64")
}

fn model(folder: &Path, args: &[&str]) -> PathBuf {
    let path = folder.join("m.pgs");
    let mut c = particlegs();
    c.arg("compress").arg(sample()).arg("-o").arg(&path).args(["--effort", "fast", "--quiet"]).args(args);
    c.assert().success();
    path
}

fn json(c: &mut assert_cmd::Command) -> Value {
    let out = c.args(["--json", "-"]).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// A model of a hundredth of the particles looks like VTK's own pictures of all of them.
#[test]
fn models_look_like_the_snapshot() {
    let dir = tempfile::tempdir().unwrap();
    let model = model(dir.path(), &["--ratio", "100", "--no-certificate"]);
    let pictures = dir.path().join("pictures");
    let mut c = particlegs();
    c.arg("render").arg(&model).arg("--views").arg(golden().join("views.json"));
    c.args(["--style", "paraview", "--quiet", "--out"]).arg(&pictures).assert().success();
    let scores = json(particlegs().arg("compare").arg(&pictures).arg(golden().join("paraview")));
    for view in scores["views"].as_array().unwrap() {
        let decibels = view["masked_psnr"].as_f64().unwrap();
        assert!(decibels > 20.0, "{}: {decibels}", view["name"]);
    }
}

#[test]
fn every_style_and_projection_draws() {
    let dir = tempfile::tempdir().unwrap();
    let model = model(dir.path(), &["--no-certificate"]);
    let out = dir.path().join("out");
    let small = ["--size", "160x120", "--quiet", "--out"];
    for style in ["expected", "paraview", "paraview-no-fxaa", "density"] {
        particlegs().arg("render").arg(&model).args(["--style", style]).args(small).arg(&out).assert().success();
        assert!(out.join("view.png").exists());
        std::fs::remove_dir_all(&out).unwrap();
    }
    for style in ["expected", "paraview", "paraview-no-fxaa", "response", "response-fxaa", "density"] {
        particlegs().arg("reference").arg(sample()).args(["--style", style]).args(small).arg(&out).assert().success();
        assert!(out.join("view.png").exists());
    }
    let mut c = particlegs();
    c.arg("render").arg(&model).args(["--style", "density", "--projection", "orthographic", "--raw"]);
    c.args(["--center", "0,0,0", "--width", "25", "--depth", "5"]).args(small).arg(&out).assert().success();
    assert_eq!(std::fs::metadata(out.join("view.f32")).unwrap().len(), 160 * 120 * 4);
}

#[test]
fn views_that_cannot_be_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let model = model(dir.path(), &["--no-certificate"]);
    let good: Value = serde_json::from_slice(&std::fs::read(golden().join("views.json")).unwrap()).unwrap();
    let bad = |change: &dyn Fn(&mut Value), text: &str| {
        let mut views = good.clone();
        change(&mut views);
        let file = dir.path().join("views.json");
        std::fs::write(&file, serde_json::to_vec(&views).unwrap()).unwrap();
        for (verb, subject) in [("render", &model), ("reference", &sample())] {
            let mut c = particlegs();
            c.arg(verb).arg(subject).arg("--views").arg(&file).args(["--style", "expected", "--out"]);
            fails(c.arg(dir.path().join("out")), 3, text);
        }
    };
    bad(&|v| v["width"] = 0.into(), "size");
    bad(&|v| v["views"][0]["radius"] = (-1.0).into(), "radius");
    bad(&|v| v["views"][0]["opacity"] = 1.5.into(), "opacity");
    bad(&|v| v["views"][0]["opacity"] = 0.into(), "opacity");
    bad(&|v| v["views"][0]["position"] = v["views"][0]["focal_point"].clone(), "focal point");
    bad(&|v| v["views"][0]["name"] = "../escape".into(), "name");
    bad(&|v| v["views"] = Value::Array(vec![]), "without views");
    bad(&|v| v["views"] = 3.into(), "views file");
    assert!(!dir.path().join("out").exists());
    let mut c = particlegs();
    c.arg("render").arg(&model).args(["--style", "expected", "--out"]).arg(model.join("below-a-file"));
    fails(&mut c, 6, "below-a-file");
}

#[test]
fn verify_finds_damage_and_measures_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = model(dir.path(), &["--ratio", "600"]);
    let seen = json(particlegs().arg("verify").arg(&path));
    assert_eq!(seen["certificate"], "not measured again");
    let again = json(particlegs().arg("verify").arg(&path).arg(sample()));
    let stored = json(particlegs().arg("info").arg(&path));
    let now = again["measured_again"]["orbits"][0]["expected"]["masked_psnr"].as_f64().unwrap();
    let then = stored["certificate"]["orbits"][0]["expected"]["masked_psnr"].as_f64().unwrap();
    assert!((now - then).abs() < 0.011, "{now} {then}");
    // The same particles are drawn and measured; the file holds f32.
    let science = |v: &Value| v["science"].clone();
    let (now, then) = (science(&again["measured_again"]), science(&stored["certificate"]));
    assert_eq!((&now["of"], &now["spectrum_grid"]), (&"drawn_particles".into(), &128.into()));
    for key in ["k_max", "power_within_1_percent_to", "power_within_5_percent_to", "r_above_0_99_to", "r_above_0_9_to"]
    {
        match now[key].as_f64() {
            Some(k) => assert!((k / then[key].as_f64().unwrap() - 1.0).abs() < 1e-6, "{key}"),
            None => assert_eq!(now[key], then[key], "{key}"),
        }
    }
    assert_eq!(now["groups_within_10_percent_from"], then["groups_within_10_percent_from"]);
    assert!(now["k_max"].as_f64().unwrap() > 7.9);

    let bytes = std::fs::read(&path).unwrap();
    let broken = dir.path().join("broken.pgs");
    for damaged in [bytes[..bytes.len() / 2].to_vec(), [&bytes[..], b"more"].concat(), flipped(&bytes, 700)] {
        std::fs::write(&broken, damaged).unwrap();
        for verb in ["verify", "info"] {
            fails(particlegs().arg(verb).arg(&broken), 4, "broken.pgs");
        }
        let mut c = particlegs();
        c.arg("render").arg(&broken).args(["--style", "expected", "--out"]).arg(dir.path().join("out"));
        fails(&mut c, 4, "broken.pgs");
    }
    assert_eq!(listing(dir.path()), ["broken.pgs", "m.pgs"]);
}

fn flipped(bytes: &[u8], at: usize) -> Vec<u8> {
    let mut out = bytes.to_vec();
    out[at] ^= 0x10;
    out
}
