use crate::SpeciesMass;
use crate::testing::{fault, fixture, vectors};

/// pynbody wrote it.
#[test]
fn three_kinds_with_their_fields() {
    let snapshot = fixture("fixtures/standard.tipsy", None);
    let d = snapshot.description();
    assert_eq!(d.format, "Tipsy snapshot, standard (big-endian)");
    let kinds: Vec<_> = d.species.iter().map(|s| (&s.name[..], s.count)).collect();
    assert_eq!(kinds, [("gas", 20), ("dm", 20), ("stars", 10)]);
    assert_eq!((d.meta.epoch.time, &d.species[1].mass), (Some(0.5), &SpeciesMass::Field("mass".into())));
    assert!(d.species[1].aliases.contains(&"dm".to_string()));
    assert_eq!(vectors(&*snapshot, 0, "temp,rho,mass")[19], [10_019.0, 19.0, 1.0]);
    assert_eq!(vectors(&*snapshot, 2, "tform,tform,mass")[9], [9.0, 9.0, 1.0]);
    assert_eq!(vectors(&*snapshot, 2, "vel")[9], [147.0, 148.0, 149.0].map(|v| v / 8.0 - 5.0));
}

#[test]
fn counts_that_do_not_fit_are_refused() {
    let good = include_bytes!("../../tests/fixtures/standard.tipsy");
    let cut = fault(&good[..good.len() - 4]);
    assert!(cut.contains("format is unknown"), "{cut}");
    let file = crate::testing::scratch(&good[..good.len() - 8]);
    let choice = crate::Choice { format: Some("tipsy".into()), ..crate::Choice::default() };
    let error = choice.open(&[file.path().to_path_buf()]).err().unwrap().to_string();
    assert!(error.contains("do not fit each other or the file's length"), "{error}");
}
