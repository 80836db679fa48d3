//! `stats` on a thinned sample.

use crate::common::{TestFolder, fails, listing};
use serde_json::{Value, json};

/// A folder with `thin`, 16 384 particles of the sample with their box.
fn thinned() -> TestFolder {
    let dir = TestFolder::new();
    dir.runs("convert SAMPLE -o thin --every 16 --quiet");
    dir
}

/// The statistics of two inputs, in the folder `out`.
fn stats(dir: &TestFolder, subjects: &str, out: &str, more: &str) -> Value {
    dir.runs(&format!("stats {subjects} -o {out} -q {more}"));
    dir.json(&format!("{out}/stats.json"))
}

const GRIDS: &str = "--grid 24 --spectrum-grid 32";

#[test]
fn a_snapshot_against_itself_is_perfect_and_threads_change_nothing() {
    let dir = thinned();
    let s = stats(&dir, "thin thin", "a", &format!("{GRIDS} --pairs 3000000"));
    let summary = &s["summary"];
    assert_eq!((summary["density_correlation"].as_f64(), summary["core_mass"].as_f64()), (Some(1.0), Some(1.0)));
    assert_eq!((summary["largest_power_deviation"].as_f64(), summary["nearest_mean"].as_f64()), (Some(0.0), Some(1.0)));
    assert_eq!(s["domain"]["periodic"], serde_json::json!([true, true, true]));
    assert_eq!(s["spectra"]["cells"], serde_json::json!([32, 32, 32]));
    let files = listing(&dir.at("a"));
    for name in ["power.svg", "power.png", "xi.png", "groups.csv", "slice_z.png", "neighbours.csv", "coherence.svg"] {
        assert!(files.iter().any(|f| f == name), "{name} of {files:?}");
    }
    let svg = dir.text("a/power.svg");
    assert!(svg.contains("k [h/Mpc]") && svg.contains("P(k) [(Mpc/h)³]"));
    let again = format!("stats thin thin -o b {GRIDS} --pairs 3000000 --quiet --threads 1");
    dir.command(&again).env("PARTICLEGS_SIMD", "off").assert().success();
    for name in files {
        assert_eq!(dir.bytes(&format!("a/{name}")), dir.bytes(&format!("b/{name}")), "{name}");
    }
}

#[test]
fn a_model_is_measured_by_its_mixture() {
    let dir = thinned();
    dir.runs("compress thin -o m.pgs --gaussians 200 --effort fast --certificate=none --quiet");
    let s = stats(&dir, "thin m.pgs", "a", &format!("{GRIDS} --pairs 3000000 --no-plots"));
    assert_eq!(s["model"], serde_json::json!([false, true]));
    assert!(s["summary"]["density_correlation"].as_f64().unwrap() > 0.5);
    assert!(s["groups"].is_null() && s["xi_by_pairs"].is_null() && s["spectra"]["shot_noise"][1] == 0.0);
    assert!(s["notes"].as_array().unwrap().iter().any(|n| n.as_str().unwrap().contains("recover")));
    assert!(listing(&dir.at("a")).iter().all(|f| !f.ends_with(".png")));
}

#[test]
fn plots_can_be_pdf_and_replace_earlier_ones() {
    let dir = thinned();
    for _ in 0..2 {
        dir.runs("stats thin thin -o pdf --only density --grid 8 --plots pdf --quiet");
    }
    let files = listing(&dir.at("pdf"));
    let plot = files.iter().find(|f| f.ends_with(".pdf")).unwrap();
    assert!(dir.bytes(&format!("pdf/{plot}")).starts_with(b"%PDF-") && files.iter().all(|f| !f.ends_with(".svg")));
}

/// The columns of a table, by name.
fn table(text: &str) -> Vec<std::collections::BTreeMap<String, String>> {
    let mut rows = text.lines().map(|l| l.split(',').map(str::to_string).collect::<Vec<_>>());
    let head = rows.next().unwrap();
    rows.map(|row| head.iter().cloned().zip(row).collect()).collect()
}

