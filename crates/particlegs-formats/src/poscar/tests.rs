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

const TWO: &str = "a run\n1.0\n10 0 0\n0 10 0\n0 0 10\nO H\n1 1\nDirect configuration= 1\n0.5 0.5 0.5\n0.1 0.2 0.3\n\
                   Direct configuration= 11\n0.6 0.5 0.5\n0.2 0.2 0.3\n";

#[test]
fn frames_of_trajectories_share_a_head_or_have_their_own() {
    let x = |text: &str, frame: i64| {
        let file = crate::testing::scratch(text.as_bytes());
        let choice = Choice { frame: Some(frame), ..Choice::default() };
        let snapshot = choice.open(&[file.path().into()]).unwrap();
        let frames = snapshot.description().frames.unwrap();
        (vectors(&*snapshot, 0, "pos")[0][0], frames.count, frames.step)
    };
    assert_eq!((x(TWO, 0), x(TWO, 1), x(TWO, -2)), ((5.0, 2, Some(1)), (6.0, 2, Some(11)), (5.0, 2, Some(1))));
    // Of changing cells each frame has all that stands before the positions.
    let changing = format!("{TWO}{}", TWO.replace("1.0\n", "2.0\n"));
    assert_eq!(
        (x(&changing, 2), x(&changing, -1), x(&changing, 1)),
        ((10.0, 4, Some(1)), (12.0, 4, Some(11)), (6.0, 4, Some(11)))
    );
    assert_eq!(x(&format!("{TWO}\n"), -1).1, 2);
    assert!(fault(&TWO.as_bytes()[..TWO.len() - 12]).contains("it states 2 atoms, but only 1 lines follow"));
    assert!(
        fault(format!("{TWO}a\n1\n1 0 0\n0 1 0\n0 0 1\nO\n1\nKartesian\n").as_bytes())
            .contains("`Kartesian` is not the beginning of a frame")
    );
}
