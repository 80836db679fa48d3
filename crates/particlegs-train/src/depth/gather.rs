//! Sums that a footprint gathers from a gradient plane: the moments of gradient times footprint.

use super::adjoint::FootprintGradient;
use fearless_simd::prelude::*;
use fearless_simd::{Level as SimdLevel, Simd, f32x8};
use particlegs_core::render::bin::{PlacedFootprint, RasterSplat, lattice_slope};
use particlegs_core::render::project::Footprint;
use particlegs_core::render::raster::exp2;
use particlegs_core::render::raster::pyramid::{Level, PAD};

/// Sums over a splat's pixels of gradient times exp(-q/2) times powers of the offset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GradientMoments {
    /// 1
    pub sum: f64,
    pub first: [f64; 2],
    pub second: [f64; 3],
}

/// Gathers `gradient`, a plane of `level`, over a splat.
pub fn gather(simd: SimdLevel, gradient: &[f32], level: &Level, splat: &RasterSplat) -> GradientMoments {
    fearless_simd::dispatch!(simd, simd => gather_all(simd, gradient, level, splat))
}

#[inline(always)]
fn gather_all<S: Simd>(simd: S, gradient: &[f32], level: &Level, s: &RasterSplat) -> GradientMoments {
    let zero = f32x8::splat(simd, 0.0);
    let lanes = f32x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let width = level.size.width + 2 * PAD;
    let top = (s.y - s.half).ceil().max(0.0) as usize;
    let bottom = (s.y + s.half).floor().min(level.rows as f32 - 1.0);
    // Sums of g e times: 1, u, u^2, v, u v, v^2; u along the row from its centre, v down.
    let mut sums = [zero; 6];
    if bottom >= 0.0 {
        let inverse = 1.0 / s.along;
        for row in top..=bottom as usize {
            let dy = row as f32 - s.y;
            let fall = s.down * (dy * dy);
            // along, down and end are negative: a row's chord is where the exponent is not below `end`.
            let left_over = (s.end - fall) * inverse;
            if left_over < 0.0 {
                continue;
            }
            let half_width = left_over.sqrt();
            let center = s.x + s.slope * dy;
            let from = (center - half_width).ceil().max(0.0);
            let to = (center + half_width).floor().min(width as f32 - 1.0);
            if to < from {
                continue;
            }
            let start = row * level.stride + from as usize;
            let count = (to - from) as usize + 1;
            // Whole vectors may run past the chord: rows have room for one more, and the exponent masks those pixels.
            let pixels = &gradient[start..start + count.next_multiple_of(8)];
            let mut dx = lanes + (from - center);
            // dy is constant along a row, so three sums over its pixels are enough for all six.
            let mut row_sums = [zero; 3];
            for eight in pixels.chunks_exact(8) {
                let square = dx * dx;
                let power = square * s.along + fall;
                let value = power.simd_ge(s.end).select(exp2(power), zero) * f32x8::from_slice(simd, eight);
                row_sums[0] += value;
                row_sums[1] += value * dx;
                row_sums[2] += value * square;
                dx += 8.0;
            }
            sums[0] += row_sums[0];
            sums[1] += row_sums[1];
            sums[2] += row_sums[2];
            sums[3] += row_sums[0] * dy;
            sums[4] += row_sums[1] * dy;
            sums[5] += row_sums[0] * (dy * dy);
        }
    }
    let [n, u, uu, v, uv, vv] = sums.map(total);
    // x = u + slope v
    let slope = f64::from(s.slope);
    GradientMoments {
        sum: n,
        first: [u + slope * v, v],
        second: [uu + slope * (2.0 * uv + slope * vv), uv + slope * vv, vv],
    }
}

/// The lanes' sum in a fixed order.
#[inline(always)]
fn total<S: Simd>(v: f32x8<S>) -> f64 {
    let mut lanes = [0.0f32; 8];
    v.store_slice(&mut lanes);
    lanes.iter().map(|&l| f64::from(l)).sum()
}

/// From the gathered moments to the gradient with the footprint.
pub fn of_footprint(f: &Footprint, placed: &PlacedFootprint, g: &GradientMoments) -> FootprintGradient {
    let peak = f64::from(placed.stroke.peak);
    let ([xx, _, yy], across, lean) = (f.cov(), f64::from(f.across), f64::from(f.lean));
    // The inverse covariance, in the picture's pixels; offsets were gathered in the plane's.
    let p = [1.0 / across, -lean / across, xx / (across * yy)];
    let unscale = 1.0 / placed.scale;
    let first = [g.first[0] * unscale, g.first[1] * unscale];
    let second = g.second.map(|v| v * unscale * unscale);
    // P S P
    let left = [
        p[0] * second[0] + p[1] * second[1],
        p[0] * second[1] + p[1] * second[2],
        p[1] * second[0] + p[2] * second[1],
        p[1] * second[1] + p[2] * second[2],
    ];
    let pxx = left[0] * p[0] + left[1] * p[1];
    let pxy = left[0] * p[1] + left[1] * p[2];
    let pyy = left[2] * p[1] + left[3] * p[2];
    // The terms of -P are the peak's, which goes with the root of the determinant; xy moves both of its pair.
    let mut gradient = FootprintGradient {
        mean: [peak * (p[0] * first[0] + p[1] * first[1]), peak * (p[1] * first[0] + p[2] * first[1])],
        cov: [0.5 * peak * (pxx - g.sum * p[0]), peak * (pxy - g.sum * p[1]), 0.5 * peak * (pyy - g.sum * p[2])],
        sum: g.sum * peak / f64::from(f.sum),
    };
    if placed.small {
        // The peak of a small footprint is divided by its lattice sum, which moves with mean and covariance.
        let (mean, cov) = lattice_slope(f.mean.map(f64::from), f.cov());
        let scale = g.sum * peak;
        gradient.mean.iter_mut().zip(mean).for_each(|(a, b)| *a -= scale * b);
        gradient.cov.iter_mut().zip(cov).for_each(|(a, b)| *a -= scale * b);
    }
    gradient
}
