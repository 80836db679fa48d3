//! Covariances as logarithms: one size and five shape numbers (docs/format.md, section 9); and the Cholesky factor of a
//! covariance, the frame in which changes of places and shapes, and slopes, are coded (sections 14 and 16).

use super::exact::to_five;
use super::sums::depth_of;
use crate::math::{Eigen, Sym3, each_axis};
use crate::model::Block;
use crate::parallel;

/// Smallest ratio of two variances of a Gaussian: flatter ones are thickened to it. Changes have no smaller ratios either.
const FLATTEST: f64 = 1.0 / (1u64 << 20) as f64;
/// The same where a block is flat.
const FLATTEST_OF_FLAT: f64 = 1.0 / (1u64 << 38) as f64;
/// From this ratio of two edges on a block is flat.
const FLAT: f64 = 32.0;
/// From this ratio of two widths on a Gaussian of a flat block lies along it.
const ALONG: f64 = 16.0;
/// Smallest radius, in longest extents of the block.
const SMALLEST: f64 = 1.0 / (1u64 << 36) as f64;
/// Counts below this are coded as this.
const FEWEST: f64 = 1.0 / 64.0;
/// Grey levels below this are coded as this: a quarter of a step of eight bits.
const DARKEST: f64 = 1.0 / 1024.0;

/// Columns of logarithms, in the order of the leaves.
pub(crate) struct Logs {
    /// ln of the geometric mean radius, ln det / 6.
    pub size: Vec<f64>,
    /// ln of the count; of the alpha-blend law ln of the depth `-ln(1 - opacity)`.
    pub count: Vec<f64>,
    /// ln of mass / count over the block's; of the alpha-blend law ln of the grey level.
    pub weight: Option<Vec<f64>>,
    /// Five a Gaussian.
    pub shape: Vec<f64>,
    pub flat: FlatPairs,
}

impl Logs {
    pub(crate) fn new(block: &Block, order: &[u32]) -> Logs {
        let g = &block.gaussians;
        let (floors, flat) = (Floors::new(block), FlatPairs::new(block));
        let shapes: Vec<(f64, [f64; 5])> =
            parallel::map_range(order.len(), |at| logarithm(&flat.level(g.cov_of(order[at] as usize)), &floors));
        let size = shapes.iter().map(|s| s.0).collect();
        let shape = shapes.iter().flat_map(|s| s.1).collect();
        let column = |value: &dyn Fn(usize) -> f64| order.iter().map(|&i| libm::log(value(i as usize))).collect();
        if let Some(s) = g.law.alpha_blend() {
            let count = column(&|i| depth_of(s.opacity[i]));
            return Logs { size, count, weight: Some(column(&|i| s.grey[i].clamp(DARKEST, 1e30))), shape, flat };
        }
        let count = |i: usize| g.count[i].max(FEWEST);
        let relative = |m: &Vec<f64>| {
            let mean = block.mass / block.count as f64;
            column(&|i| (m[i] / count(i) / mean).clamp(1e-30, 1e30))
        };
        Logs { size, count: column(&count), weight: g.masses().map(relative), shape, flat }
    }
}

/// Pairs of axes, xy, xz and yz, in which a block is flat. Rounding turns a shape by some hundredths: along a flat
/// block that is many times its thickness. So Gaussians that lie along it do so exactly.
pub(crate) struct FlatPairs([bool; 3]);

impl FlatPairs {
    fn new(block: &Block) -> FlatPairs {
        let [x, y, z] = block.bounds.extent();
        FlatPairs([[x, y], [x, z], [y, z]].map(|[a, b]| a.max(b) > FLAT * a.min(b)))
    }

    /// Whether this shape number of the five, of this value, says that a Gaussian lies along the block.
    pub(crate) fn is_along(&self, number: usize, value: f64) -> bool {
        number >= 2 && self.0[number - 2] && value == 0.0
    }

