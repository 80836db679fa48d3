//! Models for other viewers: what is written, read again by this program's own readers where it has some, and
//! held to the model. Others' readers are in tests/export.

mod grids;
mod splats;
mod tables;

use crate::common::{fails, listing, particlegs, sample};
use crate::models::tiny;
use particlegs::codec::{self, Precision};
use particlegs::model::{LawKind, Model};
use particlegs::particles::Particles;
use serde_json::Value;
use std::path::{Path, PathBuf};

const KINDS: [&str; 8] = ["ply", "glb", "gltf", "npy", "vti", "fits", "npz", "csv"];

/// A model of 64 Gaussians of the sample.
fn write(dir: &Path, law: LawKind) -> PathBuf {
    let particles = Particles::open_raw(&[sample()]).unwrap();
    let path = dir.join("m.pgs");
    std::fs::write(&path, codec::encode(&tiny(&particles, 0..64, law), &Precision::BALANCED).unwrap()).unwrap();
    path
}

/// A model of two layers with masses.
fn layers(dir: &Path) -> PathBuf {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs-formats/tests/fixtures");
    let path = dir.join("layers.pgs");
    let mut c = particlegs();
    c.arg("compress").arg(fixtures.join("species.hdf5")).arg("-o").arg(&path);
    c.args(["--gaussians", "20", "--certificate", "none", "-q"]).assert().success();
    path
}

fn decode(path: &Path) -> Model {
    codec::decode(&std::fs::read(path).unwrap(), "file").unwrap()
}

fn export(model: &Path, out: &Path, more: &[&str]) -> assert_cmd::Command {
    let mut c = particlegs();
    c.arg("export").arg(model).arg("-o").arg(out).args(more);
    c
}

/// The result as JSON.
fn exported(model: &Path, out: &Path, more: &[&str]) -> Value {
    let mut c = export(model, out, more);
    let done = c.args(["-q", "--json", "-"]).assert().success();
    serde_json::from_slice(&done.get_output().stdout).unwrap()
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

#[test]
fn every_kind_says_what_it_is_and_what_is_lost() {
    let dir = tempfile::tempdir().unwrap();
    let model = write(dir.path(), LawKind::OpticalDepth);
    for kind in KINDS {
        let out = dir.path().join(format!("out.{kind}"));
        let grid: &[&str] = if ["npy", "vti", "fits"].contains(&kind) { &["--grid", "16"] } else { &[] };
        let report = exported(&model, &out, grid);
        assert_eq!((report["kind"].as_str(), report["gaussians"].as_u64()), (Some(kind), Some(64)));
        let written = bytes(&out);
        assert_eq!(report["bytes"].as_u64(), Some(written.len() as u64), "{kind}");
        let lost = report["lost"][0].as_str().unwrap();
        // An array has no room for words: they are beside it.
        let said = if kind == "npy" { bytes(&dir.path().join("out.json")) } else { written.clone() };
        let said = match kind {
            // Codes of letters, and letters of four bytes.
            "vti" => {
                let text = String::from_utf8_lossy(&said).into_owned();
                let notes = text.split("Name=\"notes\"").nth(1).unwrap();
                let codes = notes.split('>').nth(1).unwrap().split('<').next().unwrap();
                codes.split(' ').map(|c| c.parse::<u8>().unwrap() as char).collect()
            }
            "npz" => said.iter().filter(|b| **b != 0).map(|b| *b as char).collect(),
            "fits" => {
                let head = String::from_utf8_lossy(&said[..2880 * 2]).into_owned();
                let cards: Vec<&str> = (0..head.len() / 80).map(|i| head[80 * i..80 * i + 80].trim_end()).collect();
                cards.join("").replace("COMMENT  ", "").replace("COMMENT ", "")
            }
            _ => String::from_utf8_lossy(&said).into_owned(),
        };
        let squeezed = |text: &str| text.split_whitespace().collect::<String>();
        assert!(squeezed(&said).contains(&squeezed(lost)), "{kind}: {lost}");
        assert!(said.contains("nbody64") && said.contains("optical-depth"), "{kind}");
        // To standard output, the same bytes.
        let printed = export(&model, Path::new("-"), &["--kind", kind, "-q"]).args(grid).assert().success();
        assert!(printed.get_output().stdout == written, "{kind}");
        // Whatever the threads and instructions.
        let again = dir.path().join(format!("again.{kind}"));
        export(&model, &again, &["--threads", "1", "-q"]).args(grid).env("PARTICLEGS_SIMD", "off").assert().success();
        assert!(bytes(&again) == written, "{kind}");
    }
    let help = particlegs().args(["export", "--help"]).output().unwrap();
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    for kind in KINDS {
        assert!(help.split("What is lost").nth(1).unwrap().contains(&format!(".{kind}")), "{kind}: {help}");
    }
}

#[test]
fn what_cannot_be_done_is_refused_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), LawKind::OpticalDepth);
    let out = |name: &str| dir.path().join(name);
    let refused = |name: &str, more: &[&str], code: i32, text: &str| {
        fails(&mut export(&path, &out(name), more), code, text);
        assert_eq!(listing(dir.path()), ["m.pgs"], "{name} {more:?}");
    };
    refused("splats", &[], 2, "its ending does not say");
    refused("points.hdf5", &[], 2, "its ending does not say");
    refused("a.ply", &["--kind", "csv"], 2, "its ending means ply");
    refused("a.npy", &["--grid", "0"], 2, "outside 1 to 65536");
    refused("a.npy", &["--grid", "70000"], 2, "outside 1 to 65536");
    refused("a.npy", &["--grid", "65536"], 7, "a density grid needs about");
    refused("a.vti", &["--cell", "1e-9"], 2, "more than 65536");
    for size in ["0", "-1", "nan", "inf"] {
        refused("a.fits", &[&format!("--cell={size}")], 2, "not a length above 0");
    }
    for (option, values) in [("radius", ["0", "-1", "nan", "inf"]), ("opacity", ["0", "-1", "nan", "1.5"])] {
        for value in values {
            refused("a.ply", &[&format!("--{option}={value}")], 2, &format!("--{option}"));
        }
    }
    // Options that would do nothing.
    refused("a.npz", &["--radius", "1"], 2, "--radius does nothing here: it belongs to pages and splats");
    refused("a.vti", &["--color", "layer"], 2, "--color does nothing here");
    refused("a.ply", &["--grid", "8"], 2, "--grid does nothing here: it belongs to density");
    refused("a.csv", &["--cell", "1"], 2, "--cell does nothing here");
    refused("a.ply", &["--colormap", "viridis"], 2, "--colormap does nothing here");
    // Extremes that are not out of range.
    for more in [["--radius", "1e-300"], ["--radius", "1e100"], ["--opacity", "1e-300"]] {
        let code = export(&path, &out("x.ply"), &["-q", "--force"]).args(more).output().unwrap().status.code();
        assert!(matches!(code, Some(0 | 2)), "{more:?}: {code:?}");
    }
}

