//! Smoothed surface densities, and models scored against them.

use crate::common::{TestFolder, listing, said, snapshot};
use serde_json::Value;

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
