//! Models scored: by `eval` against their snapshots, and by `compare` against smoothed surface densities.

use crate::common::{TestFolder, listing, said, snapshot, spiral, tiny};
use particlegs_core::model::LawKind;
use serde_json::Value;

#[test]
fn scores_by_orbit_in_text_and_json() {
    let dir = TestFolder::new();
    let bytes = tiny(0..64, LawKind::OpticalDepth);
    dir.write("m.pgs", &bytes);
    let run = |more: &str| {
        let [text, _] = dir.runs(&format!("eval m.pgs SAMPLE --json e.json {more}"));
        (text, dir.json("e.json"))
    };
    let (text, e) = run("--frames 1 --size 160x90");
    assert!(text.contains("paraview-no-fxaa") && text.contains("seed 42") && text.contains("160x90"));
    assert_eq!((e["model_bytes"].as_u64(), e["raw_bytes"].as_u64()), (Some(bytes.len() as u64), Some(12 * 262_144)));
    assert_eq!(e["gaussians"], 64);
    assert!((e["compression_ratio"].as_f64().unwrap() - 12.0 * 262_144.0 / bytes.len() as f64).abs() < 1e-9);
    assert_eq!(e["views"].as_array().unwrap().len(), 3);
    for place in [&e["views"][2], &e["by_orbit"]["near"], &e["mean"]] {
        for style in ["paraview", "paraview_no_fxaa", "expected"] {
            let s = &place[style];
            assert!(s["psnr"].is_number() && s["masked_psnr"].is_number() && s["ssim"].is_number(), "{s}");
            assert!(s["all_black"]["masked_psnr"].as_f64() < s["masked_psnr"].as_f64(), "{s}");
            assert_eq!(s["noise_free"]["masked_psnr"].is_null(), style == "expected");
        }
        assert!(place["paraview_no_fxaa"]["shot_noise"].is_number());
    }
    let (_, again) = run("--frames 1 --size 160x90 --threads 1");
    assert_eq!(e, again);

    let view = r#"{"name": "near_7", "position": [80, 12, 12], "focal_point": [12, 12, 12], "view_up": [0, 1, 0],
        "radius": 0.02, "opacity": 0.05}"#;
    dir.write("v.json", format!(r#"{{"width": 96, "height": 54, "fov_deg": 30, "views": [{view}]}}"#));
    let (_, e) = run("--views v.json");
    assert_eq!((e["views"][0]["orbit"].as_str(), e["width"].as_u64()), (Some("near"), Some(96)));
    assert!(e["by_orbit"].get("far").is_none());
}

#[test]
fn other_particles_than_those_of_the_model_are_named_as_such() {
    let dir = spiral();
    snapshot(&dir.at("other"), &[vec![0.1, 0.2, 0.3], vec![0.2, 0.1, 0.3], vec![0.3, 0.1, 0.2]]);
    let run = |snapshot: &str| {
        let [text, said] = dir.runs(&format!("eval spiral.pgs {snapshot} --frames 1 --size 64x36 --json e.json"));
        (text, said, dir.json("e.json")["source_matches"].as_bool())
    };
    let (text, said, matches) = run("spiral");
    assert!(matches == Some(true) && !said.contains("is not the snapshot") && !text.contains("not the particles"));
    let (text, said, matches) = run("other");
    assert!(matches == Some(false) && text.contains("these are not the particles"), "{text}");
    assert!(said.contains("warning: other is not the snapshot that spiral.pgs was made from"), "{said}");
}

/// Tolerance for sums of float32 pixels.
const NEARLY: f64 = 1e-4;

/// A clump and a uniform background in an open box, and a model of them.
fn folder() -> TestFolder {
    let dir = TestFolder::new();
    // Additive recurrences fill a cube evenly (Roberts 2018).
    let along = |step: f64| -> Vec<f32> {
        let at = |i: u32| (0.5 + step * f64::from(i)).fract();
        (0..6000).map(|i| if i % 2 == 0 { 0.4 + 0.1 * at(i) } else { at(i) } as f32).collect()
    };
    let columns = [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9].map(along);
    snapshot(&dir.at("cloud"), &columns);
    dir.once("compress cloud -o cloud.pgs --gaussians 60 --certificate=none --quiet");
    dir
}

fn drawn(dir: &TestFolder, words: &str) -> Value {
    dir.says(&format!("{words} --style density --projection orthographic --size 80x80 --quiet"))
}

/// Number of particles in a folder of values with 40 pixels per unit.
fn mass(dir: &TestFolder, name: &str) -> f64 {
    let bytes = dir.bytes(&format!("{name}/view.f32"));
    bytes.as_chunks::<4>().0.iter().map(|v| f64::from(f32::from_le_bytes(*v))).sum::<f64>() / 1600.0
}

#[test]
fn a_model_is_scored_against_the_smoothed_truth() {
    let dir = folder();
    let report = drawn(&dir, "reference cloud -o truth --smooth 32 --raw");
    assert_eq!(report["smooth"], 32);
    assert!(report["smooth_seconds"].as_f64().unwrap() >= 0.0);
    drawn(&dir, "reference cloud -o points --raw");
    drawn(&dir, "render cloud.pgs -o model --raw");
    drawn(&dir, "reference cloud -o whole --smooth 32 --raw --width 2");
    assert!((mass(&dir, "whole") / 6000.0 - 1.0).abs() < NEARLY, "{}", mass(&dir, "whole"));
    let description = dir.json("truth/view.json");
    assert_eq!((description["smooth"].as_u64(), description["width"].as_u64()), (Some(32), Some(80)));

    let scores_against = |truth: &str| dir.says(&format!("compare model {truth}"))["densities"][0].clone();
    let (smooth, points) = (scores_against("truth"), scores_against("points"));
    let score = |scores: &Value, key: &str| scores[key].as_f64().unwrap();
    assert_eq!(smooth["name"], "view");
    assert!(score(&smooth, "rms_dex") < 0.7 * score(&points, "rms_dex"), "{smooth} {points}");
    assert!(score(&smooth, "correlation") > 0.9 && score(&smooth, "mean_dex").abs() < 0.3, "{smooth}");
    assert!(score(&smooth, "pixels") > 2.0 * score(&points, "pixels"));
    let [table, _] = dir.runs("compare truth truth");
    assert!(table.contains("0.0000 dex") && table.contains("1.0000") && !table.contains("PSNR"), "{table}");
}

/// A periodic box whose shape differs from the picture's, seen from the side.
#[test]
fn a_model_has_the_window_of_its_particles() {
    let dir = folder();
    dir.write("cloud/meta.json", r#"{"box": [1.0, 2.0, 1.0], "periodic": true}"#);
    dir.runs("compress cloud --gaussians 60 --certificate=none --quiet -o periodic.pgs");
    drawn(&dir, "reference cloud -o truth --raw");
    drawn(&dir, "reference cloud -o smooth --raw --smooth 32");
    drawn(&dir, "render periodic.pgs -o model --raw");
    for truth in ["truth", "smooth"] {
        dir.runs(&format!("compare model {truth}"));
    }
    for (map, off) in [("truth", 1e-6), ("model", 1e-5), ("smooth", 2e-5)] {
        let relative = mass(&dir, map) / 6000.0 - 1.0;
        assert!(relative.abs() < off, "{map}: {relative}");
    }
}

#[test]
fn smoothed_pictures_are_the_same_whatever_the_threads() {
    let dir = folder();
    let files = ["1", "3"].map(|threads| {
        drawn(&dir, &format!("reference cloud -o {threads}.png --smooth 8 --depth 0.5 --threads {threads}"));
        dir.bytes(&format!("{threads}.png"))
    });
    assert!(files[0] == files[1]);
}

#[test]
fn impossible_smoothing_and_comparison_are_refused() {
    let dir = folder();
    dir.fails("reference cloud -o out --style density --smooth 6000", 2, "not 6000");
    dir.fails("reference cloud -o out --smooth 16", 2, "--smooth has no effect here");
    dir.command("reference cloud -o out --style density --smooth 1").assert().failure().code(2);
    drawn(&dir, "reference cloud -o a --smooth 16 --raw");
    drawn(&dir, "render cloud.pgs -o b --raw --center 0.5,0.5,0.6");
    let compare = || dir.command("compare b a").output().unwrap();
    let out = compare();
    assert_eq!(out.status.code(), Some(3));
    assert!(said(&out).contains("their views differ"));
    // Truncated and invalid files are listed in their row.
    let whole = dir.bytes("b/view.f32");
    dir.write("b/view.f32", &whole[..whole.len() - 5]);
    assert!(said(&compare()).contains("80x80 pixels take 25600"));
    dir.write("b/view.f32", vec![0xff; whole.len()]);
    assert!(said(&compare()).contains("not finite"));
    dir.write("b/view.json", "{}");
    assert!(said(&compare()).contains("does not describe raw values"));
    assert_eq!(listing(&dir.at("b")), ["view.f32", "view.json"]);
}
