use crate::SpeciesMass;
use crate::testing::{fault, fixture, vectors};

const GOOD: &[u8] = include_bytes!("../../tests/fixtures/hoomd.gsd");

#[test]
fn frames_take_what_they_lack_from_the_first() {
    for (chosen, frame) in [(Some(0), 0), (None, 2)] {
        let snapshot = fixture("fixtures/hoomd.gsd", chosen);
        let d = snapshot.description();
        let frames = d.frames.unwrap();
        assert_eq!((frames.count, frames.chosen, frames.step), (3, frame, Some(10 * frame as i64)));
        assert_eq!(d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(), [("A", 25), ("B", 25)]);
        assert_eq!(d.species[1].mass, SpeciesMass::Field("mass".into()));
        let cell = d.meta.cell.unwrap();
        assert_eq!((cell.origin, cell.periodic), ([-18.75, -12.5, -12.5], [true; 3]));
        assert_eq!(vectors(&*snapshot, 1, "velocity")[0], [3.0, 4.0, 5.0].map(|v| v / 8.0 - 5.0));
        assert!((vectors(&*snapshot, 0, "position")[0][0] - 2.259_993 - 0.25 * frame as f64).abs() < 1e-5);
    }
}

#[test]
fn broken_trajectories_are_refused() {
    let with = |at: usize, value: u64| {
        let mut bytes = GOOD.to_vec();
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        fault(&bytes)
    };
    assert!(with(16, u64::MAX).contains("its index of 18446744073709551615 entries lies beyond the file"));
    assert!(with(32, 1 << 60).contains("list of names"));
    assert!(fault(&GOOD[..300]).contains("lies beyond the file"));
    let index = u64::from_le_bytes(GOOD[8..16].try_into().unwrap()) as usize;
    let position = (0..20)
        .rev()
        .map(|i| index + 32 * i)
        .find(|&at| u64::from_le_bytes(GOOD[at + 8..at + 16].try_into().unwrap()) == 50 && GOOD[at + 24] == 3);
    let at = position.unwrap();
    let seen = with(at + 8, 1 << 50);
    assert!(seen.contains("frame 2: particles/position: its 1125899906842624 rows of 3 numbers"), "{seen}");
    assert!(with(index, 1 << 40).contains("entries for"), "{}", with(index, 1 << 40));
}
