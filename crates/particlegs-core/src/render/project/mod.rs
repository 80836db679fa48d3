//! From a Gaussian in the world to a Gaussian on the picture plane.
//!
//! In perspective a point at lateral position m + g (d - d0) and depth d lands at
//! f (g + c / d), c = m - g d0: linear in the inverse depth s = 1/d. So the picture of a Gaussian
//! follows from moments of s, weighted with s^2 as every law here weighs it: exact to second order
//! whatever the depth spread, where the first-order projection (J S J^T) is off by the square of
//! spread over depth. For a small spread both agree.

pub mod slices;

use self::slices::{ClipClass, clip_class, whole};
use super::bin::{FootprintForm, lattice_sums};
use super::lens::Lens;
use crate::math::{Sym3, dot, each_axis};
use crate::model::Mixture;
use crate::splat::PIXEL_VARIANCE;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};

/// A Gaussian in the camera's axes (right, down, forward), relative to the eye: what the projection reads, 40
/// bytes, as a GPU reads them. Lengths are in the lens' unit. The covariance is held as its factors
/// in the order depth, y, x, each given those before: rounding moves a point of the Gaussian by some 1e-7 of its
/// extent, where six rounded moments would lose a long one's width.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct CameraGaussian {
    /// Mean.
    pub mean: [f32; 3],
    /// Variance of depth.
    pub depth: f32,
    /// Change of x and y with depth.
    pub slope: [f32; 2],
    /// Variance of y at a given depth.
    pub down: f32,
    /// Change of x with y at a given depth.
    pub lean: f32,
    /// Variance of x at a given depth and y.
    pub across: f32,
    /// Its sum over pixels, times depth squared in perspective; its opacity under the alpha-blend
    /// law.
    pub weight: f32,
}

/// A Gaussian (or a piece of one) on the picture plane: what the projection writes, 24 bytes, as a GPU reads
/// them. The covariance, with the pixel's own variance, is held as its factors, y before x.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Footprint {
    /// Mean, pixels from the left and the top; pixel centres have whole coordinates.
    pub mean: [f32; 2],
    /// Variance of y, pixels^2.
    pub down: f32,
    /// Change of x with y.
    pub lean: f32,
    /// Variance of x at a given y, pixels^2.
    pub across: f32,
    /// Its sum over pixels.
    pub sum: f32,
}

/// Moments of what the picture plane depends on, over the depths of (a part of) a Gaussian: the
/// inverse depth weighted by its square in perspective, the depth itself in an orthographic view.
#[derive(Clone, Copy, Debug)]
pub struct DepthMoments {
    /// E[s^2] (perspective) or the share of the Gaussian.
    pub weight: f64,
    /// Weighted mean.
    pub mean: f64,
    /// Weighted mean square.
    pub square: f64,
    /// Weighted variance.
    pub variance: f64,
}

/// Moments of 1/d for d normal with mean `d` and (variance / mean^2) `e`, by their series in e.
#[inline(always)]
pub fn inverse_moments(d: f64, e: f64) -> DepthMoments {
    let s = 1.0 / d;
    let m2 = 1.0 + e * (3.0 + 15.0 * e);
    let m3 = 1.0 + e * (6.0 + 45.0 * e);
    let m4 = 1.0 + e * (10.0 + 105.0 * e);
    let inverse = 1.0 / m2;
    // m4 m2 - m3^2 written out, as the difference cancels.
    let spread = e * (1.0 + e * (24.0 - e * (75.0 + 450.0 * e)));
    DepthMoments {
        weight: m2 * s * s,
        mean: m3 * inverse * s,
        square: m4 * inverse * s * s,
        variance: spread.max(0.0) * inverse * inverse * s * s,
    }
}

/// Changes of [`DepthMoments`] with the Gaussian's mean depth and with its variance of depth.
#[derive(Clone, Copy, Debug)]
pub struct DepthSlopes {
    /// With the mean depth.
    pub by_depth: DepthMoments,
    /// With the variance.
    pub by_variance: DepthMoments,
}

