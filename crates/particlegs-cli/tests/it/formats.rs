//! Files of other programs: info, selection, layers, units, round trips.

use crate::common::{TestFolder, fixture, particlegs, said, success};
use serde_json::Value;

/// JSON of `info`.
fn info(dir: &TestFolder, words: &str) -> Value {
    dir.says(&format!("info {words} -q"))
}

#[test]
fn info_tells_species_fields_and_frames() {
    let dir = TestFolder::new();
    let d = info(&dir, "FIXTURES/species.hdf5");
    assert_eq!((d["particles"].as_u64(), d["species"].as_array().unwrap().len()), (Some(50), 2));
    assert_eq!(d["species"][0]["name"], "PartType0");
    assert_eq!(d["species"][0]["mass"]["field"], "Masses");
    assert_eq!(d["species"][1]["fields"][0]["components"], 3);
    assert_eq!(d["bounds"].as_array().unwrap().len(), 2);
    let d = info(&dir, "FIXTURES/two_frames.dump.gz --frame 0 --length-unit Angstrom --no-bounds");
    assert_eq!((d["frames"]["count"].as_u64(), d["frames"]["chosen"].as_u64()), (Some(2), Some(0)));
    assert_eq!((&d["meta"]["length_unit"], d["bounds"].as_array().unwrap().len()), (&"Angstrom".into(), 0));
    // Also as text, and for raw data.
    let [text, _] = dir.runs("info SAMPLE");
    assert!(text.contains("262144 particles") && text.contains("Mpc/h, comoving"), "{text}");
}

#[test]
fn trajectories_are_read_by_frames_with_velocities() {
    let dir = TestFolder::new();
    for (name, unit) in [("mdanalysis.trr", "nm"), ("mdanalysis.xtc", "nm"), ("mdanalysis.dcd", "Angstrom")] {
        let d = info(&dir, &format!("FIXTURES/{name} --frame 1"));
        assert_eq!((d["frames"]["count"].as_u64(), d["meta"]["time"].as_f64()), (Some(3), Some(0.5)), "{name}: {d}");
        assert_eq!((&d["meta"]["length_unit"], d["particles"].as_u64()), (&unit.into(), Some(50)), "{name}");
    }
    let fit = "--gaussians 6 -q --certificate=none --force --fields velocity";
    for name in [
        "mdanalysis.trr",
        "mdanalysis.gro",
        "hoomd.gsd",
        "standard.tipsy",
        "byhand.h5md",
        "rvint_lz4.asdf",
        "ase.data",
        "ase.vasp",
    ] {
        dir.runs(&format!("compress FIXTURES/{name} -o m.pgs {fit}"));
        let d = info(&dir, "m.pgs");
        assert_eq!(d["metadata"]["particles"].as_u64(), Some(50), "{name}");
        assert!(d.to_string().contains("velocity") || d.to_string().contains("vel"), "{name}");
    }
    dir.fails("info FIXTURES/mdanalysis.xtc --frame 3", 3, "there is no frame 3; the frames are 0 to 2");
}

/// Positions of one file, names and masses of another, some of the atoms; in a job as in one go.
#[test]
fn atoms_are_named_by_a_topology_and_selected() {
    let dir = TestFolder::new();
    std::fs::copy(fixture("mdanalysis.xtc"), dir.at("run.xtc")).unwrap();
    std::fs::copy(fixture("mdanalysis.gro"), dir.at("conf.gro")).unwrap();
    let d = info(&dir, "run.xtc --topology conf.gro --frame -2");
    let species = |d: &Value, k: usize| (d["species"][k]["name"].clone(), d["species"][k]["count"].as_u64());
    assert_eq!((species(&d, 0), species(&d, 1)), (("water".into(), Some(40)), ("NA".into(), Some(10))));
    assert_eq!((d["frames"]["chosen"].as_u64(), &d["meta"]["mass_unit"]), (Some(1), &"amu".into()));
    assert!(d["notes"].to_string().contains("masses are standard atomic weights"), "{d}");
    let options = "-q --gaussians 6 --blocks 1 --certificate none --topology conf.gro --frame -1 --select";
    let with = |command: &str| success(dir.command(&format!("{command} {options}")).arg("name H"));
    with("compress run.xtc -o m.pgs");
    let d = info(&dir, "m.pgs");
    assert_eq!(d["metadata"]["particles"].as_u64(), Some(20));
    let recipe = dir.model("m.pgs").metadata.recipe.to_string();
    assert!(recipe.contains("--frame -1 --select \"name H\" --topology conf.gro"), "{recipe}");
    with("plan run.xtc -o job");
    // Tasks run in other folders.
    std::fs::create_dir(dir.at("else")).unwrap();
    for task in ["block ../job 0", "merge ../job -o ../of-job.pgs"] {
        success(particlegs().current_dir(dir.at("else")).args(task.split(' ')).arg("-q"));
    }
    assert!(dir.bytes("of-job.pgs") == dir.bytes("m.pgs"));
    for (words, code, why) in [
        ("info run.xtc --select water", 3, "the file has no names of atoms"),
        ("info run.xtc --topology run.xtc", 3, "holds no topology"),
        ("info conf.gro --select (water", 2, "the selection `(water`: a `(` has no `)`"),
        ("convert run.xtc --topology conf.gro -o conf.gro --to npy --force", 8, "conf.gro"),
    ] {
        dir.fails(words, code, why);
    }
}

