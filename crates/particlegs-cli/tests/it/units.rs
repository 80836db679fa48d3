//! Two things in different units meet: numbers are converted, or the two are refused by name.

use crate::common::{fails, particlegs, snapshot};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A clump of 2000 particles in a box of 16 kpc, in a unit of `size` kpc that is written as `unit`.
fn particles(dir: &Path, name: &str, size: f32, unit: &str, comoving: bool) -> PathBuf {
    let along = |step: usize| (0..2000).map(|i| (4.0 + (i * step % 997) as f32 / 128.0) / size).collect::<Vec<f32>>();
    let folder = dir.join(name);
    snapshot(&folder, &[along(7), along(31), along(173)]);
    let text = format!(
        r#"{{"box": {}, "length_unit": "{unit}", "comoving": {comoving}, "scale_factor": 0.5, "h": 0.5,
            "mass_unit": "Msun", "particle_mass": 2}}"#,
        16.0 / size
    );
    std::fs::write(folder.join("meta.json"), text).unwrap();
    folder
}

struct UnitFolder {
    dir: tempfile::TempDir,
}

impl UnitFolder {
    /// The same particles in three units, and models of them.
    fn new() -> UnitFolder {
        let dir = tempfile::tempdir().unwrap();
        particles(dir.path(), "kpc", 1.0, "kpc", true);
        particles(dir.path(), "large", 1024.0, "1024 kpc", true);
        particles(dir.path(), "physical", 4.0, "kpc/h", false);
        particles(dir.path(), "lj", 1.0, "sigma", false);
        let s = UnitFolder { dir };
        for name in ["kpc", "large", "lj"] {
            let out = format!("{name}.pgs");
            s.runs(&["compress", name, "-o", &out, "--gaussians", "30", "--effort", "fast", "--certificate=none"]);
        }
        s
    }

    fn command(&self, words: &[&str]) -> assert_cmd::Command {
        let mut c = particlegs();
        c.current_dir(self.dir.path()).args(words);
        c
    }

    /// What it reports, and what it says on standard error.
    fn runs(&self, words: &[&str]) -> (Value, String) {
        let out = self.command(words).args(["--json", "-"]).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success(), "{words:?}: {said}");
        (serde_json::from_slice(&out.stdout).unwrap_or_default(), said)
    }
}

#[test]
fn a_model_is_scored_by_particles_of_another_unit() {
    let s = UnitFolder::new();
    let scored = |with: &str| s.runs(&["eval", "kpc.pgs", with, "--frames", "1", "--size", "160x90"]);
    let own = scored("kpc").0;
    for (other, says) in [("large", "from 1024 kpc to kpc"), ("physical", "from kpc/h to kpc")] {
        let (found, said) = scored(other);
        assert_eq!(found["mean"], own["mean"], "{other}");
        assert!(said.contains(says), "{said}");
    }
    fails(&mut s.command(&["eval", "kpc.pgs", "lj"]), 3, "lj: physical sigma cannot be converted to comoving kpc");
}

#[test]
fn statistics_are_in_the_units_of_the_truth() {
    let s = UnitFolder::new();
    let measured = |other: &str| {
        let words = ["stats", "kpc", other, "-o", "out", "--only", "density,moments,groups", "--grid", "16"];
        let out = s.runs(&[&words[..], &["--no-plots"]].concat()).0;
        std::fs::remove_dir_all(s.dir.path().join("out")).unwrap();
        out
    };
    let own = measured("kpc");
    for other in ["large", "physical", "large.pgs"] {
        let b = measured(other);
        assert_eq!(own["density"]["side"], b["density"]["side"]);
        if !other.ends_with(".pgs") {
            assert_eq!((&own["density"], &own["groups"]), (&b["density"], &b["groups"]), "{other}");
        }
        assert!(b["notes"].to_string().contains("lengths are converted from"), "{}", b["notes"]);
    }
    fails(&mut s.command(&["stats", "kpc", "lj", "-o", "out"]), 3, "sigma cannot be converted to");
}

#[test]
fn panels_and_pictures_drawn_alike_are_in_one_unit() {
    let s = UnitFolder::new();
    let look = ["--style", "density", "--size", "60x40"];
    let brightest = |models: &[&str]| {
        let words = [&["render"], models, &look[..], &["--panels", "-o", "out.png"]].concat();
        s.runs(&words).0["range"][1].as_f64().unwrap()
    };
    // Fits in other units are not the same to the last digit.
    assert!((brightest(&["kpc.pgs", "large.pgs"]) / brightest(&["kpc.pgs", "kpc.pgs"]) - 1.0).abs() < 0.1);
    let fails = |words: &[&str], text| fails(&mut s.command(&[&["render"], words].concat()), 3, text);
    fails(&["kpc.pgs", "lj.pgs", "--panels", "-o", "no.png"], "lj.pgs: physical sigma cannot be converted to");
    for (look, plain) in [("density", &["--no-annotations"][..]), ("expected", &[])] {
        let drawn = |model: &str, out: &str, more: &[&str]| {
            s.runs(&[&["render", model, "-o", out], more, plain].concat()).0["views"][0].clone()
        };
        drawn("kpc.pgs", "a.png", &["--style", look, "--size", "60x40", "--azimuth", "33"]);
        let again = drawn("kpc.pgs", "b.png", &["--like", "a.png"]);
        let other = drawn("large.pgs", "c.png", &["--like", "a.png"]);
        let number = |view: &Value, key: &str| view[key].as_f64().unwrap();
        assert_eq!(number(&again, "radius"), 1024.0 * number(&other, "radius"));
        let [b, c] = ["b.png", "c.png"].map(|name| {
            let file = std::fs::File::open(s.dir.path().join(name)).unwrap();
            let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            pixels
        });
        let apart: f64 = b.iter().zip(&c).map(|(b, c)| f64::from(b.abs_diff(*c))).sum();
        assert!(b.len() == c.len() && apart / (b.len() as f64) < 16.0, "{look:?}: {apart}");
    }
    fails(&["lj.pgs", "--like", "a.png", "-o", "no.png"], "kpc cannot be converted to physical sigma");
}

