use super::FORMAT;
use crate::testing::{SpeciesParticles, read, scratch};
use crate::{Choice, Description, SpeciesMass, Weights};

fn open(
    text: &str,
    frame: Option<i64>,
    choice: &Choice,
) -> particlegs_core::Result<(Description, Vec<SpeciesParticles>)> {
    let file = scratch(text.as_bytes());
    let options = Choice { frame, ..choice.clone() };
    let snapshot = (FORMAT.open)(&[file.path().to_path_buf()], &options)?;
    let d = snapshot.description().clone();
    let got = (0..d.species.len()).map(|s| read(&*snapshot, s, choice)).collect::<particlegs_core::Result<_>>()?;
    Ok((d, got))
}

fn message(text: &str) -> String {
    match open(text, None, &Choice::default()) {
        Ok(_) => panic!("it was read"),
        Err(e) => e.to_string(),
    }
}

#[test]
fn plain_frames_with_species_by_symbol() {
    let text = "3\nfirst\nH 0 0 0\nO 1 2 3 9\nH 4 5 6\n";
    assert!(message(text).contains("line 4 has 5 columns; expected 4"));
    let text = "3\nfirst\n H 0 0 0\n O 1 2 3\n H 4 5 6\n 1\n\nO 7 8 9\n\n";
    let (d, got) = open(text, Some(0), &Choice::default()).unwrap();
    assert_eq!((d.frames.unwrap().count, d.format), (2, "XYZ".into()));
    assert_eq!(got.iter().map(|g| &g.name[..]).collect::<Vec<_>>(), ["H", "O"]);
    assert_eq!(got[0].positions, [[0.0; 3], [4.0, 5.0, 6.0]]);
    assert_eq!(got[1].positions, [[1.0, 2.0, 3.0]]);
    let (d, got) = open(text, None, &Choice::default()).unwrap();
    assert_eq!((&got[0].name[..], &d.species[0].aliases[..]), ("atoms", &["o".to_string()][..]));
    assert_eq!(got[0].positions, [[7.0, 8.0, 9.0]]);
    assert_eq!(open("1\nno symbols\n1 2 3\n", None, &Choice::default()).unwrap().1[0].positions, [[1.0, 2.0, 3.0]]);
}

#[test]
fn extended_frames_state_cell_and_columns() {
    let text = "2\nLattice=\"2 0 0 0 3 0 1 0 4\" Origin=\"-1 0 1\" Properties=charge:I:1:pos:R:3:velo:R:3:mass:R:1:species:S:1 pbc=\"T F T\" energy=-1 name='a b'\n\
        1 0 0 0 1 1 1 5 Si\n2 1 2 3 4 5 6 7 Si\n";
    let (d, got) = open(text, None, &Choice::default()).unwrap();
    let cell = d.meta.cell.unwrap();
    assert_eq!((cell.origin, cell.periodic), ([-1.0, 0.0, 1.0], [true, false, true]));
    assert_eq!(cell.vectors[2], [1.0, 0.0, 4.0]);
    assert_eq!((&d.species[0].positions[..], &d.species[0].mass), ("pos", &SpeciesMass::Field("mass".into())));
    assert_eq!((&got[0].positions[1], &got[0].weights[..]), (&[1.0, 2.0, 3.0], &[5.0, 7.0][..]));
    let fields =
        Choice { positions: Some("velo".into()), weights: Weights::Field("charge".into()), ..Choice::default() };
    let (_, got) = open(text, None, &fields).unwrap();
    assert_eq!((&got[0].positions[1], &got[0].weights[..]), (&[4.0, 5.0, 6.0], &[1.0, 2.0][..]));
    let slab = open("0\nLattice=\"2 0 0 0 3 0 0 0 0\"\n", None, &Choice::default()).unwrap().0.meta.cell.unwrap();
    assert_eq!(slab.periodic, [true, true, false]);
    let bare = "0\nLattice=\"2 0 0 0 3 0 1 0 4\"\n";
    assert_eq!(open(bare, None, &Choice::default()).unwrap().0.meta.cell.unwrap().periodic, [true; 3]);
}

