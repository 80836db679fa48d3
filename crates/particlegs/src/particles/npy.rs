//! NumPy .npy of shape (N, 3): f32 in C order is mapped, everything else is converted.

use super::open::{map_file, named};
use super::{Column, Particles, Positions};
use crate::{Error, Result};
use rayon::prelude::*;
use std::io::Read;
use std::path::Path;

const MAGIC: &[u8; 6] = b"\x93NUMPY";
/// Headers of version 1 end below 64 KiB; longer ones are not (N, 3) of plain floats.
const LONGEST_HEADER: usize = 1 << 16;

struct Header {
    double: bool,
    big_endian: bool,
    fortran: bool,
    rows: usize,
    data: usize,
}

/// Does the file begin as .npy files do?
pub fn is_npy(path: &Path) -> Result<bool> {
    let mut file = std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
    let mut magic = [0; 6];
    match file.read_exact(&mut magic) {
        Ok(()) => Ok(&magic == MAGIC),
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(Error::io(path, e)),
    }
}

/// Opens a .npy of shape (N, 3), f32 or f64. Doubles become `origin + f32` about their centre.
///
/// # Errors
/// [`Error::Input`] where the header is broken, the type or shape is another, or the file is short.
pub fn open(path: &Path) -> Result<Particles> {
    let (map, length) = map_file(path)?;
    let Some(map) = map else { return Err(Error::input(path, "an empty file")) };
    let header = parse(&map).map_err(|what| Error::input(path, what))?;
    let width = if header.double { 8 } else { 4 };
    let values = header.rows.checked_mul(3).ok_or_else(|| Error::input(path, "the shape overflows"))?;
    let need = values.checked_mul(width).and_then(|b| b.checked_add(header.data));
    if need != Some(length) {
        return Err(Error::input(
            path,
            format!("{length} bytes, but its header says {} x 3 values of {width} bytes", header.rows),
        ));
    }
    let meta = named(path);
    let column = |offset: usize, len: usize| Column::Mapped { map: map.clone(), offset, len };
    if !header.double && !header.big_endian && header.data % 4 == 0 {
        let positions = if header.fortran {
            Positions::Columns([0, 1, 2].map(|k| column(header.data + 4 * k * header.rows, header.rows)))
        } else {
            Positions::Triples(column(header.data, values))
        };
        return Ok(Particles { positions, weights: None, origin: [0.0; 3], meta, kinds: Vec::new() });
    }
    let bytes = &map[header.data..];
    let at = |i: usize, k: usize| {
        let index = if header.fortran { k * header.rows + i } else { 3 * i + k };
        value(&bytes[index * width..], &header)
    };
    let origin = if header.double { centre(header.rows, &at) } else { [0.0; 3] };
    let columns = [0, 1, 2]
        .map(|k| Column::owned((0..header.rows).into_par_iter().map(|i| (at(i, k) - origin[k]) as f32).collect()));
    Ok(Particles { positions: Positions::Columns(columns), weights: None, origin, meta, kinds: Vec::new() })
}

