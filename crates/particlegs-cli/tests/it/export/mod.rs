//! Models for other viewers: exported files are read back by this program's readers, if any, and compared with the
//! model. Other readers are in tests/export.

mod grids;
mod splats;

use crate::common::{TestFolder, tiny};
use particlegs_core::model::{LawKind, Mixture};
use particlegs_particles::Particles;
use serde_json::Value;

const KINDS: [&str; 10] = ["ply", "glb", "gltf", "npy", "vti", "fits", "dx", "mrc", "npz", "csv"];

/// A folder with a model `m.pgs` of 64 Gaussians of the sample.
fn folder(law: LawKind) -> TestFolder {
    let dir = TestFolder::new();
    dir.write("m.pgs", tiny(0..64, law));
    dir
}

/// A folder with a model `layers.pgs` of two layers with masses.
fn layers() -> TestFolder {
    let dir = TestFolder::new();
    dir.once("compress FIXTURES/species.hdf5 -o layers.pgs --gaussians 20 --certificate none -q");
    dir
}

/// The result as JSON.
fn exported(dir: &TestFolder, words: &str) -> Value {
    dir.says(&format!("export {words} -q"))
}

#[test]
fn every_export_says_what_it_is_and_what_is_lost() {
    let dir = folder(LawKind::OpticalDepth);
    for kind in KINDS {
        let grid = if ["npy", "vti", "fits", "dx", "mrc"].contains(&kind) { "--grid 16" } else { "" };
        let report = exported(&dir, &format!("m.pgs -o out.{kind} {grid}"));
        assert_eq!((report["kind"].as_str(), report["gaussians"].as_u64()), (Some(kind), Some(64)));
        let written = dir.bytes(&format!("out.{kind}"));
        assert_eq!(report["bytes"].as_u64(), Some(written.len() as u64), "{kind}");
        let lost = report["lost"][0].as_str().unwrap();
        // An array cannot hold text, so there is a JSON file.
        let bytes = if kind == "npy" { dir.bytes("out.json") } else { written.clone() };
        let words = match kind {
            // Escaped characters, and characters of four bytes.
            "vti" => {
                let text = String::from_utf8_lossy(&bytes).into_owned();
                let notes = text.split("Name=\"notes\"").nth(1).unwrap();
                let codes = notes.split('>').nth(1).unwrap().split('<').next().unwrap();
                codes.split(' ').map(|c| c.parse::<u8>().unwrap() as char).collect()
            }
            "npz" => bytes.iter().filter(|b| **b != 0).map(|b| *b as char).collect(),
            "fits" => {
                let head = String::from_utf8_lossy(&bytes[..2880 * 2]).into_owned();
                let cards: Vec<&str> = (0..head.len() / 80).map(|i| head[80 * i..80 * i + 80].trim_end()).collect();
                cards.join("").replace("COMMENT  ", "").replace("COMMENT ", "")
            }
            _ => String::from_utf8_lossy(&bytes).into_owned(),
        };
        let squeezed = |text: &str| text.split_whitespace().collect::<String>();
        assert!(squeezed(&words).contains(&squeezed(lost)), "{kind}: {lost}");
        assert!(words.contains("nbody64") && words.contains("optical-depth"), "{kind}");
        // To standard output, the same bytes.
        let printed = dir.command(&format!("export m.pgs -o - --kind {kind} -q {grid}")).assert().success();
        assert!(printed.get_output().stdout == written, "{kind}");
        // For any threads and instructions.
        let again = format!("export m.pgs -o again.{kind} --threads 1 -q {grid}");
        dir.command(&again).env("PARTICLEGS_SIMD", "off").assert().success();
        assert!(dir.bytes(&format!("again.{kind}")) == written, "{kind}");
    }
    let [help, _] = dir.runs("export --help");
    for kind in KINDS {
        assert!(help.split("What is lost").nth(1).unwrap().contains(&format!(".{kind}")), "{kind}: {help}");
    }
}

#[test]
fn impossible_requests_are_refused_before_the_work() {
    let dir = folder(LawKind::OpticalDepth);
    let refused = |words: &str, code: i32, text: &str| {
        dir.fails(&format!("export m.pgs -o {words}"), code, text);
        assert_eq!(dir.listing(), ["m.pgs"], "{words}");
    };
    refused("splats", 2, "not clear from the ending");
    refused("points.hdf5", 2, "not clear from the ending");
    refused("a.ply --kind csv", 2, "the ending means ply");
    refused("a.npy --grid 0", 2, "outside 1 to 65536");
    refused("a.npy --grid 70000", 2, "outside 1 to 65536");
    refused("a.npy --grid 65536", 7, "a density grid needs about");
    refused("a.vti --cell 1e-9", 2, "more than 65536");
    for size in ["0", "-1", "nan", "inf"] {
        refused(&format!("a.fits --cell={size}"), 2, "is not positive");
    }
    for (option, values) in [("radius", ["0", "-1", "nan", "inf"]), ("opacity", ["0", "-1", "nan", "1.5"])] {
        for value in values {
            refused(&format!("a.ply --{option}={value}"), 2, &format!("{option} "));
        }
    }
    // Options without effect.
    refused("a.npz --radius 1", 2, "--radius has no effect here; it applies to pages and splats");
    refused("a.vti --color layer", 2, "--color has no effect here");
    refused("a.ply --grid 8", 2, "--grid has no effect here; it applies to density");
    refused("a.csv --cell 1", 2, "--cell has no effect here");
    refused("a.ply --colormap viridis", 2, "--colormap has no effect here");
    // Extreme values within the range.
    for more in ["--radius 1e-300", "--radius 1e100", "--opacity 1e-300"] {
        let out = dir.command(&format!("export m.pgs -o x.ply -q --force {more}")).output().unwrap();
        assert!(matches!(out.status.code(), Some(0 | 2)), "{more:?}: {out:?}");
    }
}

