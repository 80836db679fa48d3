//! Every good file gives the particles that its writer was given, and its box.

mod support;

use particlegs_formats::{Choice, Snapshot, Weights};
use std::collections::BTreeSet;
use std::path::Path;

fn said(e: particlegs_core::Error) -> String {
    format!("{e} ({})", e.hint())
}

/// A file, at its first frame where it has frames.
fn opened(path: &Path) -> Result<Box<dyn Snapshot>, String> {
    let snapshot = support::open(path, None, None).map_err(said)?;
    match snapshot.description().frames {
        Some(_) => support::open(path, None, Some(0)).map_err(said),
        None => Ok(snapshot),
    }
}

/// All particles: position and weight with `fields`, species after species.
fn everything(snapshot: &dyn Snapshot, choice: &Choice) -> Result<Vec<[f64; 4]>, String> {
    let mut all = Vec::new();
    for species in 0..snapshot.description().species.len() {
        all.extend(support::particles(snapshot, species, choice).map_err(said)?);
    }
    Ok(all)
}

#[test]
fn every_fixture_holds_the_first_fifty_particles() {
    let files = support::files(&support::fixtures());
    assert!(files.len() >= 69, "{} files", files.len());
    let wrong: Vec<String> =
        files.iter().filter_map(|p| Some(format!("{}: {}", p.display(), check_fixture(p).err()?))).collect();
    assert!(wrong.is_empty(), "{} of {} files:\n{}", wrong.len(), files.len(), wrong.join("\n"));
    // None of the formats is left out.
    let seen: BTreeSet<&str> = files.iter().map(|p| support::format_of(p).unwrap()).collect();
    let all: BTreeSet<&str> = Choice::formats().collect();
    assert_eq!(seen, all);
}

/// Compares with the sample's columns, whatever the species and the order.
fn check_fixture(path: &Path) -> Result<(), String> {
    let name = path.file_name().expect("a name").to_string_lossy();
    let snapshot = opened(path)?;
    check_box(&name, &*snapshot)?;
    let mut seen = everything(&*snapshot, &Choice::default())?;
    let mut wanted = support::sample(50);
    let tolerance = match &*name {
        // Half floats, twelve bits of fraction, six digits; scaled dumps have nine.
        "v1.spz" => 8e-3,
        name if name.ends_with(".spz") => 1.3e-4,
        name if name.starts_with("ascii.v") => 5e-5,
        // Three decimals.
        "mdanalysis.gro" | "mdtraj.xtc" | "mdanalysis.pdb" | "ase.pdb" => 5.1e-4,
        // A millionth of the box.
        name if name.starts_with("rvint") => 1.4e-5,
        _ => 4e-6,
    };
    if name.ends_with(".asdf") {
        // Abacus has 0 in the middle of the box.
        wanted.iter_mut().flatten().filter(|v| **v >= 12.5).for_each(|v| *v -= 25.0);
    }
    let order = |a: &[f64], b: &[f64]| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]));
    if snapshot.description().species.len() > 1 {
        wanted.sort_by(|a, b| order(a, b));
        seen.sort_by(|a, b| order(a, b));
    }
    let near = |s: &[f64; 4], w: &[f64; 3]| (0..3).all(|k| (s[k] - w[k]).abs() <= tolerance);
    if seen.len() != 50 {
        return Err(format!("{} particles", seen.len()));
    }
    match seen.iter().zip(&wanted).find(|(s, w)| !near(s, w)) {
        Some((s, w)) => Err(format!("{s:?} instead of {w:?}")),
        None => Ok(()),
    }
}

