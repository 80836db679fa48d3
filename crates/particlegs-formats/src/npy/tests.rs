use crate::testing::{open_bytes, rows};
use crate::{Choice, Weights};

pub(crate) fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let fortran = if fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(data);
    out
}

fn le<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(values).to_vec()
}

const TWO: [[f64; 4]; 2] = [[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]];

#[test]
fn every_layout() {
    let one_each = [1f32, 2., 3., 4., 5., 6.];
    let columns = [1f32, 4., 2., 5., 3., 6.];
    let big: Vec<u8> = [1f64, 4., 2., 5., 3., 6.].iter().flat_map(|v| v.to_be_bytes()).collect();
    let cases = [
        (npy("'<f4'", false, "(2, 3)", &le(&one_each)), true),
        (npy("'<f4'", true, "(2, 3)", &le(&columns)), true),
        (npy("'<f4'", false, "(3, 2)", &le(&columns)), true),
        (npy("'<f4'", true, "(3, 2)", &le(&one_each)), true),
        (npy("'<f4'", false, "(1, 2, 3)", &le(&one_each)), true),
        (npy("'>f8'", true, "(2, 3)", &big), false),
        (npy("'<i2'", false, "(2, 3)", &le(&[1i16, 2, 3, 4, 5, 6])), false),
        (npy("'<f2'", false, "(2, 3)", &le(&[0x3c00u16, 0x4000, 0x4200, 0x4400, 0x4500, 0x4600])), false),
    ];
    for (bytes, in_place) in cases {
        let snapshot = open_bytes("a.bin", &bytes).unwrap();
        assert_eq!(rows(&*snapshot, 0, &Choice::default()).unwrap(), TWO);
        assert_eq!(snapshot.reader(0, &Choice::default()).unwrap().in_place().is_some(), in_place);
    }
}

#[test]
fn records_and_tables() {
    let data = le(&[1f32, 2., 3., 0.5, 4., 5., 6., 0.25]);
    let xyz = npy("[('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('Mass', '<f4')]", false, "(2,)", &data);
    let pos = npy("[('pos', '<f4', (3,)), ('mass', '<f4')]", false, "(2,)", &data);
    let weighted = vec![[1.0, 2.0, 3.0, 0.5], [4.0, 5.0, 6.0, 0.25]];
    for bytes in [xyz, pos] {
        let snapshot = open_bytes("a.npy", &bytes).unwrap();
        assert_eq!(rows(&*snapshot, 0, &Choice::default()).unwrap(), weighted);
        let none = Choice { weights: Weights::None, ..Choice::default() };
        assert_eq!(rows(&*snapshot, 0, &none).unwrap(), TWO);
    }
    let many: Vec<f32> = (0..70 * 4).map(|v| v as f32).collect();
    let snapshot = open_bytes("a.npy", &npy("'<f4'", false, "(70, 4)", &le(&many))).unwrap();
    assert_eq!(rows(&*snapshot, 0, &Choice::default()).unwrap()[1], [4.0, 5.0, 6.0, 0.0]);
    let chosen = Choice { positions: Some("1,2,3".into()), weights: Weights::Field("0".into()), ..Choice::default() };
    assert_eq!(rows(&*snapshot, 0, &chosen).unwrap()[1], [5.0, 6.0, 7.0, 4.0]);
    assert!(snapshot.description().notes[0].contains("4 columns"));
}

#[test]
fn doubles_far_away_keep_their_precision() {
    let at = [1e12 + 0.25, 0.0, 0.0, 1e12 + 0.5, 1.0, 1.0];
    let snapshot = open_bytes("a.npy", &npy("'<f8'", false, "(2, 3)", &le(&at))).unwrap();
    let seen = rows(&*snapshot, 0, &Choice::default()).unwrap();
    assert_eq!(seen[1][0] - seen[0][0], 0.25);
}

#[test]
fn what_holds_no_positions_is_refused_in_words() {
    let zeros = [0u8; 96];
    let cases = [
        (npy("'<c8'", false, "(4, 3)", &zeros), "complex64"),
        (npy("'|O'", false, "(4, 3)", &zeros), "pickle"),
        (npy("'<f4'", false, "(24,)", &zeros), "shape"),
        (npy("'<f4'", false, "(2, 3, 4)", &zeros), "shape"),
        (npy("'<f4'", false, "(0, 3)", &[]), "no particles"),
        (npy("'<f4'", false, "(9, 3)", &zeros), "but the data have"),
        (npy("'<f4'", false, "(7, 3)", &zeros), "but the data have"),
        (npy("[('a', '<f4'), ('b', '<f4')]", false, "(12,)", &zeros), "no x, y and z"),
    ];
    for (bytes, words) in cases {
        let error = open_bytes("a.npy", &bytes).err().unwrap().to_string();
        assert!(error.contains(words), "{error}");
    }
}
