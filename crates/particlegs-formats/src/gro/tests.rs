use crate::testing::{gzip, open_bytes, read, scratch};
use crate::{Choice, Snapshot};
use std::path::Path;
use tempfile::NamedTempFile;

const WATER: &str = "Water t= 2.5 step= 5\n    3\n    1SOL     OW    1   0.126   1.624   1.679  0.1227 -0.0580  0.0434\n\
    \u{20}   1SOL    HW1    2   0.190   1.661   1.747  0.8085  0.3191 -0.7791\n\
    \u{20}   2NA      NA    3   0.177   1.568   1.613 -0.9045 -2.6469  1.3180\n   1.86206   1.86206   1.86206\n";

/// With the file, which is read later.
fn open(text: &str, frame: Option<i64>) -> particlegs_core::Result<(NamedTempFile, Box<dyn Snapshot>)> {
    let file = scratch(text.as_bytes());
    let snapshot = Choice { frame, ..Choice::default() }.open(&[file.path().to_path_buf()])?;
    Ok((file, snapshot))
}

fn message(text: &str) -> String {
    open(text, None).err().map_or("it was read".into(), |e| e.to_string())
}

#[test]
fn residues_are_species_with_velocities_and_numbers() {
    let (_file, snapshot) = open(WATER, None).unwrap();
    let d = snapshot.description();
    assert_eq!((d.meta.epoch.time, d.meta.epoch.step), (Some(2.5), Some(5)));
    assert_eq!(d.meta.units.length_text(), Some("nm"));
    assert_eq!(d.meta.cell.unwrap().lengths(), Some([1.86206; 3]));
    assert_eq!(d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(), [("water", 2), ("NA", 1)]);
    let values_of = |species, name: &str| {
        let choice = Choice { positions: Some(name.into()), ..Choice::default() };
        read(&*snapshot, species, &choice).unwrap().positions
    };
    assert_eq!(values_of(0, "pos")[1].map(|v| (v * 1e3).round()), [190.0, 1661.0, 1747.0]);
    assert_eq!(values_of(1, "velocity")[0].map(|v| (v * 1e4).round()), [-9045.0, -26469.0, 13180.0]);
    assert_eq!(values_of(1, "id,id,id")[0], [3.0; 3]);
}

#[test]
fn residues_of_proteins_are_one_species() {
    let names = ["ALA", "NALA", "CGLY", "HISB", "SOL", "NA", "CLA", "POPC"]
        .map(|name| crate::residues::substance(name.as_bytes()));
    let wanted = ["protein", "protein", "protein", "protein", "water", "NA", "CLA", "POPC"].map(str::as_bytes);
    assert_eq!(names, wanted);
}

/// MDAnalysis wrote it: three decimals, a cell with angles of 60, 60 and 90 degrees.
#[test]
fn triclinic_cells_are_read_as_written() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/mdanalysis.gro");
    let snapshot = Choice::default().open(&[path]).unwrap();
    let vectors = snapshot.description().meta.cell.unwrap().vectors;
    assert_eq!(vectors, [[25.0, 0.0, 0.0], [0.0, 25.0, 0.0], [12.5, 12.5, 17.67767]]);
    let velocity = Choice { positions: Some("velocity".into()), ..Choice::default() };
    assert_eq!(read(&*snapshot, 1, &velocity).unwrap().positions[9], [13.375, 13.5, 13.625]);
}

#[test]
fn frames_and_compression_are_read() {
    let two = WATER.to_string() + &WATER.replace("t= 2.5", "t= 3.5").replace("0.126", "9.126");
    for (frame, time, x) in [(Some(0), 2.5, 0.126), (None, 3.5, 9.126)] {
        let (_file, snapshot) = open(&two, frame).unwrap();
        assert_eq!(snapshot.description().frames.unwrap().count, 2);
        assert_eq!(snapshot.description().meta.epoch.time, Some(time));
        let keep = Choice { positions: Some("pos[0],id,id".into()), as_stored: true, ..Choice::default() };
        assert!((read(&*snapshot, 0, &keep).unwrap().positions[0][0] - x).abs() < 1e-6);
    }
    let packed = open_bytes("a.gro.gz", &gzip(WATER.as_bytes())).unwrap();
    assert_eq!(packed.description().format, "GROMACS structure (GRO), gzip");
}

#[test]
fn broken_files_are_refused() {
    let cut = &WATER[..WATER.len() - 80];
    assert!(message(cut).contains("frame 0 is cut off: it states 3 atoms"), "{}", message(cut));
    let many = WATER.replacen("    3", "99999999999", 1);
    assert!(message(&many).contains("it states 99999999999 atoms, but only 4 lines follow"), "{}", message(&many));
    let odd = WATER.replace("   1.86206   1.86206   1.86206", "   1.86206   x   1.86206");
    assert!(message(&odd).contains("line 6: the cell: `x` is not a number"), "{}", message(&odd));
}