#[test]
fn distances_profiles_and_haloes_are_written() {
    let dir = thinned();
    dir.write("centres.csv", "id,x,y,z,radius\n1,12,12,12,4\n2,1,24.5,10,\n");
    let more = "--only rdf,profile,haloes --profile-axis x --profile-bins 25 --halo-bins 8 --centres centres.csv";
    let s = stats(&dir, "thin thin", "a", more);
    assert_eq!(s["summary"]["rdf_largest_difference"], 0.0);
    assert_eq!((&s["summary"]["halo_mass"], &s["summary"]["profile_relative_difference"]), (&1.0.into(), &0.0.into()));
    assert!(s["density"].is_null() && s["groups"].is_null() && s["xi_by_pairs"].is_null());
    let rdf = table(&dir.text("a/rdf.csv"));
    assert!(rdf.len() == 200 && rdf.iter().all(|r| r["g_truth"] == r["g_other"]));
    assert!(rdf[100]["g_truth"].parse::<f64>().unwrap() > 1.0);
    let profiles = table(&dir.text("a/profiles.csv"));
    assert_eq!(profiles.iter().filter(|r| r["axis"] == "x").count(), 25);
    let mass: f64 =
        profiles.iter().take(25).map(|r| r["density_truth"].parse::<f64>().unwrap() * 25f64.powi(3) / 25.0).sum();
    assert!((mass - 16_384.0).abs() < 1e-6, "{mass}");
    let haloes = table(&dir.text("a/haloes.csv"));
    assert_eq!((haloes.len(), &haloes[7]["r_high"][..], &haloes[15]["centre"][..]), (16, "4", "2"));
    assert!(haloes.iter().all(|r| r["enclosed_truth"] == r["enclosed_other"]));
    for name in ["rdf.svg", "profile_x.png", "halo_profile.png", "halo_mass.csv"] {
        assert!(dir.at("a").join(name).exists(), "{name}");
    }
    assert!(dir.text("a/rdf.svg").contains("r [Mpc/h]"));
}

#[test]
fn a_model_has_profiles_and_haloes_and_no_distances() {
    let dir = thinned();
    dir.runs("compress thin -o m.pgs --gaussians 800 --effort fast --certificate=none --quiet");
    let more = "--only rdf,profile,haloes --profile-bins 20 --linking 0.25 --no-plots";
    let s = stats(&dir, "thin m.pgs", "a", more);
    assert!(s["rdf"].is_null() && s["notes"].as_array().unwrap().iter().any(|n| n.as_str().unwrap().contains("g(r)")));
    let figure = |name: &str| s["summary"][name].as_f64().unwrap();
    assert!(figure("profile_relative_difference") < 0.1 && (figure("halo_mass") - 1.0).abs() < 0.1, "{}", s["summary"]);
    // The other way round there are no groups as centres.
    let s = stats(&dir, "m.pgs thin", "b", "--only haloes --no-plots");
    assert!(s["haloes"].is_null() && s["notes"][0].as_str().unwrap().contains("no centres"), "{}", s["notes"]);
}

#[test]
fn centres_that_cannot_be_used_are_refused() {
    let dir = thinned();
    for (text, more, code, why) in [
        ("1 2 3\n4 5\n", "", 3, "line 2"),
        ("", "", 3, "empty"),
        ("1\u{0}2", "", 3, "a list of centres"),
        ("1 2 3 13", "--only haloes", 2, "half the box"),
        ("1 2 3", "--only haloes --halo-radius 0", 2, "the radius of a halo"),
        ("1 2 3", "--only rdf", 2, "applies to the measures `haloes`"),
    ] {
        dir.write("centres.txt", text);
        dir.fails(&format!("stats thin thin -o a --centres centres.txt {more}"), code, why);
    }
}

