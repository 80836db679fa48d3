//! Messages are short, are printed once, and use the user's names.

use crate::common::{TestFolder, listing, particlegs, success};

const SPECIES: &str = "FIXTURES/species.hdf5";

/// A folder with a model of gas and dark matter.
fn folder() -> TestFolder {
    let dir = TestFolder::new();
    dir.once("compress FIXTURES/species.hdf5 -o m.pgs --gaussians 12 --certificate=none -q");
    dir
}

#[test]
fn species_are_chosen_in_models_as_in_snapshots() {
    let dir = folder();
    let particles = |out: &str, layer: &str| {
        let mut recover = dir.command(&format!("recover m.pgs -o {out} -q --layer"));
        success(recover.arg(layer));
        dir.bytes(&format!("{out}/xx.f32")).len() / 4
    };
    let counts = [particles("0", "PartType0"), particles("1", "PartType1")];
    for (i, name) in ["gas", "0", "Gas"].into_iter().enumerate() {
        assert_eq!(particles(&format!("gas{i}"), name), counts[0], "{name}");
    }
    for (i, name) in ["dm", "1", "dark matter", "halo"].into_iter().enumerate() {
        assert_eq!(particles(&format!("dm{i}"), name), counts[1], "{name}");
    }
    dir.fails("render m.pgs --layer stars -o no.png", 2, "no layer");
    // In commands that also read snapshots, for both.
    for option in ["--layer", "--particle-type"] {
        let [_, notes] = dir.runs(&format!("eval m.pgs {SPECIES} {option} gas --frames 1 --size 16x16"));
        assert!(!notes.contains("warning"), "{notes}");
        let stats = format!("stats m.pgs {SPECIES} -o st {option} gas --only density --grid 4 --no-plots");
        let [table, _] = dir.runs(&stats);
        assert!(table.contains(&format!("model of {} particles, other {} particles", counts[0], counts[0])), "{table}");
    }
    dir.runs(&format!("compress {SPECIES} --layer gas -o g.pgs --gaussians 3 --certificate=none"));
    let [json, _] = dir.runs("info g.pgs --json -");
    assert!(json.contains("PartType0") && !json.contains("\"PartType1"), "{json}");
}

#[test]
fn legends_use_common_names_of_species() {
    let dir = folder();
    dir.runs("render m.pgs --color-by-layer --size 64x48 -o m.svg");
    let svg = dir.text("m.svg");
    assert!(svg.contains("dark matter") && !svg.contains("PartType"), "{svg}");
}

#[test]
fn files_are_named_and_quiet_commands_print_no_tables() {
    let dir = folder();
    let frames = "render m.pgs --size 16x16 --turntable";
    let [few, _] = dir.runs(&format!("{frames} 2 -o few"));
    assert!(few.ends_with("wrote few/frame_0000.png, few/frame_0001.png\n"), "{few}");
    let [many, _] = dir.runs(&format!("{frames} 14 -o many"));
    assert!(many.ends_with("wrote 14 files, many/frame_0000.png to many/frame_0013.png\n"), "{many}");
    let stats = format!("stats m.pgs {SPECIES} -o st --only density --grid 4 --no-plots");
    let [table, _] = dir.runs(&stats);
    for name in listing(&dir.at("st")) {
        assert!(table.contains(&format!("st/{name}")), "{name}: {table}");
    }
    let nothing = [String::new(), String::new()];
    assert_eq!(dir.runs(&format!("{stats} -q")), nothing);
    assert_eq!(dir.runs(&format!("{frames} 2 -o few -q")), nothing);
    // Output that goes to no file is the result.
    let [info, notes] = dir.runs("info m.pgs -q");
    assert!(info.contains("Gaussians") && notes.is_empty(), "{info}{notes}");
}

#[test]
fn a_note_is_printed_once_per_job_and_command() {
    let dir = TestFolder::new();
    let notes = |words: &str| {
        let [_, stderr] = dir.runs(words);
        let mut notes: Vec<String> = stderr.lines().filter(|l| l.starts_with("note: ")).map(String::from).collect();
        let all = notes.len();
        notes.sort();
        notes.dedup();
        assert_eq!(notes.len(), all, "{words}: {stderr}");
        notes
    };
    let options = "-o job --blocks 2 --gaussians 12 --certificate quick";
    let planned = notes(&format!("plan {SPECIES} {options}"));
    assert!(planned.iter().any(|n| n.contains("comoving")), "{planned:?}");
    for words in ["scatter job", "block job 0", "block job 1", "merge job -o m.pgs"] {
        let again = notes(words);
        assert!(!again.iter().any(|n| planned.contains(n)), "{words}: {again:?}");
    }
    let twice = format!("stats {SPECIES} {SPECIES} -o st --only density --grid 4 --no-plots");
    assert!(notes(&twice).iter().any(|n| n.contains("comoving")));
}

#[test]
fn help_has_help() {
    let text = |args: &[&str]| success(particlegs().args(args))[0].clone();
    for flag in ["-h", "--help"] {
        assert_eq!(text(&["help", flag]), text(&["help"]));
        assert_eq!(text(&["help", "compress", flag]), text(&["help", "compress"]));
    }
}