/// The slopes of [`inverse_moments`] at `e = variance / d^2`.
pub fn inverse_slopes(d: f64, variance: f64) -> DepthSlopes {
    let s = 1.0 / d;
    let s2 = s * s;
    let e = variance * s2;
    let (m2, by2) = (1.0 + e * (3.0 + 15.0 * e), 3.0 + 30.0 * e);
    let (m3, by3) = (1.0 + e * (6.0 + 45.0 * e), 6.0 + 90.0 * e);
    let (m4, by4) = (1.0 + e * (10.0 + 105.0 * e), 10.0 + 210.0 * e);
    let spread = e * (1.0 + e * (24.0 - e * (75.0 + 450.0 * e)));
    let by_spread = if spread > 0.0 { 1.0 + e * (48.0 - e * (225.0 + 1800.0 * e)) } else { 0.0 };
    let inverse = 1.0 / m2;
    let quotient = |v: f64, by: f64| (by - v * inverse * by2) * inverse;
    let by_e = DepthMoments {
        weight: by2 * s2,
        mean: quotient(m3, by3) * s,
        square: quotient(m4, by4) * s2,
        variance: (by_spread - 2.0 * spread.max(0.0) * inverse * by2) * inverse * inverse * s2,
    };
    let m = inverse_moments(d, e);
    // e falls with depth as 1/d^2, and the moments with their own powers of it.
    let by_depth = |value: f64, power: f64, by_e: f64| -s * (power * value + 2.0 * e * by_e);
    DepthSlopes {
        by_depth: DepthMoments {
            weight: by_depth(m.weight, 2.0, by_e.weight),
            mean: by_depth(m.mean, 1.0, by_e.mean),
            square: by_depth(m.square, 2.0, by_e.square),
            variance: by_depth(m.variance, 2.0, by_e.variance),
        },
        by_variance: DepthMoments {
            weight: by_e.weight * s2,
            mean: by_e.mean * s2,
            square: by_e.square * s2,
            variance: by_e.variance * s2,
        },
    }
}

/// The covariance xx, xy, yy of what is left of x and y, from its factors.
#[inline(always)]
fn covariance([down, lean, across]: [f32; 3]) -> [f64; 3] {
    let [down, lean, across] = [down, lean, across].map(f64::from);
    [across + lean * lean * down, lean * down, down]
}

impl CameraGaussian {
    /// In f64 until it is relative to the eye and factored, as both are differences of large numbers. A spread that
    /// is rounding noise beside the others counts as none.
    #[inline(always)]
    pub fn new(axes: &[[f64; 3]; 3], eye: [f64; 3], mean: [f64; 3], cov: &Sym3, weight: f64) -> CameraGaussian {
        let from_eye = each_axis(|k| mean[k] - eye[k]);
        let [right, down, forward] = *axes;
        let [with_right, with_down, with_forward] = axes.map(|a| cov.apply(a));
        let (xx, xy, yy) = (dot(right, with_right), dot(right, with_down), dot(down, with_down));
        let (xz, yz, zz) = (dot(right, with_forward), dot(down, with_forward), dot(forward, with_forward));
        // A variance that rounding alone made would send slopes to infinity.
        let inverse = |v: f64, others: f64| if v > 1e-14 * others { 1.0 / v } else { 0.0 };
        let slope = [xz, yz].map(|v| v * inverse(zz, xx + yy));
        let (xx, xy, yy) = ((xx - slope[0] * xz).max(0.0), xy - slope[0] * yz, (yy - slope[1] * yz).max(0.0));
        let lean = xy * inverse(yy, xx);
        CameraGaussian {
            mean: axes.map(|a| dot(a, from_eye) as f32),
            depth: zz as f32,
            slope: slope.map(|v| v as f32),
            down: yy as f32,
            lean: lean as f32,
            across: (xx - lean * xy).max(0.0) as f32,
            weight: weight as f32,
        }
    }

