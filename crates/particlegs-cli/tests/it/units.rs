//! Inputs in different units are converted, or refused by name.

use crate::common::{TestFolder, snapshot, success};
use serde_json::Value;

/// A clump of 2000 particles in a box of 16 kpc, in units of `size` kpc named `unit`.
fn particles(dir: &TestFolder, name: &str, size: f32, unit: &str, comoving: bool) {
    let along = |step: usize| (0..2000).map(|i| (4.0 + (i * step % 997) as f32 / 128.0) / size).collect::<Vec<f32>>();
    snapshot(&dir.at(name), &[along(7), along(31), along(173)]);
    let text = format!(
        r#"{{"box": {}, "length_unit": "{unit}", "comoving": {comoving}, "scale_factor": 0.5, "h": 0.5,
            "mass_unit": "Msun", "particle_mass": 2}}"#,
        16.0 / size
    );
    dir.write(&format!("{name}/meta.json"), text);
}

/// A folder with the same particles in three units, and models of them.
fn folder() -> TestFolder {
    let dir = TestFolder::new();
    particles(&dir, "kpc", 1.0, "kpc", true);
    particles(&dir, "large", 1024.0, "1024 kpc", true);
    particles(&dir, "physical", 4.0, "kpc/h", false);
    particles(&dir, "lj", 1.0, "sigma", false);
    for name in ["kpc", "large", "lj"] {
        dir.once(&format!("compress {name} -o {name}.pgs --gaussians 30 --effort fast --certificate=none"));
    }
    dir
}

/// Its report and standard error.
fn runs(dir: &TestFolder, words: &str) -> (Value, String) {
    let [report, said] = success(dir.command(words).args(["--json", "-"]));
    (serde_json::from_str(&report).unwrap(), said)
}

#[test]
fn a_model_is_scored_by_particles_of_another_unit() {
    let s = folder();
    let scores_of = |with: &str| runs(&s, &format!("eval kpc.pgs {with} --frames 1 --size 160x90"));
    let scores_in_kpc = scores_of("kpc").0;
    for (other, says) in [("large", "from 1024 kpc to kpc"), ("physical", "from kpc/h to kpc")] {
        let (scores, said) = scores_of(other);
        assert_eq!(scores["mean"], scores_in_kpc["mean"], "{other}");
        assert!(said.contains(says), "{said}");
    }
    s.fails("eval kpc.pgs lj", 3, "lj: physical sigma cannot be converted to comoving kpc");
}

#[test]
fn statistics_are_in_the_units_of_the_truth() {
    let s = folder();
    let measured = |other: &str| {
        let words = "--only density,moments,groups --grid 16 --no-plots";
        let out = s.says(&format!("stats kpc {other} -o out {words}"));
        std::fs::remove_dir_all(s.at("out")).unwrap();
        out
    };
    let stats_in_kpc = measured("kpc");
    for other in ["large", "physical", "large.pgs"] {
        let b = measured(other);
        assert_eq!(stats_in_kpc["density"]["side"], b["density"]["side"]);
        if !other.ends_with(".pgs") {
            assert_eq!((&stats_in_kpc["density"], &stats_in_kpc["groups"]), (&b["density"], &b["groups"]), "{other}");
        }
        assert!(b["notes"].to_string().contains("lengths are converted from"), "{}", b["notes"]);
    }
    s.fails("stats kpc lj -o out", 3, "sigma cannot be converted to");
}

