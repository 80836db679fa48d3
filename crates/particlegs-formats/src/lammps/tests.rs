use super::FORMAT;
use crate::testing::{SpeciesParticles, gzip, read, scratch, written};
use crate::{Choice, Snapshot, SpeciesMass, Weights};
use particlegs_core::model::Units;
use particlegs_core::space::Cell;
use particlegs_particles::{Column, Particles};

const HEAD: &str = "ITEM: TIMESTEP\n7\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp ff ps\n-1 9\n0 10\n0 10\n";

fn open(text: &str) -> particlegs_core::Result<Box<dyn Snapshot>> {
    open_frame(text, None)
}

fn open_frame(text: &str, frame: Option<i64>) -> particlegs_core::Result<Box<dyn Snapshot>> {
    let file = scratch(text.as_bytes());
    (FORMAT.open)(&[file.path().to_path_buf()], &Choice { frame, ..Choice::default() })
}

/// Opens and reads species 0 while the file is there.
fn all(text: &str, choice: &Choice) -> particlegs_core::Result<Vec<SpeciesParticles>> {
    let file = scratch(text.as_bytes());
    let snapshot = (FORMAT.open)(&[file.path().to_path_buf()], &Choice::default())?;
    (0..snapshot.description().species.len()).map(|s| read(&*snapshot, s, choice)).collect()
}

fn message(text: &str) -> String {
    match all(text, &Choice::default()) {
        Ok(_) => panic!("it was read"),
        Err(e) => format!("{e} ({})", e.hint()),
    }
}

#[test]
fn a_frame_is_described_and_read() {
    let text = format!(
        "ITEM: UNITS\nreal\nITEM: TIME\n0.25\n{HEAD}ITEM: ATOMS id mass x y z q\n1 2 1 2 3 .1\n2 4 -4e-1 +5 6 0\n"
    );
    let snapshot = open(&text).unwrap();
    let d = snapshot.description();
    assert_eq!((d.meta.units.length_text(), d.meta.epoch.time), (Some("Angstrom"), Some(0.25)));
    // One frame of one needs no number.
    assert_eq!((d.meta.epoch.frame, d.meta.epoch.step), (None, Some(7)));
    assert_eq!(d.meta.units.time.as_ref().unwrap().si.unwrap().factor, 1e-15);
    let cell = d.meta.cell.unwrap();
    assert_eq!((cell.origin, cell.periodic), ([-1.0, 0.0, 0.0], [true, false, false]));
    assert_eq!(cell.lengths(), Some([10.0; 3]));
    let frames = d.frames.unwrap();
    assert_eq!((frames.count, frames.chosen, frames.step), (1, 0, Some(7)));
    assert_eq!((d.species.len(), d.species[0].count, &d.species[0].mass), (1, 2, &SpeciesMass::Field("mass".into())));
    let got = all(&text, &Choice::default()).unwrap();
    assert_eq!(got[0].positions, [[1.0, 2.0, 3.0], [f64::from(-0.4f32), 5.0, 6.0]]);
    assert_eq!(got[0].weights, [2.0, 4.0]);
}