    /// Gaussian `i` of a mixture, of `weight` particles or masses; `None` outside the clipping range.
    #[inline(always)]
    pub fn from_mixture(lens: &Lens, m: &Mixture, i: usize, weight: f64) -> Option<CameraGaussian> {
        let (mean, cov, forward) = (m.mean_of(i), m.cov_of(i), lens.axes[2]);
        let depth = dot(forward, each_axis(|k| mean[k] - lens.position[k]));
        let inside = clip_class(lens, depth, dot(forward, cov.apply(forward))) != ClipClass::Outside;
        inside.then(|| CameraGaussian::new(&lens.axes, lens.position, mean, &cov, lens.unit * weight))
    }

    /// Mean and variance of its depth.
    #[inline(always)]
    pub fn depths(&self) -> [f64; 2] {
        [self.mean[2], self.depth].map(f64::from)
    }

    /// Covariance xx, xy, yy at a given depth.
    #[inline(always)]
    pub fn rest(&self) -> [f64; 3] {
        covariance([self.down, self.lean, self.across])
    }

    /// The footprint of the part that `m` describes; in f64, as what a long Gaussian leaves of its width is a
    /// difference.
    #[inline(always)]
    pub fn footprint(&self, lens: &Lens, m: &DepthMoments) -> Footprint {
        let [x, y, d] = self.mean.map(f64::from);
        let (along, rest) = (self.slope.map(f64::from), self.rest());
        // position = base + slope * q with q the moments' variable.
        let carried = [x - along[0] * d, y - along[1] * d];
        let (base, slope) = if lens.perspective { (along, carried) } else { (carried, along) };
        let scale2 = if lens.perspective { m.square } else { 1.0 };
        let f2 = lens.focal * lens.focal;
        let t = [base[0] + slope[0] * m.mean, base[1] + slope[1] * m.mean];
        // J J^T of the particle's own roundness: grows towards the corners in perspective.
        let tilt = if lens.perspective { [t[0] * t[0], t[0] * t[1], t[1] * t[1]] } else { [0.0; 3] };
        let round = scale2 * lens.radius2;
        let xx = f2 * (rest[0] * scale2 + slope[0] * slope[0] * m.variance + round * (1.0 + tilt[0])) + PIXEL_VARIANCE;
        let xy = f2 * (rest[1] * scale2 + slope[0] * slope[1] * m.variance + round * tilt[1]);
        let yy = f2 * (rest[2] * scale2 + slope[1] * slope[1] * m.variance + round * (1.0 + tilt[2])) + PIXEL_VARIANCE;
        let lean = xy / yy;
        Footprint {
            mean: [0, 1].map(|k| (lens.center[k] + lens.focal * t[k]) as f32),
            down: yy as f32,
            lean: lean as f32,
            across: (xx - lean * xy) as f32,
            sum: (f64::from(self.weight) * m.weight) as f32,
        }
    }
}

impl Footprint {
    /// Covariance xx, xy, yy.
    #[inline(always)]
    pub fn cov(&self) -> [f64; 3] {
        covariance([self.down, self.lean, self.across])
    }

    /// Its value at a point of the picture, in pixels.
    pub fn at(&self, pixel: [f64; 2]) -> f64 {
        let [dx, dy] = [0, 1].map(|k| pixel[k] - f64::from(self.mean[k]));
        let [down, lean, across, sum] = [self.down, self.lean, self.across, self.sum].map(f64::from);
        let aside = dx - lean * dy;
        let peak = sum / (2.0 * std::f64::consts::PI * (down * across).sqrt());
        peak * libm::exp(-0.5 * (dy * dy / down + aside * aside / across))
    }
}

/// Gaussians that go from stage to stage together: their columns stay in the nearest cache.
pub(super) const BLOCK: usize = 64;

/// Gaussians of a mixture in columns, as many as go together, with their weights: what stands beyond the last means nothing.
pub(super) struct GaussianBlock {
    mean: [[f64; BLOCK]; 3],
    cov: [[f64; BLOCK]; 6],
    pub weight: [f64; BLOCK],
}