#[test]
fn the_published_convention_and_bad_options() {
    let dir = thinned();
    let paper = format!("{GRIDS} --convention paper --only density,spectrum,neighbours --no-plots");
    let s = stats(&dir, "thin thin", "a", &paper);
    assert_eq!(s["spectra"]["options"]["deconvolved"], false);
    assert_eq!(s["density"]["cells"], serde_json::json!([24, 24, 24]));
    assert!(s["groups"].is_null() && s["moments"].is_null());
    for (more, code, why) in [
        ("--grid 1", 2, "must be 2 to 8192"),
        ("--grid 8192", 7, "bytes of memory"),
        ("--separations 3,1", 2, "ascending order"),
        ("--only groups --linking 0", 2, "linking"),
    ] {
        dir.fails(&format!("stats thin thin -o a {more}"), code, why);
    }
    dir.write("file", "x");
    dir.fails("stats thin thin -o file/x", 6, "file");
    dir.fails("stats thin none -o a", 6, "none");
}

/// An ideal gas of 4000 particles in a cell of volume 720: cubic, triclinic, the same with longer vectors, and with
/// permuted ones.
#[test]
fn an_ideal_gas_is_one_in_any_cell() {
    let dir = TestFolder::new();
    let write = |name: &str, drawn: [[f64; 3]; 3], stated: [[f64; 3]; 3]| {
        let lattice: Vec<String> = stated.iter().flatten().map(f64::to_string).collect();
        let mut text = format!("4000\nLattice=\"{}\" Properties=species:S:1:pos:R:3\n", lattice.join(" "));
        for i in 0..4000u64 {
            let f = [0, 1, 2].map(|k| particlegs_core::math::Random::new(8, k, i).uniform());
            let x = [0, 1, 2].map(|k| (0..3).map(|a| f[a] * drawn[a][k]).sum::<f64>().to_string());
            text += &format!("Ar {}\n", x.join(" "));
        }
        dir.write(&format!("{name}.xyz"), text);
    };
    let edge = 720f64.cbrt();
    let cube = [[edge, 0.0, 0.0], [0.0, edge, 0.0], [0.0, 0.0, edge]];
    let tilted = [[10.0, 0.0, 0.0], [4.0, 9.0, 0.0], [2.0, 3.0, 8.0]];
    let longer = [tilted[0], [24.0, 9.0, 0.0], [-12.0, -6.0, 8.0]];
    let permuted = [cube[2], cube[0].map(|v| -v), cube[1]];
    let measured = |name: &str, drawn, stated| {
        write(name, drawn, stated);
        let only = "--only rdf,spectrum,groups,neighbours,profile --spectrum-grid 32 --no-plots";
        stats(&dir, &format!("{name}.xyz {name}.xyz"), name, only)
    };
    let [cubic, one, other, turned] = [
        measured("cubic", cube, cube),
        measured("tilted", tilted, tilted),
        measured("longer", tilted, longer),
        measured("permuted", cube, permuted),
    ];
    let groups = |s: &Value| s["groups"]["grouped"][0].as_f64().unwrap();
    for s in [&cubic, &one, &other, &turned] {
        assert_eq!(s["domain"]["periodic"], serde_json::json!([true, true, true]));
        let (g, expected) = (&s["rdf"]["g"][0], &s["rdf"]["expected"][0]);
        for bin in (0..200).filter(|bin| expected[bin].as_f64().unwrap() > 500.0) {
            let sigma = (2.0 / expected[bin].as_f64().unwrap()).sqrt();
            assert!((g[bin].as_f64().unwrap() - 1.0).abs() < 4.0 * sigma, "{bin}: {} {sigma}", g[bin]);
        }
        for shell in s["spectra"]["shells"].as_array().unwrap() {
            let noise = s["spectra"]["shot_noise"][0].as_f64().unwrap();
            let sigma = (2.0 / shell["modes"].as_f64().unwrap()).sqrt();
            assert!(shell["power"][0].as_f64().unwrap().abs() < 4.0 * sigma * noise + 0.02 * noise, "{shell}");
        }
        let nearest = s["neighbours"]["distances"][0]["mean"].as_f64().unwrap() / s["spacing"].as_f64().unwrap();
        assert!((nearest - 0.554).abs() < 0.01, "{nearest}");
        let profile = &s["profiles"][2];
        assert!((profile["mean"][0].as_f64().unwrap() * 720.0 / 4000.0 - 1.0).abs() < 1e-9, "{}", profile["mean"]);
    }
    // The same lattice with other vectors.
    let pairs = |s: &Value, bin: usize| s["rdf"]["pairs"][0][bin].as_i64().unwrap();
    for (one, other) in [(&one, &other), (&cubic, &turned)] {
        assert_eq!(groups(one), groups(other));
        // Rounding of the volume may move a pair to the next bin.
        assert!((0..200).all(|bin| (pairs(one, bin) - pairs(other, bin)).abs() <= 4));
    }
    assert!(one["domain"]["tilt"].is_object() && turned["domain"]["tilt"].is_null());
}

