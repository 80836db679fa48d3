//! Covariances as logarithms: one size and five shape numbers (docs/format.md, section 9).

use super::exact::to_five;
use super::sums::depth_of;
use crate::math::{Eigen, Sym3};
use crate::model::Block;
use rayon::prelude::*;

/// Smallest ratio of two variances of a Gaussian: flatter ones are thickened to it.
const FLATTEST: f64 = 1.0 / (1u64 << 20) as f64;
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
}

impl Logs {
    pub(crate) fn new(block: &Block, order: &[u32]) -> Logs {
        let g = &block.gaussians;
        let floors = Floors::of(block);
        let shapes: Vec<(f64, [f64; 5])> =
            order.par_iter().map(|&i| logarithm(&g.cov_of(i as usize), &floors)).collect();
        let size = shapes.iter().map(|s| s.0).collect();
        let shape = shapes.iter().flat_map(|s| s.1).collect();
        let column = |value: &dyn Fn(usize) -> f64| order.iter().map(|&i| value(i as usize).ln()).collect();
        if let Some(s) = g.law.alpha_blend() {
            let count = column(&|i| depth_of(s.opacity[i]));
            return Logs { size, count, weight: Some(column(&|i| s.grey[i].clamp(DARKEST, 1e30))), shape };
        }
        let count = |i: usize| g.count[i].max(FEWEST);
        let relative = |m: &Vec<f64>| {
            let mean = block.mass / block.count as f64;
            column(&|i| (m[i] / count(i) / mean).clamp(1e-30, 1e30))
        };
        Logs { size, count: column(&count), weight: g.masses().map(relative), shape }
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
}

impl Floors {
    fn of(block: &Block) -> Floors {
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
        Floors { least, point }
    }
}

/// ln det / 6 and the coordinates of (ln C - its trace / 3) / 2, after the floors.
fn logarithm(cov: &Sym3, floors: &Floors) -> (f64, [f64; 5]) {
    // Scaled first: squares of 1e-30 or 1e30 lengths keep their digits in the rotations.
    let scale = cov.0[0].abs().max(cov.0[3].abs()).max(cov.0[5].abs());
    let least = floors.least * floors.least;
    if scale.is_nan() || scale <= least {
        return (floors.point.ln(), [0.0; 5]);
    }
    let e = cov.scale(1.0 / scale).eigen();
    let least = (e.values[0] * FLATTEST).max(least / scale);
    let half = e.values.map(|v| 0.5 * v.max(least).ln());
    let mean = (half[0] + half[1] + half[2]) / 3.0;
    let s = Sym3::from_eigen(&Eigen { values: half.map(|h| h - mean), vectors: e.vectors });
    (mean + 0.5 * scale.ln(), to_five(&s))
}
