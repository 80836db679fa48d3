//! Floor 1: what one splat does to a pixel: profile, integrals, and the response of ParaView's
//! 8-bit blending. Every constant of the picture law stands here once (docs/law/splat.md, docs/law/depth.md).

mod fxaa_mean;
mod response;

pub use fxaa_mean::{FxaaMean, fxaa_blur};
pub use response::{Response, ToneStyle, mul8};

/// A splat is the square |u|, |v| <= 3 in units of its standard deviations; its corners are drawn.
pub const CUT_SIGMA: f64 = 3.0;

/// `erf(3 / sqrt 2)`: the share of a one-dimensional Gaussian inside the cut.
pub const CUT_SHARE: f64 = 0.997_300_203_936_739_8;

/// `CUT_SHARE^2` = 0.9946: the share of a splat inside its square, the `e^2` of the law.
pub const CUT_SHARE_2D: f64 = CUT_SHARE * CUT_SHARE;

/// Variance of a pixel's box along one axis, in square pixels.
pub const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

/// Mean alpha of a covered pixel centre over the opacity: `2 pi e^2 / 36` = 0.17359.
pub const MEAN_COVERED_ALPHA: f64 = 2.0 * std::f64::consts::PI * CUT_SHARE_2D / (4.0 * CUT_SIGMA * CUT_SIGMA);

/// Peels of ParaView's dual depth peeling; what they leave is alpha-blended.
pub const PEELS: usize = 4;

/// Fragments within this window depth of a layer belong to it.
pub const DEPTH_TOLERANCE: f32 = 1e-7;

/// The largest pixel-average opacity that a logarithm is taken of: -ln(1 - m) stays finite.
pub const LARGEST_MEAN_ALPHA: f64 = 0.999_999;

/// The default opacity.
pub const DEFAULT_OPACITY: f64 = 0.05;

/// Integral of a splat's opacity over the picture, per square pixel of `sigma_x sigma_y`:
/// `2 pi a e^2`. The unbiased weight of a particle in a mean picture (A1 of docs/law/depth.md).
pub fn opacity_integral(opacity: f64) -> f64 {
    2.0 * std::f64::consts::PI * CUT_SHARE_2D * opacity
}

/// `erf` to about 1e-15: the all-positive series near zero, the continued fraction in the tail.
pub fn erf(x: f64) -> f64 {
    let z = x.abs();
    // erfc(6) is 2e-17, below the last digit of 1.
    if z > 6.0 {
        return 1.0f64.copysign(x);
    }
    if z > 3.0 {
        // erfc z = exp(-z^2)/sqrt(pi) / (z + (1/2)/(z + 1/(z + (3/2)/(z + ...)))), from its far end.
        let tail = (1..=60).rev().fold(z, |t, k| z + 0.5 * f64::from(k) / t);
        let erfc = libm::exp(-z * z) / (tail * std::f64::consts::PI.sqrt());
        return (1.0 - erfc).copysign(x);
    }
    let (mut sum, mut term, mut k) = (z, z, 0.0);
    while term > sum * 1e-17 {
        k += 1.0;
        term *= 2.0 * z * z / (2.0 * k + 1.0);
        sum += term;
    }
    (std::f64::consts::FRAC_2_SQRT_PI * libm::exp(-z * z) * sum).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        assert!((erf(3.0 / 2.0f64.sqrt()) - CUT_SHARE).abs() < 1e-15);
        assert!((erf(0.5) - 0.520_499_877_813_046_5).abs() < 1e-15);
        assert!((erf(3.5) - 0.999_999_256_901_627_7).abs() < 1e-15);
        assert_eq!(erf(-0.5), -erf(0.5));
        assert!((MEAN_COVERED_ALPHA - 0.17359).abs() < 1e-5);
    }
}