    /// A covariance with what lies along the block exactly so.
    fn level(&self, original: Sym3) -> Sym3 {
        let mut cov = original;
        for (flat, [a, covariance, b]) in self.0.into_iter().zip([[0, 1, 3], [0, 2, 5], [3, 4, 5]]) {
            let [a, b] = [cov.0[a], cov.0[b]];
            if flat && a.max(b) > ALONG * ALONG * a.min(b) {
                cov.0[covariance] = 0.0;
            }
        }
        // Two axes that both go with the third go with each other.
        if cov != original && cov.det() < 0.0 {
            cov = Sym3([cov.0[0], 0.0, 0.0, cov.0[3], 0.0, cov.0[5]]);
        }
        cov
    }
}

/// Radii that stand in for none.
struct Floors {
    /// Least radius along any axis: 2^-36 of the block's longest extent, or of its widest Gaussian
    /// where that is longer.
    least: f64,
    /// Of Gaussians without any extent: the smallest one's that has some, but at most 1/16 of the
    /// block's default particle radius.
    point: f64,
    /// Least width across a flat block that is kept whatever the other widths: a fraction of its shortest edge.
    thin: f64,
}

impl Floors {
    fn new(block: &Block) -> Floors {
        let g = &block.gaussians;
        let variance = (0..g.len()).map(|i| g.cov[0][i] + g.cov[3][i] + g.cov[5][i]).fold(0.0, f64::max);
        let longest = block.bounds.extent().into_iter().fold(variance.sqrt(), f64::max);
        let least = SMALLEST * if longest > 0.0 { longest } else { 1.0 };
        let regular = (0..g.len())
            .map(|i| (g.cov[0][i] + g.cov[3][i] + g.cov[5][i]) / 3.0)
            .filter(|v| *v > least * least)
            .fold(f64::INFINITY, f64::min)
            .sqrt();
        let point = regular.min(block.bounds.default_radius(block.count) / 16.0).max(least);
        let shortest = block.bounds.extent().into_iter().fold(f64::INFINITY, f64::min);
        let thin = if FLAT * shortest < longest { shortest / FLAT } else { f64::INFINITY };
        Floors { least, point, thin }
    }
}

/// ln det / 6 and the coordinates of (ln C - its trace / 3) / 2, after the floors.
fn logarithm(cov: &Sym3, floors: &Floors) -> (f64, [f64; 5]) {
    // Scaled first: squares of 1e-30 or 1e30 lengths keep their digits in the rotations.
    let scale = cov.0[0].abs().max(cov.0[3].abs()).max(cov.0[5].abs());
    let least = floors.least * floors.least;
    if scale.is_nan() || scale <= least {
        return (libm::log(floors.point), [0.0; 5]);
    }
    let e = cov.scale(1.0 / scale).eigen();
    // Across a flat block the usual floor may be wider than the block, so the lower of the two holds there.
    let thin = (floors.thin * floors.thin / scale).max(e.values[0] * FLATTEST_OF_FLAT);
    let least = (e.values[0] * FLATTEST).min(thin).max(least / scale);
    let half = e.values.map(|v| 0.5 * libm::log(v.max(least)));
    let mean = (half[0] + half[1] + half[2]) / 3.0;
    let s = Sym3::from_eigen(&Eigen { values: half.map(|h| h - mean), vectors: e.vectors });
    (mean + 0.5 * libm::log(scale), to_five(&s))
}

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
        // Widths are divided by, so those of a flat Gaussian are kept above 0 (section 14).
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
        // Rounding leaves the two halves of the matrix a little apart.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levelled_needles_keep_their_widths() {
        let needle = Sym3::outer([40.0, 6.0, 1.0]).add(&Sym3::scaled_identity(0.01));
        let level = FlatPairs([false, true, false]).level(needle);
        assert_eq!(level.0, [1600.01, 0.0, 0.0, 36.01, 0.0, 1.01]);
        assert!(FlatPairs([false; 3]).level(needle) == needle);
    }
}
