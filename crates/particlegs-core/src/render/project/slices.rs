//! Gaussians cut along depth: those that reach far in depth for their distance, that the camera
//! stands in, or that the clipping range cuts.
//!
//! The depth axis (its logarithm in perspective) is covered with cubic B-splines, which sum to 1
//! and are smooth, so that the pieces blend without seams. Each piece is the Gaussian times one
//! spline, inside the clipping range; its moments are sums over a fine grid of depths.

use super::{CameraGaussian, DepthMoments, DepthSlopes, inverse_moments, inverse_slopes};
use crate::render::lens::Lens;

/// A Gaussian whose depth spread is a larger share of its depth is cut.
pub const LARGEST_SPREAD: f64 = 0.03;
/// Standard deviations of depth that are looked at.
pub const REACH: f64 = 5.0;
/// Distance of the splines in the logarithm of depth.
const STEP: f64 = 0.05;
/// Grid points for a step.
const POINTS: usize = 8;
/// More pieces than this are never made; they grow coarser instead.
const MOST: f64 = 1024.0;

/// Whether a Gaussian is drawn whole, cut, or not at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipClass {
    /// In one piece.
    Whole,
    /// In pieces along depth.
    Cut,
    /// Outside the clipping range.
    Outside,
}

/// Decides for a mean depth and its variance.
#[inline(always)]
pub fn clip_class(lens: &Lens, depth: f64, variance: f64) -> ClipClass {
    let reach = REACH * variance.max(0.0).sqrt();
    let [near, far] = lens.range;
    // No short cuts: where many are decided on, the compiler makes vectors of this.
    if (depth + reach < near) | (depth - reach > far) {
        ClipClass::Outside
    } else if (depth - reach < near)
        | (depth + reach > far)
        | (lens.perspective & (variance > LARGEST_SPREAD * LARGEST_SPREAD * depth * depth))
    {
        ClipClass::Cut
    } else {
        ClipClass::Whole
    }
}

/// Whether a Gaussian lies outside the four side planes of what the picture sees. Spares the work of cutting those that
/// the camera passes by.
pub fn misses(lens: &Lens, g: &CameraGaussian) -> bool {
    let ([x, y, depth], [xx, _, yy], zz) = (g.mean.map(f64::from), g.rest(), f64::from(g.depth));
    let along = g.slope.map(f64::from);
    let sides = [(x, xx, along[0], lens.center[0]), (y, yy, along[1], lens.center[1])];
    sides.into_iter().any(|(at, rest, along, center)| {
        // Half the picture and a margin for coarse planes, over the focal length.
        let edge = (1.25 * center + 64.0) / lens.focal;
        [edge, -edge].into_iter().any(|t| {
            // The distance to the plane at = t depth (or at = t), beyond it positive.
            let (beyond, lean, round) =
                if lens.perspective { (at - t * depth, along - t, 1.0 + t * t) } else { (at - t, along, 1.0) };
            let (beyond, spread) = (beyond * t.signum(), rest + lean * lean * zz);
            // Seven deviations beyond a plane nothing of a Gaussian shows.
            beyond > 0.0 && beyond * beyond > 49.0 * (spread + lens.radius2 * round)
        })
    })
}

/// Calls `emit` with the moments of each piece that the picture may show.
#[inline(always)]
pub fn pieces(lens: &Lens, g: &CameraGaussian, mut emit: impl FnMut(DepthMoments)) {
    let [depth, variance] = g.depths();
    match clip_class(lens, depth, variance) {
        ClipClass::Outside => {}
        ClipClass::Cut if misses(lens, g) => {}
        ClipClass::Whole => emit(whole(lens, depth, variance)),
        ClipClass::Cut => cut(lens, depth, variance, emit),
    }
}

/// Calls `emit` with the moments of each piece that the picture may show, and their slopes, of a Gaussian in perspective.
pub fn pieces_with_slopes(lens: &Lens, g: &CameraGaussian, mut emit: impl FnMut(DepthMoments, DepthSlopes)) {
    let [depth, variance] = g.depths();
    match clip_class(lens, depth, variance) {
        ClipClass::Outside => {}
        ClipClass::Cut if misses(lens, g) => {}
        ClipClass::Whole => emit(whole(lens, depth, variance), inverse_slopes(depth, variance)),
        ClipClass::Cut => cut_with_slopes(lens, depth, variance, emit),
    }
}

/// The moments of a Gaussian in one piece.
#[inline(always)]
pub fn whole(lens: &Lens, depth: f64, variance: f64) -> DepthMoments {
    if lens.perspective {
        inverse_moments(depth, variance / (depth * depth))
    } else {
        DepthMoments { weight: 1.0, mean: depth, square: 0.0, variance }
    }
}

