//! `--save-views` and the JSON report draw the same pictures again.

use crate::common::{TestFolder, said, spiral};

#[test]
fn saved_views_and_reports_draw_the_same_pictures() {
    let dir = spiral();
    let view = "--azimuth 33.3 --elevation -12.1 --distance 0.7 --radius 0.0123 --opacity 0.21 --size 96x54";
    for (verb, subject) in [("render", "spiral.pgs"), ("reference", "spiral")] {
        let draw = |name: &str, more: &str| {
            dir.runs(&format!("{verb} {subject} --quiet -o {verb}-{name} {more}"));
            dir.bytes(&format!("{verb}-{name}/view.png"))
        };
        let first = draw("first", &format!("{view} --save-views views.json --json report.json"));
        for file in ["views", "report"] {
            assert!(draw(file, &format!("--views {file}.json")) == first, "{verb} {file}");
        }
        let (saved, reported) = (dir.json("views.json"), dir.json("report.json"));
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
fn a_report_of_surface_density_contains_its_window() {
    let window = "--projection orthographic --width 1.5 --size 60x40";
    let report = spiral().says(&format!("render spiral.pgs --style density {window} --quiet -o slab"));
    let view = &report["views"][0];
    assert_eq!(view["height_world"], 1.0);
    assert!(view["clipping_range"][1].as_f64().unwrap() > 0.0 && view["fov_deg"].is_null());
}

/// A window, and a slab in perspective, are drawn again from saved views, byte for byte, in every style.
#[test]
fn saved_windows_draw_the_same_pictures() {
    let dir = spiral();
    let draw = |style: &str, out: &str, more: &str| {
        dir.makes(&format!("render spiral.pgs --style {style} --quiet -o {out} {more}"))
    };
    let window = "--width 1.2 --center 0.1,0.5,0 --azimuth 20 --size 60x40";
    for style in ["paraview", "expected", "density"] {
        for projection in ["orthographic", "perspective"] {
            let window = format!("{window} --projection {projection}");
            let keep = "--depth 0.4 --save-views saved.json --json report.json";
            let first = draw(style, "a.png", &format!("{window} {keep}"));
            for file in ["saved.json", "report.json"] {
                assert!(draw(style, "b.png", &format!("--views {file}")) == first, "{style} {projection} {file}");
            }
            // The slab leaves particles out.
            assert!(draw(style, "c.png", &window) != first);
        }
    }
    dir.fails("render spiral.pgs --fit box -o d.png", 2, "no simulation box is known");
}

/// For a periodic snapshot, whose pictures of particles are not repeated.
#[test]
fn the_default_window_is_reported() {
    let dir = TestFolder::new();
    let out = dir.command("reference SAMPLE --projection orthographic --size 40x40 -o a.png").output().unwrap();
    let stderr = said(&out);
    assert!(
        stderr.contains("no width is given: the window spans the particles' bounds") && !stderr.contains("box"),
        "{stderr}"
    );
}
