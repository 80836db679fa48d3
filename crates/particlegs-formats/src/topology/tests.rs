use crate::testing::{gzip, read, rows, scratch};
use crate::{AtomSelection, Choice, Snapshot, SpeciesMass, Weights};
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name)
}

fn choice(topology: Option<&str>, select: Option<&str>) -> Choice {
    let select = select.map(|text| AtomSelection::parse(text).unwrap());
    Choice { topology: topology.map(file), select, frame: Some(0), ..Choice::default() }
}

fn species(snapshot: &dyn Snapshot) -> Vec<(&str, u64)> {
    snapshot.description().species.iter().map(|s| (&s.name[..], s.count)).collect()
}

fn said(name: &str, choice: &Choice) -> String {
    choice.open(&[file(name)]).map(drop).unwrap_err().to_string()
}

/// 20 waters of two atoms, of which each file knows what it can hold, and 10 ions.
#[test]
fn every_topology_names_the_atoms_of_every_trajectory() {
    let (residues, elements) = ([("water", 40), ("NA", 10)], [("O", 20), ("H", 20), ("NA", 10)]);
    for trajectory in ["mdanalysis.xtc", "mdtraj.trr", "mdanalysis.dcd", "mdtraj.h5"] {
        let trajectory = format!("fixtures/{trajectory}");
        let plain = rows(&*choice(None, None).open(&[file(&trajectory)]).unwrap(), 0, &Choice::default()).unwrap();
        for (topology, kinds, masses) in [
            ("fixtures/mdanalysis.gro", &residues[..], [15.999, 1.008, 22.99]),
            ("fixtures/mdanalysis.pdb", &elements[..], [15.999, 1.008, 22.99]),
            ("data/molecules/parmed.psf", &residues[..], [15.9994, 1.008, 22.9898]),
        ] {
            let about = format!("{trajectory} {topology}");
            let all = choice(Some(topology), None);
            let snapshot = all.open(&[file(&trajectory)]).unwrap_or_else(|e| panic!("{about}: {e}"));
            assert_eq!(species(&*snapshot), kinds, "{about}");
            let d = snapshot.description();
            assert_eq!(d.meta.units.mass_text(), Some("amu"));
            assert!(d.notes.iter().all(|n| !n.contains("no names")), "{:?}", d.notes);
            assert!(d.notes.iter().any(|n| n.starts_with("masses are")), "{:?}", d.notes);
            let ions = &d.species[kinds.len() - 1];
            assert!(matches!(ions.mass, SpeciesMass::Each(mass) if (mass - masses[2]).abs() < 1e-3), "{:?}", ions.mass);
            // Every other atom of a water is a hydrogen.
            let hydrogens = choice(Some(topology), Some("name H"));
            let one = hydrogens.open(&[file(&trajectory)]).unwrap();
            let weights = Choice { weights: Weights::Field("mass".into()), ..hydrogens };
            for (k, row) in rows(&*one, 0, &weights).unwrap().into_iter().enumerate() {
                let [x, y, z, _] = plain[2 * k + 1];
                assert_eq!(row, [x, y, z, f64::from(masses[1] as f32)], "{about} {k}");
            }
        }
    }
}

#[test]
fn data_files_are_topologies_by_the_numbers_of_their_atoms() {
    let content = "made, units = real\n\n3 atoms\n2 atom types\n0 9 xlo xhi\n0 9 ylo yhi\n0 9 zlo zhi\n\nMasses\n\n1 16\n2 1\n\n\
                   Atoms # full\n\n3 1 2 0.4 7 7 7\n1 1 1 -0.8 1 2 3\n2 1 2 0.4 4 5 6\n";
    let data = scratch(content.as_bytes());
    let by_type = Choice { select: AtomSelection::parse("type 2").ok(), ..Choice::default() };
    let snapshot = by_type.open(&[data.path().into()]).unwrap();
    assert_eq!(species(&*snapshot), [("type 2", 2)]);
    let charge = Choice { weights: Weights::Field("q".into()), ..by_type.clone() };
    assert_eq!(rows(&*snapshot, 0, &charge).unwrap()[0], [7.0, 7.0, 7.0, f64::from(0.4f32)]);
    let gro = "of three\n 3\n    1SOL     OW    1   1.000   2.000   3.000\n    1SOL    HW1    2   4.000   5.000   6.000\n    \
               1SOL    HW2    3   7.000   7.000   7.000\n   9 9 9\n";
    let gro = scratch(gro.as_bytes());
    let first = AtomSelection::parse("type 1 and resid 1").ok();
    let by_data = Choice { topology: Some(data.path().into()), select: first, ..Choice::default() };
    let snapshot = by_data.open(&[gro.path().into()]).unwrap();
    assert_eq!(
        (species(&*snapshot), &snapshot.description().species[0].mass),
        (vec![("type 1", 1)], &SpeciesMass::Each(16.0))
    );
    assert_eq!(rows(&*snapshot, 0, &by_data).unwrap()[0][..3], [1.0, 2.0, 3.0]);
    assert_eq!(snapshot.description().meta.units.mass_text(), Some("g/mol"));
}