#[test]
fn panels_and_pictures_drawn_alike_are_in_one_unit() {
    let s = folder();
    let brightest = |models: &str| {
        let words = format!("render {models} --style density --size 60x40 --panels -o out.png");
        s.says(&words)["range"][1].as_f64().unwrap()
    };
    // Fits in other units differ in the last digits.
    assert!((brightest("kpc.pgs large.pgs") / brightest("kpc.pgs kpc.pgs") - 1.0).abs() < 0.1);
    let refused = "lj.pgs: physical sigma cannot be converted to";
    s.fails("render kpc.pgs lj.pgs --panels -o no.png", 3, refused);
    for (style, plain) in [("density", "--no-annotations"), ("expected", "")] {
        let drawn_view = |words: &str| s.says(&format!("render {words} {plain}"))["views"][0].clone();
        drawn_view(&format!("kpc.pgs -o a.png --style {style} --size 60x40 --azimuth 33"));
        let again = drawn_view("kpc.pgs -o b.png --like a.png");
        let other = drawn_view("large.pgs -o c.png --like a.png");
        let number = |view: &Value, key: &str| view[key].as_f64().unwrap();
        assert_eq!(number(&again, "radius"), 1024.0 * number(&other, "radius"));
        let [b, c] = ["b.png", "c.png"].map(|name| {
            let mut reader = png::Decoder::new(std::io::Cursor::new(s.bytes(name))).read_info().unwrap();
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            pixels
        });
        let apart: f64 = b.iter().zip(&c).map(|(b, c)| f64::from(b.abs_diff(*c))).sum();
        assert!(b.len() == c.len() && apart / (b.len() as f64) < 16.0, "{style:?}: {apart}");
    }
    s.fails("render lj.pgs --like a.png -o no.png", 3, "kpc cannot be converted to physical sigma");
}

/// A table of particles with a charge, a temperature and a metallicity each.
fn table(dir: &TestFolder) {
    let row = |i: usize| {
        let [x, y, z] = [7, 31, 173].map(|step| (i * step % 997) as f32 / 100.0);
        format!("{x},{y},{z},{},{},{},{}\n", 1 + i % 3, 1e4 + i as f32, 0.02, 300)
    };
    let rows: String = (0..500).map(row).collect();
    dir.write("t.csv", format!("x [nm],y [nm],z [nm],Charge [e],Temperature,GFM_Metallicity,c_7 [K]\n{rows}"));
}

#[test]
fn weights_that_are_not_masses_have_their_own_name_and_unit() {
    let s = TestFolder::new();
    table(&s);
    for (field, plural) in [("Temperature", "temperatures"), ("GFM_Metallicity", "fractions"), ("c_7", "temperatures")]
    {
        let text = format!("`{field}` cannot be weights: a sum of {plural} is meaningless");
        s.fails(&format!("compress t.csv --mass-field {field} -o no.pgs"), 3, &text);
    }
    let options = "--style density --projection orthographic --size 40x40 --raw";
    s.says(&format!("reference t.csv --mass-field Charge {options} -o raw"));
    s.says("compress t.csv --mass-field Charge -o m.pgs --gaussians 20 --certificate=none");
    s.says(&format!("render m.pgs {options} -o drawn"));
    for folder in ["raw", "drawn"] {
        let mut files = std::fs::read_dir(s.at(folder)).unwrap().map(|f| f.unwrap().path());
        let json = files.find(|f| f.extension().is_some_and(|e| e == "json")).unwrap();
        let meta: Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
        assert_eq!((&meta["quantity"], &meta["unit"]), (&"surface density of Charge".into(), &"e / nm²".into()));
    }
    s.says("render m.pgs --style density --size 60x40 -o f.svg");
    assert!(s.text("f.svg").contains(">Σ of Charge (e nm⁻²)<"), "the title of the colour bar");
    let [info, _] = s.runs("info m.pgs");
    assert!(info.contains("999 of `Charge` in total"), "{info}");
    s.says("export m.pgs -o m.csv");
    assert!(s.text("m.csv").contains("Charge [e]"));
    let fits = s.says("export m.pgs -o m.fits --grid 8");
    assert_eq!(fits["grid"]["unit"], "e / nm^3");
}

#[test]
fn fits_has_units_of_the_standard() {
    let s = folder();
    particles(&s, "by_h", 1.0, "kpc/h", true);
    s.says("compress by_h -o by_h.pgs --gaussians 30 --certificate=none");
    let head = |model: &str| {
        let file = s.makes(&format!("export {model} -o d.fits --grid 8 --force"));
        String::from_utf8_lossy(&file[..5760]).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let by_h = head("by_h.pgs");
    for card in ["BUNIT = 'solMass kpc-3'", "CUNIT1 = 'kpc '", "CDELT1 = 1.9453125", "LENUNIT = 'kpc '"] {
        assert!(by_h.contains(card), "{card}: {by_h}");
    }
    let lj = head("lj.pgs");
    let units = ["DENUNIT = 'Msun / sigma^3'", "CDELT1 = 0.97265625"];
    assert!(units.iter().all(|card| lj.contains(card)) && !lj.contains("BUNIT"), "{lj}");
}
