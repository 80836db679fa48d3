//! Options without effect are refused by name, and names of pictures select their format.

use crate::common::{TestFolder, listing, snapshot};

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