/// 2000 light particles in a tenth of the box, 450 of them in two clumps, and heavy ones all over it.
#[test]
fn groups_of_a_zoom_are_those_of_its_finest_particles() {
    let dir = TestFolder::new();
    let mut text = String::from("x,y,z,mass\n");
    for (n, at, size, mass) in
        [(1550, 40.0, 10.0, 1), (300, 42.0, 0.2, 1), (150, 46.0, 0.2, 1), (1000, 0.0, 100.0, 4096)]
    {
        for i in 0..n {
            let x = [0, 1, 2].map(|k| at + size * particlegs_core::math::Random::new(at as u64, k, i).uniform());
            text += &format!("{},{},{},{mass}\n", x[0], x[1], x[2]);
        }
    }
    dir.write("zoom.csv", text);
    let options = "--only groups --no-plots --box 100 --length-unit Mpc";
    let groups = |name: &str, more: &str| {
        let s = stats(&dir, "zoom.csv zoom.csv", name, &format!("{options} {more}"));
        (s["groups"].clone(), s["notes"].to_string())
    };
    let (clumps, notes) = groups("own", "");
    assert!(
        notes.contains("link the lightest 2000 of 3000 particles") && notes.contains("0 of 2 groups contain heavier"),
        "{notes}"
    );
    assert_eq!((clumps["linked"][0].as_u64(), clumps["contaminated"][0].as_u64()), (Some(2000), Some(0)));
    let largest = clumps["largest"][0].as_u64().unwrap();
    assert!((300..310).contains(&largest) && clumps["classes"][2]["groups"][0] == 2, "{clumps}");
    // The same length in another unit, and one that joins all.
    let length = clumps["linking_length"][0].as_f64().unwrap();
    let (same, _) = groups("same", &format!("--linking-length {}kpc", 1000.0 * length));
    assert_eq!((&same["classes"], &same["largest"]), (&clumps["classes"], &clumps["largest"]));
    assert_eq!(groups("all", "--linking-length 3").0["largest"][0], 2000);
    let slab = stats(&dir, "zoom.csv zoom.csv", "slab", "--only moments --no-plots --box 100,100,0");
    assert_eq!(slab["domain"]["periodic"], serde_json::json!([true, true, false]));
    for (length, why) in
        [("3 Msun", "not a unit of length"), ("0kpc", "not a positive length"), ("Mpc", "not a positive")]
    {
        let words = format!("stats zoom.csv zoom.csv -o no {options} --linking-length");
        fails(dir.command(&words).arg(length), 2, why);
    }
}

