//! Points of a piece of VTK, in either of its formats.

use super::source::{ArrayColumns, VtkArray};
use crate::numbers::{Bytes, StridedParticles};
use crate::pieces::{ParticlePiece, RowBuffer};
use particlegs_core::{Error, Result};
use particlegs_particles::InPlace;
use std::ops::Range;

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
