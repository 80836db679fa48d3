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
    assert!(fault(&fixed).contains("3 atoms are fixed"), "{}", fault(&fixed));
    let mut wrong = NAMD.to_vec();
    let last = wrong.len() - 4;
    wrong[last] ^= 1;
    assert!(fault(&wrong).contains("frame 2: the record of 200 bytes"), "{}", fault(&wrong));
}