/// The page holds the file as it is; it has no use for what changes splats and grids.
#[test]
fn a_page_holds_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let model = write(dir.path(), LawKind::OpticalDepth);
    let out = dir.path().join("page.html");
    export(&model, &out, &[]).assert().success();
    let html = std::fs::read_to_string(&out).unwrap();
    assert!(html.starts_with("<!doctype html>") && html.contains("id=\"model-0\"") && html.contains("m.pgs"));
    for options in [
        &["--grid", "8"][..],
        &["--color", "density"],
        &["--radius", "1"],
        &["--color-by-layer"],
        &["--style", "paraview", "--range", "1,2"],
        &["--azimuth", "nan"],
        &["--distance", "0"],
        &["--look-at", "1,2"],
    ] {
        let option = options.iter().rev().find(|o| o.starts_with("--")).unwrap();
        fails(&mut export(&model, &dir.path().join("other.html"), options), 2, option);
    }
    fails(&mut export(&model, &dir.path().join("other.html"), &["--layer", "gas"]), 2, "no layer `gas`");
    fails(&mut export(&model, &dir.path().join("m.ply"), &["--azimuth", "3"]), 2, "belongs to pages");
    // It opens as it was told.
    let told = dir.path().join("told.html");
    let options = ["--style", "paraview", "--radius", "0.5", "--background", "white", "--layer", "particles"];
    export(&model, &told, &[&options[..], &["--azimuth", "30", "--projection", "orthographic"]].concat())
        .assert()
        .success();
    let html = std::fs::read_to_string(&told).unwrap();
    let opening = "\"opening\":{\"style\":\"paraview\",\"white\":true,\"layers\":[\"particles\"],\"radius\":0.5,\
                   \"azimuth\":30.0,\"orthographic\":true}";
    assert!(html.contains(opening), "{}", &html[html.find("\"opening\"").unwrap()..][..200]);
}
