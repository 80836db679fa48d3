//! From a Gaussian in the world to a Gaussian on the picture plane.
//!
//! In perspective a point at lateral position m + g (d - d0) and depth d lands at
//! f (g + c / d), c = m - g d0: linear in the inverse depth s = 1/d. So the picture of a Gaussian
//! follows from moments of s, weighted with s^2 as every law here weighs it: exact to second order
//! whatever the depth spread, where the first-order projection (J S J^T) is off by the square of
//! spread over depth. For a small spread both agree.

use super::lens::Lens;
use crate::splat::PIXEL_VARIANCE;

/// A Gaussian on the picture plane, pixels.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// Mean; pixel centres have whole coordinates.
    pub mean: [f64; 2],
    /// Covariance xx, xy, yy with the pixel's own variance.
    pub cov: [f64; 3],
    /// Its sum over pixels.
    pub sum: f64,
}

/// A Gaussian in the camera's axes: right, down, forward.
#[derive(Clone, Copy, Debug)]
pub struct InCamera {
    /// Mean relative to the eye.
    pub mean: [f64; 3],
    /// Covariance xx, xy, xz, yy, yz, zz.
    pub cov: [f64; 6],
    /// Particles (or mass).
    pub weight: f64,
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

/// How [`DepthMoments`] change with the Gaussian's mean depth and with its variance of depth.
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

/// How lateral position follows depth: its slope, and what is left of the lateral covariance.
#[derive(Clone, Copy, Debug)]
pub struct Regression {
    /// Change of x and y with depth.
    pub slope: [f64; 2],
    /// Covariance xx, xy, yy at a given depth.
    pub rest: [f64; 3],
}

impl InCamera {
    /// Slopes and conditional covariance; a depth spread that is rounding noise counts as none.
    #[inline(always)]
    pub fn regression(&self) -> Regression {
        let [xx, xy, xz, yy, yz, zz] = self.cov;
        let inverse = if zz > 1e-14 * (xx + yy) { 1.0 / zz } else { 0.0 };
        let slope = [xz * inverse, yz * inverse];
        let rest = [(xx - slope[0] * xz).max(0.0), xy - slope[0] * yz, (yy - slope[1] * yz).max(0.0)];
        Regression { slope, rest }
    }

    /// The footprint of the part that `m` describes.
    #[inline(always)]
    pub fn footprint(&self, lens: &Lens, r: &Regression, m: &DepthMoments) -> Footprint {
        let [x, y, d] = self.mean;
        // position = base + slope * q with q the moments' variable.
        let carried = [x - r.slope[0] * d, y - r.slope[1] * d];
        let (base, slope) = if lens.perspective { (r.slope, carried) } else { (carried, r.slope) };
        let scale2 = if lens.perspective { m.square } else { 1.0 };
        let f2 = lens.focal * lens.focal;
        let t = [base[0] + slope[0] * m.mean, base[1] + slope[1] * m.mean];
        // J J^T of the particle's own roundness: grows towards the corners in perspective.
        let tilt = if lens.perspective { [t[0] * t[0], t[0] * t[1], t[1] * t[1]] } else { [0.0; 3] };
        let round = scale2 * lens.radius2;
        Footprint {
            mean: [lens.center[0] + lens.focal * t[0], lens.center[1] + lens.focal * t[1]],
            cov: [
                f2 * (r.rest[0] * scale2 + slope[0] * slope[0] * m.variance + round * (1.0 + tilt[0])) + PIXEL_VARIANCE,
                f2 * (r.rest[1] * scale2 + slope[0] * slope[1] * m.variance + round * tilt[1]),
                f2 * (r.rest[2] * scale2 + slope[1] * slope[1] * m.variance + round * (1.0 + tilt[2])) + PIXEL_VARIANCE,
            ],
            sum: lens.unit * self.weight * m.weight,
        }
    }
}