#[test]
fn comments_among_sections_and_atoms_are_passed_over() {
    let atoms = "ITEM: ATOMS id type x y z\n# edited\n1 1 1 2 3\n # moved\n#\n2 2 4 5 6\n# end\n";
    let commented = format!("# by hand\n{}{atoms}", HEAD.replace("ITEM: BOX", "# the box\nITEM: BOX"));
    let got = all(&commented, &Choice::default()).unwrap();
    assert_eq!(got.iter().map(|g| g.positions.clone()).collect::<Vec<_>>(), [[[1.0, 2.0, 3.0]], [[4.0, 5.0, 6.0]]]);
    let head_of = |path: &str, text: &str| {
        crate::format::FileHead::from_bytes(path.as_ref(), 9, text.as_bytes().to_vec()).unwrap()
    };
    assert!((FORMAT.detect)(&head_of("a.dump", &commented)) && !(FORMAT.detect)(&head_of("a.txt", "# 1\n1 2 3\n")));
    // Without types, in several frames, and in a compressed file.
    let plain = format!("{HEAD}ITEM: ATOMS x y z\n1 2 3\n# c\n4 5 6\n#\n");
    let two = format!("{plain}{}", plain.replace("4 5 6", "7 8 9"));
    assert_eq!(all(&two, &Choice::default()).unwrap()[0].positions, [[1.0, 2.0, 3.0], [7.0, 8.0, 9.0]]);
    assert_eq!(open_frame(&two, None).unwrap().description().frames.unwrap().count, 2);
    let file = scratch(&gzip(two.as_bytes()));
    let snapshot = (FORMAT.open)(&[file.path().to_path_buf()], &Choice::default()).unwrap();
    assert_eq!(read(&*snapshot, 0, &Choice::default()).unwrap().positions, [[1.0, 2.0, 3.0], [7.0, 8.0, 9.0]]);
    // What is missing is still told.
    let short = format!("{HEAD}ITEM: ATOMS x y z\n1 2 3\n# c\n");
    assert!(message(&short).contains("it states 2 atoms, but only 1 lines follow"), "{}", message(&short));
}

#[test]
fn scaled_positions_lie_in_the_cell_and_others_can_be_chosen() {
    let text =
        format!("{HEAD}ITEM: ATOMS xsu ysu zsu xs ys zs xu yu zu q\n0 0 0 .5 .25 1 7 8 9 5\n0 0 0 0 0 0 1 1 1 6\n");
    assert_eq!(all(&text, &Choice::default()).unwrap()[0].positions[0], [4.0, 2.5, 10.0]);
    let fields =
        |name: &str| Choice { positions: Some(name.into()), weights: Weights::Field("q".into()), ..Choice::default() };
    let got = all(&text, &fields("xu,yu,zu")).unwrap();
    assert_eq!((got[0].positions[0], got[0].weights[0]), ([7.0, 8.0, 9.0], 5.0));
    assert_eq!(all(&text, &fields("xsu,ysu,zsu")).unwrap()[0].positions[0], [-1.0, 0.0, 0.0]);
    for wrong in ["xs,ys,zu", "xs,ys", "vx,vy,vz"] {
        assert!(all(&text, &fields(wrong)).is_err(), "{wrong}");
    }
}

/// Positions that left the box are at their images in it, whatever its shape and whatever the columns are called;
/// they are kept on request, without the box.
#[test]
fn unwrapped_positions_are_wrapped_or_kept() {
    let orthogonal = "ITEM: BOX BOUNDS pp pp ff\n-1 9\n0 10\n0 10\n";
    let tilted = "ITEM: BOX BOUNDS xy xz yz pp pp pp\n0 14 4\n0 10 0\n0 10 0\n";
    let slab = "ITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\n";
    let file = |bounds: &str, names: &str, row: &str| {
        format!("ITEM: TIMESTEP\n7\nITEM: NUMBER OF ATOMS\n1\n{bounds}ITEM: ATOMS {names}\n{row}\n")
    };
    let cases = [
        (orthogonal, "xu yu zu", "39.5 -0.5 -70", [-0.5, 9.5, -70.0]),
        (orthogonal, "id xsu ysu zsu", "1 3.25 -2 7", [1.5, 0.0, 70.0]),
        (orthogonal, "x y z", "-41 30 5", [-1.0, 0.0, 5.0]),
        // One vector y up is 4 along x.
        (tilted, "xu yu zu", "25 12 5", [1.0, 2.0, 5.0]),
    ];
    for (bounds, names, row, wrapped) in cases {
        let text = file(bounds, names, row);
        let got = all(&text, &Choice::default()).unwrap();
        assert_eq!(got[0].positions, [wrapped], "{names}");
        let notes = open(&text).unwrap().description().notes.clone();
        assert!(notes.iter().any(|n| n.contains("wrapped into the periodic box")), "{notes:?}");
    }
    let keep = |text: &str| {
        let (file, choice) = (scratch(text.as_bytes()), Choice { keep_unwrapped: true, ..Choice::default() });
        let snapshot = choice.open(&[file.path().to_path_buf()])?;
        Ok::<_, particlegs_core::Error>((snapshot.description().meta.cell, read(&*snapshot, 0, &choice)?.positions))
    };
    assert_eq!(keep(&file(tilted, "xu yu zu", "25 12 5")).unwrap(), (None, vec![[25.0, 12.0, 5.0]]));
    assert!(keep(&file(slab, "xu yu zu", "25 12 5")).is_err());
    // Atoms that stepped out of the box since it was last seen to are as the file has them.
    let near = file(orthogonal, "x y z", "9.25 10 -0.5");
    assert_eq!(all(&near, &Choice::default()).unwrap()[0].positions, [[9.25, 10.0, -0.5]]);
    assert!(open(&near).unwrap().description().notes.is_empty());
}

