//! Numbers in bytes: their types, and columns of them at equal distances, as most binary formats have them.

use crate::pieces::{ParticlePiece, RowBuffer};
use particlegs_core::{Error, Result};
use particlegs_files::input::{MappedFile, map_file};
use particlegs_particles::{Column, InPlace, Positions};
use std::ops::{Deref, Range};
use std::path::Path;
use std::sync::Arc;

/// A file's bytes, mapped, or decoded bytes in memory.
#[derive(Clone)]
pub enum Bytes {
    Mapped(Arc<MappedFile>),
    Owned(Arc<Vec<u8>>),
    /// In memory, of another owner.
    Lent(Arc<dyn AsRef<[u8]> + Send + Sync>),
}

impl Bytes {
    /// A file's bytes, mapped; none of an empty one.
    pub fn from_file(path: &Path) -> Result<Bytes> {
        Ok(map_file(path)?.0.map_or_else(|| Bytes::Owned(Arc::default()), Bytes::Mapped))
    }

    /// The same of a file that must not be empty.
    pub fn from_filled_file(path: &Path) -> Result<Bytes> {
        match Bytes::from_file(path)? {
            bytes if bytes.is_empty() => Err(Error::input(path, "the file is empty")),
            bytes => Ok(bytes),
        }
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Bytes::Mapped(map) => map,
            Bytes::Owned(bytes) => bytes,
            Bytes::Lent(owner) => (**owner).as_ref(),
        }
    }
}

particlegs_core::named_values! {
    /// Types of numbers in files, by their names in [`crate::SpeciesField::kind`].
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum NumberType {
        F16 = "f16",
        F32 = "f32",
        F64 = "f64",
        I8 = "i8",
        I16 = "i16",
        I24 = "i24",
        I32 = "i32",
        I64 = "i64",
        U8 = "u8",
        U16 = "u16",
        U32 = "u32",
        U64 = "u64",
        /// The bits of whole numbers of 8 bytes.
        B64 = "bits",
    }
}

impl NumberType {
    /// IEEE 754 numbers of `bytes` bytes, without half floats.
    pub fn float(bytes: u64) -> Option<NumberType> {
        match bytes {
            4 => Some(NumberType::F32),
            8 => Some(NumberType::F64),
            _ => None,
        }
    }

    /// Integers of `bytes` bytes.
    pub fn integer(bytes: u64, signed: bool) -> Option<NumberType> {
        match (bytes, signed) {
            (1, true) => Some(NumberType::I8),
            (2, true) => Some(NumberType::I16),
            (4, true) => Some(NumberType::I32),
            (8, true) => Some(NumberType::I64),
            (1, false) => Some(NumberType::U8),
            (2, false) => Some(NumberType::U16),
            (4, false) => Some(NumberType::U32),
            (8, false) => Some(NumberType::U64),
            _ => None,
        }
    }

    pub fn bytes(self) -> u64 {
        match self {
            NumberType::I8 | NumberType::U8 => 1,
            NumberType::F16 | NumberType::I16 | NumberType::U16 => 2,
            NumberType::I24 => 3,
            NumberType::F32 | NumberType::I32 | NumberType::U32 => 4,
            NumberType::F64 | NumberType::I64 | NumberType::U64 | NumberType::B64 => 8,
        }
    }

    /// The same, or the bits of whole numbers that f64 cannot hold.
    pub fn stored(self, as_stored: bool) -> NumberType {
        match self {
            NumberType::I64 | NumberType::U64 if as_stored => NumberType::B64,
            other => other,
        }
    }

    /// Whether f32 cannot hold all its values.
    pub fn is_wide(self) -> bool {
        matches!(self, NumberType::F64 | NumberType::I32 | NumberType::U32 | NumberType::I64 | NumberType::U64)
    }

    /// The number at the beginning of `bytes`, which holds it.
    pub fn get(self, bytes: &[u8], big_endian: bool) -> f64 {
        let mut raw = [0u8; 8];
        let n = self.bytes() as usize;
        raw[..n].copy_from_slice(&bytes[..n]);
        if big_endian {
            raw[..n].reverse();
        }
        let four = [raw[0], raw[1], raw[2], raw[3]];
        match self {
            NumberType::F16 => half(u16::from_le_bytes([raw[0], raw[1]])),
            // In the upper three bytes first: the shift down then copies the sign.
            NumberType::I24 => f64::from(i32::from_le_bytes([0, raw[0], raw[1], raw[2]]) >> 8),
            NumberType::F32 => f64::from(f32::from_le_bytes(four)),
            NumberType::F64 => f64::from_le_bytes(raw),
            NumberType::I8 => f64::from(raw[0] as i8),
            NumberType::U8 => f64::from(raw[0]),
            NumberType::I16 => f64::from(i16::from_le_bytes([raw[0], raw[1]])),
            NumberType::U16 => f64::from(u16::from_le_bytes([raw[0], raw[1]])),
            NumberType::I32 => f64::from(i32::from_le_bytes(four)),
            NumberType::U32 => f64::from(u32::from_le_bytes(four)),
            NumberType::I64 => i64::from_le_bytes(raw) as f64,
            NumberType::U64 => u64::from_le_bytes(raw) as f64,
            NumberType::B64 => f64::from_bits(u64::from_le_bytes(raw)),
        }
    }
}

/// A number of IEEE 754's half precision.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    let size = match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        e => (1.0 + fraction / 1024.0) * 2f64.powi(e - 15),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// The places of a column's numbers: the i-th at byte `offset + i * stride`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StridedColumn {
    pub offset: u64,
    pub stride: u64,
    pub kind: NumberType,
    pub big_endian: bool,
}

