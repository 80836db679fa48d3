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

#[test]
fn each_model_has_its_cell_wherever_that_stands() {
    let cell = |a: u32| format!("CRYST1{a:>9}   30.000   40.000  90.00  90.00  90.00 P 1           1\n");
    let atom = "ATOM      1  OW  SOL     1       1.000   2.000   3.000\n";
    let model = |n: u32, inside: &str| format!("MODEL        {n}\n{atom}{inside}ENDMDL\n");
    let [a, b, c] = [20, 21, 22].map(cell);
    let [one, two, three] = [1, 2, 3].map(|n| model(n, ""));
    let files = [
        // Behind each model, the last one behind all, before each, within each, one for all.
        (format!("{one}{a}{two}{b}{three}{c}END\n"), [Some(20.0), Some(21.0), Some(22.0)]),
        (format!("{one}{two}{three}{c}END\n"), [Some(22.0); 3]),
        (format!("{a}{one}{b}{two}{c}{three}END\n"), [Some(20.0), Some(21.0), Some(22.0)]),
        (format!("TITLE x\n{a}{one}TITLE y\n{b}{two}TITLE z\n{c}{three}"), [Some(20.0), Some(21.0), Some(22.0)]),
        ([(1, &a), (2, &b), (3, &c)].map(|(n, cell)| model(n, cell)).concat(), [Some(20.0), Some(21.0), Some(22.0)]),
        (format!("{a}{one}{two}{three}"), [Some(20.0); 3]),
        // None of the first model: nothing stands behind the last.
        (format!("{one}{b}{two}{c}{three}END\n"), [None, Some(21.0), Some(22.0)]),
        (format!("{a}{atom}{b}{atom}{c}{atom}END\n"), [Some(20.0), Some(21.0), Some(22.0)]),
    ];
    for (text, cells) in files {
        let file = crate::testing::scratch(text.as_bytes());
        for (frame, cell) in cells.into_iter().enumerate() {
            for frame in [frame as i64, frame as i64 - 3] {
                let snapshot = Choice { frame: Some(frame), ..Choice::default() }.open(&[file.path().into()]).unwrap();
                let length = snapshot.description().meta.cell.and_then(|c| c.lengths()).map(|l| l[0]);
                assert_eq!(length, cell, "frame {frame} of\n{text}");
            }
        }
    }
}
