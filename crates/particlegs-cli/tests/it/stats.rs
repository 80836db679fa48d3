//! `stats` as a user runs it, on a thinned sample.

use crate::common::{fails, listing, particlegs, sample};
use std::path::{Path, PathBuf};

/// 16 384 particles of the sample as a snapshot with its box.
fn thinned(dir: &Path) -> PathBuf {
    let out = dir.join("thin");
    particlegs().arg("convert").arg(sample()).arg("-o").arg(&out).args(["--every", "16", "--quiet"]).assert().success();
    out
}

/// Without options of measures that may not be among them.
fn stats_of(truth: &Path, other: &Path, out: &Path, more: &[&str]) -> serde_json::Value {
    particlegs().arg("stats").arg(truth).arg(other).arg("-o").arg(out).args(more).arg("-q").assert().success();
    serde_json::from_slice(&std::fs::read(out.join("stats.json")).unwrap()).unwrap()
}

fn stats(truth: &Path, other: &Path, out: &Path, more: &[&str]) -> serde_json::Value {
    let mut command = particlegs();
    command.arg("stats").arg(truth).arg(other).arg("-o").arg(out).args(["--grid", "24", "--spectrum-grid", "32"]);
    if !more.contains(&"--only") {
        command.args(["--pairs", "3000000"]);
    }
    command.arg("--quiet").args(more).assert().success();
    serde_json::from_slice(&std::fs::read(out.join("stats.json")).unwrap()).unwrap()
}

#[test]
fn a_snapshot_against_itself_is_perfect_and_threads_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, out) = (thinned(dir.path()), dir.path().join("a"));
    let s = stats(&thin, &thin, &out, &[]);
    let summary = &s["summary"];
    assert_eq!((summary["density_correlation"].as_f64(), summary["core_mass"].as_f64()), (Some(1.0), Some(1.0)));
    assert_eq!((summary["largest_power_deviation"].as_f64(), summary["nearest_mean"].as_f64()), (Some(0.0), Some(1.0)));
    assert_eq!(s["domain"]["periodic"], serde_json::json!([true, true, true]));
    assert_eq!(s["spectra"]["cells"], serde_json::json!([32, 32, 32]));
    let files = listing(&out);
    for name in ["power.svg", "power.png", "xi.png", "groups.csv", "slice_z.png", "neighbours.csv", "coherence.svg"] {
        assert!(files.iter().any(|f| f == name), "{name} of {files:?}");
    }
    let svg = std::fs::read_to_string(out.join("power.svg")).unwrap();
    assert!(svg.contains("k [h/Mpc]") && svg.contains("P(k) [(Mpc/h)³]"));
    let again = dir.path().join("b");
    let mut command = particlegs();
    command.arg("stats").arg(&thin).arg(&thin).arg("-o").arg(&again).args(["--grid", "24", "--spectrum-grid", "32"]);
    command.args(["--pairs", "3000000", "--quiet", "--threads", "1"]).env("PARTICLEGS_SIMD", "off").assert().success();
    for name in files {
        assert_eq!(std::fs::read(out.join(&name)).unwrap(), std::fs::read(again.join(&name)).unwrap(), "{name}");
    }
}

#[test]
fn a_model_is_measured_by_its_mixture() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, model, out) = (thinned(dir.path()), dir.path().join("m.pgs"), dir.path().join("a"));
    let mut compress = particlegs();
    compress.arg("compress").arg(&thin).arg("-o").arg(&model).args([
        "--gaussians",
        "200",
        "--effort",
        "fast",
        "--certificate=none",
        "--quiet",
    ]);
    compress.assert().success();
    let s = stats(&thin, &model, &out, &["--no-plots"]);
    assert_eq!(s["model"], serde_json::json!([false, true]));
    assert!(s["summary"]["density_correlation"].as_f64().unwrap() > 0.5);
    assert!(s["groups"].is_null() && s["xi_by_pairs"].is_null() && s["spectra"]["shot_noise"][1] == 0.0);
    assert!(s["notes"].as_array().unwrap().iter().any(|n| n.as_str().unwrap().contains("recover")));
    assert!(listing(&out).iter().all(|f| !f.ends_with(".png")));
}

/// The columns of a table, by name.
fn table(path: &Path) -> Vec<std::collections::BTreeMap<String, String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut rows = text.lines().map(|l| l.split(',').map(str::to_string).collect::<Vec<_>>());
    let head = rows.next().unwrap();
    rows.map(|row| head.iter().cloned().zip(row).collect()).collect()
}