/// The middle of the finite values of each axis, rounded to a short number; 0 where the origin
/// lies well inside, so that data about it stay as they are.
fn centre(rows: usize, at: &(impl Fn(usize, usize) -> f64 + Sync)) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let (lo, hi) = (0..rows)
            .into_par_iter()
            .map(|i| at(i, k))
            .filter(|v| v.is_finite())
            .fold(|| (f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
            .reduce(|| (f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
        let middle = 0.5 * lo + 0.5 * hi;
        if !middle.is_finite() || middle.abs() <= 2.0 * (hi - lo) { 0.0 } else { middle }
    })
}

fn value(bytes: &[u8], header: &Header) -> f64 {
    match (header.double, header.big_endian) {
        (true, false) => f64::from_le_bytes(bytes[..8].try_into().expect("8 bytes")),
        (true, true) => f64::from_be_bytes(bytes[..8].try_into().expect("8 bytes")),
        (false, false) => f64::from(f32::from_le_bytes(bytes[..4].try_into().expect("4 bytes"))),
        (false, true) => f64::from(f32::from_be_bytes(bytes[..4].try_into().expect("4 bytes"))),
    }
}

/// Parses the header dictionary: descr, fortran_order, shape.
fn parse(bytes: &[u8]) -> std::result::Result<Header, String> {
    let fail = || "a broken .npy header".to_string();
    if bytes.len() < 12 || &bytes[..6] != MAGIC {
        return Err(fail());
    }
    let (start, length) = match bytes[6] {
        1 => (10, u16::from_le_bytes([bytes[8], bytes[9]]) as usize),
        2 | 3 => (12, u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize),
        v => return Err(format!(".npy version {v} is not known")),
    };
    if length > LONGEST_HEADER || start + length > bytes.len() {
        return Err(fail());
    }
    let text = std::str::from_utf8(&bytes[start..start + length]).map_err(|_| fail())?;
    let after = |key: &str| text.split_once(key).map(|(_, rest)| rest.trim_start_matches([' ', ':']));
    let descr = after("'descr'").ok_or_else(fail)?;
    let (double, big_endian) = match descr.get(..5) {
        Some("'<f4'") => (false, false),
        Some("'<f8'") => (true, false),
        Some("'>f4'") => (false, true),
        Some("'>f8'") => (true, true),
        _ => return Err("values are not f32 or f64".into()),
    };
    let fortran = after("'fortran_order'").ok_or_else(fail)?.starts_with("True");
    let shape = after("'shape'").and_then(|s| s.strip_prefix('(')).and_then(|s| s.split_once(')')).ok_or_else(fail)?.0;
    let sides: Vec<usize> = shape
        .split(',')
        .map(str::trim)
        .filter(|s| !s.is_empty())
        .map(|s| s.parse().map_err(|_| fail()))
        .collect::<std::result::Result<_, _>>()?;
    let [rows, 3] = sides[..] else { return Err(format!("shape ({shape}) is not (N, 3)")) };
    Ok(Header { double, big_endian, fortran, rows, data: start + length })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(descr: &str, fortran: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let mut header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}");
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

    fn read(bytes: &[u8]) -> Result<Particles> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        std::fs::write(&path, bytes).unwrap();
        open(&path)
    }

    #[test]
    fn every_layout() {
        let c: Vec<u8> = [1f32, 2., 3., 4., 5., 6.].iter().flat_map(|v| v.to_le_bytes()).collect();
        let f: Vec<u8> = [1f64, 4., 2., 5., 3., 6.].iter().flat_map(|v| v.to_be_bytes()).collect();
        for bytes in [npy("<f4", "False", "(2, 3)", &c), npy(">f8", "True", "(2, 3)", &f)] {
            let p = read(&bytes).unwrap();
            assert_eq!([p.position(0), p.position(1)], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        }
    }

    #[test]
    fn doubles_far_away_keep_their_precision() {
        let at: [f64; 6] = [1e12 + 0.25, 0.0, 0.0, 1e12 + 0.5, 1.0, 1.0];
        let bytes: Vec<u8> = at.iter().flat_map(|v| v.to_le_bytes()).collect();
        let p = read(&npy("<f8", "False", "(2, 3)", &bytes)).unwrap();
        assert_eq!(p.position(1)[0] - p.position(0)[0], 0.25);
    }

    #[test]
    fn lies_are_refused() {
        let c = [0u8; 24];
        let good = npy("<f4", "False", "(2, 3)", &c);
        for cut in 0..good.len() {
            assert!(read(&good[..cut]).is_err(), "cut at {cut}");
        }
        for (descr, shape) in [("<i4", "(2, 3)"), ("<f4", "(3, 2)"), ("<f4", "(99999999999999999999, 3)")] {
            assert!(read(&npy(descr, "False", shape, &c)).is_err());
        }
    }
}