impl StridedColumn {
    /// Whether a lane of `rows` numbers ends within `length` bytes.
    pub fn fits(&self, rows: u64, length: usize) -> bool {
        let last = rows.saturating_sub(1).checked_mul(self.stride).and_then(|b| b.checked_add(self.offset));
        rows == 0 || last.and_then(|b| b.checked_add(self.kind.bytes())).is_some_and(|end| end <= length as u64)
    }

    /// Appends rows `rows` of a lane that fits.
    pub fn append(&self, bytes: &[u8], rows: Range<u64>, out: &mut Vec<f64>) {
        let at = |i: u64| &bytes[(self.offset + i * self.stride) as usize..];
        match (self.kind, self.big_endian) {
            // The common one, without a match a number.
            (NumberType::F32, false) => {
                out.extend(rows.map(|i| {
                    let b = at(i);
                    f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                }));
            }
            (kind, big_endian) => out.extend(rows.map(|i| kind.get(at(i), big_endian))),
        }
    }
}

/// Positions and perhaps weights at equal distances.
pub struct StridedParticles {
    bytes: Bytes,
    rows: u64,
    axes: [StridedColumn; 3],
    weight: Option<StridedColumn>,
}

impl StridedParticles {
    /// `rows` particles in `bytes`, whose x, y, z and perhaps weights are `columns`. `place` names the file in errors.
    pub fn new(place: &str, bytes: Bytes, rows: u64, columns: &[StridedColumn]) -> Result<Self> {
        match columns.split_first_chunk() {
            Some((&axes, weight)) if columns.iter().all(|column| column.fits(rows, bytes.len())) => {
                Ok(StridedParticles { bytes, rows, axes, weight: weight.first().copied() })
            }
            _ => {
                let end = bytes.len();
                let message = format!("the header says {rows} particles, but the data end early, at byte {end}");
                Err(Error::input_with(place, message, "the file is cut short or damaged: copy it again"))
            }
        }
    }
}

impl ParticlePiece for StridedParticles {
    fn rows(&self) -> u64 {
        self.rows
    }

    fn is_wide(&self) -> bool {
        self.axes.iter().any(|lane| lane.kind.is_wide())
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        for (lane, column) in self.axes.iter().zip(&mut out.position) {
            lane.append(&self.bytes, rows.clone(), column);
        }
        if let Some(lane) = &self.weight {
            lane.append(&self.bytes, rows, &mut out.weight);
        }
        Ok(())
    }

    /// Little-endian f32 in runs or triples, aligned, in a mapped file.
    fn in_place(&self) -> Option<InPlace> {
        let Bytes::Mapped(map) = &self.bytes else { return None };
        let plain = |l: &StridedColumn| l.kind == NumberType::F32 && !l.big_endian && l.offset.is_multiple_of(4);
        if cfg!(target_endian = "big") || !self.axes.iter().chain(&self.weight).all(plain) {
            return None;
        }
        let rows = usize::try_from(self.rows).ok()?;
        let column = |l: &StridedColumn, len: usize| Column::mapped(map.clone(), l.offset as usize, len);
        let [x, y, z] = &self.axes;
        let positions = if self.axes.iter().all(|l| l.stride == 4) {
            Positions::Columns([column(x, rows), column(y, rows), column(z, rows)])
        } else if self.axes.iter().all(|l| l.stride == 12) && y.offset == x.offset + 4 && z.offset == x.offset + 8 {
            Positions::Triples(column(x, 3 * rows))
        } else {
            return None;
        };
        let weights = match &self.weight {
            Some(l) if l.stride == 4 => Some(column(l, rows)),
            Some(_) => return None,
            None => None,
        };
        Some(InPlace { positions, weights })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three lanes of interleaved x, y, z.
    fn triples(offset: u64, kind: NumberType, big_endian: bool) -> [StridedColumn; 3] {
        let lane =
            |k: u64| StridedColumn { offset: offset + k * kind.bytes(), stride: 3 * kind.bytes(), kind, big_endian };
        [lane(0), lane(1), lane(2)]
    }

    #[test]
    fn lanes_read_every_kind_and_order() {
        let bytes = [0x3f, 0x80, 0, 0, 0xff, 0xfe];
        assert_eq!(NumberType::F32.get(&bytes, true), 1.0);
        assert_eq!(NumberType::I16.get(&bytes[4..], true), -2.0);
        assert_eq!(NumberType::U16.get(&bytes[4..], false), 65_279.0);
        assert_eq!(NumberType::U8.get(&bytes[4..], false), 255.0);
        assert_eq!(NumberType::I24.get(&[0, 0xf0, 0xff], false), -4096.0);
        assert_eq!(NumberType::I24.get(&[0, 0x10, 1], true), 4097.0);
        assert_eq!([0x3c00, 0xc180, 1, 0x7c00].map(half), [1.0, -2.75, 2f64.powi(-24), f64::INFINITY]);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let bytes = Bytes::Owned(Arc::new(vec![0; 24]));
        let axes = triples(0, NumberType::F32, false);
        assert!(StridedParticles::new("a", bytes.clone(), 2, &axes).is_ok());
        assert!(StridedParticles::new("a", bytes.clone(), 3, &axes).is_err());
        assert!(StridedParticles::new("a", bytes.clone(), u64::MAX, &axes).is_err());
        let far = triples(u64::MAX - 8, NumberType::F32, false);
        assert!(StridedParticles::new("a", bytes, 1, &far).is_err());
    }
}
