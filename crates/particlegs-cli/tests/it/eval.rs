//! `eval` on a tiny model of the sample.

use crate::common::{TestFolder, snapshot, spiral};
use crate::models::tiny;
use particlegs_core::model::LawKind;

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
