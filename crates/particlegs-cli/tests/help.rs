//! What a user reads before anything runs: help that fits a screen, options of one spelling, versions,
//! completions and manual pages.
#![allow(missing_docs)]

mod common;

use common::{listing, particlegs};

/// Lines and columns of a terminal that `-h` of every command fits on.
const SCREEN: [usize; 2] = [40, 100];

fn printed(arguments: &[&str]) -> String {
    let out = particlegs().env("COLUMNS", SCREEN[1].to_string()).args(arguments).output().unwrap();
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// The commands that `particlegs -h` lists.
fn commands() -> Vec<String> {
    let help = printed(&["-h"]);
    let list = help.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    let names: Vec<String> = list.map(|l| l.split_whitespace().next().unwrap().to_string()).collect();
    assert!(names.len() >= 20 && names.iter().any(|n| n == "compress"), "{names:?}");
    names.into_iter().filter(|n| n != "help").collect()
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
    assert!(training.contains("--law") && !training.contains("--pictures") && !training.contains("--no-certificate"));
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
    let writers =
        ["compress", "plan", "merge", "finetune", "simplify", "recover", "convert", "reference", "render", "stats"];
    for name in writers {
        assert!(printed(&[name, "-h"]).contains("-o, --output"), "{name}");
        for option in ["-o", "--output", "--out"] {
            let out = particlegs().args([name, option]).output().unwrap();
            let said = String::from_utf8_lossy(&out.stderr).into_owned();
            assert!(said.contains("a value is required for '--output"), "{name} {option}: {said}");
        }
    }
}

/// Layers of a model are `--layer` everywhere; what becomes a layer is `--layers-by`.
#[test]
fn layers_have_one_spelling() {
    for name in ["render", "recover"] {
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
        "viridis inferno magma cividis grey",
        "hdf5 genericio npy npz ply",
        "raw npy hdf5 vtp lammps",
        "fast default high",
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
    let render =
        script.split("particlegs__subcmd__render)").nth(1).or(script.split("particlegs__render)").nth(1)).unwrap();
    let output = render.split("--output)").nth(1).unwrap().split(";;").next().unwrap();
    assert!(output.contains("plusdirs") || output.contains("compgen -d"), "{output}");
    for shell in ["zsh", "fish"] {
        assert!(printed(&["completions", shell]).contains("inferno"), "{shell}");
    }
}

#[test]
fn a_manual_page_for_every_command() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("man1");
    particlegs().arg("man").arg(&folder).assert().success();
    let names = commands();
    let pages = listing(&folder);
    assert_eq!(pages.len(), names.len() + 1, "{pages:?}");
    for name in names {
        let page = std::fs::read_to_string(folder.join(format!("particlegs-{name}.1"))).unwrap();
        assert!(page.contains(&format!(".TH particlegs-{name} 1")) && page.contains(".SH SYNOPSIS"), "{name}");
    }
    let page = std::fs::read_to_string(folder.join("particlegs-compress.1")).unwrap();
    assert!(page.contains("\\-\\-psnr") && page.contains("\\-\\-scratch") && page.contains("particlegs compress"));
    for described in ["Number of blocks", "Folder for the scratch files", "Leave out particles", ".SH NOTES\nExamples:"]
    {
        assert!(page.contains(described), "{described}");
    }
    let whole = std::fs::read_to_string(folder.join("particlegs.1")).unwrap();
    assert!(whole.contains("particlegs\\-compress(1)"), "{whole}");
}
