//! Options without effect are refused by name, and names of pictures select their format; every option in the help of
//! every command that reads or draws, at odd values: the command succeeds, prints one error line, or works and can be
//! stopped.

use crate::common::{TestFolder, errors, listing, particlegs, process, signal, snapshot};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// A folder with a snapshot `in` of 512 particles and a model `m.pgs` of it.
fn folder() -> TestFolder {
    let dir = TestFolder::new();
    let column = |stride: usize| (0..512).map(|i| ((i / stride) % 8) as f32 + 0.5).collect::<Vec<f32>>();
    snapshot(&dir.at("in"), &[column(1), column(8), column(64)]);
    dir.once("compress in -o m.pgs --effort fast --certificate=none -q");
    dir
}

#[test]
fn options_without_effect_are_refused_by_name() {
    let dir = folder();
    let (render, density) = ("render m.pgs --size 64x36 --out p", "render m.pgs --size 64x36 --out p --style density");
    let (compress, stats) = ("compress in -o x.pgs", "stats in m.pgs -o s --only density");
    let before = dir.listing();
    for (command, more, text) in [
        (render, "--colormap magma", "--colormap"),
        (render, "--range 1,2", "--range"),
        (render, "--projection orthographic --distance 2", "--distance"),
        (render, "--width 3 --distance 2", "--distance"),
        (render, "--colorbar inside", "--colorbar"),
        (render, "--video v.mp4", "--video"),
        (density, "--color-by-layer", "--color-by-layer"),
        (density, "--raw --title t", "--title"),
        (render, "--raw", "--raw"),
        (render, "--no-annotations", "--no-annotations"),
        ("reference in --size 64x36 --out p", "--colormap magma", "--colormap"),
        (density, "--opacity 0.1", "--opacity"),
        (density, "--radius 0.1", "--radius"),
        (density, "--projection orthographic --distance 2", "--distance"),
        (density, "--raw --no-annotations", "--no-annotations"),
        (compress, "--resume", "--resume"),
        (compress, "--log l.jsonl", "--log"),
        (compress, "--iterations 5", "--iterations"),
        (compress, "--train paper --effort fast", "--effort"),
        ("plan in -o job", "--scale 0.5", "--scale"),
        ("info m.pgs", "--frame 3", "--frame"),
        ("info m.pgs", "--box 8", "--box"),
        ("info m.pgs", "--no-bounds", "--no-bounds"),
        ("convert m.pgs -o m.ply", "--every 2", "--every"),
        ("convert m.pgs -o m.ply", "--mass-field none", "--mass-field"),
        ("verify m.pgs", "--sample 9", "--sample"),
        ("verify m.pgs", "--layers mass", "--layers"),
        ("merge m.pgs -o x.pgs", "--certificate=none", "--certificate"),
        ("recover m.pgs -o x", "--method grid --scale 2", "--scale"),
        ("stats in m.pgs -o s", "--only groups --grid 8", "--grid"),
        (stats, "--k-max 8", "--k-max"),
        (stats, "--linking 0.1", "--linking"),
        (stats, "--neighbours 9", "--neighbours"),
    ] {
        dir.fails(&format!("{command} {more}"), 2, text);
        assert_eq!(dir.listing(), before, "{command} {more}");
    }
}

/// The same options are accepted where they have an effect, with both spellings of the output.
#[test]
fn options_with_an_effect_are_accepted() {
    let dir = folder();
    for words in [
        "render m.pgs -o d --projection orthographic --width 3 --style density --size 64x36",
        "render m.pgs --output e --raw --style density --size 64x36",
        "render m.pgs --out f --colormap magma --no-annotations --style density --size 64x36",
        "render m.pgs -o g.pdf --no-annotations --size 64x36 --center 1,1,1 --depth 3",
        "reference in -o h --size 64x36 --center 1,1,1 --width 3",
        "info in --box 8 --no-bounds",
        "merge m.pgs --out merged.pgs",
        "stats in m.pgs --output s --only density --grid 8 --no-plots",
    ] {
        dir.runs(words);
    }
    assert_eq!(listing(&dir.at("e")), ["view.f32", "view.json"]);
}

#[test]
fn one_picture_may_be_named() {
    let dir = folder();
    for words in ["render m.pgs --out a.png", "render m.pgs --style density -o b.PNG", "reference in -o c.png"] {
        dir.runs(&format!("{words} --size 64x36"));
        assert!(dir.bytes(words.rsplit(' ').next().unwrap()).starts_with(b"\x89PNG"), "{words}");
    }
    let two = r#"{"size": [64, 36], "views": []}"#;
    dir.write("note.txt", two);
    dir.fails("render m.pgs -o note.txt", 2, "does not end in .png");
    assert_eq!(dir.text("note.txt"), two);
    dir.fails("render m.pgs -o d.png --style density --raw", 2, "raw values are written");
    assert!(!dir.at("d.png").exists());
}

#[test]
fn a_name_of_another_type_of_file_is_refused_by_every_command() {
    let dir = folder();
    let before = dir.listing();
    for words in [
        "render m.pgs --output x.jpg",
        "reference in -o x.webp",
        "convert in -o x.vdb",
        "recover m.pgs -o x.xyzw",
        "haloes in -o h.txt",
        "haloes in -o h.csv --mass-function f.txt",
        "stats in m.pgs -o s.csv",
        "eval m.pgs in --pictures p.png",
        "compress in -o x.ply --effort fast",
        "compress in -o x.pgs --effort fast --pictures p.mp4",
        "simplify m.pgs --gaussians 3 -o x.json",
        "merge m.pgs -o x.h5",
        "plan in -o job.pgs",
    ] {
        dir.fails(words, 2, "this command does not write .");
        assert_eq!(dir.listing(), before, "{words}");
    }
    // Names of folders that are no types of files.
    for name in ["out.v2", "run.2024", "snap_0.5", "x.jpg/"] {
        dir.runs(&format!("render m.pgs --size 64x36 -o {name}"));
        assert_eq!(listing(&dir.at(name)), ["view.png"], "{name}");
    }
}

