//! Periodic images: positions taken near a point.

use super::Chunk;
use particlegs_core::math::each_axis;
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::{Error, Hint, Result};

/// A share of the box by which rounding may make a region wider.
const WIDER: f64 = 1e-12;

/// Takes positions at their periodic images nearest to a point.
pub(super) struct NearestImages {
    centre: [f64; 3],
    cell: Cell,
    /// Maps a world vector to fractions of the cell vectors.
    fractions: [[f64; 3]; 3],
}

impl NearestImages {
    /// Images about the middle of `crop`, which must not be wider than the cell where it repeats.
    pub fn about(crop: &Bounds, cell: Option<&Cell>, name: &str) -> Result<Self> {
        let Some(cell) = cell else {
            let hint = Hint::state_box().words(", or use ").option("region", "").words(", which stays inside the box");
            return Err(Error::input_with(name, "a region across the boundary needs a periodic box", hint));
        };
        // Rounded fractions find the near images only where the vectors are short.
        let cell = cell.reduced();
        let fractions = cell.inverse().ok_or_else(|| Error::input(name, "the periodic cell has no volume"))?;
        let extent = crop.extent();
        // The span of the crop along vector a, in lengths of that vector.
        let wide = |a: usize| (0..3).map(|k| extent[k] * fractions[k][a].abs()).sum::<f64>();
        if let Some(a) = (0..3).find(|&a| cell.periodic[a] && wide(a) > 1.0 + WIDER) {
            return Err(Error::argument(match cell.lengths() {
                Some(l) => format!("the region ({} on axis {a}) is wider than the box ({})", extent[a], l[a]),
                None => {
                    format!("the region {} x {} x {} does not fit into the tilted box", extent[0], extent[1], extent[2])
                }
            }));
        }
        Ok(NearestImages { centre: crop.center(), cell, fractions })
    }

    /// Replaces the positions of `columns` (about `origin`) by those of `chunk` (about `offset`) at
    /// their images.
    pub fn nearest(&self, chunk: &Chunk<'_>, offset: [f64; 3], origin: [f64; 3], columns: &mut [Vec<f32>; 4]) {
        for i in 0..chunk.len() {
            let p = self.nearest_to(each_axis(|k| f64::from(chunk.position[k][i]) + offset[k]));
            (0..3).for_each(|k| columns[k][i] = (p[k] - origin[k]) as f32);
        }
    }

    pub fn nearest_to(&self, p: [f64; 3]) -> [f64; 3] {
        let d: [f64; 3] = each_axis(|k| p[k] - self.centre[k]);
        let steps: [f64; 3] = each_axis(|a| {
            let fraction: f64 = (0..3).map(|k| d[k] * self.fractions[k][a]).sum();
            if self.cell.periodic[a] { fraction.round() } else { 0.0 }
        });
        each_axis(|k| {
            let shift: f64 = (0..3).map(|a| steps[a] * self.cell.vectors[a][k]).sum();
            p[k] - shift
        })
    }
}
