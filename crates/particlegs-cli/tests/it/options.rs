//! Options that would do nothing are refused by name, and outputs of pictures are what their names say.

use crate::common::{fails, listing, particlegs, snapshot};
use std::path::Path;

/// A folder with a snapshot `in` of 512 particles and a model `m.pgs` of it.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let column = |stride: usize| (0..512).map(|i| ((i / stride) % 8) as f32 + 0.5).collect::<Vec<f32>>();
    snapshot(&dir.path().join("in"), &[column(1), column(8), column(64)]);
    let mut c = particlegs();
    c.current_dir(&dir).args(["compress", "in", "-o", "m.pgs", "--effort", "fast", "--certificate=none", "-q"]);
    assert!(c.output().unwrap().status.success());
    dir
}

#[test]
fn options_that_do_nothing_are_refused_by_name() {
    let dir = folder();
    let picture = ["--size", "64x36", "--out", "p"];
    let render = |more: &[&'static str]| [&["render", "m.pgs"], &picture[..], more].concat();
    let reference = |more: &[&'static str]| [&["reference", "in"], &picture[..], more].concat();
    let on = |head: &[&'static str], more: &[&'static str]| [head, more].concat();
    let cases: Vec<(Vec<&str>, &str)> = vec![
        (render(&["--colormap", "magma"]), "--colormap"),
        (render(&["--range", "1,2"]), "--range"),
        (render(&["--projection", "orthographic", "--distance", "2"]), "--distance"),
        (render(&["--width", "3", "--distance", "2"]), "--distance"),
        (render(&["--colorbar", "inside"]), "--colorbar"),
        (render(&["--video", "v.mp4"]), "--video"),
        (render(&["--style", "density", "--color-by-layer"]), "--color-by-layer"),
        (render(&["--style", "density", "--raw", "--title", "t"]), "--title"),
        (render(&["--raw"]), "--raw"),
        (render(&["--no-annotations"]), "--no-annotations"),
        (reference(&["--colormap", "magma"]), "--colormap"),
        (render(&["--style", "density", "--opacity", "0.1"]), "--opacity"),
        (render(&["--style", "density", "--radius", "0.1"]), "--radius"),
        (render(&["--style", "density", "--projection", "orthographic", "--distance", "2"]), "--distance"),
        (render(&["--style", "density", "--raw", "--no-annotations"]), "--no-annotations"),
        (on(&["compress", "in", "-o", "x.pgs"], &["--resume"]), "--resume"),
        (on(&["compress", "in", "-o", "x.pgs"], &["--log", "l.jsonl"]), "--log"),
        (on(&["compress", "in", "-o", "x.pgs"], &["--iterations", "5"]), "--iterations"),
        (on(&["compress", "in", "-o", "x.pgs"], &["--train", "paper", "--effort", "fast"]), "--effort"),
        (on(&["plan", "in", "-o", "job"], &["--scale", "0.5"]), "--scale"),
        (on(&["info", "m.pgs"], &["--frame", "3"]), "--frame"),
        (on(&["info", "m.pgs"], &["--box", "8"]), "--box"),
        (on(&["info", "m.pgs"], &["--no-bounds"]), "--no-bounds"),
        (on(&["convert", "m.pgs", "-o", "m.ply"], &["--every", "2"]), "--every"),
        (on(&["convert", "m.pgs", "-o", "m.ply"], &["--mass-field", "none"]), "--mass-field"),
        (on(&["verify", "m.pgs"], &["--sample", "9"]), "--sample"),
        (on(&["verify", "m.pgs"], &["--layers", "mass"]), "--layers"),
        (on(&["merge", "m.pgs", "-o", "x.pgs"], &["--certificate=none"]), "--certificate"),
        (on(&["recover", "m.pgs", "-o", "x"], &["--method", "grid", "--scale", "2"]), "--scale"),
        (on(&["stats", "in", "m.pgs", "-o", "s"], &["--only", "groups", "--grid", "8"]), "--grid"),
        (on(&["stats", "in", "m.pgs", "-o", "s"], &["--only", "density", "--k-max", "8"]), "--k-max"),
        (on(&["stats", "in", "m.pgs", "-o", "s"], &["--only", "density", "--linking", "0.1"]), "--linking"),
        (on(&["stats", "in", "m.pgs", "-o", "s"], &["--only", "density", "--neighbours", "9"]), "--neighbours"),
    ];
    let before = listing(dir.path());
    for (args, text) in cases {
        let mut c = particlegs();
        fails(c.current_dir(&dir).args(&args), 2, text);
        assert_eq!(listing(dir.path()), before, "{args:?}");
    }
}

/// The same options where they mean something are taken, in the words of both spellings of the output.
#[test]
fn options_that_mean_something_are_taken() {
    let dir = folder();
    let run = |args: &[&str]| {
        let out = particlegs().current_dir(&dir).args(args).output().unwrap();
        assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    };
    let density = ["--style", "density", "--size", "64x36"];
    run(&[&["render", "m.pgs", "-o", "d", "--projection", "orthographic", "--width", "3"], &density[..]].concat());
    run(&[&["render", "m.pgs", "--output", "e", "--raw"], &density[..]].concat());
    run(&[&["render", "m.pgs", "--out", "f", "--colormap", "magma", "--no-annotations"], &density[..]].concat());
    run(&[
        "render",
        "m.pgs",
        "-o",
        "g.pdf",
        "--no-annotations",
        "--size",
        "64x36",
        "--center",
        "1,1,1",
        "--depth",
        "3",
    ]);
    run(&["reference", "in", "-o", "h", "--size", "64x36", "--center", "1,1,1", "--width", "3"]);
    run(&["info", "in", "--box", "8", "--no-bounds"]);
    run(&["merge", "m.pgs", "--out", "merged.pgs"]);
    run(&["stats", "in", "m.pgs", "--output", "s", "--only", "density", "--grid", "8", "--no-plots"]);
    assert_eq!(listing(&dir.path().join("e")), ["view.f32", "view.json"]);
}

#[test]
fn one_picture_may_be_named() {
    let dir = folder();
    let size = ["--size", "64x36"];
    let at = |name: &str| dir.path().join(name);
    let run = |args: &[&str]| particlegs().current_dir(&dir).args(args).args(size).output().unwrap();
    for args in [
        vec!["render", "m.pgs", "--out", "a.png"],
        vec!["render", "m.pgs", "-o", "b.PNG", "--style", "density"],
        vec!["reference", "in", "-o", "c.png"],
    ] {
        let out = run(&args);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        assert!(is_png(&at(args[3])), "{args:?}");
    }
    let two = r#"{"size": [64, 36], "views": []}"#;
    std::fs::write(at("note.txt"), two).unwrap();
    fails(particlegs().current_dir(&dir).args(["render", "m.pgs", "-o", "note.txt"]), 2, "does not end in .png");
    assert_eq!(std::fs::read_to_string(at("note.txt")).unwrap(), two);
    let raw = ["render", "m.pgs", "-o", "d.png", "--style", "density", "--raw"];
    fails(particlegs().current_dir(&dir).args(raw), 2, "--raw writes values");
    assert!(!at("d.png").exists());
}

fn is_png(path: &Path) -> bool {
    std::fs::read(path).is_ok_and(|b| b.starts_with(b"\x89PNG"))
}