#[test]
fn distances_profiles_and_haloes_are_written() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, out) = (thinned(dir.path()), dir.path().join("a"));
    let centres = dir.path().join("centres.csv");
    std::fs::write(&centres, "id,x,y,z,radius\n1,12,12,12,4\n2,1,24.5,10,\n").unwrap();
    let more = ["--only", "rdf,profile,haloes", "--profile-axis", "x", "--profile-bins", "25", "--halo-bins", "8"];
    let given = ["--centres", centres.to_str().unwrap()];
    let s = stats_of(&thin, &thin, &out, &[&more[..], &given].concat());
    assert_eq!(s["summary"]["rdf_largest_difference"], 0.0);
    assert_eq!((&s["summary"]["halo_mass"], &s["summary"]["profile_relative_difference"]), (&1.0.into(), &0.0.into()));
    assert!(s["density"].is_null() && s["groups"].is_null() && s["xi_by_pairs"].is_null());
    let rdf = table(&out.join("rdf.csv"));
    assert!(rdf.len() == 200 && rdf.iter().all(|r| r["g_truth"] == r["g_other"]));
    assert!(rdf[100]["g_truth"].parse::<f64>().unwrap() > 1.0);
    let profiles = table(&out.join("profiles.csv"));
    assert_eq!(profiles.iter().filter(|r| r["axis"] == "x").count(), 25);
    let mass: f64 =
        profiles.iter().take(25).map(|r| r["density_truth"].parse::<f64>().unwrap() * 25f64.powi(3) / 25.0).sum();
    assert!((mass - 16_384.0).abs() < 1e-6, "{mass}");
    let haloes = table(&out.join("haloes.csv"));
    assert_eq!((haloes.len(), &haloes[7]["r_high"][..], &haloes[15]["centre"][..]), (16, "4", "2"));
    assert!(haloes.iter().all(|r| r["enclosed_truth"] == r["enclosed_other"]));
    for name in ["rdf.svg", "profile_x.png", "halo_profile.png", "halo_mass.csv"] {
        assert!(out.join(name).exists(), "{name}");
    }
    assert!(std::fs::read_to_string(out.join("rdf.svg")).unwrap().contains("r [Mpc/h]"));
}

#[test]
fn a_model_has_profiles_and_haloes_and_no_distances() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, model, out) = (thinned(dir.path()), dir.path().join("m.pgs"), dir.path().join("a"));
    let mut compress = particlegs();
    compress.arg("compress").arg(&thin).arg("-o").arg(&model).args(["--gaussians", "800", "--effort", "fast"]);
    compress.args(["--certificate=none", "--quiet"]).assert().success();
    let more = ["--only", "rdf,profile,haloes", "--profile-bins", "20", "--linking", "0.25", "--no-plots"];
    let s = stats_of(&thin, &model, &out, &more);
    assert!(s["rdf"].is_null() && s["notes"].as_array().unwrap().iter().any(|n| n.as_str().unwrap().contains("g(r)")));
    let of = |name: &str| s["summary"][name].as_f64().unwrap();
    assert!(of("profile_relative_difference") < 0.1 && (of("halo_mass") - 1.0).abs() < 0.1, "{}", s["summary"]);
    // The other way round there are no groups to take centres of.
    let s = stats_of(&model, &thin, &dir.path().join("b"), &["--only", "haloes", "--no-plots"]);
    assert!(s["haloes"].is_null() && s["notes"][0].as_str().unwrap().contains("no centres"), "{}", s["notes"]);
}

#[test]
fn centres_that_cannot_be_used_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, centres) = (thinned(dir.path()), dir.path().join("centres.txt"));
    let run = |text: &str, more: &[&str]| {
        std::fs::write(&centres, text).unwrap();
        let mut command = particlegs();
        command.arg("stats").arg(&thin).arg(&thin).arg("-o").arg(dir.path().join("a")).arg("--centres").arg(&centres);
        command.args(more);
        command
    };
    fails(&mut run("1 2 3\n4 5\n", &[]), 3, "line 2");
    fails(&mut run("", &[]), 3, "empty");
    fails(&mut run("1\u{0}2", &[]), 3, "a list of centres");
    fails(&mut run("1 2 3 13", &["--only", "haloes"]), 2, "half the box");
    fails(&mut run("1 2 3", &["--only", "haloes", "--halo-radius", "0"]), 2, "the radius of a halo");
    fails(&mut run("1 2 3", &["--only", "rdf"]), 2, "belongs to the measure `haloes`");
}