/// A table of particles with a charge, a temperature and a metallicity each.
fn table(dir: &Path) -> PathBuf {
    let row = |i: usize| {
        let [x, y, z] = [7, 31, 173].map(|step| (i * step % 997) as f32 / 100.0);
        format!("{x},{y},{z},{},{},{},{}\n", 1 + i % 3, 1e4 + i as f32, 0.02, 300)
    };
    let rows: String = (0..500).map(row).collect();
    let path = dir.join("t.csv");
    std::fs::write(&path, format!("x [nm],y [nm],z [nm],Charge [e],Temperature,GFM_Metallicity,c_7 [K]\n{rows}"))
        .unwrap();
    path
}

#[test]
fn weights_that_are_not_masses_have_their_own_name_and_unit() {
    let dir = tempfile::tempdir().unwrap();
    let s = UnitFolder { dir };
    table(s.dir.path());
    for (field, plural) in [("Temperature", "temperatures"), ("GFM_Metallicity", "fractions"), ("c_7", "temperatures")]
    {
        let text = format!("`{field}` cannot be weights: a sum of {plural} is no map");
        fails(&mut s.command(&["compress", "t.csv", "--mass-field", field, "-o", "no.pgs"]), 3, &text);
    }
    let weighted = ["t.csv", "--weights", "Charge"];
    let look = ["--style", "density", "--projection", "orthographic", "--size", "40x40", "--raw", "-o", "raw"];
    s.runs(&[&["reference"], &weighted[..], &look].concat());
    s.runs(&[&["compress"], &weighted[..], &["-o", "m.pgs", "--gaussians", "20", "--certificate=none"]].concat());
    s.runs(&[&["render", "m.pgs"], &look[..8], &["drawn"]].concat());
    for folder in ["raw", "drawn"] {
        let mut files = std::fs::read_dir(s.dir.path().join(folder)).unwrap().map(|f| f.unwrap().path());
        let json = files.find(|f| f.extension().is_some_and(|e| e == "json")).unwrap();
        let said: Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
        assert_eq!((&said["quantity"], &said["unit"]), (&"surface density of Charge".into(), &"e / nm²".into()));
    }
    s.runs(&["render", "m.pgs", "--style", "density", "--size", "60x40", "-o", "f.svg"]);
    let svg = std::fs::read_to_string(s.dir.path().join("f.svg")).unwrap();
    assert!(svg.contains(">Σ of Charge (e nm⁻²)<"), "the title of the colour bar");
    let info = s.command(&["info", "m.pgs"]).output().unwrap();
    assert!(String::from_utf8_lossy(&info.stdout).contains("999 of `Charge` in all"), "{info:?}");
    s.runs(&["export", "m.pgs", "-o", "m.csv"]);
    assert!(std::fs::read_to_string(s.dir.path().join("m.csv")).unwrap().contains("Charge [e]"));
    let fits = s.runs(&["export", "m.pgs", "-o", "m.fits", "--grid", "8"]).0;
    assert_eq!(fits["grid"]["unit"], "e / nm^3");
}

#[test]
fn fits_has_units_of_the_standard() {
    let s = UnitFolder::new();
    particles(s.dir.path(), "by_h", 1.0, "kpc/h", true);
    s.runs(&["compress", "by_h", "-o", "by_h.pgs", "--gaussians", "30", "--certificate=none"]);
    let head = |model: &str| {
        s.runs(&["export", model, "-o", "d.fits", "--grid", "8", "--force"]);
        let file = std::fs::read(s.dir.path().join("d.fits")).unwrap();
        String::from_utf8_lossy(&file[..5760]).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let by_h = head("by_h.pgs");
    for card in ["BUNIT = 'solMass kpc-3'", "CUNIT1 = 'kpc '", "CDELT1 = 1.9453125", "LENUNIT = 'kpc '"] {
        assert!(by_h.contains(card), "{card}: {by_h}");
    }
    let lj = head("lj.pgs");
    assert!(
        lj.contains("DENUNIT = 'Msun / sigma^3'") && lj.contains("CDELT1 = 0.97265625") && !lj.contains("BUNIT"),
        "{lj}"
    );
}
