//! Help that fits a screen, consistent options, versions, completions and manual pages.

use crate::common::{TestFolder, listing, particlegs, success};

/// Lines and columns of a terminal that `-h` of every command fits on.
const SCREEN: [usize; 2] = [40, 100];

fn printed(arguments: &[&str]) -> String {
    let [text, _] = success(particlegs().env("COLUMNS", SCREEN[1].to_string()).args(arguments));
    text
}

/// The commands that `particlegs -h` lists.
fn commands() -> Vec<String> {
    let help = printed(&["-h"]);
    let list = help.lines().take_while(|l| *l != "Options:").filter(|l| l.starts_with("  "));
    let names: Vec<String> = list.map(|l| l.split_whitespace().next().unwrap().to_string()).collect();
    assert!(names.len() >= 20 && names.iter().any(|n| n == "compress"), "{names:?}");
    names.into_iter().filter(|n| n != "help").collect()
}

#[cfg(not(feature = "lab"))]
#[test]
fn a_program_without_the_laboratory_says_how_to_get_it() {
    for arguments in [&["bench", "all", "samples/nbody64"][..], &["bench", "--help"], &["bench"]] {
        crate::common::fails(particlegs().args(arguments), 2, "built without `bench`");
    }
}

#[test]
fn short_help_of_every_command_fits_a_screen() {
    let fits = |arguments: &[&str], lines: usize| {
        let help = printed(arguments);
        assert!(help.lines().count() <= lines, "{arguments:?}: {} lines\n{help}", help.lines().count());
        // Usage lines are not broken by clap.
        let widest = help.lines().filter(|l| !l.starts_with("Usage:")).map(|l| l.chars().count()).max().unwrap_or(0);
        assert!(widest <= SCREEN[1], "{arguments:?}: {widest} columns\n{help}");
    };
    fits(&["-h"], SCREEN[0]);
    for name in commands() {
        fits(&[&name, "-h"], SCREEN[0]);
        fits(&[&name, "--help"], usize::MAX);
    }
}

#[test]
fn every_option_is_described_and_grouped_in_the_long_help() {
    let long = printed(&["compress", "--help"]);
    for heading in ["Training:", "Snapshot options:", "Selection options", "Common options:"] {
        assert!(long.lines().any(|l| l.starts_with(heading)), "{heading}");
    }
    let options = |text: &str| {
        let starts =
            |l: &&str| l.trim_start().starts_with("--") || l.trim_start().starts_with('-') && l.contains(", --");
        text.lines().filter(starts).count()
    };
    let short = printed(&["compress", "-h"]);
    assert!(options(&long) > 2 * options(&short), "{} and {}", options(&long), options(&short));
    // Options that do not belong to training are not listed under its heading.
    let training = long.split("\nTraining:").nth(1).unwrap().split("\nSnapshot options:").next().unwrap();
    assert!(training.contains("--law"));
    for other in ["--pictures", "--certificate", "--force"] {
        assert!(!training.contains(other), "{other}");
    }
}

#[test]
fn the_version_is_the_programs() {
    let version = printed(&["-V"]);
    assert_eq!(version.trim(), format!("particlegs {}", env!("CARGO_PKG_VERSION")));
    commands().iter().for_each(|name| assert_eq!(printed(&[name, "-V"]), version, "{name}"));
}

/// Every command that writes takes `-o`, `--output` and `--out`.
#[test]
fn outputs_have_one_spelling() {
    let writers = "compress plan merge finetune simplify recover convert export reference render stats";
    for name in writers.split(' ') {
        assert!(printed(&[name, "-h"]).contains("-o, --output"), "{name}");
        for option in ["-o", "--output", "--out"] {
            let out = particlegs().args([name, option]).output().unwrap();
            let stderr = String::from_utf8_lossy(&out.stderr).into_owned();
            assert!(stderr.contains("a value is required for '--output"), "{name} {option}: {stderr}");
        }
    }
}

/// Layers of a model are `--layer` everywhere; what becomes a layer is `--layers-by`.
#[test]
fn layers_have_one_spelling() {
    for name in ["render", "recover", "export"] {
        assert!(printed(&[name, "-h"]).contains("--layer <NAME,...>"), "{name}");
    }
    for name in ["compress", "plan", "info", "convert", "eval"] {
        let help = printed(&[name, "--help"]);
        assert!(help.contains("--layers-by <WHAT>") && !help.contains("--layers "), "{name}");
    }
}

#[test]
fn quiet_is_q_everywhere() {
    for name in commands().iter().filter(|n| !["completions", "man"].contains(&n.as_str())) {
        assert!(printed(&[name, "-h"]).contains("-q, --quiet"), "{name}");
    }
}

