use super::*;
use crate::npy::tests::npy;
use crate::testing::{deflate, open_bytes, rows as read_rows};
use crate::{Choice, Weights};

/// An archive of members, each compressed if its flag says so.
fn npz(members: &[(&str, Vec<u8>, bool)]) -> Vec<u8> {
    let (mut out, mut table) = (Vec::new(), Vec::new());
    for (name, content, compress) in members {
        let (packed, sum) = deflate(content);
        let data = if *compress { packed } else { content.clone() };
        let mut common = vec![20, 0, 0, 0, if *compress { 8 } else { 0 }, 0, 0, 0, 0, 0];
        common.extend(sum.to_le_bytes());
        common.extend((data.len() as u32).to_le_bytes());
        common.extend((content.len() as u32).to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        table.extend(b"PK\x01\x02\x14\x00");
        table.extend(&common);
        table.extend([0; 10]);
        table.extend((out.len() as u32).to_le_bytes());
        table.extend(name.as_bytes());
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(data);
    }
    let (start, length, count) = (out.len() as u32, table.len() as u32, members.len() as u16);
    out.extend(table);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend(count.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend(length.to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0, 0]);
    out
}

fn floats(shape: &str, fortran: bool, values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    npy("'<f4'", fortran, shape, &values.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
}

fn is_counted(rows: &[[f64; 4]]) -> bool {
    rows.iter().enumerate().all(|(i, r)| (0..3).all(|k| r[k] == (3 * i + k) as f64))
}

#[test]
fn stored_and_compressed_members_give_the_same() {
    let n = 70_000usize;
    let shape = format!("({n},)");
    let axis = |k: usize| floats(&shape, false, (0..n).map(move |i| (3 * i + k) as f32));
    let triples = floats(&format!("({n}, 3)"), false, (0..3 * n).map(|v| v as f32));
    let columns = floats(&format!("({n}, 3)"), true, (0..3 * n).map(|v| (v % n * 3 + v / n) as f32));
    let mass = floats(&shape, false, (0..n).map(|i| i as f32));
    for compress in [false, true] {
        for positions in [
            vec![("x.npy", axis(0)), ("y.npy", axis(1)), ("z.npy", axis(2))],
            vec![("Pos.npy", triples.clone())],
            vec![("coordinates.npy", columns.clone())],
        ] {
            let mut members: Vec<_> = positions.into_iter().map(|(name, bytes)| (name, bytes, compress)).collect();
            members.push(("box.npy", npy("'<f8'", false, "()", &25f64.to_le_bytes()), true));
            members.push(("mass.npy", mass.clone(), true));
            let snapshot = open_bytes("a.npz", &npz(&members)).unwrap();
            let rows = read_rows(&*snapshot, 0, &Choice::default()).unwrap();
            assert!(is_counted(&rows) && rows[69_999][3] == 69_999.0);
            let none = Choice { weights: Weights::None, ..Choice::default() };
            assert!(is_counted(&read_rows(&*snapshot, 0, &none).unwrap()));
            assert_eq!(snapshot.description().meta.cell, Some(Cell::orthogonal([25.0; 3])));
        }
    }
}

#[test]
fn a_choice_is_asked_for_where_names_do_not_decide() {
    let six = || floats("(2, 3)", false, (0..6).map(|v| v as f32));
    let snapshot = open_bytes("a.npz", &npz(&[("a.npy", six(), false), ("b.npy", six(), true)])).unwrap();
    let error = snapshot.reader(0, &Choice::default()).err().unwrap();
    assert!(error.hint().to_string().contains("a, b"), "{error}");
    let chosen = Choice { positions: Some("b".into()), ..Choice::default() };
    assert!(is_counted(&read_rows(&*snapshot, 0, &chosen).unwrap()));
}

#[test]
fn broken_archives_are_refused() {
    let six = || floats("(2, 3)", false, (0..6).map(|v| v as f32));
    let refused = |members: &[(&str, Vec<u8>, bool)], words: &str| {
        let error = open_bytes("a.npz", &npz(members)).err().unwrap().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(&[("../../evil.npy", six(), false)], "points outside");
    refused(&[("/etc/evil.npy", six(), false)], "points outside");
    refused(&[("a.txt", b"words".to_vec(), true)], "skipped");
    refused(&[("v.npy", floats("(6,)", false, [0.0; 6]), false)], "no array holds positions");
    let cell = |values: &[f64]| {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        npy("'<f8'", false, &format!("({},)", values.len()), &bytes)
    };
    refused(&[("pos.npy", six(), false), ("box.npy", cell(&[f64::NAN]), false)], "cell");
    refused(&[("pos.npy", six(), false), ("box.npy", cell(&[1.0, -1.0, 1.0]), false)], "volume");
    let mut bytes = npz(&[("pos.npy", floats("(2000, 3)", false, (0..6000).map(|v| v as f32)), true)]);
    bytes[200] ^= 8;
    let snapshot = open_bytes("a.npz", &bytes);
    assert!(snapshot.and_then(|s| read_rows(&*s, 0, &Choice::default())).is_err());
}

#[test]
fn cells_of_every_shape() {
    assert_eq!(cell(&[0.0]).unwrap(), None);
    assert_eq!(cell(&[2.0]).unwrap(), Some(Cell::orthogonal([2.0; 3])));
    let tilted = [2.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 3.0];
    assert_eq!(cell(&tilted).unwrap().unwrap().vectors[1], [1.0, 2.0, 0.0]);
    // Slabs, and vectors in one plane.
    let slab = cell(&[1.0, 2.0, 0.0]).unwrap().unwrap();
    assert_eq!((slab.periodic, slab.lengths()), ([true, true, false], Some([1.0, 2.0, 0.0])));
    let leaning = cell(&[2.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0]).unwrap().unwrap();
    assert_eq!(leaning.periodic, [true, true, false]);
    assert!(cell(&[2.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 3.0]).is_err() && cell(&[1.0, -2.0, 0.0]).is_err());
    assert!(cell(&[1.0, 2.0]).is_err());
}

#[test]
fn large_archives_are_read_by_their_large_fields() {
    let content = floats("(2, 3)", false, (0..6).map(|v| v as f32));
    let small = npz(&[("pos.npy", content.clone(), false)]);
    // The same member behind a table whose numbers stand in the fields of ZIP64.
    let data = 30 + 7 + content.len();
    let mut bytes = small[..data].to_vec();
    let mut entry = small[data..data + 46 + 7].to_vec();
    entry[20..28].fill(0xff);
    entry[42..46].fill(0xff);
    entry[30..32].copy_from_slice(&28u16.to_le_bytes());
    bytes.extend(entry);
    bytes.extend([1, 0, 24, 0]);
    let sizes = [content.len() as u64, content.len() as u64, 0];
    bytes.extend(sizes.iter().flat_map(|v| v.to_le_bytes()));
    let large = bytes.len() as u64;
    bytes.extend(b"PK\x06\x06");
    bytes.extend(44u64.to_le_bytes());
    bytes.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    let table = [1, 1, large - data as u64, data as u64];
    bytes.extend(table.iter().flat_map(|v: &u64| v.to_le_bytes()));
    bytes.extend(b"PK\x06\x07\0\0\0\0");
    bytes.extend(large.to_le_bytes());
    bytes.extend([1, 0, 0, 0]);
    bytes.extend(b"PK\x05\x06");
    bytes.extend([0, 0, 0, 0, 0xff, 0xff, 0xff, 0xff]);
    bytes.extend([0xff; 8]);
    bytes.extend([0, 0]);
    let snapshot = open_bytes("a.npz", &bytes).unwrap();
    assert!(is_counted(&read_rows(&*snapshot, 0, &Choice::default()).unwrap()));
}
