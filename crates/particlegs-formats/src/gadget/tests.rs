//! Small snapshots made here: formats, byte orders, several files, masses.

use super::*;
use crate::{Choice, Weights};
use std::path::Path;

fn record(out: &mut Vec<u8>, data: &[u8]) {
    let mark = (data.len() as u32).to_le_bytes();
    out.extend(mark);
    out.extend(data);
    out.extend(mark);
}

fn block(out: &mut Vec<u8>, name: Option<&[u8; 4]>, data: &[u8]) {
    if let Some(name) = name {
        let mut label = name.to_vec();
        label.extend((data.len() as u32 + 8).to_le_bytes());
        record(out, &label);
    }
    record(out, data);
}

fn floats(n: std::ops::Range<u32>) -> Vec<u8> {
    n.flat_map(|v| (v as f32).to_le_bytes()).collect()
}

/// Two gas particles with masses of their own and three of dark matter with one in the table.
fn file(named: bool, files: u32, total: [u32; 6]) -> Vec<u8> {
    let mut out = Vec::new();
    let name = |n: &'static [u8; 4]| named.then_some(n);
    let header = header::sample([2, 3, 0, 0, 0, 0], [0.0, 0.5, 0.0, 0.0, 0.0, 0.0], files, total);
    block(&mut out, name(b"HEAD"), &header);
    block(&mut out, name(b"POS "), &floats(0..15));
    block(&mut out, name(b"VEL "), &floats(100..115));
    block(&mut out, name(b"ID  "), &[0; 20]);
    block(&mut out, name(b"MASS"), &floats(7..9));
    block(&mut out, name(b"U   "), &floats(20..22));
    out
}

fn open(paths: &[PathBuf]) -> Result<Box<dyn Snapshot>> {
    Choice::default().open(paths)
}

fn rows(snapshot: &dyn Snapshot, species: usize, choice: &Choice) -> Vec<[f64; 4]> {
    crate::testing::rows(snapshot, species, choice).unwrap()
}

fn written(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn both_formats_give_types_and_masses() {
    let folder = tempfile::tempdir().unwrap();
    for named in [false, true] {
        let path = written(folder.path(), "snap", &file(named, 1, [2, 3, 0, 0, 0, 0]));
        let snapshot = open(&[path]).unwrap();
        let d = snapshot.description();
        assert!(d.format.starts_with("Gadget binary"));
        assert_eq!(d.species.iter().map(|s| s.count).collect::<Vec<_>>(), [2, 3]);
        assert_eq!(d.species[0].mass, SpeciesMass::Field("MASS".into()));
        assert_eq!(d.species[1].mass, SpeciesMass::Each(0.5));
        assert_eq!(d.meta.cell.unwrap().lengths(), Some([25.0; 3]));
        let names = |s: &Species| s.fields.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&d.species[0]), ["POS", "VEL", "ID", "MASS", "U"]);
        assert_eq!(names(&d.species[1]), ["POS", "VEL", "ID"]);
        let auto = Choice::default();
        assert_eq!(rows(&*snapshot, 0, &auto), [[0.0, 1.0, 2.0, 7.0], [3.0, 4.0, 5.0, 8.0]]);
        assert_eq!(rows(&*snapshot, 1, &auto)[0], [6.0, 7.0, 8.0, 0.0]);
        let other =
            Choice { positions: Some("VEL".into()), weights: Weights::Field("MASS".into()), ..Choice::default() };
        assert_eq!(rows(&*snapshot, 0, &other)[1], [103.0, 104.0, 105.0, 8.0]);
        assert!(snapshot.reader(1, &auto).unwrap().in_place().is_some());
        assert_eq!(snapshot.reader(1, &auto).unwrap().meta().particle_mass, Some(0.5));
    }
}

#[test]
fn files_are_found_and_missing_ones_named() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = file(true, 2, [4, 6, 0, 0, 0, 0]);
    let first = written(folder.path(), "s.0", &bytes);
    let error = open(std::slice::from_ref(&first)).err().unwrap().to_string();
    assert!(error.contains("s.1") && error.contains("missing"), "{error}");
    let second = written(folder.path(), "s.1", &bytes);
    for paths in [vec![first.clone()], vec![second.clone()], vec![second.clone(), first.clone()]] {
        let snapshot = open(&paths).unwrap();
        assert_eq!(snapshot.description().species[0].count, 4);
        assert_eq!(rows(&*snapshot, 0, &Choice::default())[2], [0.0, 1.0, 2.0, 7.0]);
    }
    let alien = written(folder.path(), "t.0", &bytes);
    assert!(open(&[first, alien]).is_err());
    let unnumbered = written(folder.path(), "s", &bytes);
    let strict = |path: &PathBuf| Choice { strict: true, ..Choice::default() }.open(std::slice::from_ref(path));
    assert!(strict(&unnumbered).err().unwrap().to_string().contains("no number"));
    let alone = open(&[unnumbered]).unwrap();
    assert_eq!(alone.description().species[0].count, 2);
    let said = |text: &str| alone.description().notes.iter().any(|n| n.contains(text));
    assert!(said("the snapshot has 2 files") && said("says 4 particles of type 0 in total, but the files have 2"));
}

#[test]
fn contradictions_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let fault = |bytes: &[u8]| open(&[written(folder.path(), "s", bytes)]).err().unwrap().to_string();
    let good = file(false, 1, [2, 3, 0, 0, 0, 0]);
    let mut counts = good.clone();
    counts[8..12].copy_from_slice(&4_000_000_000u32.to_le_bytes());
    assert!(fault(&counts).contains("block POS"));
    for cut in 1..good.len() {
        let _ = open(&[written(folder.path(), "s", &good[..cut])]);
    }
    assert!(fault(&good[..300]).contains("ends at byte 300"));
}

