//! Other people's files as a user brings them: info, choosing, layers, units, round trips.

use crate::common::{self, run};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs-formats/tests/fixtures");
    folder.join(name).display().to_string()
}

fn sample() -> String {
    common::sample().display().to_string()
}

fn at(dir: &tempfile::TempDir, name: &str) -> String {
    dir.path().join(name).display().to_string()
}

/// What `info --json -` says.
fn info(arguments: &[&str]) -> Value {
    let output = run(&[&["info", "--json", "-", "-q"], arguments].concat()).success().get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

#[test]
fn info_tells_species_fields_and_frames() {
    let d = info(&[&fixture("species.hdf5")]);
    assert_eq!((d["particles"].as_u64(), d["species"].as_array().unwrap().len()), (Some(50), 2));
    assert_eq!(d["species"][0]["name"], "PartType0");
    assert_eq!(d["species"][0]["mass"]["field"], "Masses");
    assert_eq!(d["species"][1]["fields"][0]["components"], 3);
    assert_eq!(d["bounds"].as_array().unwrap().len(), 2);
    let d = info(&[&fixture("two_frames.dump.gz"), "--frame", "0", "--length-unit", "Angstrom", "--no-bounds"]);
    assert_eq!((d["frames"]["count"].as_u64(), d["frames"]["chosen"].as_u64()), (Some(2), Some(0)));
    assert_eq!((&d["meta"]["length_unit"], d["bounds"].as_array().unwrap().len()), (&"Angstrom".into(), 0));
    // In words, too, and raw data like any other.
    let text = run(&["info", &sample()]).success().get_output().stdout.clone();
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains("262144 particles") && text.contains("Mpc/h, comoving"), "{text}");
}

#[test]
fn species_and_masses_become_layers() {
    let dir = tempfile::tempdir().unwrap();
    let model = at(&dir, "m.pgs");
    let compress = |more: &[&str]| {
        let base = [
            "compress",
            &fixture("species.hdf5"),
            "-o",
            &model,
            "--gaussians",
            "12",
            "-q",
            "--certificate=none",
            "--force",
        ];
        run(&[&base, more].concat()).success();
        let d = info(&[&model]);
        let layers: Vec<Value> = d["layers"].as_array().unwrap().clone();
        let names: Vec<String> = layers.iter().map(|l| l["name"].as_str().unwrap().to_string()).collect();
        (d, layers, names)
    };
    let (d, layers, names) = compress(&["--mass-unit", "Msun"]);
    assert_eq!(names, ["PartType0", "PartType1"]);
    assert!(layers.iter().all(|l| l["weighted"] == true));
    assert_eq!((d["metadata"]["particles"].as_u64(), &d["metadata"]["mass_unit"]), (Some(50), &"Msun".into()));
    let (_, _, names) = compress(&["--particle-type", "dm"]);
    assert_eq!(names, ["PartType1"]);
    let (_, layers, names) = compress(&["--layers", "mass", "--particle-type", "1"]);
    assert_eq!(names, ["PartType1 m=1", "PartType1 m=2", "PartType1 m=3"]);
    assert!(layers.iter().all(|l| l["weighted"] == false && l["blocks"][0]["count"] == 10));
    assert_eq!(layers[2]["particle_mass"], 3.0);
    let (_, layers, _) = compress(&["--mass-field", "none"]);
    assert!(layers.iter().all(|l| l["weighted"] == false && l["particle_mass"].is_null()));
    // One layer alone is drawn, and a name that is none is told.
    compress(&[]);
    let render = |layer: &str| run(&["render", &model, "--layer", layer, "--size", "64x64", "--out", &at(&dir, layer)]);
    render("PartType1").success();
    let error = render("stars").failure().code(2).get_output().stderr.clone();
    assert!(String::from_utf8(error).unwrap().contains("PartType0, PartType1"));
    let picture = |layer: &str| std::fs::read(dir.path().join(layer).join("view.png")).unwrap();
    render("all").success();
    assert_ne!(picture("all"), picture("PartType1"));
    // Scores and the certificate take all layers.
    run(&["verify", &model, &fixture("species.hdf5"), "-q"]).success();
}

#[test]
fn a_window_wraps_around_the_box() {
    let dir = tempfile::tempdir().unwrap();
    let (window, region) = (at(&dir, "window"), at(&dir, "region"));
    run(&["convert", &sample(), "-o", &window, "--center", "0,12,12", "--width", "4,25,25", "-q"]).success();
    let d = info(&[&window]);
    let (lo, hi) = (d["bounds"][0]["min"][0].as_f64().unwrap(), d["bounds"][0]["max"][0].as_f64().unwrap());
    assert!((-2.0..-1.9).contains(&lo) && (1.9..2.0).contains(&hi), "{lo} {hi}");
    run(&["convert", &sample(), "-o", &region, "--region", "0,2,-1,26,-1,26", "-q"]).success();
    let right = info(&[&region])["particles"].as_u64().unwrap();
    run(&["convert", &sample(), "-o", &region, "--region", "23,25,-1,26,-1,26", "-q", "--force"]).success();
    let left = info(&[&region])["particles"].as_u64().unwrap();
    assert_eq!(d["particles"].as_u64(), Some(left + right));
    // Without a box nothing wraps, and a window wider than the box would repeat it.
    let columns = ["xx.f32", "yy.f32", "zz.f32"].map(|c| dir.path().join("window").join(c).display().to_string());
    std::fs::remove_file(dir.path().join("window/meta.json")).unwrap();
    let window = ["--center", "0,0,0", "--width", "9"];
    let base = ["convert", &columns[0], &columns[1], &columns[2], "-o", &region, "-q", "--force"];
    run(&[&base[..], &window].concat()).failure().code(3);
    run(&["convert", &sample(), "-o", &region, "--center", "0,0,0", "--width", "26", "--force"]).failure().code(2);
}

