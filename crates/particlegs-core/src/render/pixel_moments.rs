//! Moments of a field at a pixel of a Gaussian's footprint: those that a slab along depth leaves, and those under the
//! weight of another field (docs/law/fields.md).

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
}

/// The field that weighs, on a footprint of the one that is mapped.
pub(super) struct WeightFootprint {
    /// Its mean at the centre (a logarithm's, if it is logarithmic), and how it changes per pixel.
    pub value: f64,
    pub tilt: [f64; 2],
    /// Variance about that, and covariance with the field that is mapped.
    pub variance: f64,
    pub covariance: f64,
    /// Least and largest value; of a logarithmic field those of the logarithms.
    pub range: [f64; 2],
    /// One over its mean everywhere.
    pub per_mean: f64,
    pub excess: Option<LogExcess>,
    /// Change with depth, at one pixel.
    pub slope: f64,
}

/// The field that is mapped, at a pixel: its mean and variance without a slab.
#[derive(Clone, Copy)]
pub(super) struct PixelValue {
    pub mean: f64,
    pub variance: f64,
    /// Of a logarithmic field: what is added to the mean of the logarithms for the mean of values, and their range.
    pub excess: Option<(f64, LogExcess)>,
}

/// Moments under the weight.
pub(super) struct WeightedValue {
    /// The mean of the weight itself, of what a slab leaves, over that of all.
    pub weight: f64,
    pub mean: f64,
    pub variance: f64,
    /// Of a logarithmic field, the mean of values.
    pub value: f64,
}

impl WeightFootprint {
    /// At a place, in pixels from the footprint's centre, where a slab leaves a share. Both fields and depth are normal
    /// together; a logarithmic field weighs by an exponential, which moves their means.
    pub fn at(&self, place: [f64; 2], q: PixelValue, slab: Option<&DepthCut>) -> WeightedValue {
        let weight_mean = self.value + self.tilt[0] * place[0] + self.tilt[1] * place[1];
        let moments = |tilt: f64| slab.map_or([1.0, 0.0, 0.0, 0.0], |s| s.moments(place, tilt));
        let [of_q, of_w] = slab.map_or([0.0; 2], |s| [s.slope, self.slope].map(|slope| slope * s.deviation));
        let [share, shift, change, skew] = moments(0.0);
        // Without the part that depth explains.
        let left = self.covariance - of_q * of_w;
        let log_share = |tilt: f64| libm::log(moments(tilt)[0] / share);
        let values = |log: f64| q.excess.map_or(0.0, |(added, _)| added + q.mean + 0.5 * q.variance + log);
        match self.excess {
            None => {
                let [least, largest] = self.range;
                let weight = (weight_mean + of_w * shift).clamp(least, largest);
                let mean = q.mean + of_q * shift;
                let per = 1.0 / weight.max(f64::MIN_POSITIVE);
                let moved = per * (self.covariance + of_q * of_w * change);
                let value = q.excess.map_or(0.0, |(_, LogExcess { range, .. })| {
                    let under = (weight_mean + left + of_w * (of_q + moments(of_q)[1])).clamp(least, largest);
                    let mean = libm::exp(values(log_share(of_q)).clamp(range[0], range[1]));
                    mean * under * per
                });
                let variance = q.variance + of_q * of_q * (change + per * of_w * skew) - moved * moved;
                WeightedValue { weight: weight * self.per_mean, mean: mean + moved, variance, value }
            }
            Some(LogExcess { added, range: [least, largest] }) => {
                let [_, shift, change, _] = moments(of_w);
                let whole = weight_mean + 0.5 * self.variance + added;
                let log = (whole + log_share(of_w)).clamp(least, largest);
                let value = q.excess.map_or(0.0, |(_, LogExcess { range, .. })| {
                    let both = values(whole + self.covariance + log_share(of_q + of_w));
                    libm::exp((both - log).clamp(range[0], range[1]))
                });
                WeightedValue {
                    weight: libm::exp(log) * self.per_mean,
                    mean: q.mean + left + of_q * (of_w + shift),
                    variance: q.variance + of_q * of_q * change,
                    value,
                }
            }
        }
    }
}