/// Formats that state a box state this one; the others none.
fn check_box(name: &str, snapshot: &dyn Snapshot) -> Result<(), String> {
    let states_one = [
        "hdf5", "gio", "dump", "dump.gz", "dump.bz2", "dump.zst", "extxyz", "gro", "xtc", "trr", "dcd", "h5md", "pdb",
        "data", "vasp", "xdatcar", "gsd", "h5", "asdf",
    ];
    let states_one =
        states_one.iter().any(|e| name.ends_with(e)) || name.starts_with("gadget") || name.ends_with("npz");
    let wanted = match name {
        _ if name.starts_with("mdanalysis.") && name != "mdanalysis.data" => {
            Some([[25.0, 0.0, 0.0], [0.0, 25.0, 0.0], [12.5, 12.5, 25.0 * std::f64::consts::FRAC_1_SQRT_2]])
        }
        "hoomd.gsd" => Some([[25.0, 0.0, 0.0], [12.5, 25.0, 0.0], [0.0, 0.0, 25.0]]),
        "tilted.dump.bz2" => Some([[25.0, 0.0, 0.0], [2.5, 25.0, 0.0], [1.25, 5.0, 25.0]]),
        _ if states_one => Some([[25.0, 0.0, 0.0], [0.0, 25.0, 0.0], [0.0, 0.0, 25.0]]),
        _ => None,
    };
    let seen = snapshot.description().meta.cell.as_ref().map(|c| c.vectors);
    let same = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| {
        // Cells of molecular formats have six digits, or the rounding of their angles.
        let tolerance = if name.contains("md") || name.contains("cosines") { 1e-5 } else { 0.0 };
        a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() <= tolerance)
    };
    let fits = seen.zip(wanted).map_or(seen == wanted, |(a, b)| same(a, b));
    if fits { Ok(()) } else { Err(format!("box {seen:?} instead of {wanted:?}")) }
}

/// Files of a snapshot in two parts: either part gives the whole.
#[test]
fn either_part_gives_the_whole() {
    for part in ["gadget1_parts.0", "gadget1_parts.1"] {
        let snapshot = opened(&support::fixtures().join(part)).unwrap();
        assert_eq!(snapshot.description().files.len(), 2, "{part}");
    }
}

/// Files that HACC's own library compressed, bit for bit, and one that the reference packer of SPZ packed.
#[test]
fn files_by_the_formats_own_programs() {
    let folder = support::data("others");
    let compressed = opened(&folder.join("hacc_2ranks_blosc.gio")).unwrap();
    let lengths = compressed.description().meta.cell.as_ref().and_then(|c| c.lengths());
    assert_eq!(lengths, Some([25.0; 3]));
    let seen = everything(&*compressed, &Choice::default()).unwrap();
    assert_eq!(seen.len(), 5000);
    for (i, (s, w)) in seen.iter().zip(support::sample(5000)).enumerate() {
        assert_eq!(s[..3], w[..], "particle {i}");
    }
    let splats = everything(&*opened(&folder.join("splat_sh3_spzv3.spz")).unwrap(), &Choice::default()).unwrap();
    assert_eq!(splats.len(), 1000);
    for (s, w) in splats.iter().zip(support::sample(1000)) {
        assert!((0..3).all(|k| (s[k] - w[k]).abs() <= 1.3e-4), "{s:?} instead of {w:?}");
    }
}

/// Coordinates outside the box are wrapped into it, or kept where that is wanted.
#[test]
fn unwrapped_coordinates_are_wrapped_or_kept() {
    for (keep_unwrapped, boxes) in [(false, 0.0), (true, 1.0)] {
        let choice = Choice { keep_unwrapped, ..Choice::default() };
        let snapshot = choice.open(&[support::data("others").join("unwrapped.dump")]).unwrap();
        let seen = everything(&*snapshot, &choice).unwrap();
        assert_eq!(seen.len(), 50);
        for (i, (s, w)) in seen.iter().zip(support::sample(50)).enumerate() {
            for k in 0..3 {
                let wanted = w[k] + boxes * (25.0 * ((3 * i + k) % 5) as f64 - 50.0);
                assert!((s[k] - wanted).abs() <= 1e-5, "{s:?} instead of {w:?}");
            }
        }
    }
}

/// Masses come with the particles they belong to, where the rows are in another order, too.
#[test]
fn weights_follow_their_particles() {
    let by_mass = Choice { weights: Weights::Field("mass".into()), ..Choice::default() };
    let wanted = support::sample(50);
    for name in
        ["records.npy", "deflate.npz", "header.csv.gz", "big_f8.ply", "raw_be.vtp", "raw_zlib.vtu", "binary51.vtk"]
    {
        let all = everything(&*opened(&support::fixtures().join(name)).unwrap(), &by_mass).unwrap();
        assert_eq!(all.len(), 50, "{name}");
        for p in &all {
            let i = wanted.iter().position(|w| (0..3).all(|k| (p[k] - w[k]).abs() < 4e-6)).expect("a particle");
            assert_eq!(p[3], (1 + (i + 1) % 3) as f64, "{name}, particle {i}");
        }
    }
    let masses = opened(&support::fixtures().join("gadget2_masses")).unwrap();
    let all = everything(&*masses, &Choice::default()).unwrap();
    assert!(all.iter().enumerate().all(|(i, p)| p[3] == (1 + (i + 1) % 3) as f64), "{all:?}");
}