#[test]
fn what_is_written_is_read_again() {
    let dir = tempfile::tempdir().unwrap();
    let raw = at(&dir, "raw");
    run(&["convert", &sample(), "-o", &raw, "--sample", "70000", "-q"]).success();
    let column = |folder: &str| std::fs::read(PathBuf::from(folder).join("yy.f32")).unwrap();
    for name in ["a.npy", "a.hdf5", "a.vtp", "a.dump"] {
        let (out, back) = (at(&dir, name), at(&dir, &format!("{name}.raw")));
        run(&["convert", &raw, "-o", &out, "-q"]).success();
        run(&["convert", &out, "-o", &back, "-q"]).success();
        assert!(column(&raw) == column(&back), "{name} changes bits");
    }
    // Species and masses survive where the format has them.
    for name in ["s.hdf5", "s"] {
        let out = at(&dir, name);
        run(&["convert", &fixture("species.hdf5"), "-o", &out, "-q"]).success();
        let d = info(&[&out]);
        let counts: Vec<u64> = d["species"].as_array().unwrap().iter().map(|s| s["count"].as_u64().unwrap()).collect();
        assert_eq!(counts, [20, 30], "{name}");
    }
}

#[test]
fn what_cannot_be_read_is_told_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let (nothing, out) = (at(&dir, "nothing.bin"), at(&dir, "out"));
    std::fs::write(&nothing, [7u8; 100]).unwrap();
    let refused = |arguments: &[&str], code: i32, word: &str| {
        let error = run(arguments).failure().code(code).get_output().stderr.clone();
        let error = String::from_utf8(error).unwrap();
        assert!(error.starts_with("error: ") && error.contains(word), "{error}");
        assert!(error.lines().count() <= 2, "{error}");
        assert!(!Path::new(&out).exists());
    };
    refused(&["info", &nothing], 3, "--format");
    refused(&["convert", &nothing, "-o", &out], 3, "not in a format");
    refused(&["convert", &fixture("species.hdf5"), "-o", &out, "--particle-type", "9", "-q"], 3, "PartType1 (1, dm");
    refused(&["convert", &fixture("species.hdf5"), "-o", &out, "--mass-field", "Age", "-q"], 3, "Age");
    refused(&["convert", &fixture("two_frames.dump.gz"), "-o", &out, "--frame", "7", "-q"], 3, "frame");
    refused(&["convert", &fixture("species.hdf5"), "-o", &out, "--frame", "0", "-q"], 2, "no frames");
    refused(&["convert", &sample(), "-o", &out, "--positions", "Coordinates", "-q"], 2, "xx, yy and zz");
    refused(&["info", &at(&dir, "missing.hdf5")], 6, "missing.hdf5");
}

/// Trajectories that were not wrapped, blocks that Gadget does not know and headers of other snapshots are read, with a
/// note; what the user says of them goes first.
#[test]
fn what_files_leave_open_is_said_and_can_be_stated() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        std::fs::write(dir.path().join(name), bytes).unwrap();
        at(&dir, name)
    };
    let head = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp pp pp\n0 10\n0 10\n0 10\n";
    let dump = file("xu.dump", format!("{head}ITEM: ATOMS id xu yu zu\n1 73 -22 5\n2 1 2 3\n").as_bytes());
    let d = info(&[&dump]);
    assert_eq!(d["bounds"][0]["max"], serde_json::json!([3.0, 8.0, 5.0]));
    assert!(d["notes"].to_string().contains("wrapped into the periodic box"), "{}", d["notes"]);
    let d = info(&[&dump, "--unwrapped", "keep"]);
    assert_eq!((&d["bounds"][0]["max"][0], d["meta"]["cell"].is_null()), (&73.0.into(), true));
    let cut = format!("{}/../data/snapshots/cutout_99.hdf5", fixture(""));
    let d = info(&[&cut]);
    assert_eq!(d["particles"], 15);
    assert!(d["notes"].to_string().contains("of 448 files"), "{}", d["notes"]);
    let refused = |arguments: &[&str], code: i32, what: &str| {
        common::fails(common::particlegs().args(arguments), code, what);
    };
    refused(&["info", &cut, "--strict", "-q"], 3, "448 files");
    refused(&["info", &fixture("plain.txt"), "--unwrapped", "keep", "-q"], 3, "not a trajectory");
    refused(&["info", &fixture("gadget2_masses"), "--gadget-blocks", "POS,VEL", "-q"], 3, "format 2");
    for option in ["--gadget-blocks", "--blocks"] {
        let d = info(&[&fixture("gadget1_le"), option, "POS,-,ID"]);
        let fields: Vec<&str> =
            d["species"][0]["fields"].as_array().unwrap().iter().filter_map(|f| f["name"].as_str()).collect();
        assert_eq!(fields, ["POS", "ID"]);
    }
    refused(
        &["compress", &fixture("gadget1_le"), "-o", "-", "--blocks", "POS,-,ID"],
        2,
        "--gadget-blocks names the blocks of a Gadget file",
    );
}
