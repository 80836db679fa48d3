use crate::Choice;
use crate::testing::{fault, fixture, open_bytes, read, vectors};

const FOUR: &str = "old\n2.0\n10 0 0\n0 10 0\n0 5 10\n1 2\nDirect\n0.5 0.5 0.5\n0.1 0.2 0.3\n0 0 0\n";

#[test]
fn scales_modes_and_velocities_are_followed() {
    let snapshot = fixture("fixtures/volume.vasp", None);
    let d = snapshot.description();
    assert_eq!(d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(), [("O", 30), ("H", 20)]);
    assert!((vectors(&*snapshot, 1, "velocity")[19][2] - 13.625).abs() < 1e-9);
    let by_ase = fixture("fixtures/ase.vasp", None);
    assert_eq!(by_ase.description().species.len(), 3);
    assert!((vectors(&*by_ase, 0, "velocity")[0][0] + 0.005).abs() < 1e-9);
    let old = open_bytes("POSCAR", FOUR.as_bytes()).unwrap();
    let d = old.description();
    assert_eq!(d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(), [("type 1", 1), ("type 2", 2)]);
    assert_eq!(d.meta.cell.unwrap().vectors[2], [0.0, 10.0, 20.0]);
    assert_eq!(read(&*old, 0, &Choice::default()).unwrap().positions, [[10.0, 15.0, 10.0]]);
}

#[test]
fn broken_files_are_refused() {
    let cut = fault(&FOUR.as_bytes()[..FOUR.len() - 6]);
    assert!(cut.contains("it states 3 atoms, but only 2 lines follow"), "{cut}");
    let many = fault(FOUR.replace("1 2\n", "1 99999999999\n").as_bytes());
    assert!(many.contains("it states 100000000000 atoms, but only 3"), "{many}");
    let odd = fault(FOUR.replace("0.1 0.2", "0.1 y").as_bytes());
    assert!(odd.contains("line 9: `y` is not a number"), "{odd}");
    assert!(fault(FOUR.replace("2.0\n", "0\n").as_bytes()).contains("the scale is invalid"));
}
