//! `convert` and `compare`.

use crate::common::TestFolder;
use std::path::Path;

#[test]
fn tiles_the_sample() {
    let dir = TestFolder::new();
    let report = dir.says("convert SAMPLE -o tiled --tile 1,2,2");
    assert_eq!(dir.bytes("tiled/yy.f32").len(), 4 * 4 * 262_144);
    let meta = dir.json("tiled/meta.json");
    assert_eq!(meta["box"], serde_json::json!([25.0, 50.0, 50.0]));
    assert_eq!(meta["length_unit"], "Mpc/h");
    assert_eq!(report["particles"], 4 * 262_144);
}

#[test]
fn the_same_sample_for_any_number_of_threads() {
    let dir = TestFolder::new();
    let draw = |threads: u32| dir.makes(&format!("convert SAMPLE -o {threads}.npy --sample 1000 --threads {threads}"));
    let one = draw(1);
    assert_eq!(one.len() % 64, 12 * 1000 % 64);
    assert_eq!(one, draw(2));
}

#[test]
fn fields_ids_and_float64_are_carried() {
    let dir = TestFolder::new();
    let notes_of = |words: &str| {
        let [_, notes] = dir.runs(words);
        notes
    };
    // Ids beyond 2^53, by way of HDF5, VTK and text.
    assert!(!notes_of("convert FIXTURES/../data/tables/positions.hdf5 -o a.hdf5").contains("cannot store"));
    notes_of("convert a.hdf5 -o b.vtp");
    notes_of("convert b.vtp -o c.dump");
    let rows = dir.text("c.dump");
    assert!(rows.contains("\n1152921504606846977 1 0.75 1.0 1.25\n"), "{rows}");
    // Float64 and velocities of a table, part of a table, and fields that the format cannot store.
    let row = |i: u32| format!("{},{},3.25,{i},{},-1.5,{}\n", 0.1 + f64::from(i), i, 2 * i, 7 * i);
    dir.write("t.csv", format!("x,y,z,vx,vy,vz,id\n{}", (0..9).map(row).collect::<String>()));
    notes_of("convert t.csv -o a.hdf5 --every 4 --force");
    let info = dir.says("info a.hdf5").to_string();
    assert!(info.contains("Velocities") && info.contains("ParticleIDs"), "{info}");
    notes_of("convert a.hdf5 -o c.dump --force");
    let rows = dir.text("c.dump");
    for row in ["ATOMS id type x y z vx vy vz\n", "\n28 1 4.1 4.0 3.25 4.0 8.0 -1.5\n"] {
        assert!(rows.contains(row), "{rows}");
    }
    let npy = notes_of("convert t.csv -o p.npy");
    assert!(npy.contains("note: NumPy array of shape (N, 3) cannot store: vx, vy, vz, id"), "{npy}");
    let compressed = notes_of("compress t.csv -o m.pgs --gaussians 2");
    assert!(compressed.contains("note: the model omits these fields: vx, vy, vz, id"), "{compressed}");
}

#[test]
fn bad_arguments_leave_nothing() {
    let dir = TestFolder::new();
    for bad in [
        "--tile 2,2",
        "--tile 0,1,1",
        "--tile 4000000000,4000000000,4000000000",
        "--crop 0,1,0,1",
        "--crop 5,1,0,1,0,1",
        "--crop 900,901,0,1,0,1",
        "--every 0",
        "--sample 0",
        "--sample 262145",
    ] {
        let failed = dir.command(&format!("convert -o out --quiet SAMPLE {bad}")).assert().failure();
        assert!(String::from_utf8_lossy(&failed.get_output().stderr).starts_with("error: "), "{bad:?}");
        assert!(dir.listing().is_empty(), "{bad:?}");
    }
    dir.command("convert SAMPLE -o missing/out").assert().failure();
    assert!(dir.listing().is_empty());
}

#[test]
fn compare_lists_files_that_it_cannot_score() {
    use particlegs_core::picture::Size;
    use particlegs_files::png::write_png;
    let dir = TestFolder::new();
    let [a, b] = ["a", "b"].map(|n| dir.at(n));
    let write = |folder: &Path, name: &str, side: usize, level: u8| {
        std::fs::create_dir_all(folder).unwrap();
        let size = Size { width: side, height: side };
        write_png(&folder.join(name), size, &vec![level; side * side]).unwrap();
    };
    write(&a, "far_00.png", 16, 100);
    write(&b, "far_00.png", 16, 110);
    write(&a, "alone.png", 16, 0);
    let outcome = dir.command("compare a b --json -").assert().success();
    let c: serde_json::Value = serde_json::from_slice(&outcome.get_output().stdout).unwrap();
    assert!((c["views"][0]["psnr"].as_f64().unwrap() - 28.13).abs() < 0.01);
    assert_eq!((c["views"][0]["name"].as_str(), c["only_in_a"][0].as_str()), (Some("far_00"), Some("alone")));
    assert!(String::from_utf8_lossy(&outcome.get_output().stderr).contains("alone"));
    write(&b, "alone.png", 17, 0);
    let failed = dir.command("compare a b").assert().failure().code(3);
    assert!(String::from_utf8_lossy(&failed.get_output().stdout).contains("28.13 dB"));
    assert!(String::from_utf8_lossy(&failed.get_output().stderr).contains("sizes differ, 16x16 and 17x17 pixels"));
    dir.command("compare a c").assert().failure().code(6);
}
