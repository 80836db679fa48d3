//! A grid over a domain and the schemes that share a particle among its cells.

use super::{Domain, Tilt};
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::CELL_SIZES;

/// Cells of eight particles along the longest edge at most: 200 MB while they are filled.
const MOST_CELLS: f64 = 256.0;
/// Their numbers are multiples of this, so that cells of twice and four times their edge fill the domain, too.
const COARSEST: usize = 1 << (CELL_SIZES - 1);

/// Cells over a domain; x is the slowest index. Those of a tilted domain lie along its edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Lowest corner, world units.
    pub min: [f64; 3],
    /// Edges of a cell, world units.
    pub side: [f64; 3],
    /// Cells along x, y and z.
    pub cells: [usize; 3],
    /// Whether the axis repeats.
    pub periodic: [bool; 3],
    /// Directions of the cells' edges, if not x, y and z.
    pub(crate) tilt: Option<Tilt>,
}

particlegs_core::named_values! {
    /// Scheme that shares a particle among cells (Hockney and Eastwood 1981).
    #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Assignment {
        Ngp = "ngp": "Nearest grid point",
        Cic = "cic": "Cloud in cell",
        Tsc = "tsc": "Triangular-shaped cloud",
    }
}

impl Assignment {
    /// Power of sinc in the window's transform; also the most cells an axis.
    pub fn order(self) -> usize {
        match self {
            Assignment::Ngp => 1,
            Assignment::Cic => 2,
            Assignment::Tsc => 3,
        }
    }

    /// The first cell and the weights of coordinate `u` in cells, 0 or more (cell i spans i to i + 1).
    #[inline(always)]
    pub(super) fn weights(self, u: f64) -> (i64, [f64; 3]) {
        // Of what is not negative, a conversion is the floor, and quicker.
        match self {
            Assignment::Ngp => (u as i64, [1.0, 0.0, 0.0]),
            Assignment::Cic => {
                let after = (u + 0.5) as i64;
                let f = u + 0.5 - after as f64;
                (after - 1, [1.0 - f, f, 0.0])
            }
            Assignment::Tsc => {
                let nearest = u as i64;
                let d = u - nearest as f64 - 0.5;
                let (low, high) = (0.5 - d, 0.5 + d);
                (nearest - 1, [0.5 * low * low, 0.75 - d * d, 0.5 * high * high])
            }
        }
    }
}

impl Grid {
    /// `longest` cells along the longest edge and as many of about the same length along the others.
    pub fn new(domain: &Domain, longest: usize) -> Self {
        let side = domain.longest() / longest.max(1) as f64;
        Self::stretched(domain, domain.length.map(|l| ((l / side).round() as usize).max(1)))
    }

    /// Cells of two mean spacings, so of eight particles on average, in multiples of four along each edge; larger ones
    /// where the longest edge would have more than 256.
    pub fn of_eight(domain: &Domain, particles: usize) -> Self {
        // Cells of a tilted box hold less than cubes of their edge.
        let cube = domain.tilt.map_or(1.0, |t| libm::cbrt(t.volume()));
        let edge = (2.0 * domain.spacing(particles) / cube).max(domain.longest() / MOST_CELLS);
        let cells = each_axis(|k| COARSEST * (domain.length[k] / (edge * COARSEST as f64)).round().max(1.0) as usize);
        Self::stretched(domain, cells)
    }

    /// Given numbers of cells, of whatever shape that makes them.
    pub fn stretched(domain: &Domain, cells: [usize; 3]) -> Self {
        Grid {
            min: domain.min,
            side: each_axis(|k| domain.length[k] / cells[k] as f64),
            cells,
            periodic: domain.periodic,
            tilt: domain.tilt,
        }
    }

    /// The longest edge of a cell, world units.
    pub(crate) fn coarsest(&self) -> f64 {
        self.side[0].max(self.side[1]).max(self.side[2])
    }

    /// A place as lengths along the edges from the lowest corner.
    #[inline]
    pub(crate) fn offset_from_corner(&self, p: [f64; 3]) -> [f64; 3] {
        let d = each_axis(|k| p[k] - self.min[k]);
        self.tilt.as_ref().map_or(d, |t| t.upright(d))
    }

    /// A Gaussian as an upright grid of the same corner, sides and cells sees it.
    pub(crate) fn upright(&self, mean: [f64; 3], cov: Sym3) -> ([f64; 3], Sym3) {
        let Some(tilt) = &self.tilt else { return (mean, cov) };
        let along = self.offset_from_corner(mean);
        (each_axis(|k| self.min[k] + along[k]), tilt.upright_covariance(&cov))
    }

    /// The cells along an axis that hold coordinate `u`, in cells: none beyond an open edge, but an open grid's far
    /// end belongs to its last.
    pub(super) fn slab(&self, axis: usize, u: f64) -> Option<usize> {
        let n = self.cells[axis];
        if u >= 0.0 && u < n as f64 {
            Some(u as usize)
        } else if self.periodic[axis] {
            // The remainder of a tiny negative number is rounded up to n.
            Some(u.rem_euclid(n as f64) as usize % n)
        } else {
            (u == n as f64).then_some(n - 1)
        }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.cells.iter().product()
    }

    /// Whether it has no cells, which is never: a grid has at least one.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Place of a cell in a column of cells.
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.cells[1] + j) * self.cells[2] + k
    }

    /// A cell index along `axis` as it is stored: repeated, or the nearest at an open edge.
    #[inline]
    pub(crate) fn wrap(&self, axis: usize, i: i64) -> usize {
        let n = self.cells[axis] as i64;
        if (0..n).contains(&i) {
            return i as usize;
        }
        (if self.periodic[axis] { i.rem_euclid(n) } else { i.clamp(0, n - 1) }) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_keep_the_place() {
        for i in 0..1000 {
            let u = i as f64 * 0.0173 + 3.0;
            for scheme in [Assignment::Ngp, Assignment::Cic, Assignment::Tsc] {
                let (first, w) = scheme.weights(u);
                assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                assert!(w.iter().all(|v| *v >= -1e-12));
                let center: f64 = w.iter().enumerate().map(|(j, w)| w * (first as f64 + j as f64 + 0.5)).sum();
                if scheme != Assignment::Ngp {
                    assert!((center - u).abs() < 1e-12, "{scheme:?} {u}");
                }
            }
        }
    }

    #[test]
    fn slabs_get_cells_of_one_length() {
        let d = Domain::upright([0.0; 3], [1.0, 4.0, 3.9], [true, true, false]);
        let g = Grid::new(&d, 40);
        assert_eq!(g.cells, [10, 40, 39]);
        assert_eq!([g.wrap(0, -1), g.wrap(2, -1), g.wrap(2, 50)], [9, 0, 38]);
    }
}
