//! Covariances as logarithms: one size and five shape numbers (docs/format.md, section 9).

use super::exact::to_five;
use super::sums::depth_of;
use crate::math::{Eigen, Sym3};
use crate::model::Block;
use crate::parallel;

/// Smallest ratio of two variances of a Gaussian: flatter ones are thickened to it.
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
    let thin = (floors.thin * floors.thin / scale).max(e.values[0] * FLATTEST_OF_FLAT);
    let least = (e.values[0] * FLATTEST).min(thin).max(least / scale);
    let half = e.values.map(|v| 0.5 * libm::log(v.max(least)));
    let mean = (half[0] + half[1] + half[2]) / 3.0;
    let s = Sym3::from_eigen(&Eigen { values: half.map(|h| h - mean), vectors: e.vectors });
    (mean + 0.5 * libm::log(scale), to_five(&s))
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