#[test]
fn tilted_boxes_are_told_from_the_boxes_around_them() {
    let rows = "ITEM: ATOMS xs ys zs\n0 0 0\n1 1 1\n";
    let tilted =
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS xy xz yz pp pp pp\n-2 14 -2\n-1 10 4\n0 5 -1\n";
    let snapshot = open(&format!("{tilted}{rows}")).unwrap();
    let cell = snapshot.description().meta.cell.unwrap();
    // x: -2 + min(0, -2, 4, 2) = -2 is the lowest corner of the box around it, 14 - 4 the highest.
    assert_eq!((cell.origin, cell.vectors), ([0.0, 0.0, 0.0], [[10.0, 0.0, 0.0], [-2.0, 10.0, 0.0], [4.0, -1.0, 5.0]]));
    let general = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS abc origin pp pp pp\n1 2 3 -1\n0 2 3 -2\n0 0 3 -3\n";
    let got = all(&format!("{general}{rows}"), &Choice::default()).unwrap();
    assert_eq!(got[0].positions, [[-1.0, -2.0, -3.0], [0.0, 2.0, 6.0]]);
}

#[test]
fn types_are_species() {
    let text = format!(
        "{}ITEM: ATOMS id type x y z q\n1 10 1 1 1 1\n2 9 2 2 2 2\n3 9 3 3 3 3\n",
        HEAD.replace("\n2\n", "\n3\n")
    );
    let got = all(&text, &Choice { weights: Weights::Field("q".into()), ..Choice::default() }).unwrap();
    assert_eq!(got.iter().map(|g| &g.name[..]).collect::<Vec<_>>(), ["type 9", "type 10"]);
    assert_eq!((&got[0].weights[..], &got[1].weights[..]), (&[2.0, 3.0][..], &[1.0][..]));
    assert!(open(&text).unwrap().description().species[1].aliases.contains(&"10".to_string()));
}

#[test]
fn frames_are_counted_and_the_last_or_a_chosen_one_is_read() {
    let frame =
        |step: u32| format!("{HEAD}ITEM: ATOMS x y z\n{step} 0 0\n1 1 1\n").replace("\n7\n", &format!("\n{step}\n"));
    let text = [frame(5), frame(6), frame(8)].concat();
    let frames = open(&text).unwrap().description().frames.unwrap();
    assert_eq!((frames.count, frames.chosen, frames.step), (3, 2, Some(8)));
    let frames = open_frame(&text, Some(1)).unwrap().description().frames.unwrap();
    assert_eq!((frames.count, frames.chosen, frames.step), (3, 1, Some(6)));
    assert!(open_frame(&text, Some(3)).is_err());
    let cut = &text[..text.len() - 7];
    let said = message(cut);
    assert!(said.contains("frame 2 is cut off: it states 2 atoms, but only 1 lines follow ("), "{said}");
    assert!(said.contains("frame 1` reads the last whole frame"), "{said}");
    let earlier = open_frame(cut, Some(1)).unwrap();
    assert!(earlier.description().notes[0].contains("frame 2 cannot be read"));
}

