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

/// What a command says, and what it writes as text.
fn told(args: &[&str]) -> String {
    let done = run(args).success();
    String::from_utf8_lossy(&done.get_output().stderr).into_owned()
}

#[test]
fn fields_ids_and_float64_are_carried() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs-formats/tests/data/tables/positions.hdf5");
    // Ids beyond 2^53, by way of HDF5, VTK and text.
    let (hdf5, vtp, dump) = (path("a.hdf5"), path("b.vtp"), path("c.dump"));
    assert!(!told(&["convert", text(&source), "-o", text(&hdf5)]).contains("does not hold"));
    told(&["convert", text(&hdf5), "-o", text(&vtp)]);
    told(&["convert", text(&vtp), "-o", text(&dump)]);
    let rows = std::fs::read_to_string(&dump).unwrap();
    assert!(rows.contains("\n1152921504606846977 1 0.75 1.0 1.25\n"), "{rows}");
    // Float64 and velocities of a table, a part of it, and what has no place.
    let table = path("t.csv");
    let row = |i: u32| format!("{},{},3.25,{i},{},-1.5,{}\n", 0.1 + f64::from(i), i, 2 * i, 7 * i);
    std::fs::write(&table, format!("x,y,z,vx,vy,vz,id\n{}", (0..9).map(row).collect::<String>())).unwrap();
    told(&["convert", text(&table), "-o", text(&hdf5), "--every", "4", "--force"]);
    let info = run(&["info", text(&hdf5), "--json", "-"]).success();
    let info = String::from_utf8_lossy(&info.get_output().stdout).into_owned();
    assert!(info.contains("Velocities") && info.contains("ParticleIDs"), "{info}");
    told(&["convert", text(&hdf5), "-o", text(&dump), "--force"]);
    let rows = std::fs::read_to_string(&dump).unwrap();
    assert!(
        rows.contains("ATOMS id type x y z vx vy vz\n") && rows.contains("\n28 1 4.1 4.0 3.25 4.0 8.0 -1.5\n"),
        "{rows}"
    );
    let npy = told(&["convert", text(&table), "-o", text(&path("p.npy"))]);
    assert!(npy.contains("note: NumPy array of shape (N, 3) does not hold: vx, vy, vz, id"), "{npy}");
    let compressed = told(&["compress", text(&table), "-o", text(&path("m.pgs")), "--gaussians", "2"]);
    assert!(compressed.contains("note: fields that the model leaves out: vx, vy, vz, id"), "{compressed}");
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