/// Calls `emit` with the moments of each piece.
pub fn cut(lens: &Lens, depth: f64, variance: f64, mut emit: impl FnMut(DepthMoments)) {
    slice::<3>(lens, depth, variance, |sums| emit(moments(sums)));
}

/// Calls `emit` with the moments of each piece and their slopes; the splines stay where they are.
fn cut_with_slopes(lens: &Lens, depth: f64, variance: f64, mut emit: impl FnMut(DepthMoments, DepthSlopes)) {
    slice::<9>(lens, depth, variance, |sums| {
        let [weight, first, second] = [sums[0], sums[1], sums[2]];
        let m = moments(&[weight, first, second]);
        let by = |at: usize| {
            let mean = (sums[at + 1] - m.mean * sums[at]) / weight;
            let square = (sums[at + 2] - m.square * sums[at]) / weight;
            let variance = if m.variance > 0.0 { square - 2.0 * m.mean * mean } else { 0.0 };
            DepthMoments { weight: sums[at], mean, square, variance }
        };
        emit(m, DepthSlopes { by_depth: by(3), by_variance: by(6) });
    });
}

/// Moments from a piece's sums of w, w q and w q^2.
fn moments(&[weight, first, second]: &[f64; 3]) -> DepthMoments {
    let (mean, square) = (first / weight, second / weight);
    DepthMoments { weight, mean, square, variance: (square - mean * mean).max(0.0) }
}

/// Calls `emit` with the sums of each piece: w, w q, w q^2 and, where `N` is 9, their changes with
/// the mean depth and with its variance.
fn slice<const N: usize>(lens: &Lens, mean: f64, variance: f64, mut emit: impl FnMut(&[f64; N])) {
    let [near, far] = lens.range;
    let sigma = variance.max(0.0).sqrt();
    let (lo, hi) = ((mean - REACH * sigma).max(near), (mean + REACH * sigma).min(far));
    if lo >= hi {
        // No spread (or none inside): all or nothing, as for a particle.
        if mean >= near && mean <= far {
            emit(&flat(lens, mean));
        }
        return;
    }
    let (from, to) = if lens.perspective { (libm::log(lo), libm::log(hi)) } else { (lo, hi) };
    let length = to - from;
    // In the axis' unit: no coarser than the Gaussian itself, nor than perspective allows.
    let gaussian_step = 0.35 * sigma / if lens.perspective { hi.min(mean.max(lo)) } else { 1.0 };
    let step = if lens.perspective { STEP.min(gaussian_step) } else { gaussian_step };
    let steps = (length / step).ceil().clamp(1.0, MOST);
    let step = length / steps;
    // A cubic spline spans four steps, so there are three more splines than steps.
    let mut pieces = vec![[0.0f64; N]; steps as usize + 3];
    let points = steps as usize * POINTS;
    for i in 0..points {
        let u = (i as f64 + 0.5) / POINTS as f64;
        let axis = from + step * u;
        let depth = if lens.perspective { libm::exp(axis) } else { axis };
        let z = (depth - mean) / sigma;
        let stretch = if lens.perspective { depth } else { 1.0 };
        let density =
            libm::exp(-0.5 * z * z) * stretch * step / (POINTS as f64 * sigma * (2.0 * std::f64::consts::PI).sqrt());
        let (q, density) = if lens.perspective { (1.0 / depth, density / (depth * depth)) } else { (depth, density) };
        let first = u as usize;
        // The density's relative changes with the mean and with the variance.
        let slopes = [1.0, z / sigma, 0.5 * (z * z - 1.0) / (sigma * sigma)];
        for (k, b) in spline(u - first as f64).into_iter().enumerate() {
            let w = b * density;
            for (sums, slope) in pieces[first + k].chunks_exact_mut(3).zip(slopes) {
                let w = w * slope;
                sums[0] += w;
                sums[1] += w * q;
                sums[2] += w * q * q;
            }
        }
    }
    pieces.iter().filter(|sums| sums[0] > 0.0).for_each(emit);
}

/// Sums of a Gaussian without depth; what they would change with is left at 0.
fn flat<const N: usize>(lens: &Lens, depth: f64) -> [f64; N] {
    let (weight, q) = if lens.perspective { (1.0 / (depth * depth), 1.0 / depth) } else { (1.0, depth) };
    let mut sums = [0.0; N];
    sums[..3].copy_from_slice(&[weight, weight * q, weight * q * q]);
    sums
}

/// The four cubic B-splines that reach a point `t` in [0, 1) of a step.
fn spline(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    let s = 1.0 - t;
    [s * s * s / 6.0, (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0, (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) / 6.0, t3 / 6.0]
}
