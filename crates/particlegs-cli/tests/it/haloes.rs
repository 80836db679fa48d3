//! `haloes`: catalogues of particles and of models.

use crate::common::TestFolder;
use std::collections::BTreeMap;

const STATED: &str = "--particle-mass 5.128166339993477e9 --mass-unit Msun/h";

/// Columns by name; NaN where a row has nothing.
fn table(text: &str) -> BTreeMap<String, Vec<f64>> {
    let mut rows = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = rows.next().unwrap().split(',').collect();
    let mut columns: BTreeMap<String, Vec<f64>> = names.iter().map(|n| (n.to_string(), Vec::new())).collect();
    for row in rows {
        for (name, value) in names.iter().zip(row.split(',')) {
            columns.get_mut(*name).unwrap().push(value.parse().unwrap_or(f64::NAN));
        }
    }
    columns
}

#[test]
fn haloes_of_a_model_are_those_of_its_particles() {
    let dir = TestFolder::new();
    dir.runs("compress SAMPLE -o m.pgs --ratio 300 --effort fast --certificate none");
    let [said, _] = dir.runs(&format!(
        "haloes m.pgs -o m.csv --truth SAMPLE {STATED} --mass-function masses.csv,masses.png --json m.json"
    ));
    assert!(said.contains("completeness") && said.contains("median"), "{said}");
    let report = dir.json("m.json");
    let agreement = &report["agreement"];
    assert!(agreement["completeness"].as_f64().unwrap() > 0.85, "{agreement}");
    assert!(agreement["purity"].as_f64().unwrap() > 0.85, "{agreement}");
    assert!((agreement["mass_median"].as_f64().unwrap() - 1.0).abs() < 0.05, "{agreement}");
    assert!((0.5..3.0).contains(&agreement["mass_pull_sd"].as_f64().unwrap()), "{agreement}");
    assert!(said.contains("difference over its error"), "{said}");
    let of_model = table(&dir.text("m.csv"));
    let (mass, error) = (&of_model["m200m"], &of_model["m200m_err"]);
    assert!(mass.iter().zip(error).all(|(m, e)| m.is_nan() == e.is_nan() && !(*e < 0.0 || e > m)));
    assert!(of_model["position_err"].iter().zip(&of_model["r200m"]).all(|(e, r)| *e > 0.0 && (r.is_nan() || e < r)));
    for (value, error) in [("num_p", "num_p_err"), ("mfof", "mfof_err"), ("n200m", "n200m_err")] {
        let (value, error) = (&of_model[value][..20], &of_model[error][..20]);
        assert!(value.iter().zip(error).all(|(v, e)| v.is_nan() == e.is_nan() && !(*e <= 0.0 || e > v)), "{error:?}");
    }
    let masses = table(&dir.text("masses.csv"));
    let truth: f64 = masses["haloes_truth"].iter().sum();
    assert!(truth > 50.0 && masses["density"].iter().all(|d| d.is_finite()), "{truth}");
    assert!(std::fs::read(dir.at("masses.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn catalogues_hold_masses_where_spheres_have_enough_particles_and_open_as_centres() {
    let dir = TestFolder::new();
    dir.runs(&format!("haloes SAMPLE -o h.csv {STATED}"));
    let haloes = table(&dir.text("h.csv"));
    let (number, linked) = (&haloes["n200m"], &haloes["num_p"]);
    assert!(number.windows(2).all(|n| n[0] >= n[1]) && linked.iter().all(|n| *n >= 20.0));
    for (name, least) in [("m200m", 100.0), ("vmax", 300.0), ("c_to_a", 300.0), ("c200c", 1000.0)] {
        let column = &haloes[name];
        assert!(column.iter().zip(number).all(|(v, n)| *n >= least || v.is_nan()), "{name}");
        assert!(column.iter().filter(|v| v.is_finite()).count() > 5, "{name}");
    }
    assert!(!haloes.contains_key("vx") && !haloes.contains_key("contamination") && !haloes.contains_key("m200m_err"));
    for i in 0..number.len() {
        let value_of = |name: &str| haloes[name][i];
        if value_of("m200m").is_nan() {
            continue;
        }
        // Masses are those of the particles inside; 200m is wider than 200c, and that than 500c.
        assert!((value_of("m200m") / (5.128166339993477e9 * value_of("n200m")) - 1.0).abs() < 1e-6);
        assert!((value_of("m200m_msun") / value_of("m200m") * 0.68 - 1.0).abs() < 1e-6);
        assert!((value_of("r200m_kpc") / value_of("r200m") * 0.68 / 1000.0 - 1.0).abs() < 1e-6);
        assert!(!(value_of("r200c") > value_of("r200m") || value_of("r500c") > value_of("r200c")));
        let parent = value_of("parent_id");
        assert!(value_of("satellite") == 0.0 || linked[parent as usize - 1] >= value_of("num_p"));
    }
    // The sample has 262144 particles, each in one halo at most.
    let counted = (0..number.len()).filter(|i| haloes["satellite"][*i] == 0.0 && number[*i].is_finite());
    assert!((90_000.0..262_144.0).contains(&counted.map(|i| number[i]).sum::<f64>()));
    // Its centres are read again, with their radii.
    let head: String =
        dir.text("h.csv").lines().filter(|l| !l.is_empty()).take(120).map(|l| format!("{l}\n")).collect();
    std::fs::write(dir.at("few.csv"), head).unwrap();
    let [said, _] = dir.runs("stats SAMPLE SAMPLE -o stats --only haloes --centres few.csv --no-plots");
    assert!(said.contains("haloes"), "{said}");
    // The same numbers as HDF5, whatever the threads.
    dir.runs(&format!("haloes SAMPLE -o h.hdf5 {STATED} --threads 1"));
    let bytes = std::fs::read(dir.at("h.hdf5")).unwrap();
    let column: Vec<u8> = number.iter().flat_map(|n| (*n as i64).to_le_bytes()).collect();
    assert!(bytes.windows(column.len()).any(|w| w == column));
}

#[test]
fn what_is_missing_or_wrong_is_said_in_a_line() {
    let dir = TestFolder::new();
    let [_, said] = dir.runs("haloes SAMPLE -o h.csv");
    assert!(said.contains("the file does not state masses") && said.contains("--particle-mass"), "{said}");
    assert!(!dir.text("h.csv").lines().next().unwrap().contains("m200"), "{said}");
    for (options, code, message) in [
        ("--cosmology h=0.7,Om", 2, "NAME=VALUE"),
        ("--cosmology w=1", 2, "there are h"),
        ("--linking 9", 2, "the linking length"),
        ("--link stars", 2, "no particle type `stars`"),
        ("--sample-fraction 0", 2, "the share of particles"),
        ("--redshift -2", 2, "the redshift must be"),
        ("--min-particles 100000", 2, "no haloes"),
    ] {
        dir.fails(&format!("haloes SAMPLE -o other.csv {options}"), code, message);
        assert!(!dir.at("other.csv").exists());
    }
    dir.write("haloes.hdf5", b"\x89HDF\r\n\x1a\n another file");
    dir.fails("haloes SAMPLE -o haloes.hdf5", 8, "haloes.hdf5");
}

/// Texts of a file are texts: no line, cell or control character of their own in a table.
#[test]
fn texts_of_a_model_are_on_one_line_in_tables() {
    let dir = TestFolder::new();
    // Ten clouds, each denser than the box by far.
    let place = |i: usize, k: usize| (i % 10) as f32 + ((i * (7 + k)) % 101) as f32 / 500.0;
    let columns: Vec<Vec<f32>> = (0..3).map(|k| (0..4000).map(|i| place(i, k)).collect()).collect();
    crate::common::snapshot(&dir.at("in"), &columns);
    let unit = "Mpc\\n=cmd|' /C calc'!A0\\u001b[2J\\u202e\\u0000";
    dir.write(
        "in/meta.json",
        format!(r#"{{"box": 11, "length_unit": "{unit}", "mass_unit": "{unit}", "particle_mass": 2}}"#),
    );
    dir.runs("compress in -o m.pgs --gaussians 40 --effort fast --certificate none --quiet");
    for (words, name) in [("haloes in --mass-function f.csv -o", "h.csv"), ("export m.pgs -o", "g.csv")] {
        dir.runs(&format!("{words} {name} --quiet"));
        let text = dir.text(name);
        assert!(!text.contains(|c: char| c != '\n' && c.is_control() || c == '\u{202e}'), "{words}: {text}");
        assert!(text.lines().all(|l| !l.starts_with(['=', '+', '@'])) && text.contains("=cmd"), "{words}: {text}");
    }
    assert!(!dir.text("f.csv").contains('\u{1b}'));
}