/// Centres from a halo finder's list, with names after # in any order, in its own units.
#[test]
fn catalogues_of_haloes_are_lists_of_centres() {
    let dir = thinned();
    let words = |text: &str, out: &str| {
        dir.write("out_1.list", text);
        format!("stats thin thin -o {out} --centres out_1.list --only haloes --no-plots")
    };
    let row = |out: &str| dir.text(&format!("{out}/haloes.csv")).lines().nth(1).map(str::to_string);
    let rockstar = "#ID DescID Mvir Rvir Np X Y Z A[x]\n#a = 1.0\n#Box size: 25.0 Mpc/h\n\
        #Units: Positions in Mpc / h (comoving)\n0 -1 1e12 2000 45 10.5 8.5 1.25 0.1\n";
    let [_, said] = dir.runs(&words(rockstar, "a"));
    assert!(said.contains("Rockstar"), "{said}");
    assert!(row("a").unwrap().starts_with("1,10.5,8.5,1.25,2,"), "{:?}", row("a"));
    let ahf = "#ID(1)\thostHalo(2)\tXc(6)\tYc(7)\tZc(8)\tRhalo(12)\n7\t0\t10500\t8500\t1250\t2000\n";
    dir.runs(&words(ahf, "b"));
    assert_eq!(row("b"), row("a"));
    // Centres outside this box are refused.
    dir.fails(&words("#x y z r\n10500 8500 1250 2000\n", "c"), 3, "outside the periodic box");
    dir.fails(&words("#id m a b c\n1 2 3 4 5\n", "c"), 3, "id, m, a, b, c");
}

/// [`thinned`] with velocities in km/s: a flow that follows a wave along x, and random motions.
fn moving() -> TestFolder {
    let dir = thinned();
    let places: Vec<f32> = dir.bytes("thin/xx.f32").as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let wave = |i: usize| (std::f64::consts::TAU * f64::from(places[i]) / 25.0).sin();
    for (k, name) in ["vx", "vy", "vz"].iter().enumerate() {
        let random = |i: usize| particlegs_core::math::Random::new(4, k as u32, i as u64).normal();
        let flow = if k == 0 { 300.0 } else { 0.0 };
        let values = (0..places.len()).flat_map(|i| ((flow * wave(i) + 60.0 * random(i)) as f32).to_le_bytes());
        dir.write(&format!("thin/{name}.f32"), values.collect::<Vec<u8>>());
    }
    let mut meta = dir.json("thin/meta.json");
    meta["field_units"] = serde_json::json!({"vx": "km/s", "vy": "km/s", "vz": "km/s"});
    dir.write("thin/meta.json", meta.to_string());
    dir
}

const OF_VELOCITIES: &str = "--only multipoles,momentum,dispersion --spectrum-grid 32 --linking 0.25";

#[test]
fn velocities_of_a_model_are_those_of_particles_drawn_from_it() {
    let dir = moving();
    dir.runs("compress thin -o m.pgs --gaussians 800 --effort fast --certificate none --fields velocity --quiet");
    let s = stats(&dir, "thin m.pgs", "a", OF_VELOCITIES);
    assert!((s["multipoles"]["displacement"].as_f64().unwrap() - 0.01).abs() < 1e-9 && s["velocity_unit"] == "km/s");
    let first = &s["multipoles"]["shells"][0];
    let ratio = |pair: &Value| pair[1].as_f64().unwrap() / pair[0].as_f64().unwrap();
    assert!((ratio(&first["monopole"]) - 1.0).abs() < 0.1, "{first}");
    let first = &s["momentum"]["shells"][0];
    assert!((ratio(&first["power"]) - 1.0).abs() < 0.1 && first["r"].as_f64().unwrap() > 0.98, "{first}");
    let median = s["summary"]["halo_dispersion"].as_f64().unwrap();
    assert!((median - 1.0).abs() < 0.1, "{median}");
    let columns = |name: &str| dir.text(&format!("a/{name}")).lines().next().unwrap().split(',').count();
    assert_eq!(["multipoles.csv", "momentum.csv", "halo_dispersion.csv"].map(columns), [10, 12, 10]);
    assert!(dir.text("a/multipoles.svg").contains("P(k) [(Mpc/h)³]") && dir.at("a/momentum.png").exists());
    // The same particles in a file have the same numbers, unit and all.
    dir.runs("recover m.pgs -o drawn --seed 42");
    assert_eq!(dir.json("drawn/meta.json")["field_units"]["velocity_y"], "km/s");
    let again = stats(&dir, "thin drawn", "b", &format!("{OF_VELOCITIES} --no-plots --threads 1"));
    for name in ["multipoles", "momentum", "dispersion"] {
        assert_eq!(again[name], s[name], "{name}");
    }
    assert!(again["notes"].as_array().unwrap().is_empty(), "{}", again["notes"]);
}

