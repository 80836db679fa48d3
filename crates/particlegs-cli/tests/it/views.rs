//! Cameras go out and come back: `--save-views`, and the JSON report, draw the same pictures again.

use crate::common::{fails, particlegs, sample, snapshot};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A few particles on a spiral, and a model of them.
fn subjects(dir: &Path) -> [PathBuf; 2] {
    let along = |f: fn(f32) -> f32| (0..3000).map(|i| f(i as f32 / 3000.0)).collect::<Vec<f32>>();
    let columns = [along(|t| (19.0 * t).cos() * t), along(|t| t), along(|t| (19.0 * t).sin() * t)];
    let (particles, model) = (dir.join("spiral"), dir.join("spiral.pgs"));
    snapshot(&particles, &columns);
    let mut c = particlegs();
    c.arg("compress").arg(&particles).arg("-o").arg(&model);
    c.args(["--gaussians", "40", "--effort", "fast", "--certificate=none", "--quiet"]).assert().success();
    [model, particles]
}

const VIEW: [&str; 12] = [
    "--azimuth",
    "33.3",
    "--elevation",
    "-12.1",
    "--distance",
    "0.7",
    "--radius",
    "0.0123",
    "--opacity",
    "0.21",
    "--size",
    "96x54",
];

#[test]
fn saved_views_and_reports_draw_the_same_pictures() {
    let dir = tempfile::tempdir().unwrap();
    for (verb, subject) in ["render", "reference"].iter().zip(subjects(dir.path())) {
        let at = |name: &str| dir.path().join(format!("{verb}-{name}"));
        let draw = |out: &Path| {
            let mut c = particlegs();
            c.arg(verb).arg(&subject).arg("--quiet").arg("-o").arg(out);
            c
        };
        let (views, report) = (at("views.json"), at("report.json"));
        draw(&at("first")).args(VIEW).arg("--save-views").arg(&views).arg("--json").arg(&report).assert().success();
        let picture = |name: &str| std::fs::read(at(name).join("view.png")).unwrap();
        for (name, file) in [("saved", &views), ("reported", &report)] {
            draw(&at(name)).arg("--views").arg(file).assert().success();
            assert!(picture(name) == picture("first"), "{verb} {name}");
        }
        let value = |path: &Path| serde_json::from_slice::<Value>(&std::fs::read(path).unwrap()).unwrap();
        let (saved, reported) = (value(&views), value(&report));
        for key in ["width", "height", "fov_deg"] {
            assert_eq!(saved[key], reported[key], "{key}");
        }
        for key in ["name", "position", "focal_point", "view_up", "radius", "opacity"] {
            assert_eq!(saved["views"][0][key], reported["views"][0][key], "{key}");
            assert!(!saved["views"][0][key].is_null(), "{key}");
        }
    }
}

#[test]
fn a_report_of_surface_density_says_its_window() {
    let dir = tempfile::tempdir().unwrap();
    let [model, _] = subjects(dir.path());
    let mut c = particlegs();
    c.arg("render").arg(&model).args(["--style", "density", "--projection", "orthographic", "--width", "1.5"]);
    c.args(["--size", "60x40", "--quiet", "--json", "-", "-o"]).arg(dir.path().join("slab"));
    let report: Value = serde_json::from_slice(&c.output().unwrap().stdout).unwrap();
    let view = &report["views"][0];
    assert_eq!(view["height_world"], 1.0);
    assert!(view["clipping_range"][1].as_f64().unwrap() > 0.0 && view["fov_deg"].is_null());
}

/// A window, and a slab in perspective, are drawn again from what was saved, to the byte, in every look.
#[test]
fn saved_windows_draw_the_same_pictures() {
    let dir = tempfile::tempdir().unwrap();
    let [model, _] = subjects(dir.path());
    let at = |name: &str| dir.path().join(name);
    let draw = |style: &str, out: &str, more: &[&str]| {
        let mut c = particlegs();
        c.arg("render").arg(&model).args(["--style", style, "--quiet", "-o"]).arg(at(out)).args(more);
        c.assert().success();
        std::fs::read(at(out)).unwrap()
    };
    let (saved, report) = (at("saved.json"), at("report.json"));
    let [saved, report] = [&saved, &report].map(|p| p.to_str().unwrap());
    let window = ["--width", "1.2", "--depth", "0.4", "--center", "0.1,0.5,0", "--azimuth", "20", "--size", "60x40"];
    for style in ["paraview", "expected", "density"] {
        for projection in ["orthographic", "perspective"] {
            let keep = ["--projection", projection, "--save-views", saved, "--json", report];
            let first = draw(style, "a.png", &[&window[..], &keep].concat());
            for file in [saved, report] {
                assert!(draw(style, "b.png", &["--views", file]) == first, "{style} {projection} {file}");
            }
            // The slab leaves something away.
            let whole: Vec<&str> = window.iter().copied().filter(|o| !["--depth", "0.4"].contains(o)).collect();
            assert!(draw(style, "c.png", &[&whole[..], &["--projection", projection]].concat()) != first);
        }
    }
    let mut c = particlegs();
    c.arg("render").arg(&model).args(["--fit", "box", "-o"]).arg(at("d.png"));
    fails(&mut c, 2, "no simulation box is known");
}

/// Of a periodic snapshot, whose pictures of particles are not repeated.
#[test]
fn a_window_that_was_not_stated_is_told_and_no_box_denied() {
    let dir = tempfile::tempdir().unwrap();
    let mut c = particlegs();
    c.arg("reference").arg(sample()).args(["--projection", "orthographic", "--size", "40x40", "-o"]);
    let said = c.arg(dir.path().join("a.png")).output().unwrap().stderr;
    let said = String::from_utf8_lossy(&said);
    assert!(
        said.contains("no --width given: the window spans the particles' bounds") && !said.contains("box"),
        "{said}"
    );
}
