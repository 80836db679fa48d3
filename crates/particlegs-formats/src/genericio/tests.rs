//! Small files made here: both byte orders, ranks, checksums, boxes, split snapshots.

use super::*;
use crate::codecs::crc64;
use crate::{Choice, Weights};

struct FileBuilder {
    big_endian: bool,
    bytes: Vec<u8>,
}

impl FileBuilder {
    fn int(&mut self, v: u64) {
        self.bytes.extend(if self.big_endian { v.to_be_bytes() } else { v.to_le_bytes() });
    }

    fn variable(&mut self, name: &str, flags: u64) {
        self.bytes.extend(name.as_bytes());
        self.bytes.resize(self.bytes.len() + 256 - name.len(), 0);
        [flags, 4].iter().for_each(|&v| self.int(v));
    }

    fn sum(&mut self, from: usize) {
        let sum = !crc64(&self.bytes[from..]);
        self.bytes.extend(sum.to_le_bytes());
    }
}

/// Columns by rank; `i32` where a name begins with `$`, else `f32`.
fn file(big_endian: bool, names: &[&str], ranks: &[Vec<Vec<f32>>]) -> Vec<u8> {
    let mut m = FileBuilder { big_endian, bytes: if big_endian { b"HACC01B\0" } else { b"HACC01L\0" }.to_vec() };
    let (nv, nr) = (names.len() as u64, ranks.len() as u64);
    let counts: Vec<u64> = ranks.iter().map(|r| r[0].len() as u64).collect();
    let size = 168 + 272 * nv + 48 * nr;
    [size, counts.iter().sum(), nr, 1, 1, nv, 272, 168, nr, 48, 168 + 272 * nv, 168].iter().for_each(|&v| m.int(v));
    [1.0f64, 2.0, 3.0, 10.0, 20.0, 30.0].iter().for_each(|v| m.int(v.to_bits()));
    [0, 0].iter().for_each(|&v| m.int(v));
    for name in names {
        m.variable(name, if name.starts_with('$') { 2 } else { 3 });
    }
    let mut start = size + 8;
    for (r, n) in counts.iter().enumerate() {
        [r as u64, 0, 0, *n, start, r as u64].iter().for_each(|&v| m.int(v));
        start += nv * (4 * n + 8);
    }
    m.sum(0);
    for (name, column) in ranks.iter().flat_map(|r| names.iter().zip(r)) {
        let from = m.bytes.len();
        for v in column {
            let raw = if name.starts_with('$') { *v as i32 as u32 } else { v.to_bits() };
            m.bytes.extend(if big_endian { raw.to_be_bytes() } else { raw.to_le_bytes() });
        }
        m.sum(from);
    }
    m.bytes
}

fn ranks() -> Vec<Vec<Vec<f32>>> {
    let rank = |k: f32, n: usize| (0..4).map(|c| vec![k + c as f32; n]).collect();
    vec![rank(1.0, 3), rank(0.0, 0), rank(5.0, 2)]
}

const NAMES: [&str; 4] = ["x", "y", "z", "mass"];

fn rows(paths: &[PathBuf], choice: &Choice) -> Result<Vec<[f64; 4]>> {
    crate::testing::rows(&*Choice::default().open(paths)?, 0, choice)
}

#[test]
fn both_byte_orders_and_several_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gio");
    for big_endian in [false, true] {
        std::fs::write(&path, file(big_endian, &NAMES, &ranks())).unwrap();
        let snapshot = Choice::default().open(std::slice::from_ref(&path)).unwrap();
        let d = snapshot.description();
        let cell = d.meta.cell.unwrap();
        assert_eq!((cell.origin, cell.lengths()), ([1.0, 2.0, 3.0], Some([10.0, 20.0, 30.0])));
        assert_eq!((d.species[0].count, &d.species[0].mass), (5, &SpeciesMass::Field("mass".into())));
        let got = rows(std::slice::from_ref(&path), &Choice::default()).unwrap();
        assert_eq!((got[0], got[4]), ([1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]));
        let other = Choice { positions: Some("mass,z,y".into()), weights: Weights::None, ..Choice::default() };
        assert_eq!(rows(std::slice::from_ref(&path), &other).unwrap()[3], [8.0, 7.0, 6.0, 0.0]);
    }
}

