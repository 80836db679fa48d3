//! The part of a grid that one thread fills.

use super::Grid;
use particlegs_core::math::Sym3;
use std::ops::Range;

/// Kernels are never narrower than this share of a cell: what is smaller is a point to the grid.
pub(super) const SMALLEST: f64 = 0.1;
/// Nor than this share of the largest deviation: a bound on the lattice, for flat Gaussians.
pub(super) const FLATTEST: f64 = 1.0 / 16.0;

/// Some planes of a grid across x, and the sums in their cells.
pub struct Slab<'a, S = f64> {
    pub(crate) grid: &'a Grid,
    /// Numbers of its planes.
    pub(crate) planes: Range<usize>,
    /// The cells of those planes alone.
    pub(crate) cells: &'a mut [S],
}

impl<'a, S> Slab<'a, S> {
    pub(crate) fn whole(grid: &'a Grid, cells: &'a mut [S]) -> Self {
        Slab { grid, planes: 0..grid.cells[0], cells }
    }

    /// False where a Gaussian has nothing in the slab, by a generous bound.
    pub(crate) fn may_hold(&self, mean: [f64; 3], cov: &Sym3) -> bool {
        let (g, planes) = (self.grid, &self.planes);
        // The lattice ends 3.5 deviations and a step from the mean along each principal axis, its
        // kernel TAIL further; a kernel is at most the deviation along x or one of the two floors.
        let kernel = cov.0[0].max(0.0).sqrt() + SMALLEST * g.side[0] + FLATTEST * cov.trace().max(0.0).sqrt();
        let reach = (7.0 * cov.0[0].max(0.0).sqrt() + 7.5 * kernel) / g.side[0] + 1.0;
        let (n, x) = (g.cells[0] as f64, (mean[0] - g.min[0]) / g.side[0]);
        let (low, high) = (planes.start as f64 - reach, planes.end as f64 + reach);
        if !g.periodic[0] {
            return x >= low && x <= high;
        }
        high - low >= n || (x - low).rem_euclid(n) <= high - low
    }
}
