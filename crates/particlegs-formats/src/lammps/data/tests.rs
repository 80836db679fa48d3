use crate::testing::{fault, fixture, gzip, open_bytes, read, vectors, written};
use crate::{Choice, SpeciesMass};
use particlegs_core::context::Context;
use particlegs_particles::Storage;

const FULL: &str = "LAMMPS data file via write_data, version 2 Aug 2023, timestep = 100, units = real\n\n3 atoms\n2 atom types\n\n\
    0 30 xlo xhi\n0 20 ylo yhi\n-5 5 zlo zhi\n3 0 0 xy xz yz\n\nAtom Type Labels\n\n1 C\n2 O\n\nMasses\n\n1 12.011 # C\n2 15.999\n\n\
    Pair Coeffs # lj/cut\n\n1 0.1 3.0\n2 0.1 3.0\n\nAtoms # full\n\n2 1 2 -0.5 4 5 6 0 0 1\n1 1 1 0.5 1 2 3 0 0 0 # a comment\n3 2 2 0.25 7 8 -4 0 0 0\n\n\
    Velocities\n\n1 0.1 0.2 0.3\n3 0.7 0.8 0.9\n2 0.4 0.5 0.6\n\nBonds\n\n1 1 1 2\n";

#[test]
fn sections_styles_and_labels_are_read() {
    for content in [FULL.as_bytes().to_vec(), gzip(FULL.as_bytes())] {
        let snapshot = open_bytes("data.lmp", &content).unwrap();
        let d = snapshot.description();
        assert_eq!((d.meta.units.length_text(), d.meta.epoch.step), (Some("Angstrom"), Some(100)));
        let cell = d.meta.cell.unwrap();
        assert_eq!((cell.origin, cell.vectors[1]), ([0.0, 0.0, -5.0], [3.0, 20.0, 0.0]));
        let name_and_mass = |s: usize| (&d.species[s].name[..], &d.species[s].mass);
        assert_eq!(name_and_mass(0), ("type 2", &SpeciesMass::Each(15.999)));
        assert_eq!(name_and_mass(1), ("type 1", &SpeciesMass::Each(12.011)));
        assert!(d.species[0].aliases.contains(&"o".to_string()));
        assert_eq!(read(&*snapshot, 0, &Choice::default()).unwrap().positions, [[4.0, 5.0, 6.0], [7.0, 8.0, -4.0]]);
        let velocity = vectors(&*snapshot, 0, "velocity");
        assert!((velocity[0][1] - 0.5).abs() < 1e-6 && (velocity[1][2] - 0.9).abs() < 1e-6);
        assert_eq!(vectors(&*snapshot, 1, "id,mol,q")[0], [1.0, 1.0, 0.5]);
    }
}

#[test]
fn files_of_other_programs_are_read() {
    let velocity = |name: &str, last: f64| {
        let snapshot = fixture(&format!("fixtures/{name}"), None);
        let all = (0..snapshot.description().species.len()).flat_map(|s| vectors(&*snapshot, s, "velocity"));
        assert!(all.flatten().any(|v| (v - last).abs() < 1e-6), "{name}");
        assert!(snapshot.description().species.iter().all(|s| matches!(s.mass, SpeciesMass::Each(_))), "{name}");
    };
    velocity("ase.data", 13.625);
    velocity("chemfiles.data", 13.625);
    velocity("mdanalysis.data", 0.013_625);
}

/// Types with a mass each keep it in a dump.
#[test]
fn masses_of_types_are_written_as_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let [from, to] = ["from.data", "to.dump"].map(|name| dir.path().join(name));
    std::fs::write(&from, FULL).unwrap();
    let particles = Choice::default().read(&[from], &Storage::Memory, &Context::SILENT).unwrap();
    written(&particles, &to, "lammps");
    let dump = Choice::default().open(&[to]).unwrap();
    assert_eq!(read(&*dump, 0, &Choice::default()).unwrap().weights, [15.999; 2]);
    assert_eq!(read(&*dump, 1, &Choice::default()).unwrap().weights, [12.011]);
}

#[test]
fn broken_files_are_refused() {
    let cut = fault(FULL.split("3 2 2 0.25").next().unwrap().as_bytes());
    assert!(cut.contains("the header states 3 atoms, but the section `Atoms` has 2"), "{cut}");
    let with = |from: &str, to: &str| fault(FULL.replace(from, to).as_bytes());
    assert!(with("3 atoms", "99999999999 atoms").contains("states 99999999999 atoms"));
    assert!(with("Atoms # full", "Atoms # granular").contains("atoms of style `granular` are not read"));
    assert!(with("4 5 6 0 0 1", "4 x 6 0 0 1").contains("line 28: `x` is not a number"));
    assert!(with("0 30 xlo", "30 0 xlo").contains("the box is inverted"));
    assert!(with("\n3 0.7 0.8 0.9", "\n4 0.7 0.8 0.9").contains("atom 3 has no velocity"));
}
