use crate::Choice;
use crate::testing::{fault, fixture, vectors};

const WATER: &[u8] = include_bytes!("../../tests/data/molecules/water.xtc");
const F64: &[u8] = include_bytes!("../../tests/fixtures/f64.trr");

fn water(frame: u64, atom: u64) -> [f64; 3] {
    let molecule = atom / 3;
    let centre = [molecule * 7919 % 3000, molecule * 104_729 % 3000, molecule * 1_299_709 % 3000];
    let offset = [[0, 0, 0], [95, 10, -20], [-30, 80, 55]][atom as usize % 3];
    [0, 1, 2].map(|k| (centre[k] as i64 + offset[k] + 5 * frame as i64) as f64 / 1000.0)
}

/// Positions that another program packed, in any order and in runs of neighbours.
#[test]
fn packed_positions_are_those_that_were_written() {
    for (chosen, frame) in [(Some(0), 0), (None, 1)] {
        let snapshot = fixture("data/molecules/water.xtc", chosen);
        let d = snapshot.description();
        let frames = d.frames.unwrap();
        assert_eq!((frames.count, frames.chosen, d.species[0].count), (2, frame, 300));
        assert_eq!(d.meta.epoch.time, Some(0.5 * frame as f64));
        assert!(d.notes.iter().any(|n| n.contains("rounded to 0.001 nm")), "{:?}", d.notes);
        for (atom, seen) in (0..).zip(vectors(&*snapshot, 0, "pos")) {
            let wanted = water(frame, atom);
            assert!((0..3).all(|k| (seen[k] - wanted[k]).abs() < 1e-6), "{atom}: {seen:?} {wanted:?}");
        }
    }
    let few = fixture("data/molecules/few.xtc", None);
    assert!((vectors(&*few, 0, "pos")[0][0] - 2.259_993).abs() < 1e-5);
}

#[test]
fn velocities_cells_and_times_are_read() {
    for (name, cell) in [("f64.trr", [0.0, 0.0, 25.0]), ("mdanalysis.trr", [12.5, 12.5, 17.677_67])] {
        let snapshot = fixture(&format!("fixtures/{name}"), Some(0));
        let meta = &snapshot.description().meta;
        let last = meta.cell.unwrap().vectors[2];
        assert!((0..3).all(|k| (last[k] - cell[k]).abs() < 1e-5), "{last:?}");
        for (i, seen) in vectors(&*snapshot, 0, "velocity").into_iter().enumerate() {
            let wanted = [0, 1, 2].map(|k| (3 * i + k) as f64 / 8.0 - 5.0);
            assert!((0..3).all(|k| (seen[k] - wanted[k]).abs() < 1e-5), "{name} {i}: {seen:?} {wanted:?}");
        }
    }
    let last = fixture("fixtures/mdanalysis.trr", None);
    let d = last.description();
    assert_eq!((d.frames.unwrap().step, d.meta.epoch.time, d.frames.unwrap().count), (Some(20), Some(1.0), 3));
    assert_eq!((d.meta.units.length_text(), &d.meta.units.time.as_ref().unwrap().text[..]), (Some("nm"), "ps"));
}

#[test]
fn atoms_beyond_a_cell_are_wrapped_or_kept() {
    let mut far = WATER.to_vec();
    // A cell of 0.5 nm, in the last frame.
    let frame = far.len() / 2;
    for vector in 0..3 {
        far[frame + 16 + 16 * vector..][..4].copy_from_slice(&0.5f32.to_be_bytes());
    }
    let file = crate::testing::scratch(&far);
    for keep_unwrapped in [false, true] {
        let choice = Choice { keep_unwrapped, ..Choice::default() };
        let snapshot = choice.open(&[file.path().to_path_buf()]).unwrap();
        assert_eq!(snapshot.description().meta.cell.is_none(), keep_unwrapped);
        let wraps = vectors(&*snapshot, 0, "pos").iter().flatten().all(|&v| v <= 0.500_001);
        assert_eq!(wraps, !keep_unwrapped);
    }
}

#[test]
fn broken_trajectories_are_refused() {
    let cut = fault(&WATER[..WATER.len() - 9]);
    assert!(cut.contains("frame 1, at byte 1124: it needs"), "{cut}");
    let with = |bytes: &[u8], at: usize, value: u32| {
        let mut bytes = bytes.to_vec();
        bytes[at..at + 4].copy_from_slice(&value.to_be_bytes());
        fault(&bytes)
    };
    let frame = WATER.len() / 2;
    assert!(with(WATER, frame, 7).contains("does not begin as a frame does"));
    assert!(with(WATER, frame + 4, 301).contains("301 atoms and 300"));
    assert!(with(WATER, frame + 56, 0).contains("the precision 0 is invalid"));
    assert!(with(WATER, frame + 60, 0x7000_0000).contains("coordinates range from 1879048192"));
    assert!(with(WATER, frame + 84, 80).contains("no small size 80"));
    let few = [&WATER[frame..frame + 88], &8u32.to_be_bytes(), &[0; 8]].concat();
    assert!(fault(&few).contains("8 bytes cannot hold 300 atoms"), "{}", fault(&few));
    assert!(with(F64, 4 + 4 + 4 + 12 + 28, 50).contains("do not fit arrays"));
    assert!(fault(&F64[..F64.len() - 1]).contains("it needs 2564 bytes, but 2563 are left"));
    assert!(fault(&crate::testing::gzip(WATER)).contains("compressed with gzip"));
}
