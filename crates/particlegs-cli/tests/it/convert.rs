//! `convert` and `compare` as a user runs them.

use crate::common::{run, sample};
use std::path::Path;

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn tiles_the_sample() {
    let dir = tempfile::tempdir().unwrap();
    let (out, json) = (dir.path().join("tiled"), dir.path().join("r.json"));
    run(&["convert", text(&sample()), "-o", text(&out), "--tile", "1,2,2", "--json", text(&json)]).success();
    assert_eq!(std::fs::metadata(out.join("yy.f32")).unwrap().len(), 4 * 4 * 262_144);
    let meta: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("meta.json")).unwrap()).unwrap();
    assert_eq!(meta["box"], serde_json::json!([25.0, 50.0, 50.0]));
    assert_eq!(meta["length_unit"], "Mpc/h");
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    assert_eq!(report["particles"], 4 * 262_144);
}

#[test]
fn the_same_sample_for_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let draw = |threads: &str| {
        let out = dir.path().join(format!("{threads}.npy"));
        run(&["convert", text(&sample()), "-o", text(&out), "--sample", "1000", "--threads", threads]).success();
        std::fs::read(out).unwrap()
    };
    let one = draw("1");
    assert_eq!(one.len() % 64, 12 * 1000 % 64);
    assert_eq!(one, draw("2"));
}

#[test]
fn bad_arguments_leave_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    for bad in [
        &["--tile", "2,2"][..],
        &["--tile", "0,1,1"],
        &["--tile", "4000000000,4000000000,4000000000"],
        &["--crop", "0,1,0,1"],
        &["--crop", "5,1,0,1,0,1"],
        &["--crop", "900,901,0,1,0,1"],
        &["--every", "0"],
        &["--sample", "0"],
        &["--sample", "262145"],
    ] {
        let mut all = vec!["convert", "-o", text(&out), "--quiet"];
        let input = sample();
        all.push(text(&input));
        all.extend(bad);
        let failed = run(&all).failure();
        assert!(String::from_utf8_lossy(&failed.get_output().stderr).starts_with("error: "), "{bad:?}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "{bad:?}");
    }
    let place = dir.path().join("missing/out");
    run(&["convert", text(&sample()), "-o", text(&place)]).failure();
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn compare_names_what_it_cannot_score() {
    use particlegs::picture::{Size, write_png};
    let dir = tempfile::tempdir().unwrap();
    let [a, b] = ["a", "b"].map(|n| dir.path().join(n));
    let write = |folder: &Path, name: &str, side: usize, level: u8| {
        std::fs::create_dir_all(folder).unwrap();
        let size = Size { width: side, height: side };
        write_png(&folder.join(name), size, &vec![level; side * side]).unwrap();
    };
    write(&a, "far_00.png", 16, 100);
    write(&b, "far_00.png", 16, 110);
    write(&a, "alone.png", 16, 0);
    let done = run(&["compare", text(&a), text(&b), "--json", "-"]).success();
    let c: serde_json::Value = serde_json::from_slice(&done.get_output().stdout).unwrap();
    assert!((c["views"][0]["psnr"].as_f64().unwrap() - 28.13).abs() < 0.01);
    assert_eq!((c["views"][0]["name"].as_str(), c["only_in_a"][0].as_str()), (Some("far_00"), Some("alone")));
    assert!(String::from_utf8_lossy(&done.get_output().stderr).contains("alone"));
    write(&b, "alone.png", 17, 0);
    let failed = run(&["compare", text(&a), text(&b)]).failure().code(3);
    assert!(String::from_utf8_lossy(&failed.get_output().stdout).contains("28.13 dB"));
    assert!(String::from_utf8_lossy(&failed.get_output().stderr).contains("16x16 pixels against 17x17"));
    run(&["compare", text(&a), text(&dir.path().join("c"))]).failure().code(6);
}