impl GaussianBlock {
    pub const EMPTY: Self = GaussianBlock { mean: [[0.0; BLOCK]; 3], cov: [[0.0; BLOCK]; 6], weight: [0.0; BLOCK] };

    /// Takes the Gaussians of these numbers.
    pub fn read(&mut self, m: &Mixture, range: std::ops::Range<usize>, weight: &impl Fn(usize) -> f64) {
        let n = range.len();
        for (block, column) in self.mean.iter_mut().zip(&m.mean).chain(self.cov.iter_mut().zip(&m.cov)) {
            block[..n].copy_from_slice(&column[range.clone()]);
        }
        self.weight[..n].iter_mut().zip(range).for_each(|(w, i)| *w = weight(i));
    }
}

/// The footprints of a block of Gaussians, as far as these are in one piece, in columns.
pub(super) struct FootprintBlock {
    /// Which are.
    pub is_whole: [bool; BLOCK],
    /// The columns of [`Footprint`], in its order.
    footprints: [[f32; BLOCK]; 6],
    /// The columns of [`FootprintForm`], in its order.
    shapes: [[f64; BLOCK]; 3],
    /// Sums over the pixel grid.
    lattice: [f32; BLOCK],
}

impl FootprintBlock {
    pub const EMPTY: Self = FootprintBlock {
        is_whole: [false; BLOCK],
        footprints: [[0.0; BLOCK]; 6],
        shapes: [[0.0; BLOCK]; 3],
        lattice: [0.0; BLOCK],
    };

    /// Footprint `k`, what its stroke follows from, and its sum over the pixel grid.
    #[inline(always)]
    pub fn footprint(&self, k: usize) -> (Footprint, FootprintForm, f64) {
        let footprint: [f32; 6] = std::array::from_fn(|c| self.footprints[c][k]);
        let [across, peak, smaller] = each_axis(|c| self.shapes[c][k]);
        (bytemuck::cast(footprint), FootprintForm { across, peak, smaller }, f64::from(self.lattice[k]))
    }

    /// Projects all Gaussians of a block.
    #[inline(always)]
    pub fn project<S: Simd>(&mut self, simd: S, lens: &Lens, block: &GaussianBlock) {
        // A copy, as these loops become vectors only where nothing that they write can be what they read.
        let lens = *lens;
        for k in 0..BLOCK {
            let (mean, cov) = (each_axis(|a| block.mean[a][k]), Sym3(std::array::from_fn(|a| block.cov[a][k])));
            let g = CameraGaussian::new(&lens.axes, lens.position, mean, &cov, lens.unit * block.weight[k]);
            let [depth, variance] = g.depths();
            self.is_whole[k] = clip_class(&lens, depth, variance) == ClipClass::Whole;
            let footprint: [f32; 6] = bytemuck::cast(g.footprint(&lens, &whole(&lens, depth, variance)));
            (0..6).for_each(|c| self.footprints[c][k] = footprint[c]);
        }
        for k in 0..BLOCK {
            let footprint: [f32; 6] = std::array::from_fn(|c| self.footprints[c][k]);
            let shape = FootprintForm::new(&bytemuck::cast(footprint));
            self.shapes[0][k] = shape.across;
            self.shapes[1][k] = shape.peak;
            self.shapes[2][k] = shape.smaller;
        }
        for k in (0..BLOCK).step_by(8) {
            let eight = |c: usize| f32x8::from_slice(simd, &self.footprints[c][k..k + 8]);
            lattice_sums([eight(0), eight(1), eight(2), eight(3), eight(4)]).store_slice(&mut self.lattice[k..k + 8]);
        }
    }
}

/// The footprints of Gaussians, of all their pieces.
pub fn project(lens: &Lens, gaussians: &[CameraGaussian], footprints: &mut Vec<Footprint>) {
    for g in gaussians {
        slices::pieces(lens, g, |m| footprints.push(g.footprint(lens, &m)));
    }
}