#[test]
fn faults_are_named() {
    let cases = [
        ("ITEM: ATOMS x y z\n1 2\n1 2 3\n", "line 10 has 2 columns; expected 3"),
        ("ITEM: ATOMS x y z\n1 2 3 4\n1 2 3\n", "line 10 has 4 columns; expected 3"),
        ("ITEM: ATOMS x y z\n1 2 3\n1 abc 3\n", "line 11 column 2 (`y`): `abc` is not a number"),
        ("ITEM: ATOMS x y z\n1 2 3\n", "frame 0 is cut off: it states 2 atoms, but only 1 lines follow"),
        ("ITEM: ATOMS x y z\n1 2 3\n1 2 3\n1 2 3\n", "line 12 is `1 2 3`, but frame 0 states only 2 atoms"),
        ("ITEM: ATOMS\n1\n2\n", "lists no columns"),
        ("ITEM: ATOMS vx vy vz\n1 2 3\n1 2 3\n", "no columns are named as positions"),
        ("ITEM: GRID\n", "unexpected section"),
    ];
    for (text, expected) in cases {
        let message = message(&format!("{HEAD}{text}"));
        assert!(message.contains(expected), "{message}");
    }
    let rest = "ITEM: ATOMS x y z\n1 2 3\n1 2 3\n";
    for (from, to) in [("-1 9", "9 -1"), ("-1 9", "nan 9"), ("-1 9", "1"), ("\n2\n", "\n-2\n"), ("\n2\n", "\nx\n")] {
        message(&format!("{}{rest}", HEAD.replace(from, to)));
    }
    message(rest);
}

fn particles() -> Particles {
    let n = 70_000usize;
    let value =
        |i: usize, k: u32| f32::from_bits(0x3f80_0000 + (i as u32).wrapping_mul(2_654_435_761 >> k) % 0x0200_0000);
    let column = |k| (0..n).map(|i| if i % 3 == 0 { -value(i, k) } else { value(i, k) * 1e-9 }).collect();
    Particles::from_columns(column(0), column(1), column(2))
}

#[test]
fn what_is_written_reads_back_with_equal_bits() {
    let p = particles();
    let weights = (0..p.len()).map(|i| 0.1 + i as f32).collect();
    let mut p = p.with_weights(Column::owned(weights));
    p.meta.units = Units::new(Some("nm"), None, None);
    let cells = [
        Some(Cell::orthogonal([20.0, 30.0, 40.0])),
        Some(Cell {
            origin: [1.0, 2.0, 3.0],
            vectors: [[80.0, 0.0, 0.0], [20.0, 80.0, 0.0], [-40.0, 10.0, 80.0]],
            periodic: [true, false, true],
        }),
        Some(Cell {
            origin: [1.0, 2.0, 3.0],
            vectors: [[8.0, 1.0, 0.0], [2.0, 8.0, 0.0], [-4.0, 1.0, 8.0]],
            periodic: [false; 3],
        }),
        None,
    ];
    for cell in cells {
        p.meta.cell = cell;
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out.dump");
        written(&p, &out, "lammps");
        let snapshot = (FORMAT.open)(&[out], &Choice::default()).unwrap();
        let meta = &snapshot.description().meta;
        assert_eq!(meta.units.length_text(), Some("nm"));
        assert!(cell.is_none() || meta.cell == cell, "{:?} is not {cell:?}", meta.cell);
        let got = read(&*snapshot, 0, &Choice::default()).unwrap();
        assert!((0..p.len()).all(|i| got.positions[i] == p.position(i)));
        assert_eq!(&got.weights[..], &p.weights().unwrap()[..]);
    }
}

/// Data files.
mod data {
    use crate::testing::{fault, fixture, gzip, open_bytes, read, vectors, written};
    use crate::{Choice, SpeciesMass};
    use particlegs_core::context::Context;
    use particlegs_particles::Storage;

    const FULL: &str = "LAMMPS data file via write_data, version 2 Aug 2023, timestep = 100, units = real\n\n3 atoms\n2 atom types\n\n\
        0 30 xlo xhi\n0 20 ylo yhi\n-5 5 zlo zhi\n3 0 0 xy xz yz\n\nAtom Type Labels\n\n1 C\n2 O\n\nMasses\n\n1 12.011 # C\n2 15.999\n\n\
        Pair Coeffs # lj/cut\n\n1 0.1 3.0\n2 0.1 3.0\n\nAtoms # full\n\n2 1 2 -0.5 4 5 6 0 0 1\n1 1 1 0.5 1 2 3 0 0 0 # a comment\n3 2 2 0.25 7 8 -4 0 0 0\n\n\
        Velocities\n\n1 0.1 0.2 0.3\n3 0.7 0.8 0.9\n2 0.4 0.5 0.6\n\nBonds\n\n1 1 1 2\n";

