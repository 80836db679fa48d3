//! Figures, films and panels, and the provenance in a picture.

use crate::common::{TestFolder, listing, said, snapshot};
use serde_json::Value;

/// A model of particles on a spiral, with units, a box and two layers.
fn model(dir: &TestFolder, name: &str, turns: f32, gaussians: u32) {
    let along = |f: &dyn Fn(f32) -> f32| (0..3000).map(|i| f(i as f32 / 3000.0)).collect::<Vec<f32>>();
    let columns = [
        along(&|t| 5.0 + 4.0 * (turns * t).cos() * t),
        along(&|t| 1.0 + 8.0 * t),
        along(&|t| 5.0 + 4.0 * (turns * t).sin() * t),
        along(&|t| if t < 0.5 { 1.0 } else { 3.0 }),
    ];
    snapshot(&dir.at(&format!("{name}-in")), &columns);
    dir.write(&format!("{name}-in/meta.json"), r#"{"box": 10, "length_unit": "Mpc/h"}"#);
    let fit = format!("--gaussians {gaussians} --layers-by mass --effort fast --certificate=none --quiet");
    dir.once(&format!("compress {name}-in -o {name}.pgs {fit}"));
}

fn folder() -> TestFolder {
    let dir = TestFolder::new();
    model(&dir, "a", 19.0, 40);
    dir
}

fn render(s: &TestFolder, words: &str) -> Value {
    s.says(&format!("render {words} --quiet"))
}

fn refused(s: &TestFolder, words: &str, code: i32, text: &str) {
    s.fails(&format!("render {words} --quiet"), code, text);
}

const DENSITY: &str = "a.pgs --style density --projection orthographic --size 60x60 -o";

#[test]
fn a_figure_has_its_labels_as_text_and_its_picture_as_it_is() {
    let s = folder();
    let framed = format!("render {DENSITY} f.svg --axes frame");
    s.command(&framed).args(["--title", "A < B"]).assert().success();
    let svg = s.text("f.svg");
    assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"));
    assert!(svg.contains("width=\"238.11pt\""), "84 mm");
    for text in [">x (Mpc h⁻¹)<", ">y (Mpc h⁻¹)<", ">A &lt; B<", "font-size=\"8\"", ">4<", ">6<"] {
        assert!(svg.contains(text), "{text}");
    }
    // One colour bar with a title, and two images: the density and the bar.
    assert_eq!(svg.matches(">Σ (").count(), 1);
    assert_eq!(svg.matches("data:image/png;base64,").count(), 2);
    assert!(svg.contains("<metadata>{&quot;particlegs&quot;"));
    render(&s, &format!("{DENSITY} f.pdf --figure-width 50mm --font-size 6"));
    let pdf = String::from_utf8_lossy(&s.bytes("f.pdf")).into_owned();
    assert!(pdf.starts_with("%PDF-") && pdf.contains("/FontFile2") && pdf.contains("/ToUnicode"));
    assert!(pdf.contains("/MediaBox [0 0 141.73"), "50 mm");
    // The same figure has the same bytes.
    render(&s, &format!("{DENSITY} g.pdf --figure-width 50mm --font-size 6 --threads 1"));
    assert!(s.bytes("f.pdf") == s.bytes("g.pdf"));
}

#[test]
fn a_picture_can_be_drawn_again_from_its_provenance() {
    let s = folder();
    for view in [
        "--azimuth 33.3 --elevation -12 --radius 0.03 --opacity 0.3 --size 80x50",
        "--style density --colormap viridis --size 80x50 --background white",
        "--style density --projection orthographic --depth 2 --size 50x50",
        "--style expected --color-by-layer --distance 0.6 --size 80x50",
    ] {
        render(&s, &format!("a.pgs -o a.png {view}"));
        render(&s, "a.pgs -o b.png --like a.png");
        assert!(s.bytes("a.png") == s.bytes("b.png"), "{view:?}");
    }
    // For another model it is the same view.
    model(&s, "b", 7.0, 60);
    let first = render(&s, "a.pgs -o a.png --azimuth 33 --width 4 --size 80x50");
    let other = render(&s, "b.pgs -o b.png --like a.png");
    for key in ["position", "focal_point", "view_up", "fov_deg", "radius", "opacity"] {
        assert_eq!(first["views"][0][key], other["views"][0][key], "{key}");
    }
    assert!(s.bytes("a.png") != s.bytes("b.png"));
    // Pictures without that text, and files that are no pictures, are refused.
    s.write("no.png", [&s.bytes("a.png")[..40], b"more"].concat());
    refused(&s, "a.pgs -o c.png --like no.png", 3, "does not contain the settings of its view");
    refused(&s, "a.pgs -o c.png --like a.pgs", 3, "a.pgs");
    refused(&s, "a.pgs -o a.png --like a.png", 8, "is an input");
    assert!(!s.at("c.png").exists());
}

#[test]
fn panels_have_one_range_and_one_bar() {
    let s = folder();
    model(&s, "b", 7.0, 60);
    let range = |words: &str| {
        let view = "--style density --size 60x40 --center 5,5,5 --width 10";
        let report = render(&s, &format!("{words} {view} --panels"));
        [0, 1].map(|k| report["range"][k].as_f64().unwrap())
    };
    let alone = ["a.pgs", "b.pgs"].map(|m| range(&format!("{m} -o one.svg")));
    let both = range("a.pgs b.pgs -o two.svg");
    assert_eq!(both[1], alone[0][1].max(alone[1][1]));
    assert!(both[0] <= alone[0][0].max(alone[1][0]) && alone[0] != alone[1]);
    let svg = s.text("two.svg");
    assert_eq!((svg.matches(">Σ (").count(), svg.matches("data:image/png").count()), (1, 3));
    assert!(svg.contains(">a</text>") && svg.contains(">b</text>"));
    range("a.pgs b.pgs -o two.pdf --captions before,after --columns 1");
    refused(&s, "a.pgs b.pgs -o x.png", 2, "2 models are given");
    refused(&s, "a.pgs b.pgs -o x.png --panels --captions one", 2, "2 panels");
    let one = render(&s, "a.pgs --style density --size 60x40 -o x --panels");
    assert!(one["views"].as_array().unwrap().len() == 1 && s.at("x/panels.png").exists());
}

#[test]
fn a_turn_begins_with_its_view_and_has_one_range() {
    let s = folder();
    let turn = "--turntable 5 --size 48x30 --elevation 15";
    let report = render(&s, &format!("a.pgs -o frames --save-views keys.json {turn}"));
    let names: Vec<String> = (0..5).map(|i| format!("frame_000{i}.png")).collect();
    assert_eq!(listing(&s.at("frames")), names);
    assert_eq!(report["views"].as_array().unwrap().len(), 5);
    render(&s, "a.pgs -o first.png --size 48x30 --elevation 15");
    let pixels = |name: &str| particlegs_files::png::read_png(&s.at(name)).unwrap();
    assert_eq!(pixels("frames/frame_0000.png"), pixels("first.png"));
    assert!(pixels("frames/frame_0001.png") != pixels("first.png"));
    // The frames match the saved views, for any number of threads.
    render(&s, "a.pgs -o again --views keys.json");
    render(&s, &format!("a.pgs -o alone --threads 1 {turn}"));
    for name in &names {
        assert_eq!(pixels(&format!("again/{name}")), pixels(&format!("frames/{name}")));
        assert!(s.bytes(&format!("alone/{name}")) == s.bytes(&format!("frames/{name}")));
    }
    let density = render(&s, "a.pgs -o sigma --style density --turntable 3 --size 48x30");
    assert!(density["range"][1].as_f64() > density["range"][0].as_f64());
    // A path through the turn's views passes through them.
    render(&s, "a.pgs -o path --path keys.json --frames 9");
    assert_eq!(listing(&s.at("path")).len(), 9);
    assert_eq!(pixels("path/frame_0004.png"), pixels("frames/frame_0002.png"));
    refused(&s, "a.pgs -o x --views keys.json --turntable 3", 2, "take one view");
    refused(&s, "a.pgs -o x.png --turntable 3", 2, "names one picture");
    refused(&s, "a.pgs -o x --turntable 3 --video x.avi", 2, ".mp4, .webm or .gif");
}

/// Without ffmpeg the frames are kept, and the error prints the command that joins them.
#[test]
fn without_ffmpeg_frames_are_kept() {
    let s = folder();
    let film = "render a.pgs --turntable 2 --size 32x20 --video turn.mp4";
    let out = s.command(film).env("PATH", s.path()).output().unwrap();
    let stderr = said(&out);
    assert!(out.status.code() == Some(6) && stderr.contains("ffmpeg -v error"), "{stderr}");
    assert!(
        stderr.contains("turn-frames/frame_%04d.png") && stderr.lines().any(|l| l.ends_with("turn.mp4")),
        "{stderr}"
    );
    assert_eq!(listing(&s.at("turn-frames")), ["frame_0000.png", "frame_0001.png"]);
    assert!(!s.at("turn.mp4").exists());
}

/// ffmpeg gets names with `file:`, since it would take text before a colon for a protocol. Its output is checked.
#[cfg(unix)]
#[test]
fn films_with_colons_in_their_names_are_files() {
    use std::os::unix::fs::PermissionsExt;
    let s = folder();
    let stand_in = |does: &str| {
        let script = format!("#!/bin/sh\nfor last; do :; done\n{does}\n");
        s.write("ffmpeg", script);
        std::fs::set_permissions(s.at("ffmpeg"), std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    let film = |name: &str, code: i32| {
        let film = format!("render a.pgs --turntable 2 --size 32x20 --video={name} --quiet");
        let path = format!("{}:/usr/bin:/bin", s.path().display());
        let out = s.command(&film).env("PATH", path).output().unwrap();
        let stderr = said(&out);
        assert_eq!(out.status.code(), Some(code), "{stderr}");
        stderr
    };
    stand_in(r#"case "$last" in file:*) echo film > "${last#file:}";; esac"#);
    for name in ["12:30.mp4", "http:turn.webm", "-turn.mp4"] {
        let stderr = film(name, 0);
        assert!(s.at(name).exists(), "{stderr}");
    }
    stand_in("exit 0");
    let stderr = film("none.mp4", 6);
    assert!(stderr.contains("file:none-frames/frame_%04d.png") && !s.at("none.mp4").exists(), "{stderr}");
    assert_eq!(listing(&s.at("none-frames")), ["frame_0000.png", "frame_0001.png"]);
}

#[test]
fn impossible_figures_are_refused() {
    let s = folder();
    refused(&s, "a.pgs -o x.pdf --axes frame", 2, "need an orthographic view");
    refused(&s, &format!("{DENSITY} x.pdf --figure-width 10mm --font-size 20"), 2, "too narrow");
    refused(&s, "a.pgs -o x.png --depth=-1", 2, "the depth -1");
    refused(&s, "a.pgs -o x.png --center 1,2", 2, "a centre is X,Y,Z");
    for words in ["render a.pgs -o x.png --figure-width 84 --quiet", "render a.pgs --quiet"] {
        s.command(words).assert().failure().code(2);
    }
    assert!(!s.at("x.png").exists() && !s.at("x.pdf").exists());
    // Bars on the picture do not change its size.
    render(&s, &format!("{DENSITY} z.png --colorbar inside"));
    let size = particlegs_files::png::read_png(&s.at("z.png")).unwrap().size;
    assert_eq!([size.width, size.height], [60, 60]);
    // A view with its focal point outside the particles has no scale.
    render(&s, "a.pgs -o x.svg --center 90,0,0 --distance 5 --size 40x30");
    assert!(!s.text("x.svg").split("</metadata>").nth(1).unwrap().contains("Mpc"));
    render(&s, "a.pgs -o y.svg --size 40x30");
    assert!(s.text("y.svg").contains(" Mpc h⁻¹ (at the centre)</text>"));
}

/// Decodes a GIF by its specification (version 89a): size, and the colours of every frame's pixels.
fn decoded(file: &[u8]) -> ([usize; 2], Vec<Vec<[u8; 3]>>) {
    assert!(file.starts_with(b"GIF89a"));
    let word = |at: usize| usize::from(file[at]) + 256 * usize::from(file[at + 1]);
    let palette = |at: usize, flags: u8| -> Vec<[u8; 3]> {
        let count = if flags & 0x80 != 0 { 2usize << (flags & 7) } else { 0 };
        file[at..at + 3 * count].chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
    };
    let all = palette(13, file[10]);
    let (mut at, mut frames) = (13 + 3 * all.len(), Vec::new());
    // Sub-blocks from a position on, and their end.
    let blocks = |mut at: usize| {
        let mut data = Vec::new();
        while file[at] > 0 {
            data.extend_from_slice(&file[at + 1..][..usize::from(file[at])]);
            at += 1 + usize::from(file[at]);
        }
        (data, at + 1)
    };
    loop {
        match file[at] {
            0x21 => at = blocks(at + 2).1,
            0x2c => {
                assert_eq!([word(at + 5), word(at + 7)], [word(6), word(8)], "whole frames");
                let local_palette = palette(at + 10, file[at + 9]);
                at += 10 + 3 * local_palette.len();
                let colours = if local_palette.is_empty() { &all } else { &local_palette };
                let (data, end) = blocks(at + 1);
                let pixels = unpacked(&data, u32::from(file[at]));
                frames.push(pixels.into_iter().map(|p| colours[usize::from(p)]).collect());
                at = end;
            }
            0x3b => return ([word(6), word(8)], frames),
            other => panic!("block {other:#x}"),
        }
    }
}

/// LZW with codes that grow, the least significant bit first.
fn unpacked(data: &[u8], least: u32) -> Vec<u8> {
    let (clear, end) = (1usize << least, (1usize << least) + 1);
    let fresh = || -> Vec<Vec<u8>> { (0..end + 1).map(|c| if c < clear { vec![c as u8] } else { vec![] }).collect() };
    let (mut table, mut last, mut out) = (fresh(), Vec::new(), Vec::new());
    let (mut bit, mut width) = (0usize, least + 1);
    loop {
        let code =
            (0..width as usize).map(|i| usize::from(data[(bit + i) / 8] >> ((bit + i) % 8) & 1) << i).sum::<usize>();
        bit += width as usize;
        if code == clear {
            (table, last, width) = (fresh(), Vec::new(), least + 1);
            continue;
        }
        if code == end {
            return out;
        }
        let entry = match table.get(code) {
            Some(entry) => entry.clone(),
            None => [&last[..], &last[..1]].concat(),
        };
        out.extend_from_slice(&entry);
        if !last.is_empty() && table.len() < 4096 {
            table.push([&last[..], &entry[..1]].concat());
        }
        if table.len() == 1 << width && width < 12 {
            width += 1;
        }
        last = entry;
    }
}

#[test]
fn a_gif_has_the_frames_pixels() {
    let s = folder();
    render(&s, "a.pgs --turntable 4 --size 64x40 --video turn.gif -o frames");
    let (size, frames) = decoded(&s.bytes("turn.gif"));
    assert_eq!((size, frames.len()), ([64, 40], 4));
    for (i, frame) in frames.iter().enumerate() {
        let png = particlegs_files::png::read_png(&s.at(&format!("frames/frame_000{i}.png"))).unwrap();
        assert!(png.data.iter().zip(frame).all(|(level, p)| *p == [*level; 3]), "{i}");
    }
    // Alone, a GIF leaves no frames behind.
    render(&s, "a.pgs --turntable 2 --size 64x40 --style density --video sigma.gif --fps 10");
    assert_eq!(decoded(&s.bytes("sigma.gif")).1.len(), 2);
    assert!(!s.at("sigma-frames").exists());
}

#[test]
fn densities_of_masses_and_of_particles_share_no_colours() {
    let s = folder();
    s.runs("compress a-in -o n.pgs --mass-field none --gaussians 40 --effort fast --certificate=none --quiet");
    let density = "--style density --projection orthographic --size 60x60";
    refused(
        &s,
        &format!("a.pgs n.pgs --panels {density} -o p.png"),
        3,
        "its density is of particles, that of a.pgs of mass",
    );
    // Other styles show no densities.
    render(&s, "a.pgs n.pgs --panels --size 60x60 -o p.png");
    render(&s, &format!("a.pgs {density} -o a.png"));
    render(&s, &format!("n.pgs {density} -o n.png"));
    s.fails("compare a.png n.png", 3, "density of mass in");
    refused(&s, "n.pgs --like a.png -o b.png", 3, "its density is of particles, that of a.png of mass");
    s.runs("compare a.png a.png");
    s.fails(
        "stats a-in n.pgs -o stats --only density --no-plots",
        3,
        "its density is of particles, that of the truth of mass",
    );
}