#[test]
fn the_published_convention_and_bad_options() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, out) = (thinned(dir.path()), dir.path().join("a"));
    let s =
        stats(&thin, &thin, &out, &["--convention", "paper", "--only", "density,spectrum,neighbours", "--no-plots"]);
    assert_eq!(s["spectra"]["options"]["deconvolved"], false);
    assert_eq!(s["density"]["cells"], serde_json::json!([24, 24, 24]));
    assert!(s["groups"].is_null() && s["moments"].is_null());
    let run = |more: &[&str]| {
        let mut command = particlegs();
        command.arg("stats").arg(&thin).arg(&thin).arg("-o").arg(&out).args(more);
        command
    };
    fails(&mut run(&["--grid", "1"]), 2, "outside 2 to 8192");
    fails(&mut run(&["--grid", "8192"]), 7, "bytes of memory");
    fails(&mut run(&["--separations", "3,1"]), 2, "must ascend");
    fails(&mut run(&["--only", "groups", "--linking", "0"]), 2, "linking");
    let file = dir.path().join("file");
    std::fs::write(&file, "x").unwrap();
    let mut command = particlegs();
    fails(command.arg("stats").arg(&thin).arg(&thin).arg("-o").arg(file.join("x")), 6, "file");
    let mut command = particlegs();
    fails(command.arg("stats").arg(&thin).arg(dir.path().join("none")).arg("-o").arg(&out), 6, "none");
}

/// An ideal gas of 4000 in a cell of 720: cubic, triclinic, the same by longer vectors, and upright by permuted ones.
#[test]
fn an_ideal_gas_is_one_in_any_cell() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, drawn: [[f64; 3]; 3], stated: [[f64; 3]; 3]| {
        let lattice: Vec<String> = stated.iter().flatten().map(f64::to_string).collect();
        let mut text = format!("4000\nLattice=\"{}\" Properties=species:S:1:pos:R:3\n", lattice.join(" "));
        for i in 0..4000u64 {
            let f = [0, 1, 2].map(|k| particlegs::math::Random::new(8, k, i).uniform());
            let x = [0, 1, 2].map(|k| (0..3).map(|a| f[a] * drawn[a][k]).sum::<f64>().to_string());
            text += &format!("Ar {}\n", x.join(" "));
        }
        let path = dir.path().join(format!("{name}.xyz"));
        std::fs::write(&path, text).unwrap();
        path
    };
    let edge = 720f64.cbrt();
    let cube = [[edge, 0.0, 0.0], [0.0, edge, 0.0], [0.0, 0.0, edge]];
    let tilted = [[10.0, 0.0, 0.0], [4.0, 9.0, 0.0], [2.0, 3.0, 8.0]];
    let longer = [tilted[0], [24.0, 9.0, 0.0], [-12.0, -6.0, 8.0]];
    let permuted = [cube[2], cube[0].map(|v| -v), cube[1]];
    let measured = |name: &str, drawn, stated| {
        let path = write(name, drawn, stated);
        let only = ["--only", "rdf,spectrum,groups,neighbours,profile", "--spectrum-grid", "32", "--no-plots"];
        stats_of(&path, &path, &dir.path().join(name), &only)
    };
    let [cubic, one, other, turned] = [
        measured("cubic", cube, cube),
        measured("tilted", tilted, tilted),
        measured("longer", tilted, longer),
        measured("permuted", cube, permuted),
    ];
    let groups = |s: &serde_json::Value| s["groups"]["grouped"][0].as_f64().unwrap();
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
    // The same lattice, by other vectors.
    let pairs = |s: &serde_json::Value, bin: usize| s["rdf"]["pairs"][0][bin].as_i64().unwrap();
    for (one, other) in [(&one, &other), (&cubic, &turned)] {
        assert_eq!(groups(one), groups(other));
        // Rounding of the volume, and so of the bins, may move a pair to the next.
        assert!((0..200).all(|bin| (pairs(one, bin) - pairs(other, bin)).abs() <= 4));
    }
    assert!(one["domain"]["tilt"].is_object() && turned["domain"]["tilt"].is_null());
}