#[test]
fn sites_without_a_mass_are_left_out_of_masses_alone() {
    let atom = |k: usize, name: &str| format!("    1SOL  {name:>5}{k:>5}   {k}.000   2.000   3.000\n");
    let atoms = [atom(1, "OW"), atom(2, "HW1"), atom(3, "HW2"), atom(4, "MW")].concat();
    let gro = scratch(format!("water\n 4\n{atoms}   9 9 9\n").as_bytes());
    for (weights, count) in [(Weights::Auto, 3), (Weights::None, 4)] {
        let choice = Choice { topology: Some(gro.path().into()), weights, ..Choice::default() };
        let snapshot = choice.open(&[gro.path().into()]).unwrap();
        let notes = snapshot.description().notes.join("; ");
        assert_eq!(
            (species(&*snapshot), notes.contains("1 sites without a mass are left out")),
            (vec![("water", count)], count == 3)
        );
        assert_eq!(rows(&*snapshot, 0, &choice).unwrap()[2][0], 3.0);
    }
}

/// More than a run of particles, from a plain file and from a stream.
#[test]
fn long_selections_are_read_in_runs() {
    let count = 160_000;
    let mut gro = format!("long\n{count}\n");
    for i in 0..count {
        let [residue, name] = [["LIG", "SOL"][i / 3 % 2], ["A", "B", "C"][i % 3]];
        gro += &format!(
            "{:>5}{residue:<5}{name:>5}{:>5}{:>8}{:>8}{:>8}\n",
            i / 3 % 100_000,
            i % 100_000,
            format!("{}.0", i % 1000),
            format!("{}.0", i / 1000),
            "0.5"
        );
    }
    gro += "0 0 0\n";
    for content in [gro.clone().into_bytes(), gzip(gro.as_bytes())] {
        let file = scratch(&content);
        let choice = Choice { select: AtomSelection::parse("name A C").ok(), ..Choice::default() };
        let snapshot = choice.open(&[file.path().into()]).unwrap();
        assert_eq!(species(&*snapshot), [("LIG", 53334), ("water", 53333)]);
        for (which, parity) in [0, 1].into_iter().enumerate() {
            let seen = read(&*snapshot, which, &choice).unwrap().positions;
            let wanted = (0..count)
                .filter(|i| i % 3 != 1 && i / 3 % 2 == parity)
                .map(|i| [(i % 1000) as f64, (i / 1000) as f64, 0.5]);
            assert!(seen.into_iter().eq(wanted), "species {which}");
        }
        let all = Choice {
            select: AtomSelection::parse("resname LIG SOL and index 10:159999").ok(),
            species: Vec::new(),
            ..choice
        };
        let snapshot = all.open(&[file.path().into()]).unwrap();
        assert_eq!(species(&*snapshot).iter().map(|s| s.1).sum::<u64>(), 159_990);
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let xtc = "fixtures/mdanalysis.xtc";
    for (name, topology, select, why) in [
        (xtc, None, Some("name O"), "the file has no names of atoms"),
        (xtc, Some("fixtures/mdtraj.xtc"), None, "a file of the format `xtc` holds no topology"),
        ("data/molecules/water.xtc", Some("fixtures/mdanalysis.gro"), None, "the file has 300 atoms, but"),
        (xtc, Some("fixtures/mdanalysis.gro"), Some("name XX"), "the selection holds no atoms"),
        (xtc, Some("fixtures/mdanalysis.gro"), Some("type OT"), "mdanalysis.gro states no types of atoms"),
        ("fixtures/mdanalysis.data", None, Some("water"), "mdanalysis.data states no residues"),
        ("fixtures/byhand.h5md", None, Some("water"), "the file has no names of atoms"),
        (
            "fixtures/plain.dump",
            Some("fixtures/mdanalysis.gro"),
            None,
            "the format `lammps` has no atoms that can be named",
        ),
        ("fixtures/header.csv", None, Some("all"), "the format `csv` has no atoms that can be named"),
    ] {
        let choice = Choice { frame: None, ..choice(topology, select) };
        assert!(said(name, &choice).contains(why), "{name}: {}", said(name, &choice));
    }
}

#[test]
fn damaged_topologies_are_read_or_refused_in_one_line() {
    let whole = std::fs::read(file("data/molecules/parmed.psf")).unwrap();
    for at in (0..whole.len()).step_by(7) {
        let mut flipped = whole.clone();
        flipped[at] ^= 1 << (at % 8);
        for bytes in [&whole[..at], &flipped] {
            let topology = scratch(bytes);
            let choice = Choice { topology: Some(topology.path().into()), ..choice(None, Some("water or index 3")) };
            if let Err(e) = choice.open(&[file("fixtures/mdanalysis.xtc")]) {
                assert!(!e.to_string().contains('\n'), "{at}: {e}");
            }
        }
    }
}
