//! Periodic copies: the snapshot repeated along its cell vectors, and positions taken at their images near a point.

use super::{Chunk, Particles};
use particlegs_core::math::{each_axis, floor};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::{Error, Hint, Result};

/// The number of times that the snapshot stands beside itself along each cell vector. Tiles are numbered with the
/// last axis fastest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tiling {
    repeats: [u32; 3],
    vectors: [[f64; 3]; 3],
}

impl Tiling {
    /// The snapshot once.
    pub fn single() -> Self {
        Tiling { repeats: [1; 3], vectors: [[0.0; 3]; 3] }
    }

    /// `repeats` tiles along each axis of the snapshot's cell.
    pub fn new(repeats: [u32; 3], particles: &Particles) -> Result<Self> {
        if repeats.contains(&0) {
            return Err(Error::argument(format!("use at least 1 tile along each axis, not {repeats:?}")));
        }
        let name = &particles.meta.name;
        let cell = particles
            .meta
            .cell
            .as_ref()
            .ok_or_else(|| Error::input_with(name, "tiling needs a periodic box", Hint::state_box()))?;
        if let Some(k) = (0..3).find(|&k| repeats[k] > 1 && !cell.periodic[k]) {
            return Err(Error::input(name, format!("axis {k} is not periodic and cannot be repeated")));
        }
        let tiling = Tiling { repeats, vectors: cell.vectors };
        let total = repeats.iter().try_fold(particles.len() as u64, |n, &r| n.checked_mul(u64::from(r)));
        match total {
            // Files of 16 bytes a particle must still have lengths that fit an i64.
            Some(n) if n <= i64::MAX as u64 / 16 => Ok(tiling),
            _ => Err(Error::argument(format!("{repeats:?} tiles have too many particles: use fewer tiles"))),
        }
    }

    /// Number of tiles.
    pub fn tiles(&self) -> u64 {
        self.repeats.iter().map(|&r| u64::from(r)).product()
    }

    /// The shift of the positions in tile `tile`, world units.
    pub fn shift(&self, tile: u64) -> [f64; 3] {
        let [_, ny, nz] = self.repeats.map(u64::from);
        let steps = [tile / (ny * nz), tile / nz % ny, tile % nz];
        each_axis(|k| (0..3).map(|axis| steps[axis] as f64 * self.vectors[axis][k]).sum())
    }

    /// The cell of all tiles together.
    pub fn cell(&self, one: &Cell) -> Cell {
        let mut cell = *one;
        for axis in 0..3 {
            cell.vectors[axis] = one.vectors[axis].map(|v| v * f64::from(self.repeats[axis]));
        }
        cell
    }
}

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

    /// Adds the positions of `chunk` (about `offset`), at their images, to `columns` (about `origin`).
    pub fn nearest(&self, chunk: &Chunk<'_>, offset: [f64; 3], origin: [f64; 3], columns: &mut [Vec<f32>; 4]) {
        if self.cell.lengths().is_some() {
            // Axes of an upright box are each on their own, and vectors of numbers.
            for k in 0..3 {
                let (centre, fraction, length) = (self.centre[k], self.fractions[k][k], self.cell.vectors[k][k]);
                let is_periodic = self.cell.periodic[k];
                let turns = |p: f64| if is_periodic { floor((p - centre) * fraction + 0.5) } else { 0.0 };
                let nearest = |p: f64| p - turns(p) * length;
                let positions = chunk.position[k].iter().map(|&v| nearest(f64::from(v) + offset[k]));
                columns[k].extend(positions.map(|p| (p - origin[k]) as f32));
            }
            return;
        }
        for i in 0..chunk.len() {
            let p = self.nearest_to(each_axis(|k| f64::from(chunk.position[k][i]) + offset[k]));
            (0..3).for_each(|k| columns[k].push((p[k] - origin[k]) as f32));
        }
    }

    pub fn nearest_to(&self, p: [f64; 3]) -> [f64; 3] {
        let d: [f64; 3] = each_axis(|k| p[k] - self.centre[k]);
        let steps: [f64; 3] = each_axis(|a| {
            let fraction: f64 = (0..3).map(|k| d[k] * self.fractions[k][a]).sum();
            if self.cell.periodic[a] { floor(fraction + 0.5) } else { 0.0 }
        });
        each_axis(|k| {
            let shift: f64 = (0..3).map(|a| steps[a] * self.cell.vectors[a][k]).sum();
            p[k] - shift
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(lengths: [f64; 3]) -> Particles {
        let mut p = Particles::from_columns(vec![0.5], vec![0.5], vec![0.5]);
        p.meta.cell = Some(Cell::orthogonal(lengths));
        p
    }

    #[test]
    fn tiles_are_numbered_last_axis_first() {
        let t = Tiling::new([2, 1, 3], &boxed([1.0, 10.0, 100.0])).unwrap();
        assert_eq!(t.tiles(), 6);
        assert_eq!(t.shift(0), [0.0; 3]);
        assert_eq!(t.shift(2), [0.0, 0.0, 200.0]);
        assert_eq!(t.shift(4), [1.0, 0.0, 100.0]);
        assert_eq!(t.cell(&Cell::orthogonal([1.0, 10.0, 100.0])).lengths(), Some([2.0, 10.0, 300.0]));
    }

    /// Upright boxes, axis by axis, give what a place at a time gives.
    #[test]
    fn images_of_chunks_are_those_of_each_place() {
        let mut p = Particles::from_columns(
            (0..400).map(|i| 0.173 * i as f32 - 30.0).collect(),
            (0..400).map(|i| 0.5 * (i % 80) as f32 - 20.0).collect(),
            (0..400).map(|i| 9.0 - 0.31 * i as f32).collect(),
        );
        for (vectors, periodic) in [
            ([[10.0, 0.0, 0.0], [0.0, 8.0, 0.0], [0.0, 0.0, 6.0]], [true, true, false]),
            ([[10.0, 0.0, 0.0], [2.0, 8.0, 0.0], [1.0, -1.0, 6.0]], [true; 3]),
        ] {
            p.meta.cell = Some(Cell { origin: [0.0; 3], vectors, periodic });
            let crop = Bounds { min: [1.0, 2.0, 1.0], max: [4.0, 4.0, 3.0] };
            let images = NearestImages::about(&crop, p.meta.cell.as_ref(), "a test").unwrap();
            let (mut buffer, mut columns, origin) = (Default::default(), <[Vec<f32>; 4]>::default(), [0.5, 0.0, -1.0]);
            images.nearest(&p.chunk(0..400, &mut buffer), [0.25, 0.0, 0.0], origin, &mut columns);
            for i in 0..400 {
                let x = p.position(i);
                let image = images.nearest_to([x[0] + 0.25, x[1], x[2]]);
                (0..3).for_each(|k| assert_eq!(columns[k][i], (image[k] - origin[k]) as f32));
            }
        }
    }

    #[test]
    fn what_cannot_be_tiled_is_refused() {
        let mut p = boxed([1.0; 3]);
        assert!(Tiling::new([0, 1, 1], &p).is_err());
        assert!(Tiling::new([u32::MAX; 3], &p).is_err());
        p.meta.cell.as_mut().unwrap().periodic[1] = false;
        assert!(Tiling::new([2, 1, 1], &p).is_ok());
        assert!(Tiling::new([1, 2, 1], &p).is_err());
        p.meta.cell = None;
        assert!(Tiling::new([1, 1, 2], &p).is_err());
    }
}