#[test]
fn what_velocities_lack_is_said() {
    let dir = moving();
    let meta = dir.json("thin/meta.json");
    let check_note = |change: &dyn Fn(&mut Value), why: &str| {
        let mut altered_meta = meta.clone();
        change(&mut altered_meta);
        dir.write("thin/meta.json", altered_meta.to_string());
        let s = stats(&dir, "thin thin", "a", "--only multipoles,momentum --spectrum-grid 16 --no-plots");
        assert!(s["multipoles"].is_null() && !s["momentum"].is_null());
        assert!(s["notes"].to_string().contains(&format!("no multipoles: {why}")), "{}", s["notes"]);
    };
    let remove = |meta: &mut Value, key: &str| drop(meta.as_object_mut().unwrap().remove(key));
    check_note(&|meta| remove(meta, "field_units"), "the files do not say that velocities are in km/s");
    let named =
        |unit: &'static str| move |meta: &mut Value| meta["field_units"] = json!({"vx": unit, "vy": unit, "vz": unit});
    check_note(&named("furlong"), "velocities are in furlong, not in km/s");
    check_note(&|meta| meta["periodic"] = false.into(), "the box is not periodic along all axes");
    check_note(&|meta| remove(meta, "scale_factor"), "the files do not state the scale factor");
    let early = |meta: &mut Value| {
        meta["scale_factor"] = 0.5.into();
        remove(meta, "omega_lambda");
    };
    check_note(&early, "the files do not state Omega_Lambda");
    // Columns of different units are no velocity, unless all are known.
    let in_units = |vz: &str| {
        let mut altered_meta = meta.clone();
        altered_meta["field_units"]["vz"] = vz.into();
        dir.write("thin/meta.json", altered_meta.to_string());
        stats(&dir, "thin thin", "a", "--only momentum --spectrum-grid 16 --no-plots")["momentum"].is_null()
    };
    assert_eq!([in_units("m/s"), in_units("furlong")], [false, true]);
    std::fs::remove_file(dir.at("thin/vz.f32")).unwrap();
    let s = stats(&dir, "thin thin", "a", "--only momentum,dispersion --no-plots");
    assert!(s["momentum"].is_null() && s["dispersion"].is_null());
    assert!(s["notes"].to_string().contains("no momentum, dispersion: the truth has no velocities"), "{}", s["notes"]);
}

/// The grid of `density` is that of the certificate's smallest cells.
#[test]
fn densities_are_compared_in_the_cells_of_the_certificate() {
    let dir = TestFolder::new();
    dir.once("compress SAMPLE -o m.pgs --ratio 300 --effort fast --certificate full --quiet");
    let certificate = dir.says("info m.pgs")["certificate"]["densities"][0].clone();
    let s = stats(&dir, "SAMPLE m.pgs", "s", "--only density --no-plots");
    assert_eq!(s["density"]["cells"], serde_json::json!([32, 32, 32]));
    let [a, b] = [&certificate["correlation"], &s["density"]["agreement"]["correlation"]].map(|v| v.as_f64().unwrap());
    assert!((a - b).abs() < 1e-6, "{a} {b}");
}
