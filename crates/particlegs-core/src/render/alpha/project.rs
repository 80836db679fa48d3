//! One Gaussian on the picture: the affine approximation of EWA splatting (Zwicker et al. 2001) as
//! 3DGS takes it, widened by a pixel and dimmed for that.

use super::eye::Eye;
use crate::math::Sym3;

/// Variance added to every footprint along either axis: one pixel, in quadrature (docs/law/published.md).
pub const LOW_PASS: f64 = 1.0;

/// Least ratio of determinants that is compensated for (3DGS, antialiasing).
pub const LEAST_RATIO: f64 = 2.5e-5;

/// A Gaussian in the training frame, adapted to radius and opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Mean.
    pub mean: [f64; 3],
    /// Covariance.
    pub cov: Sym3,
    /// Opacity at its peak, in (0, 1).
    pub opacity: f64,
    /// Grey level, 1 = white.
    pub grey: f64,
}

/// A Gaussian's footprint.
#[derive(Clone, Copy, Debug)]
pub struct Projected {
    /// Its centre, pixels.
    pub at: [f64; 2],
    /// Right, down, depth in the training frame.
    pub seen: [f64; 3],
    /// The slopes x/depth and y/depth at which the shape is taken, and whether they were cut off.
    pub slope: [(f64, bool); 2],
    /// Covariance xx, xy, yy before widening, square pixels.
    pub sharp: [f64; 3],
    /// Covariance after.
    pub wide: [f64; 3],
    /// Determinant before.
    pub sharp_det: f64,
    /// Determinant after.
    pub wide_det: f64,
    /// Factor on opacity.
    pub compensation: f64,
}

/// Rows of J A: what a step of the place does to the centre in pixels, at first order.
pub fn jacobian(eye: &Eye, depth: f64, slope: [f64; 2]) -> [[f64; 3]; 2] {
    let unit = eye.focal / depth;
    let [right, down, forward] = eye.axes;
    let row = |axis: [f64; 3], slope: f64| std::array::from_fn(|k| unit * (axis[k] - slope * forward[k]));
    [row(right, slope[0]), row(down, slope[1])]
}

/// The footprint, or `None` in front of the near plane or beyond the far one, or where a number is
/// not one.
pub fn project(eye: &Eye, mean: [f64; 3], cov: &Sym3) -> Option<Projected> {
    let seen = eye.see(mean);
    let [x, y, depth] = seen;
    if !(depth > eye.range[0] && depth <= eye.range[1]) {
        return None;
    }
    let slope = [(x / depth, eye.guard[0]), (y / depth, eye.guard[1])].map(|(s, g)| (s.clamp(-g, g), s.abs() > g));
    let [m0, m1] = jacobian(eye, depth, [slope[0].0, slope[1].0]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (s0, s1) = (cov.apply(m0), cov.apply(m1));
    let sharp = [dot(m0, s0), dot(m0, s1), dot(m1, s1)];
    let wide = [sharp[0] + LOW_PASS, sharp[1], sharp[2] + LOW_PASS];
    let det = |c: [f64; 3]| c[0] * c[2] - c[1] * c[1];
    let (sharp_det, wide_det) = (det(sharp).max(0.0), det(wide));
    let at = [eye.center[0] + eye.focal * x / depth, eye.center[1] + eye.focal * y / depth];
    let fine = at[0].is_finite() && at[1].is_finite() && wide_det > 0.0 && wide_det.is_finite();
    fine.then(|| Projected {
        at,
        seen,
        slope,
        sharp,
        wide,
        sharp_det,
        wide_det,
        compensation: (sharp_det / wide_det).max(LEAST_RATIO).sqrt(),
    })
}

/// A footprint as tiles are drawn with it. The alpha of a pixel is `peak 2^p` with
/// `p = along d^2 + down dy^2`, where d is its distance in x from the crest of its row.
/// 32 bytes, as a GPU reads them.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Centre, pixels from the left; pixel centres have whole coordinates.
    pub x: f32,
    /// Centre, pixels from the top.
    pub y: f32,
    /// How far the crest moves with a row, pixels.
    pub lean: f32,
    /// Fall along a row, 1/pixels^2; negative.
    pub along: f32,
    /// Fall of the crest from row to row, 1/pixels^2; negative.
    pub down: f32,
    /// Alpha at the centre.
    pub peak: f32,
    /// Power below which alpha is too small to be drawn.
    pub end: f32,
    /// Grey level.
    pub grey: f32,
}

impl Splat {
    /// With the reach in x and y of what is drawn; `None` where nothing is.
    pub fn new(p: &Projected, opacity: f64, grey: f64, least_alpha: f64) -> Option<(Splat, [f64; 2])> {
        let peak = opacity * p.compensation;
        // Not the negation: nothing is drawn of what is not a number.
        if !(peak >= least_alpha && peak.is_finite() && grey.is_finite()) {
            return None;
        }
        let [xx, xy, yy] = p.wide;
        let half_log2 = 0.5 * std::f64::consts::LOG2_E;
        let end = libm::log2(least_alpha / peak);
        let reach = [xx, yy].map(|v| (v * -end / half_log2).sqrt());
        let splat = Splat {
            x: p.at[0] as f32,
            y: p.at[1] as f32,
            lean: (xy / yy) as f32,
            along: (-half_log2 * yy / p.wide_det) as f32,
            down: (-half_log2 / yy) as f32,
            peak: peak as f32,
            end: end as f32,
            grey: grey as f32,
        };
        Some((splat, reach))
    }
}