#[test]
fn a_block_above_4_gib_has_a_wrapped_mark() {
    // A sparse file: 400 million particles need 4.8 GB of positions.
    let n: u32 = 400_000_000;
    let length = 12 * u64::from(n);
    let mut head = Vec::new();
    block(&mut head, None, &header::sample([0, n, 0, 0, 0, 0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 1, [0, n, 0, 0, 0, 0]));
    let mark = (length as u32).to_le_bytes();
    head.extend(mark);
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), "big", &head);
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    let at = head.len() as u64 + length;
    use std::os::unix::fs::FileExt;
    file.set_len(at + 4).expect("a temporary folder that takes sparse files");
    file.write_all_at(&mark, at).unwrap();
    file.write_all_at(&5f32.to_le_bytes(), at - 4).unwrap();
    let snapshot = open(&[path]).unwrap();
    assert_eq!(snapshot.description().species[0].count, u64::from(n));
}

/// Blocks of format 1 behind the header, of two gas particles and three of dark matter, all with masses of their own.
fn plain(blocks: &[Vec<u8>]) -> Vec<u8> {
    let mut out = Vec::new();
    block(&mut out, None, &header::sample([2, 3, 0, 0, 0, 0], [0.0; 6], 1, [2, 3, 0, 0, 0, 0]));
    blocks.iter().for_each(|data| block(&mut out, None, data));
    out
}

fn whole(values: [u32; 5]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Blocks that Gadget does not write, wherever they stand, are told from masses by what they hold.
#[test]
fn blocks_of_format_1_are_told_by_length_and_values() {
    let folder = tempfile::tempdir().unwrap();
    let (pos, vel, mass, u) = (floats(0..15), vec![0; 60], floats(1..6), floats(20..22));
    let (id, children, zeros) = (whole([5, 1, 4, 2, 3]), whole([1, 1, 2, 2, 1]), vec![0; 20]);
    // Hashes, and numbers that look like small reals.
    let (hashes, large) = (whole([0xffff_1234, 7, 0x3f80_0000, 99, 1 << 31]), whole([1_000_000_000; 5]));
    let long: Vec<u8> = (0..5u64).flat_map(|v| (v << 40 | 3).to_le_bytes()).collect();
    let double: Vec<u8> = (1..6).flat_map(|v| f64::from(v).to_le_bytes()).collect();
    let cases: [(&[&Vec<u8>], &str); 9] = [
        (&[&pos, &vel, &id, &mass, &u], "POS VEL ID MASS U"),
        (&[&pos, &vel, &id, &children, &zeros, &mass, &u], "POS VEL ID ID2 ID3 MASS U"),
        (&[&vec![0; 48], &pos, &vel, &id, &mass], "- POS VEL ID MASS"),
        (&[&pos, &vel, &hashes, &mass, &u], "POS VEL ID MASS U"),
        (&[&pos, &vel, &large, &children, &mass], "POS VEL ID ID2 MASS"),
        (&[&pos, &vel, &long, &long, &double], "POS VEL ID ID2 MASS"),
        (&[&pos, &id, &mass], "POS ID MASS"),
        (&[&pos, &vel, &mass, &u], "POS VEL MASS U"),
        (&[&pos, &vel, &id, &zeros, &u], "POS VEL ID MASS U"),
    ];
    for (blocks, names) in cases {
        let blocks: Vec<Vec<u8>> = blocks.iter().map(|b| b.to_vec()).collect();
        let part = GadgetFile::open(&written(folder.path(), "s", &plain(&blocks)), &[]).unwrap();
        assert_eq!(part.order.join(" "), names);
    }
    let gizmo = plain(&[pos.clone(), vel.clone(), id.clone(), children.clone(), zeros, mass.clone(), u.clone()]);
    let snapshot = open(&[written(folder.path(), "s", &gizmo)]).unwrap();
    assert_eq!(rows(&*snapshot, 0, &Choice::default())[1], [3.0, 4.0, 5.0, 2.0]);
    assert_eq!(rows(&*snapshot, 1, &Choice::default())[0], [6.0, 7.0, 8.0, 3.0]);
    let notes = &snapshot.description().notes;
    assert!(notes.iter().any(|n| n.contains("POS, VEL, ID, ID2, ID3, MASS, U")), "{notes:?}");
    // What cannot be told is refused, and can be stated.
    let path = written(folder.path(), "s", &plain(&[pos, vel, id, children, mass, u.clone(), u]));
    let stated = |names: &str| {
        let blocks = names.split(',').map(String::from).collect();
        let choice = Choice { blocks, ..Choice::default() };
        let snapshot = choice.open(std::slice::from_ref(&path))?;
        Ok::<_, Error>(rows(&*snapshot, 0, &choice)[1][3])
    };
    assert_eq!(stated("POS,VEL,ID,-,MASS,RHO,U").unwrap(), 2.0);
    for wrong in ["POS,VEL,ID,MASS,-,VEL", "POS,VEL,ID,-,MASS,U,RHO,HSML"] {
        assert!(stated(wrong).is_err(), "{wrong}");
    }
    let refused = plain(&[floats(0..15), floats(0..15), whole([1, 2, 3, 4, 5]), whole([9, 9, 9, 9, 9])]);
    let refused = open(&[written(folder.path(), "s", &refused)]).err().unwrap();
    assert!(refused.to_string().contains("none of the 2 blocks"), "{refused}");
    assert!(refused.hint().to_string().starts_with("`gadget-blocks POS,VEL,ID,-,MASS` names the blocks"));
    let named = written(folder.path(), "s", &file(true, 1, [2, 3, 0, 0, 0, 0]));
    assert!(Choice { blocks: vec!["POS".into()], ..Choice::default() }.open(&[named]).is_err());
}
