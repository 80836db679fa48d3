use crate::Choice;
use crate::testing::{fault, fixture, gzip, open_bytes, read, vectors};

const TWO: &str = "REMARK made by hand\nCRYST1   20.000   30.000   40.000  90.00  90.00  90.00 P 1           1\n\
MODEL        1\nATOM      1  OW  SOL     1       1.000   2.000   3.000\nTER\nHETATM    2  C1  LIG     2      -4.000   5.000   6.500\nENDMDL\n\
MODEL        2\nATOM      1  OW  SOL     1       1.500   2.000   3.000\nHETATM    2  C1  LIG     2      -4.000   5.000   7.500\nENDMDL\nEND\n";

#[test]
fn models_are_frames_and_elements_or_residues_species() {
    let snapshot = fixture("fixtures/mdanalysis.pdb", Some(1));
    let d = snapshot.description();
    assert_eq!((d.frames.unwrap().count, d.meta.units.length_text()), (2, Some("Angstrom")));
    let kinds: Vec<_> = d.species.iter().map(|s| (&s.name[..], s.count)).collect();
    assert_eq!(kinds, [("O", 20), ("H", 20), ("NA", 10)]);
    assert_eq!(vectors(&*snapshot, 2, "id,id,id")[0], [41.0; 3]);
    for content in [TWO.as_bytes().to_vec(), gzip(TWO.as_bytes())] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("two.pdb");
        std::fs::write(&path, content).unwrap();
        for (frame, z) in [(Some(0), 6.5), (None, 7.5)] {
            let snapshot = Choice { frame, ..Choice::default() }.open(std::slice::from_ref(&path)).unwrap();
            let d = snapshot.description();
            assert_eq!(d.meta.cell.unwrap().lengths(), Some([20.0, 30.0, 40.0]));
            assert_eq!(d.species.iter().map(|s| &s.name[..]).collect::<Vec<_>>(), ["water", "LIG"]);
            assert_eq!(read(&*snapshot, 1, &Choice::default()).unwrap().positions, [[-4.0, 5.0, z]]);
        }
    }
    let none =
        open_bytes("a.pdb", TWO.replace("20.000   30.000   40.000", " 1.000    1.000    1.000").as_bytes()).unwrap();
    assert!(none.description().meta.cell.is_none());
}

#[test]
fn broken_files_are_refused() {
    let odd = fault(TWO.replace("20.000   30.000", "20.000   3x.000").as_bytes());
    assert!(odd.contains("line 2: CRYST1: `3x.000` is not a number"), "{odd}");
    let odd = fault(TWO.replace("   7.500", "        ").as_bytes());
    assert!(odd.contains("line 10 column 7 (`z`)"), "{odd}");
    let none = fault(b"HEADER    X\nREMARK nothing\nEND\n");
    assert!(none.contains("the file has no frames"), "{none}");
}