#[test]
fn species_and_masses_become_layers() {
    let dir = TestFolder::new();
    let compress = |more: &str| {
        let fit = "--gaussians 12 -q --certificate=none --force";
        dir.runs(&format!("compress FIXTURES/species.hdf5 -o m.pgs {fit} {more}"));
        let d = info(&dir, "m.pgs");
        let layers: Vec<Value> = d["layers"].as_array().unwrap().clone();
        let names: Vec<String> = layers.iter().map(|l| l["name"].as_str().unwrap().to_string()).collect();
        (d, layers, names)
    };
    let (d, layers, names) = compress("--mass-unit Msun");
    assert_eq!(names, ["PartType0", "PartType1"]);
    assert!(layers.iter().all(|l| l["weighted"] == true));
    assert_eq!((d["metadata"]["particles"].as_u64(), &d["metadata"]["mass_unit"]), (Some(50), &"Msun".into()));
    let (_, _, names) = compress("--particle-type dm");
    assert_eq!(names, ["PartType1"]);
    let (_, layers, names) = compress("--layers mass --particle-type 1");
    assert_eq!(names, ["PartType1 m=1", "PartType1 m=2", "PartType1 m=3"]);
    assert!(layers.iter().all(|l| l["weighted"] == false && l["blocks"][0]["count"] == 10));
    assert_eq!(layers[2]["particle_mass"], 3.0);
    let (_, layers, _) = compress("--mass-field none");
    assert!(layers.iter().all(|l| l["weighted"] == false && l["particle_mass"].is_null()));
    // One layer can be drawn alone; unknown names are refused.
    compress("");
    let render = |layer: &str| format!("render m.pgs --layer {layer} --size 64x64 --out {layer}");
    dir.runs(&render("PartType1"));
    dir.fails(&render("stars"), 2, "PartType0, PartType1");
    dir.runs(&render("all"));
    assert_ne!(dir.bytes("all/view.png"), dir.bytes("PartType1/view.png"));
    // Scores and the certificate take all layers.
    dir.runs("verify m.pgs FIXTURES/species.hdf5 -q");
}

#[test]
fn a_window_wraps_around_the_box() {
    let dir = TestFolder::new();
    dir.runs("convert SAMPLE -o window --center 0,12,12 --width 4,25,25 -q");
    let d = info(&dir, "window");
    let (lo, hi) = (d["bounds"][0]["min"][0].as_f64().unwrap(), d["bounds"][0]["max"][0].as_f64().unwrap());
    assert!((-2.0..-1.9).contains(&lo) && (1.9..2.0).contains(&hi), "{lo} {hi}");
    let [right, left] = ["0,2,-1,26,-1,26", "23,25,-1,26,-1,26"].map(|region| {
        dir.runs(&format!("convert SAMPLE -o region --region {region} -q --force"));
        info(&dir, "region")["particles"].as_u64().unwrap()
    });
    assert_eq!(d["particles"].as_u64(), Some(left + right));
    // Without a box nothing wraps, and a window wider than the box would repeat it.
    std::fs::remove_file(dir.at("window/meta.json")).unwrap();
    let columns = "window/xx.f32 window/yy.f32 window/zz.f32";
    for (words, code) in [(format!("{columns} --width 9 -q"), 3), ("SAMPLE --width 26".into(), 2)] {
        let words = format!("convert {words} -o region --center 0,0,0 --force");
        dir.command(&words).assert().failure().code(code);
    }
}