#[test]
fn a_single_model_has_no_frames_and_nothing_to_extract() {
    let dir = folder();
    let before = dir.listing();
    for words in [
        "render m.pgs -o p.png --frame 3",
        "render m.pgs -o p.png --time a=0.5",
        "recover m.pgs -o x --frame 0",
        "simplify m.pgs --gaussians 3 -o x.pgs --frame 0",
        "export m.pgs -o x.ply --frame 0",
        "haloes m.pgs -o h.csv --frame 0",
        "stats m.pgs m.pgs -o s --frame 0",
        "extract m.pgs -o x.pgs",
    ] {
        dir.fails(words, 3, "it is one model, not a series");
        assert_eq!(dir.listing(), before, "{words}");
    }
}

/// A working command is stopped after this ...
const PATIENCE: Duration = Duration::from_secs(4);
/// ... and must end within this, on a busy machine.
const HEARD: Duration = Duration::from_secs(30);

const VALUES: [&str; 9] =
    ["0", "-1", "5e-324", "1e-300", "1e300", "nan", "inf", "18446744073709551615", "1e-9,1e300,1"];

/// Commands with required arguments, and options that make them quick.
const COMMANDS: [[&str; 2]; 9] = [
    ["compress snap --certificate=none", "-o=@.pgs --effort=fast --ratio=10"],
    ["render m.pgs", "--out=@ --size=32x24"],
    ["reference snap", "--out=@ --size=32x24"],
    ["eval m.pgs snap", "--frames=1 --size=32x24"],
    ["stats snap snap --no-plots", "-o=@ --grid=8 --spectrum-grid=8 --pairs=10000"],
    ["simplify m.pgs", "-o=@.pgs --gaussians=5"],
    ["recover m.pgs", "-o=@ --particles=50"],
    ["convert snap", "-o=@"],
    ["plan snap", "-o=@ --blocks=2"],
];

/// A folder with a snapshot and a model of it.
fn inputs() -> TestFolder {
    let dir = TestFolder::new();
    let column = |k: u64| (0..600u64).map(|i| ((i * (7 + k) * 2_654_435_761) % 10_007) as f32 * 1e-2).collect();
    snapshot(&dir.at("snap"), &[column(0), column(1), column(2)]);
    dir.runs("compress snap -o m.pgs --gaussians 20 --effort fast --certificate=none -q");
    dir
}

/// The options of a command that take a value, from its help.
fn options(command: &str) -> Vec<String> {
    let out = particlegs().args([command, "--help"]).output().unwrap();
    let help = String::from_utf8(out.stdout).unwrap();
    let option = |line: &str| {
        let (before, _) = line.trim().split_once(" <")?;
        let name = before.split(' ').next_back()?;
        (line.trim().starts_with('-') && name.starts_with("--")).then(|| name.to_string())
    };
    let options: Vec<String> = help.lines().filter_map(option).collect();
    assert!(options.len() > 3, "{command}: {options:?}");
    options
}

fn arguments([base, small]: [&str; 2], option: &str, value: &str, number: usize) -> Vec<String> {
    let mut all: Vec<String> = base.split(' ').map(String::from).collect();
    for word in small.split(' ') {
        let (name, small) = word.split_once('=').unwrap();
        if name != option && !(name == "-o" && option == "--out") {
            all.extend([name.to_string(), small.replace('@', &format!("out{number}"))]);
        }
    }
    all.extend(["-q".into(), format!("{option}={value}")]);
    all
}

fn wait(child: &mut Child, limit: Duration) -> bool {
    let start = Instant::now();
    while start.elapsed() < limit {
        if child.try_wait().unwrap().is_some() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(3));
    }
    false
}

/// Runs a command until it ends or is stopped.
fn run(dir: &TestFolder, arguments: &[String]) {
    let error = std::fs::File::create(dir.at("stderr")).unwrap();
    let mut command = process(dir.path());
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(error);
    let mut child = command.spawn().unwrap();
    let mut ended = wait(&mut child, PATIENCE);
    if !ended {
        signal(&child, "-TERM");
        ended = wait(&mut child, HEARD);
    }
    if !ended {
        child.kill().unwrap();
    }
    let status = child.wait().unwrap();
    let text = dir.text("stderr");
    assert!(ended, "{arguments:?} does not end:\n{text}");
    let code = status.code().unwrap_or_else(|| panic!("{arguments:?} ended by {status}:\n{text}"));
    assert!([0, 2, 3, 4, 5, 6, 7, 8, 75, 130].contains(&code), "{arguments:?} ended with {code}:\n{text}");
    assert!(!text.contains("panicked"), "{arguments:?} ended with {code}:\n{text}");
    assert_eq!(errors(&text), usize::from(code != 0), "{arguments:?} ended with {code}:\n{text}");
}

/// Every option with each value, starting with the `first`.
fn sweep(first: usize) {
    let dir = inputs();
    let mut number = 0;
    for base in COMMANDS {
        for (i, option) in options(base[0].split(' ').next().unwrap()).iter().enumerate() {
            let value = VALUES[(first + i) % VALUES.len()];
            run(&dir, &arguments(base, option, value, number));
            number += 1;
        }
    }
    assert!(number > 50);
}

#[test]
fn options_at_odd_values_end() {
    sweep(0);
}

#[test]
#[ignore = "slow"]
fn options_at_other_odd_values_end() {
    sweep(4);
}
