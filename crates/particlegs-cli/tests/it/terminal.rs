//! What commands say: little, once, and in users' names.

use crate::common::{fails, listing, particlegs, run};
use std::path::Path;

const SPECIES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../particlegs-formats/tests/fixtures/species.hdf5");

fn said(folder: &Path, args: &[&str]) -> [String; 2] {
    let out = particlegs().current_dir(folder).args(args).output().unwrap();
    let [said, told] = [out.stdout, out.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(out.status.success(), "{args:?}: {told}");
    [said, told]
}

/// A model of gas and dark matter.
fn model(folder: &Path) {
    said(folder, &["compress", SPECIES, "-o", "m.pgs", "--gaussians", "12", "--certificate=none", "-q"]);
}

#[test]
fn species_are_chosen_in_models_as_in_snapshots() {
    let dir = tempfile::tempdir().unwrap();
    model(dir.path());
    let particles = |out: &str, args: &[&str]| {
        said(dir.path(), &[&["recover", "m.pgs", "-o", out, "-q"], args].concat());
        std::fs::metadata(dir.path().join(out).join("xx.f32")).unwrap().len() / 4
    };
    let own = [particles("0", &["--layer", "PartType0"]), particles("1", &["--layer", "PartType1"])];
    for (i, name) in ["gas", "0", "Gas"].into_iter().enumerate() {
        assert_eq!(particles(&format!("gas{i}"), &["--layer", name]), own[0], "{name}");
    }
    for (i, name) in ["dm", "1", "dark matter", "halo"].into_iter().enumerate() {
        assert_eq!(particles(&format!("dm{i}"), &["--layer", name]), own[1], "{name}");
    }
    fails(particlegs().current_dir(&dir).args(["render", "m.pgs", "--layer", "stars", "-o", "no.png"]), 2, "no layer");
    // Where snapshots are read as well, of both.
    for option in ["--layer", "--particle-type"] {
        let [_, told] =
            said(dir.path(), &["eval", "m.pgs", SPECIES, option, "gas", "--frames", "1", "--size", "16x16"]);
        assert!(!told.contains("warning"), "{told}");
        let args = ["stats", "m.pgs", SPECIES, "-o", "st", option, "gas", "--only", "density", "--grid", "4"];
        let [table, _] = said(dir.path(), &[&args[..], &["--no-plots"]].concat());
        assert!(table.contains(&format!("model of {} particles, other {} particles", own[0], own[0])), "{table}");
    }
    said(dir.path(), &["compress", SPECIES, "--layer", "gas", "-o", "g.pgs", "--gaussians", "3", "--certificate=none"]);
    let [json, _] = said(dir.path(), &["info", "g.pgs", "--json", "-"]);
    assert!(json.contains("PartType0") && !json.contains("\"PartType1"), "{json}");
}

#[test]
fn legends_name_species_as_people_do() {
    let dir = tempfile::tempdir().unwrap();
    model(dir.path());
    said(dir.path(), &["render", "m.pgs", "--color-by-layer", "--size", "64x48", "-o", "m.svg"]);
    let svg = std::fs::read_to_string(dir.path().join("m.svg")).unwrap();
    assert!(svg.contains("dark matter") && !svg.contains("PartType"), "{svg}");
}

#[test]
fn files_are_named_and_quiet_commands_print_no_tables() {
    let dir = tempfile::tempdir().unwrap();
    model(dir.path());
    let frames = ["render", "m.pgs", "--size", "16x16", "--turntable"];
    let [few, _] = said(dir.path(), &[&frames[..], &["2", "-o", "few"]].concat());
    assert!(few.ends_with("wrote few/frame_0000.png, few/frame_0001.png\n"), "{few}");
    let [many, _] = said(dir.path(), &[&frames[..], &["14", "-o", "many"]].concat());
    assert!(many.ends_with("wrote 14 files, many/frame_0000.png to many/frame_0013.png\n"), "{many}");
    let stats = ["stats", "m.pgs", SPECIES, "-o", "st", "--only", "density", "--grid", "4", "--no-plots"];
    let [table, _] = said(dir.path(), &stats);
    for name in listing(&dir.path().join("st")) {
        assert!(table.contains(&format!("st/{name}")), "{name}: {table}");
    }
    let nothing = [String::new(), String::new()];
    assert_eq!(said(dir.path(), &[&stats[..], &["-q"]].concat()), nothing);
    assert_eq!(said(dir.path(), &[&frames[..], &["2", "-o", "few", "-q"]].concat()), nothing);
    // What goes to no file is the result.
    let [info, told] = said(dir.path(), &["info", "m.pgs", "-q"]);
    assert!(info.contains("Gaussians") && told.is_empty(), "{info}{told}");
}

#[test]
fn a_note_is_told_once_of_a_job_and_of_a_command() {
    let dir = tempfile::tempdir().unwrap();
    let notes = |args: &[&str]| {
        let [_, told] = said(dir.path(), args);
        let mut notes: Vec<String> = told.lines().filter(|l| l.starts_with("note: ")).map(String::from).collect();
        let all = notes.len();
        notes.sort();
        notes.dedup();
        assert_eq!(notes.len(), all, "{args:?}: {told}");
        notes
    };
    let options = ["-o", "job", "--blocks", "2", "--gaussians", "12", "--certificate", "quick"];
    let planned = notes(&[&["plan", SPECIES], &options[..]].concat());
    assert!(planned.iter().any(|n| n.contains("comoving")), "{planned:?}");
    for args in
        [&["scatter", "job"][..], &["block", "job", "0"], &["block", "job", "1"], &["merge", "job", "-o", "m.pgs"]]
    {
        let again = notes(args);
        assert!(!again.iter().any(|n| planned.contains(n)), "{args:?}: {again:?}");
    }
    let twice = ["stats", SPECIES, SPECIES, "-o", "st", "--only", "density", "--grid", "4", "--no-plots"];
    assert!(notes(&twice).iter().any(|n| n.contains("comoving")));
}

#[test]
fn help_has_help() {
    let text = |args: &[&str]| run(args).success().get_output().stdout.clone();
    for flag in ["-h", "--help"] {
        assert_eq!(text(&["help", flag]), text(&["help"]));
        assert_eq!(text(&["help", "compress", flag]), text(&["help", "compress"]));
    }
}