#[test]
fn a_page_holds_the_circles_of_a_list_and_bad_lists_are_refused() {
    let dir = folder(LawKind::OpticalDepth);
    dir.write("list.csv", "x,y,z,radius\n1,2,3,0.5\n4,5,6,\n0.5,8,9,1.5\n");
    dir.runs("export m.pgs -o page.html --overlay list.csv");
    // The last lies over a face of the periodic box, and is at both sides.
    let circles = "\"opening\":{\"circles\":[[[1.0,2.0,3.0],0.5],[[0.5,8.0,9.0],1.5],[[25.5,8.0,9.0],1.5]]}";
    assert!(dir.text("page.html").contains(circles));
    dir.write("bad.csv", "mass,radius,n,m\n1,2,3,4\n");
    dir.write("points.csv", "x,y,z\n1,2,3\n");
    dir.write("many.csv", format!("x,y,z,radius\n{}", "1,2,3,1\n".repeat(100_001)));
    for (list, text) in [
        ("bad.csv", "no columns are named x, y and z"),
        ("points.csv", "no centre has a radius"),
        ("many.csv", "100001 circles are more than the 100000 that a page can hold"),
    ] {
        dir.fails(&format!("export m.pgs -o bad.html --overlay {list}"), 3, text);
        dir.fails(&format!("view m.pgs --no-open --port 0 --overlay {list}"), 3, text);
        assert!(!dir.at("bad.html").exists());
    }
    dir.fails("export m.pgs -o m.ply --overlay list.csv", 2, "--overlay has no effect here");
}

/// The page contains the unchanged file; options of splats and grids are refused.
#[test]
fn a_page_holds_the_file() {
    let dir = folder(LawKind::OpticalDepth);
    dir.runs("export m.pgs -o page.html");
    let html = dir.text("page.html");
    assert!(html.starts_with("<!doctype html>") && html.contains("id=\"model-0\"") && html.contains("m.pgs"));
    for (options, text) in [
        ("--grid 8", "--grid"),
        ("--color density", "--color"),
        ("--radius 1", "--radius"),
        ("--color-by-layer", "--color-by-layer"),
        ("--style paraview --range 1,2", "--range"),
        ("--azimuth nan", "--azimuth"),
        ("--distance 0", "--distance"),
        ("--look-at 1,2", "--look-at"),
        ("--layer gas", "no layer `gas`"),
    ] {
        dir.fails(&format!("export m.pgs -o other.html {options}"), 2, text);
    }
    dir.fails("export m.pgs -o m.ply --azimuth 3", 2, "applies to pages");
    // It opens with the given options.
    let options = "--style paraview --radius 0.5 --background white --layer particles --azimuth 30";
    dir.runs(&format!("export m.pgs -o told.html {options} --projection orthographic"));
    let html = dir.text("told.html");
    let opening = "\"opening\":{\"style\":\"paraview\",\"white\":true,\"layers\":[\"particles\"],\"radius\":0.5,\
                   \"azimuth\":30.0,\"orthographic\":true}";
    assert!(html.contains(opening), "{}", &html[html.find("\"opening\"").unwrap()..][..200]);
}

/// NPZ and CSV.
#[test]
fn tables_hold_the_gaussians_to_the_last_digit() {
    let dir = layers();
    let model = dir.model("layers.pgs");
    let text = String::from_utf8(dir.makes("export layers.pgs -o t.csv -q")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().filter(|l| !l.starts_with('#')).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows[0][..3], ["x", "y", "z"]);
    let terms = ["xx", "xy", "xz", "yy", "yz", "zz"].map(|k| format!("covariance_{k}"));
    assert_eq!(rows[0][3..9], terms);
    assert_eq!(rows[0][9..], ["count", "mass", "layer"]);
    let all: Vec<(&str, &Mixture, usize, f64)> = model
        .layers
        .iter()
        .flat_map(|l| l.content.iter().map(move |b| (l, &b.gaussians)))
        .flat_map(|(l, g)| (0..g.len()).map(move |i| (&l.name[..], g, i, l.mass.unit_or_one())))
        .collect();
    assert_eq!(rows.len() - 1, all.len());
    for (row, (layer, g, i, unit)) in rows[1..].iter().zip(&all) {
        let numbers: Vec<f64> = row[..11].iter().map(|v| v.parse().unwrap()).collect();
        let want = [&g.mean_of(*i)[..], &g.cov_of(*i).0, &[g.count[*i], unit * g.mass_of(*i)]].concat();
        assert_eq!((numbers, row[11]), (want, *layer));
    }
    // This program reads both tables as points.
    dir.runs("export layers.pgs -o t.npz -q");
    for file in ["t.csv", "t.npz --positions mean"] {
        dir.runs(&format!("convert {file} -o points -q --force --mass-field none"));
        let points = Particles::open_raw(&[dir.at("points")]).unwrap();
        assert_eq!(points.len(), all.len());
        for (i, (_, g, number, _)) in all.iter().enumerate() {
            assert!((0..3).all(|k| (points.position(i)[k] - g.mean[k][*number]).abs() < 1e-5));
        }
    }
}
