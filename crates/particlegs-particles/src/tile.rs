//! Periodic tiling: the snapshot repeated along its cell vectors.

use super::Particles;
use particlegs_core::math::each_axis;
use particlegs_core::space::Cell;
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
