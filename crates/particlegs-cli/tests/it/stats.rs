//! `stats` as a user runs it, on a thinned sample.

use crate::common::{fails, listing, particlegs, sample};
use std::path::{Path, PathBuf};

/// 16 384 particles of the sample as a snapshot with its box.
fn thinned(dir: &Path) -> PathBuf {
    let out = dir.join("thin");
    particlegs().arg("convert").arg(sample()).arg("-o").arg(&out).args(["--every", "16", "--quiet"]).assert().success();
    out
}

fn stats(truth: &Path, other: &Path, out: &Path, more: &[&str]) -> serde_json::Value {
    let mut command = particlegs();
    command.arg("stats").arg(truth).arg(other).arg("-o").arg(out).args(["--grid", "24", "--spectrum-grid", "32"]);
    if !more.contains(&"--only") {
        command.args(["--pairs", "3000000"]);
    }
    command.arg("--quiet").args(more).assert().success();
    serde_json::from_slice(&std::fs::read(out.join("stats.json")).unwrap()).unwrap()
}

#[test]
fn a_snapshot_against_itself_is_perfect_and_threads_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, out) = (thinned(dir.path()), dir.path().join("a"));
    let s = stats(&thin, &thin, &out, &[]);
    let summary = &s["summary"];
    assert_eq!((summary["density_correlation"].as_f64(), summary["core_mass"].as_f64()), (Some(1.0), Some(1.0)));
    assert_eq!((summary["largest_power_deviation"].as_f64(), summary["nearest_mean"].as_f64()), (Some(0.0), Some(1.0)));
    assert_eq!(s["domain"]["periodic"], serde_json::json!([true, true, true]));
    assert_eq!(s["spectra"]["cells"], serde_json::json!([32, 32, 32]));
    let files = listing(&out);
    for name in ["power.svg", "power.png", "xi.png", "groups.csv", "slice_z.png", "neighbours.csv", "coherence.svg"] {
        assert!(files.iter().any(|f| f == name), "{name} of {files:?}");
    }
    let svg = std::fs::read_to_string(out.join("power.svg")).unwrap();
    assert!(svg.contains("k [h/Mpc]") && svg.contains("P(k) [(Mpc/h)³]"));
    let again = dir.path().join("b");
    let mut command = particlegs();
    command.arg("stats").arg(&thin).arg(&thin).arg("-o").arg(&again).args(["--grid", "24", "--spectrum-grid", "32"]);
    command.args(["--pairs", "3000000", "--quiet", "--threads", "1"]).env("PARTICLEGS_SIMD", "off").assert().success();
    for name in files {
        assert_eq!(std::fs::read(out.join(&name)).unwrap(), std::fs::read(again.join(&name)).unwrap(), "{name}");
    }
}

#[test]
fn a_model_is_measured_by_its_mixture() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, model, out) = (thinned(dir.path()), dir.path().join("m.pgs"), dir.path().join("a"));
    let mut compress = particlegs();
    compress.arg("compress").arg(&thin).arg("-o").arg(&model).args([
        "--gaussians",
        "200",
        "--effort",
        "fast",
        "--certificate=none",
        "--quiet",
    ]);
    compress.assert().success();
    let s = stats(&thin, &model, &out, &["--no-plots"]);
    assert_eq!(s["model"], serde_json::json!([false, true]));
    assert!(s["summary"]["density_correlation"].as_f64().unwrap() > 0.5);
    assert!(s["groups"].is_null() && s["xi_by_pairs"].is_null() && s["spectra"]["shot_noise"][1] == 0.0);
    assert!(s["notes"].as_array().unwrap().iter().any(|n| n.as_str().unwrap().contains("recover")));
    assert!(listing(&out).iter().all(|f| !f.ends_with(".png")));
}

#[test]
fn the_published_convention_and_bad_options() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, out) = (thinned(dir.path()), dir.path().join("a"));
    let s =
        stats(&thin, &thin, &out, &["--convention", "paper", "--only", "density,spectrum,neighbours", "--no-plots"]);
    assert_eq!(s["spectra"]["options"]["deconvolved"], false);
    assert_eq!(s["density"]["cells"], serde_json::json!([24, 24, 24]));
    assert!(s["groups"].is_null() && s["moments"].is_null());
    let run = |more: &[&str]| {
        let mut command = particlegs();
        command.arg("stats").arg(&thin).arg(&thin).arg("-o").arg(&out).args(more);
        command
    };
    fails(&mut run(&["--grid", "1"]), 2, "outside 2 to 8192");
    fails(&mut run(&["--grid", "8192"]), 7, "bytes of memory");
    fails(&mut run(&["--separations", "3,1"]), 2, "must ascend");
    fails(&mut run(&["--only", "groups", "--linking", "0"]), 2, "linking");
    let file = dir.path().join("file");
    std::fs::write(&file, "x").unwrap();
    let mut command = particlegs();
    fails(command.arg("stats").arg(&thin).arg(&thin).arg("-o").arg(file.join("x")), 6, "file");
    let mut command = particlegs();
    fails(command.arg("stats").arg(&thin).arg(dir.path().join("none")).arg("-o").arg(&out), 6, "none");
}