/// 2000 light particles in a tenth of the box, 450 of them in two clumps, and heavy ones all over it.
#[test]
fn groups_of_a_zoom_are_those_of_its_finest_particles() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("zoom.csv");
    let mut text = String::from("x,y,z,mass\n");
    for (n, at, size, mass) in
        [(1550, 40.0, 10.0, 1), (300, 42.0, 0.2, 1), (150, 46.0, 0.2, 1), (1000, 0.0, 100.0, 4096)]
    {
        for i in 0..n {
            let x = [0, 1, 2].map(|k| at + size * particlegs::math::Random::new(at as u64, k, i).uniform());
            text += &format!("{},{},{},{mass}\n", x[0], x[1], x[2]);
        }
    }
    std::fs::write(&path, text).unwrap();
    let options = ["--only", "groups", "--no-plots", "--box", "100", "--length-unit", "Mpc"];
    let groups = |name: &str, more: &[&str]| {
        let s = stats_of(&path, &path, &dir.path().join(name), &[&options[..], more].concat());
        (s["groups"].clone(), s["notes"].to_string())
    };
    let (own, notes) = groups("own", &[]);
    assert!(
        notes.contains("link the finest 2000 of 3000 particles") && notes.contains("0 of 2 groups hold heavier"),
        "{notes}"
    );
    assert_eq!((own["linked"][0].as_u64(), own["contaminated"][0].as_u64()), (Some(2000), Some(0)));
    let largest = own["largest"][0].as_u64().unwrap();
    assert!((300..310).contains(&largest) && own["classes"][2]["groups"][0] == 2, "{own}");
    // As long, in another unit; and one that joins all.
    let length = own["linking_length"][0].as_f64().unwrap();
    let (same, _) = groups("same", &["--linking-length", &format!("{}kpc", 1000.0 * length)]);
    assert_eq!((&same["classes"], &same["largest"]), (&own["classes"], &own["largest"]));
    assert_eq!(groups("all", &["--linking-length", "3"]).0["largest"][0], 2000);
    let flat = ["--only", "moments", "--no-plots", "--box", "100,100,0"];
    let slab = stats_of(&path, &path, &dir.path().join("slab"), &flat);
    assert_eq!(slab["domain"]["periodic"], serde_json::json!([true, true, false]));
    for (asked, why) in [("3 Msun", "not a unit of length"), ("0kpc", "not a length above 0"), ("Mpc", "not a length")]
    {
        let mut command = particlegs();
        command.arg("stats").arg(&path).arg(&path).arg("-o").arg(dir.path().join("no")).args(options);
        fails(command.args(["--linking-length", asked]), 2, why);
    }
}

/// A halo finder's list, whose names stand behind # in no fixed order, names its centres, in its own units.
#[test]
fn catalogues_of_haloes_are_lists_of_centres() {
    let dir = tempfile::tempdir().unwrap();
    let (thin, list) = (thinned(dir.path()), dir.path().join("out_1.list"));
    let stats = |text: &str, out: &str| {
        std::fs::write(&list, text).unwrap();
        let out = dir.path().join(out);
        let mut command = particlegs();
        command.arg("stats").arg(&thin).arg(&thin).arg("-o").arg(&out).arg("--centres").arg(&list);
        command.args(["--only", "haloes", "--no-plots"]);
        (command, out.join("haloes.csv"))
    };
    let rockstar = "#ID DescID Mvir Rvir Np X Y Z A[x]\n#a = 1.0\n#Box size: 25.0 Mpc/h\n\
        #Units: Positions in Mpc / h (comoving)\n0 -1 1e12 2000 45 10.5 8.5 1.25 0.1\n";
    let (mut command, table) = stats(rockstar, "a");
    let said = command.assert().success().get_output().stderr.clone();
    assert!(String::from_utf8_lossy(&said).contains("Rockstar"), "{}", String::from_utf8_lossy(&said));
    let row = std::fs::read_to_string(table).unwrap().lines().nth(1).unwrap().to_string();
    assert!(row.starts_with("1,10.5,8.5,1.25,2,"), "{row}");
    let ahf = "#ID(1)\thostHalo(2)\tXc(6)\tYc(7)\tZc(8)\tRhalo(12)\n7\t0\t10500\t8500\t1250\t2000\n";
    let (mut command, table) = stats(ahf, "b");
    command.assert().success();
    assert_eq!(std::fs::read_to_string(table).unwrap().lines().nth(1), Some(&row[..]));
    // What cannot be the centres of this box is refused.
    fails(&mut stats("#x y z r\n10500 8500 1250 2000\n", "c").0, 3, "outside the periodic box");
    fails(&mut stats("#id m a b c\n1 2 3 4 5\n", "c").0, 3, "id, m, a, b, c");
}