/// One rank of unsigned integers, each column a chunk that blosc wrote (`blosc::chunks`).
fn compressed(name: &str) -> Vec<u8> {
    let (_, n, chunk) = crate::blosc::chunks().find(|c| c.0 == name && c.1 == 256).unwrap();
    let mut m = FileBuilder { big_endian: false, bytes: b"HACC01L\0".to_vec() };
    let n = u64::from(n);
    let blocks = 168 + 272 * 3 + 48;
    let size = blocks + 48 * 3;
    [size, n, 1, 1, 1, 3, 272, 168, 1, 48, 168 + 272 * 3, 168].iter().for_each(|&v| m.int(v));
    (0..6).for_each(|_| m.int(0));
    [48, blocks].iter().for_each(|&v| m.int(v));
    for name in ["x", "y", "z"] {
        m.variable(name, 0);
    }
    let start = size + 8;
    let stored = chunk.len() as u64 + 8;
    [0, 0, 0, n, start, 0].iter().for_each(|&v| m.int(v));
    for k in 0..3 {
        m.bytes.extend(b"BLOSC");
        m.bytes.resize(m.bytes.len() + 27, 0);
        [start + k * (stored + 8), stored].iter().for_each(|&v| m.int(v));
    }
    m.sum(0);
    for _ in 0..3 {
        let from = m.bytes.len();
        m.int(0);
        m.bytes.extend(&chunk);
        m.sum(from);
    }
    m.bytes
}

#[test]
fn blosc_columns_are_read_and_what_is_broken_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gio");
    for name in ["blosclz shuffle 1", "lz4 shuffle 2", "zlib shuffle 1", "zstd shuffle 1"] {
        let good = compressed(name);
        std::fs::write(&path, &good).unwrap();
        let got = rows(std::slice::from_ref(&path), &Choice::default()).unwrap();
        assert!(got.iter().zip(0u32..).all(|(row, i)| row[..3] == [f64::from(i / 7 + i * i % 13); 3]), "{name}");
        // Data that were damaged before their checksum was made.
        let header = 168 + 272 * 3 + 48 + 48 * 3 + 8;
        let length = (good.len() - header) / 3;
        for at in [8 + 4, 8 + 9, 8 + 16, 8 + 20, 8 + 30] {
            let mut bad = good.clone();
            bad[header + at] ^= 0x41;
            let sum = !crc64(&bad[header..header + length - 8]);
            bad[header + length - 8..header + length].copy_from_slice(&sum.to_le_bytes());
            std::fs::write(&path, bad).unwrap();
            if let Err(e) = rows(std::slice::from_ref(&path), &Choice::default()) {
                assert!(e.to_string().contains("variable x of rank 0"), "{e}");
            }
        }
    }
}

#[test]
fn checksums_are_verified_in_what_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gio");
    for ranks in [ranks(), ranks()[..1].to_vec()] {
        let good = file(false, &NAMES, &ranks);
        let header = 168 + 272 * 4 + 48 * ranks.len() + 8;
        let fault = |at: usize| {
            let mut bad = good.clone();
            bad[at] ^= 4;
            std::fs::write(&path, bad).unwrap();
            rows(std::slice::from_ref(&path), &Choice::default()).err().map(|e| e.to_string()).unwrap_or_default()
        };
        assert!(fault(40).contains("header"));
        assert!(fault(header + 1).contains("variable x of rank 0"), "{}", fault(header + 1));
        assert!(fault(header + 4 * 3 + 8 + 2).contains("variable y of rank 0"));
        assert!(fault(good.len() - 9).contains(&format!("variable mass of rank {}", ranks.len() - 1)));
        // A column that is not read is not looked at.
        let mut bad = good.clone();
        let at = bad.len() - 9;
        bad[at] ^= 1;
        std::fs::write(&path, bad).unwrap();
        let plain = Choice { weights: Weights::None, ..Choice::default() };
        assert!(rows(std::slice::from_ref(&path), &plain).is_ok());
    }
}

#[test]
fn split_snapshots_are_found_by_their_map() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("s"), file(false, &["$rank", "$partition"], &[vec![vec![0.0, 1.0, 2.0], vec![7.0, 2.0, 7.0]]]))
        .unwrap();
    std::fs::write(at("s#2"), file(false, &NAMES, &ranks()[..1])).unwrap();
    let missing = rows(&[at("s")], &Choice::default()).unwrap_err().to_string();
    assert!(missing.contains("s#7") && missing.contains("missing"));
    std::fs::write(at("s#7"), file(false, &NAMES, &ranks()[2..])).unwrap();
    for paths in [vec![at("s")], vec![at("s#7")], vec![at("s"), at("s#2"), at("s#7")]] {
        assert_eq!(rows(&paths, &Choice::default()).unwrap().len(), 5);
    }
    assert!(rows(&[at("s"), at("t")], &Choice::default()).is_err());
}