#[test]
fn written_values_are_read_back() {
    let dir = TestFolder::new();
    dir.runs("convert SAMPLE -o raw --sample 70000 -q");
    for name in ["a.npy", "a.hdf5", "a.vtp", "a.dump"] {
        dir.runs(&format!("convert raw -o {name} -q"));
        dir.runs(&format!("convert {name} -o {name}.raw -q"));
        assert!(dir.bytes("raw/yy.f32") == dir.bytes(&format!("{name}.raw/yy.f32")), "{name} changes bits");
    }
    // Species and masses survive if the format can store them.
    for name in ["s.hdf5", "s"] {
        dir.runs(&format!("convert FIXTURES/species.hdf5 -o {name} -q"));
        let d = info(&dir, name);
        let counts: Vec<u64> = d["species"].as_array().unwrap().iter().map(|s| s["count"].as_u64().unwrap()).collect();
        assert_eq!(counts, [20, 30], "{name}");
    }
}

#[test]
fn unreadable_files_are_reported_in_one_line() {
    let dir = TestFolder::new();
    dir.write("nothing.bin", [7u8; 100]);
    for (words, code, word) in [
        ("info nothing.bin", 3, "--format"),
        ("convert nothing.bin -o out", 3, "the file format is unknown"),
        ("convert FIXTURES/species.hdf5 -o out --particle-type 9 -q", 3, "PartType1 (1, dm"),
        ("convert FIXTURES/species.hdf5 -o out --mass-field Age -q", 3, "Age"),
        ("convert FIXTURES/two_frames.dump.gz -o out --frame 7 -q", 3, "frame"),
        ("convert FIXTURES/species.hdf5 -o out --frame 0 -q", 2, "without frames"),
        ("convert SAMPLE -o out --positions Coordinates -q", 2, "xx, yy and zz"),
        ("info missing.hdf5", 6, "missing.hdf5"),
    ] {
        let out = dir.command(words).output().unwrap();
        let error = said(&out);
        assert_eq!(out.status.code(), Some(code), "{error}");
        assert!(error.starts_with("error: ") && error.contains(word), "{error}");
        assert!(error.lines().count() <= 2, "{error}");
        assert!(!dir.at("out").exists());
    }
}

/// Unwrapped trajectories, unknown Gadget blocks and headers of other snapshots are read with a note; options override
/// them.
#[test]
fn missing_metadata_is_reported_and_can_be_given() {
    let dir = TestFolder::new();
    let head = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp pp pp\n0 10\n0 10\n0 10\n";
    dir.write("xu.dump", format!("{head}ITEM: ATOMS id xu yu zu\n1 73 -22 5\n2 1 2 3\n"));
    let d = info(&dir, "xu.dump");
    assert_eq!(d["bounds"][0]["max"], serde_json::json!([3.0, 8.0, 5.0]));
    assert!(d["notes"].to_string().contains("wrapped into the periodic box"), "{}", d["notes"]);
    let d = info(&dir, "xu.dump --unwrapped keep");
    assert_eq!((&d["bounds"][0]["max"][0], d["meta"]["cell"].is_null()), (&73.0.into(), true));
    let cut = "FIXTURES/../data/snapshots/cutout_99.hdf5";
    let d = info(&dir, cut);
    assert_eq!(d["particles"], 15);
    assert!(d["notes"].to_string().contains("448 files"), "{}", d["notes"]);
    dir.fails(&format!("info {cut} --strict -q"), 3, "448 files");
    dir.fails("info FIXTURES/plain.txt --unwrapped keep -q", 3, "only stored in trajectories");
    dir.fails("info FIXTURES/gadget2_masses --gadget-blocks POS,VEL -q", 3, "format 2");
    for option in ["--gadget-blocks", "--blocks"] {
        let d = info(&dir, &format!("FIXTURES/gadget1_le {option} POS,-,ID"));
        let fields: Vec<&str> =
            d["species"][0]["fields"].as_array().unwrap().iter().filter_map(|f| f["name"].as_str()).collect();
        assert_eq!(fields, ["POS", "ID"]);
    }
    let blocks = "--gadget-blocks names the blocks of a Gadget file";
    dir.fails("compress FIXTURES/gadget1_le -o - --blocks POS,-,ID", 2, blocks);
}