#[test]
fn unwrapped_positions_are_wrapped() {
    let text = "1\nLattice=\"2 0 0 0 3 0 1 0 4\" Properties=pos:R:3\n9 -7 6\n";
    let (d, got) = open(text, None, &Choice::default()).unwrap();
    // One vector up along z, which is 1 along x; three along x; three down along y.
    assert_eq!(got[0].positions, [[2.0, 2.0, 2.0]]);
    assert!(d.notes.iter().any(|n| n.contains("wrapped into the periodic box")), "{:?}", d.notes);
    let keep = Choice { keep_unwrapped: true, ..Choice::default() };
    assert_eq!(open(text, None, &keep).unwrap().1[0].positions, [[9.0, -7.0, 6.0]]);
}

#[test]
fn arrays_of_the_new_style_and_moments_are_read() {
    let cell = |comment: &str| open(&format!("1\n{comment}\nH 1 2 3\n"), None, &Choice::default()).unwrap().0.meta;
    let tilted = [[2.0, 0.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 4.0]];
    for comment in [
        "Lattice=\"[[2, 0, 0], [1, 3, 0], [0, 0, 4]]\" pbc=\"[T, T, F]\" time=2.5 step=70",
        "Lattice=[[2,0,0],[1,3,0],[0,0,4]] pbc=[T,T,F] Time=2.5 Step=70",
        "Lattice = [[2.0, 0, 0], [1, 3, 0], [0, 0, 4]] pbc = [True, true, FALSE] time = 2.5 timestep = 70",
        "time=2.5 step=70 note=\"a = [1\" Lattice={2 0 0 1 3 0 0 0 4} pbc={T T F}",
        "pbc='1 1 0' step=70 time=2.5e0 Lattice='2 0 0 1 3 0 0 0 4'",
    ] {
        let meta = cell(comment);
        let parsed_cell = meta.cell.unwrap();
        assert_eq!((parsed_cell.vectors, parsed_cell.periodic), (tilted, [true, true, false]), "{comment}");
        assert_eq!((meta.epoch.time, meta.epoch.step), (Some(2.5), Some(70)), "{comment}");
    }
    assert_eq!(cell("Lattice=[2, 3, 4]").cell.unwrap().lengths(), Some([2.0, 3.0, 4.0]));
    assert!(message("1\nLattice=[[1,2,3]\nH 1 2 3\n").contains("`Lattice`"));
}

#[test]
fn the_frame_used_is_reported() {
    let text = "1\n\nH 1 2 3\n1\n\nH 4 5 6\n1\n\nH 7 8 9\n";
    let notes = |frame| open(text, frame, &Choice::default()).unwrap().0.notes.join("; ");
    assert!(notes(None).contains("using frame 2, the last of 3 (0 to 2)"));
    assert!(!notes(Some(1)).contains("using frame"));
}

#[test]
fn faults_are_named() {
    let cases = [
        ("x\n\n", "frame 0, line 1: `x` is not a number of atoms"),
        ("-1\n\n", "`-1` is not a number of atoms"),
        ("2", "ends after the number of atoms"),
        ("2\n\nH 1 2 3\n", "it states 2 atoms, but only 1 lines follow"),
        ("1\n\nH 1 2 x\n", "line 3 column 4 (`pos`): `x` is not a number"),
        ("1\nLattice=\"1 2\"\nH 1 2 3\n", "`Lattice` has 2 numbers, not 9"),
        ("1\nLattice=\"1 0 0 0 inf 0 0 0 1\"\nH 1 2 3\n", "`Lattice`: `inf` is not finite"),
        ("1\nProperties=pos:R\nH 1 2 3\n", "not a list of name:kind:columns"),
        ("1\nProperties=pos:R:4000000000\nH 1 2 3\n", "is not a number of columns"),
        ("1\nProperties=pos:Q:3\nH 1 2 3\n", "kind `Q` is not"),
        ("1\npbc=\"T T\"\nH 1 2 3\n", "`pbc` has 2 values"),
        ("1\nProperties=species:S:1:velo:R:3\nH 1 2 3\n", "no columns are named as positions"),
        ("1\n\nH 1 2 3\nH 4 5 6\n", "frame 1, line 4: `H 4 5 6` is not a number of atoms"),
    ];
    for (text, expected) in cases {
        let message = message(text);
        assert!(message.contains(expected), "{message}");
    }
}
