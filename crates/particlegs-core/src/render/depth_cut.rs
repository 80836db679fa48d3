//! The part of a Gaussian that a slab along depth leaves at a pixel, and that of a logarithmic field
//! (docs/law/fields.md).

use crate::splat::erf;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// A slab that leaves less of a Gaussian at a pixel leaves nothing.
const LEAST_SHARE: f64 = 1e-9;

/// The step from a mean of logarithms to the mean of values.
#[derive(Clone, Copy)]
pub(super) struct LogExcess {
    /// Added to the logarithm of a log-normal distribution's mean.
    pub added: f64,
    /// The logarithms' least and largest value.
    pub range: [f64; 2],
}

/// A normal distribution of depth at each pixel, cut off at two depths, and how values change with depth there.
#[derive(Clone, Copy)]
pub(super) struct DepthCut {
    /// The mean depth at the footprint's centre, and how it changes per pixel.
    pub mean: f64,
    pub tilt: [f64; 2],
    pub deviation: f64,
    /// The nearest and farthest depth that count.
    pub range: [f64; 2],
    /// Change of the value per depth, at one pixel.
    pub slope: f64,
}

impl DepthCut {
    /// The share of the mass that is left at a place, in pixels from the centre, and what that makes of depth's mean, variance
    /// and third moment (the changes of the first two), in its deviations: those of a truncated normal distribution whose mean
    /// is moved by `tilt` of them, as a weight of exp(tilt) for each does.
    pub fn moments(&self, from_center: [f64; 2], tilt: f64) -> [f64; 4] {
        let mean = self.mean + self.tilt[0] * from_center[0] + self.tilt[1] * from_center[1];
        let [low, high] = self.range.map(|d| (d - mean) / self.deviation - tilt);
        let share = 0.5 * (erf(high * FRAC_1_SQRT_2) - erf(low * FRAC_1_SQRT_2));
        if share < LEAST_SHARE {
            return [0.0; 4];
        }
        let density = |z: f64| libm::exp(-0.5 * z * z) / (2.0 * PI).sqrt();
        let [at_low, at_high] = [density(low), density(high)];
        // An end at infinity adds nothing.
        let end = |z: f64, density: f64| if density > 0.0 { z * density } else { 0.0 };
        let shift = (at_low - at_high) / share;
        let square = (end(low, at_low) - end(high, at_high)) / share;
        let cube = (end(low * low, at_low) - end(high * high, at_high)) / share;
        let skew = cube - shift * (1.0 + 3.0 * square - 2.0 * shift * shift);
        [share, shift, square - shift * shift, skew]
    }

    /// The share that is left at a place, the value's change on average, and that of its variance.
    pub fn at(&self, from_center: [f64; 2]) -> [f64; 3] {
        let [share, shift, change, _] = self.moments(from_center, 0.0);
        let scale = self.slope * self.deviation;
        [share, scale * shift, scale * scale * change]
    }

    /// The factor of the cut on the mean of exp(value): the share of the mass that is left where each depth weighs by
    /// it, over [`DepthCut::at`]'s share.
    pub fn tilted(&self, from_center: [f64; 2], share: f64) -> f64 {
        self.moments(from_center, self.slope * self.deviation)[0] / share
    }
}