#[test]
fn completions_offer_the_values() {
    let script = printed(&["completions", "bash"]);
    for values in [
        "viridis inferno magma cividis ember arctic thermal ice grey",
        "hdf5 genericio npy npz ply",
        "raw npy hdf5 vtp lammps",
        "html ply glb gltf npy vti fits dx mrc npz csv",
        "fast default",
        "none fast best paper",
        "optical-depth alpha-blend",
        "paraview paraview-no-fxaa expected density",
        "species mass",
        "density spectrum pairs groups neighbours moments",
        "slurm snakemake",
        "ngp cic tsc",
        "count volume ellipsoid grid stratified spaced",
    ] {
        assert!(script.contains(&format!("compgen -W \"{values}")), "{values}");
    }
    // Folders where a folder is wanted.
    let stats =
        script.split("particlegs__subcmd__stats)").nth(1).or(script.split("particlegs__stats)").nth(1)).unwrap();
    let output = stats.split("--output)").nth(1).unwrap().split(";;").next().unwrap();
    assert!(output.contains("plusdirs") || output.contains("compgen -d"), "{output}");
    for shell in ["zsh", "fish"] {
        assert!(printed(&["completions", shell]).contains("inferno"), "{shell}");
    }
}

#[test]
fn a_manual_page_for_every_command() {
    let dir = TestFolder::new();
    dir.runs("man man1");
    let names = commands();
    let pages = listing(&dir.at("man1"));
    assert_eq!(pages.len(), names.len() + 1, "{pages:?}");
    for name in names {
        let page = dir.text(&format!("man1/particlegs-{name}.1"));
        assert!(page.contains(&format!(".TH particlegs-{name} 1")) && page.contains(".SH SYNOPSIS"), "{name}");
    }
    let page = dir.text("man1/particlegs-compress.1");
    assert!(page.contains("\\-\\-psnr") && page.contains("\\-\\-scratch") && page.contains("particlegs compress"));
    for described in ["Number of blocks", "Folder for the scratch files", "Leave out particles", ".SH NOTES\nExamples:"]
    {
        assert!(page.contains(described), "{described}");
    }
    // Replaces only files of its own kind.
    dir.runs("man man1");
    dir.write("man1/particlegs-block.1", "my notes");
    dir.command("man man1").assert().code(8);
    assert_eq!(dir.text("man1/particlegs-block.1"), "my notes");
    let whole = dir.text("man1/particlegs.1");
    assert!(whole.contains("particlegs\\-compress(1)"), "{whole}");
}

fn page(name: &str) -> String {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/guide").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The long options that a command's `--help` lists before `Snapshot options` or `Common options`.
fn own_options(command: &str) -> Vec<String> {
    let help = printed(&[command, "--help"]);
    let command_help = help.split("\nSnapshot options:").next().unwrap().split("\nCommon options:").next().unwrap();
    let line = |l: &str| {
        // Descriptions are indented further than options.
        let l = l.strip_prefix("      ").or(l.strip_prefix("  ")).filter(|l| !l.starts_with(' '))?;
        let option = l.starts_with("--") || (l.starts_with('-') && l.contains(", --"));
        option.then(|| l.split_whitespace().find(|w| w.starts_with("--")).unwrap().to_string())
    };
    let options: Vec<String> = command_help.lines().filter_map(line).collect();
    assert!(options.len() >= 6, "{command}: {options:?}");
    options.into_iter().filter(|o| !["--help", "--version", "--output", "--force"].contains(&o.as_str())).collect()
}

#[test]
fn the_guides_describe_every_option() {
    let guides =
        [("render", "pictures.md"), ("reference", "pictures.md"), ("stats", "statistics.md"), ("view", "view.md")];
    for (command, guide) in guides {
        let page = page(guide);
        for option in own_options(command) {
            assert!(page.contains(&option), "{guide} does not name {option} of `{command}`");
        }
    }
}

/// The tables of `stats` have the columns that the guide says.
#[test]
fn the_guide_of_statistics_names_every_column() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs-measure/src/stats");
    let files = std::fs::read_dir(folder).unwrap().map(|f| std::fs::read_to_string(f.unwrap().path()).unwrap());
    let (page, code) = (page("statistics.md"), files.collect::<String>());
    let is_head = |text: &&str| text.matches(',').count() > 1 && !text.contains([' ', '\n', '\\', '{']);
    let heads: Vec<&str> = code.split('"').filter(is_head).collect();
    assert!(heads.len() >= 13, "{heads:?}");
    heads.iter().for_each(|head| assert!(page.contains(head), "{head}"));
}

#[test]
fn the_glossary_has_the_programs_words() {
    let page = page("glossary.md");
    let words = "certificate, verdict, law, noise-free, base distance, masked PSNR, gap, shot noise, layer, block, \
                 effort, step factor, settled";
    for word in words.split(", ").chain(["look, style"]) {
        assert!(page.contains(&format!("| **{word}** |")), "{word}");
    }
    let entries: Vec<String> = page.lines().filter_map(|l| Some(l.strip_prefix("| **")?.to_lowercase())).collect();
    assert!(entries.is_sorted(), "in the order of the alphabet: {entries:?}");
}
