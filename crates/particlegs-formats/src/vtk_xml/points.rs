//! Points of a piece of VTK, in either of its formats, and the arrays that they are in, of which any rows can be read.

use super::blocks::CompressedBlocks;
use super::stream::Stream;
use crate::TextResult;
use crate::ascii::Ascii;
use crate::axes::FieldComponent;
use crate::numbers::{Bytes, NumberType, StridedColumn, StridedParticles};
use crate::pieces::{ParticlePiece, RowBuffer};
use particlegs_core::{Error, Result};
use particlegs_particles::InPlace;
use std::ops::Range;
use std::sync::Arc;

/// The arrays that are read of a piece.
pub struct PiecePoints {
    place: String,
    bytes: Bytes,
    rows: u64,
    arrays: Vec<VtkArray>,
    /// Array and component of x, y, z and perhaps the weight.
    columns: Vec<(usize, u32)>,
    /// All columns in the file, where they lie there as they are.
    plain: Option<StridedParticles>,
}

impl PiecePoints {
    /// `rows` points of the file `place`, whose columns are components of arrays.
    pub fn new(place: &str, bytes: Bytes, rows: u64, (arrays, columns): ArrayColumns) -> Result<PiecePoints> {
        let lanes: Option<Vec<_>> = columns.iter().map(|&(a, c)| arrays[a].lane(c)).collect();
        let plain = lanes.map(|lanes| StridedParticles::new(place, bytes.clone(), rows, &lanes)).transpose()?;
        Ok(PiecePoints { place: place.into(), bytes, rows, arrays, columns, plain })
    }
}

impl ParticlePiece for PiecePoints {
    fn rows(&self) -> u64 {
        self.rows
    }

    fn is_wide(&self) -> bool {
        self.columns.iter().take(3).any(|&(a, _)| self.arrays[a].kind.is_wide())
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        if let Some(plain) = &self.plain {
            return plain.read(rows, out);
        }
        let mut numbers = Vec::new();
        let mut held = None;
        for (k, &(index, component)) in self.columns.iter().enumerate() {
            let array = &self.arrays[index];
            // x, y and z are mostly of one array, which is decoded once.
            if held != Some(index) {
                numbers.clear();
                let fault = |e| Error::input(&self.place, format!("array `{}`: {e}", array.name));
                array.append(&self.bytes, rows.clone(), &mut numbers).map_err(fault)?;
                held = Some(index);
            }
            out.column(k).extend(numbers.iter().skip(component as usize).step_by(array.components as usize));
        }
        Ok(())
    }

    fn in_place(&self) -> Option<InPlace> {
        self.plain.as_ref()?.in_place()
    }
}

pub enum ArraySource {
    Plain(Stream),
    Blocks(CompressedBlocks),
    Ascii(Arc<Ascii>),
}

pub struct VtkArray {
    pub name: String,
    pub kind: NumberType,
    pub components: u32,
    pub big_endian: bool,
    pub source: ArraySource,
}

impl VtkArray {
    /// The place of component `component`, if the numbers lie in the file as they are.
    pub fn lane(&self, component: u32) -> Option<StridedColumn> {
        let ArraySource::Plain(Stream::Raw(start)) = self.source else { return None };
        let size = self.kind.bytes();
        let offset = start + u64::from(component) * size;
        Some(StridedColumn {
            offset,
            stride: size * u64::from(self.components),
            kind: self.kind,
            big_endian: self.big_endian,
        })
    }

    /// Appends rows `rows`, all components of each.
    pub fn append(&self, bytes: &Bytes, rows: Range<u64>, out: &mut Vec<f64>) -> TextResult<()> {
        let wide = u64::from(self.components);
        let numbers = rows.start * wide..rows.end * wide;
        let size = self.kind.bytes();
        let range = numbers.start * size..numbers.end * size;
        let mut push = |raw: &[u8]| {
            let lane = StridedColumn { offset: 0, stride: size, kind: self.kind, big_endian: self.big_endian };
            lane.append(raw, 0..raw.len() as u64 / size, out);
        };
        match &self.source {
            ArraySource::Plain(stream) => push(&stream.get(bytes, range)?),
            ArraySource::Blocks(blocks) => push(&blocks.get(bytes, range)?),
            ArraySource::Ascii(ascii) => ascii.append(bytes, numbers, self.kind, out)?,
        }
        Ok(())
    }
}

/// Arrays, and which of them and which of its components each column is: x, y, z and perhaps the weight.
pub type ArrayColumns = (Vec<VtkArray>, Vec<(usize, u32)>);

/// The arrays that hold `columns`, each opened once.
pub fn open_columns(
    columns: &[FieldComponent],
    mut open: impl FnMut(&str) -> particlegs_core::Result<VtkArray>,
) -> particlegs_core::Result<ArrayColumns> {
    let (mut arrays, mut names, mut places) = (Vec::new(), Vec::<&str>::new(), Vec::new());
    for FieldComponent { field, component } in columns {
        let index = match names.iter().position(|n| n == field) {
            Some(index) => index,
            None => {
                arrays.push(open(field)?);
                names.push(field);
                arrays.len() - 1
            }
        };
        places.push((index, *component));
    }
    Ok((arrays, places))
}