    #[test]
    fn sections_styles_and_labels_are_read() {
        for content in [FULL.as_bytes().to_vec(), gzip(FULL.as_bytes())] {
            let snapshot = open_bytes("data.lmp", &content).unwrap();
            let d = snapshot.description();
            assert_eq!((d.meta.units.length_text(), d.meta.epoch.step), (Some("Angstrom"), Some(100)));
            let cell = d.meta.cell.unwrap();
            assert_eq!((cell.origin, cell.vectors[1]), ([0.0, 0.0, -5.0], [3.0, 20.0, 0.0]));
            let name_and_mass = |s: usize| (&d.species[s].name[..], &d.species[s].mass);
            assert_eq!(name_and_mass(0), ("type 2", &SpeciesMass::Each(15.999)));
            assert_eq!(name_and_mass(1), ("type 1", &SpeciesMass::Each(12.011)));
            assert!(d.species[0].aliases.contains(&"o".to_string()));
            assert_eq!(read(&*snapshot, 0, &Choice::default()).unwrap().positions, [[4.0, 5.0, 6.0], [7.0, 8.0, -4.0]]);
            let velocity = vectors(&*snapshot, 0, "velocity");
            assert!((velocity[0][1] - 0.5).abs() < 1e-6 && (velocity[1][2] - 0.9).abs() < 1e-6);
            assert_eq!(vectors(&*snapshot, 1, "id,mol,q")[0], [1.0, 1.0, 0.5]);
        }
    }

    #[test]
    fn files_of_other_programs_are_read() {
        let velocity = |name: &str, last: f64| {
            let snapshot = fixture(&format!("fixtures/{name}"), None);
            let all = (0..snapshot.description().species.len()).flat_map(|s| vectors(&*snapshot, s, "velocity"));
            assert!(all.flatten().any(|v| (v - last).abs() < 1e-6), "{name}");
            assert!(snapshot.description().species.iter().all(|s| matches!(s.mass, SpeciesMass::Each(_))), "{name}");
        };
        velocity("ase.data", 13.625);
        velocity("chemfiles.data", 13.625);
        velocity("mdanalysis.data", 0.013_625);
    }

    /// Types with a mass each keep it in a dump.
    #[test]
    fn masses_of_types_are_written_as_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let [from, to] = ["from.data", "to.dump"].map(|name| dir.path().join(name));
        std::fs::write(&from, FULL).unwrap();
        let particles = Choice::default().read(&[from], &Storage::Memory, &Context::SILENT).unwrap();
        written(&particles, &to, "lammps");
        let dump = Choice::default().open(&[to]).unwrap();
        assert_eq!(read(&*dump, 0, &Choice::default()).unwrap().weights, [15.999; 2]);
        assert_eq!(read(&*dump, 1, &Choice::default()).unwrap().weights, [12.011]);
    }

    #[test]
    fn broken_files_are_refused() {
        let cut = fault(FULL.split("3 2 2 0.25").next().unwrap().as_bytes());
        assert!(cut.contains("the header states 3 atoms, but the section `Atoms` has 2"), "{cut}");
        let with = |from: &str, to: &str| fault(FULL.replace(from, to).as_bytes());
        assert!(with("3 atoms", "99999999999 atoms").contains("states 99999999999 atoms"));
        assert!(with("Atoms # full", "Atoms # granular").contains("atoms of style `granular` are not read"));
        assert!(with("4 5 6 0 0 1", "4 x 6 0 0 1").contains("line 28: `x` is not a number"));
        assert!(with("0 30 xlo", "30 0 xlo").contains("the box is inverted"));
        assert!(with("\n3 0.7 0.8 0.9", "\n4 0.7 0.8 0.9").contains("atom 3 has no velocity"));
    }
}
