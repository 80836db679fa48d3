use crate::testing::{fault, fixture, open_bytes};

const NAMD: &[u8] = include_bytes!("../../tests/fixtures/mdanalysis.dcd");

#[test]
fn frames_cells_and_times_are_read() {
    for (chosen, frame) in [(Some(0), 0), (Some(1), 1), (None, 2)] {
        let snapshot = fixture("fixtures/mdanalysis.dcd", chosen);
        let d = snapshot.description();
        let frames = d.frames.unwrap();
        assert_eq!((frames.count, frames.chosen, frames.step), (3, frame, Some(10 * frame as i64)));
        assert_eq!(d.meta.epoch.time, Some(0.5 * frame as f64));
        assert_eq!(d.meta.units.length_text(), Some("Angstrom"));
    }
    let mut lammps = NAMD.to_vec();
    // The title of the file, behind the first record and its own number of lines.
    lammps[100..106].copy_from_slice(b"LAMMPS");
    let by_lammps = open_bytes("a.dcd", &lammps).unwrap();
    let meta = &by_lammps.description().meta;
    assert_eq!((meta.units.length_text(), meta.epoch.time, meta.epoch.step), (None, None, Some(20)));
    let angles = |name: &str| fixture(name, None).description().meta.cell.unwrap().vectors[1];
    assert_eq!(angles("fixtures/be_cosines.dcd"), [0.0, 25.0, 0.0]);
}

#[test]
fn broken_trajectories_are_refused() {
    let cut = fault(&NAMD[..NAMD.len() - 9]);
    assert!(cut.contains("frame 2 is cut off: it has"), "{cut}");
    let mut many = NAMD.to_vec();
    let atoms = many.windows(4).skip(100).position(|w| w == 50u32.to_le_bytes()).unwrap() + 100;
    many[atoms..atoms + 4].copy_from_slice(&2_000_000_000u32.to_le_bytes());
    assert!(fault(&many).contains("frame 0 is cut off"), "{}", fault(&many));
    let mut fixed = NAMD.to_vec();
    fixed[4 + 4 + 32] = 3;
    assert!(fault(&fixed).contains("does not name the 47 atoms that move"), "{}", fault(&fixed));
    let mut wrong = NAMD.to_vec();
    let last = wrong.len() - 4;
    wrong[last] ^= 1;
    assert!(fault(&wrong).contains("frame 2: the record of 200 bytes"), "{}", fault(&wrong));
}

/// A file as CHARMM writes it: atoms 2 and 4 of 5 move, and later frames hold them alone.
#[test]
fn fixed_atoms_are_those_of_the_first_frame() {
    let record = |content: Vec<u8>| {
        let length = (content.len() as u32).to_le_bytes();
        [&length[..], &content, &length].concat()
    };
    let words = |numbers: &[i32]| record(numbers.iter().flat_map(|n| n.to_le_bytes()).collect());
    let axis = |values: &[f32]| record(values.iter().flat_map(|v| v.to_le_bytes()).collect());
    let mut control = [0i32; 20];
    (control[0], control[2], control[8], control[19]) = (3, 1, 3, 24);
    let numbers = control.iter().flat_map(|n| n.to_le_bytes());
    let head = record(b"CORD".iter().copied().chain(numbers).collect());
    let title = record([&1u32.to_le_bytes()[..], &[b' '; 80]].concat());
    let file = |free: &[i32], later: &[f32]| {
        let frame = |values: &[f32]| [axis(values), axis(values), axis(&vec![7.0; values.len()])].concat();
        [
            head.clone(),
            title.clone(),
            words(&[5]),
            words(free),
            frame(&[0.0, 1.0, 2.0, 3.0, 4.0]),
            frame(later),
            frame(&[-3.0, -4.0]),
        ]
        .concat()
    };
    let whole = file(&[2, 4], &[-1.0, -2.0]);
    for (frame, x) in
        [(0, [0.0, 1.0, 2.0, 3.0, 4.0]), (1, [0.0, -1.0, 2.0, -2.0, 4.0]), (-1, [0.0, -3.0, 2.0, -4.0, 4.0])]
    {
        let path = crate::testing::scratch(&whole);
        let choice = crate::Choice { frame: Some(frame), ..crate::Choice::default() };
        let snapshot = choice.open(&[path.path().into()]).unwrap();
        assert_eq!(crate::testing::vectors(&*snapshot, 0, "pos"), x.map(|x| [x, x, 7.0]), "{frame}");
        assert_eq!(snapshot.description().frames.unwrap().count, 3);
    }
    for (broken, why) in [
        (file(&[2, 6], &[-1.0, -2.0]), "does not name the 2 atoms that move"),
        (file(&[4, 2], &[-1.0, -2.0]), "does not name the 2 atoms that move"),
        (file(&[2], &[-1.0, -2.0]), "does not name the 2 atoms that move"),
        (file(&[2, 4], &[-1.0]), "is cut off: it has"),
        (whole[..whole.len() - 1].to_vec(), "frame 2 is cut off: it has 47 of 48 bytes"),
    ] {
        assert!(fault(&broken).contains(why), "{why}: {}", fault(&broken));
    }
}
