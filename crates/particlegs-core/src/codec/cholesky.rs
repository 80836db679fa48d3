//! The Cholesky factor of a covariance: the frame in which places, shapes and slopes of a Gaussian are coded.

use super::exact::to_five;
use crate::math::{Sym3, each_axis};

/// Variances are changed by ratios no smaller than this part of the largest.
const FLATTEST: f64 = 1.0 / (1u64 << 20) as f64;
/// Variance along an axis that is left at least, over the sum of all three: 2^-40.
const NARROWEST: f64 = 1.0 / (1u64 << 40) as f64;

/// Widths of a Gaussian along the axes where the earlier ones are known, and the rest of its Cholesky factor.
#[derive(Clone, Copy)]
pub(super) struct CholeskyFactor {
    width: [f64; 3],
    /// (1, 0), (2, 0), (2, 1).
    below: [f64; 3],
}

impl CholeskyFactor {
    pub(super) fn new(cov: &Sym3) -> CholeskyFactor {
        let [xx, xy, xz, yy, yz, zz] = cov.0;
        let least = (xx + yy + zz) * NARROWEST + 1e-300;
        let root = |v: f64| v.max(least).sqrt();
        let x = root(xx);
        let (a, b) = (xy / x, xz / x);
        let y = root(yy - a * a);
        let c = (yz - b * a) / y;
        CholeskyFactor { width: [x, y, root((zz - b * b) - c * c)], below: [a, b, c] }
    }

    /// The factor times a vector.
    pub(super) fn apply(&self, q: [f64; 3]) -> [f64; 3] {
        let ([x, y, z], [a, b, c]) = (self.width, self.below);
        [x * q[0], a * q[0] + y * q[1], (b * q[0] + c * q[1]) + z * q[2]]
    }

    /// The vector that the factor makes `d` of, one axis after the other.
    pub(super) fn solve(&self, d: [f64; 3], axis: usize, known: [f64; 3]) -> f64 {
        let [a, b, c] = self.below;
        let left = match axis {
            0 => d[0],
            1 => d[1] - a * known[0],
            _ => d[2] - (b * known[0] + c * known[1]),
        };
        left / self.width[axis]
    }

    /// The factor times a symmetric matrix times the factor's transpose.
    pub(super) fn congruent(&self, m: &Sym3) -> Sym3 {
        let [xx, xy, xz, yy, yz, zz] = m.0;
        // Columns of the factor times the matrix.
        let rows = [self.apply([xx, xy, xz]), self.apply([xy, yy, yz]), self.apply([xz, yz, zz])];
        let row = |i: usize| self.apply(each_axis(|j| rows[j][i]));
        let (x, y, z) = (row(0), row(1), row(2));
        Sym3([x[0], x[1], x[2], y[1], y[2], z[2]])
    }

    /// Half the logarithm of a covariance in the frame of this factor: size and five shape numbers.
    pub(super) fn logarithm(&self, cov: &Sym3) -> Option<[f64; 6]> {
        let full = [[cov.0[0], cov.0[1], cov.0[2]], [cov.0[1], cov.0[3], cov.0[4]], [cov.0[2], cov.0[4], cov.0[5]]];
        let whitened = |d: [f64; 3]| {
            let mut q = [0.0; 3];
            for k in 0..3 {
                q[k] = self.solve(d, k, q);
            }
            q
        };
        let half = full.map(whitened);
        let rows: [[f64; 3]; 3] = each_axis(|i| whitened(each_axis(|j| half[j][i])));
        let mean = |i: usize, j: usize| 0.5 * (rows[i][j] + rows[j][i]);
        let mut e = Sym3([rows[0][0], mean(0, 1), mean(0, 2), rows[1][1], mean(1, 2), rows[2][2]]).eigen();
        if !e.values.iter().all(|v| v.is_finite()) {
            return None;
        }
        let least = (FLATTEST * e.values[0]).max(1e-300);
        e.values = e.values.map(|v| 0.5 * libm::log(v.max(least)));
        let size = (e.values[0] + e.values[1] + e.values[2]) / 3.0;
        e.values = e.values.map(|v| v - size);
        let [a, b, c, d, f] = to_five(&Sym3::from_eigen(&e));
        Some([size, a, b, c, d, f])
    }

    /// The change of a field over the widths, by its slope.
    pub(super) fn over(&self, slope: [f64; 3]) -> [f64; 3] {
        let ([x, y, z], [a, b, c]) = (self.width, self.below);
        [slope[0] * x + slope[1] * a + slope[2] * b, slope[1] * y + slope[2] * c, slope[2] * z]
    }

    /// The slope of a field by its change over the widths.
    pub(super) fn slope(&self, over: [f64; 3]) -> [f64; 3] {
        let ([x, y, z], [a, b, c]) = (self.width, self.below);
        let along_z = over[2] / z;
        let along_y = (over[1] - c * along_z) / y;
        [((over[0] - a * along_y) - b * along_z) / x, along_y, along_z]
    }
}
