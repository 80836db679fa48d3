//! The change of a picture when one Gaussian stands for two, or two for one: the squared difference of
//! the projected densities before and after, blurred, summed over the three axis planes, in closed form.
//! A split's gain and a merge's cost are this one measure.

use super::Moments;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::splat::PIXEL_VARIANCE;
use std::f64::consts::TAU;

/// A Gaussian as projections see it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PictureGaussian {
    pub count: f64,
    pub mean: [f64; 3],
    pub cov: Sym3,
}

impl PictureGaussian {
    /// One blob with the moments of both.
    pub fn union(&self, other: &PictureGaussian) -> PictureGaussian {
        let (a, b) = (self, other);
        let count = a.count + b.count;
        let (p, q) = (a.count / count, b.count / count);
        let mean = each_axis(|k| p * a.mean[k] + q * b.mean[k]);
        let d: [f64; 3] = each_axis(|k| a.mean[k] - b.mean[k]);
        let cov = a.cov.scale(p).add(&b.cov.scale(q)).add(&Sym3::outer(d).scale(p * q));
        PictureGaussian { count, mean, cov }
    }
}

impl From<&Moments> for PictureGaussian {
    fn from(m: &Moments) -> PictureGaussian {
        PictureGaussian { count: m.count as f64, mean: m.mean, cov: m.cov }
    }
}

/// The blur under which pictures are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Blur {
    /// Its variance along either axis of the picture plane, the square of the unit of positions.
    pub variance: f64,
}

/// The planes' axes and the elements of the covariance that they keep.
const PLANES: [([usize; 2], [usize; 3]); 3] = [([0, 1], [0, 1, 3]), ([0, 2], [0, 2, 5]), ([1, 2], [3, 4, 5])];

/// Standard deviation of a splat's blur and a square pixel's together.
pub(crate) fn picture_sigma(splat: f64, pixel: f64) -> f64 {
    (splat * splat + PIXEL_VARIANCE * pixel * pixel).sqrt()
}

impl Blur {
    /// A blur of standard deviation `sigma`.
    pub fn from_sigma(sigma: f64) -> Blur {
        Blur { variance: sigma * sigma }
    }

    /// Sum over the three axis planes of ||P(whole) - P(a) - P(b)||^2, where P projects along an axis
    /// and blurs. Products are closed: <A,B> = n_A n_B N2(mu_A - mu_B; S_A + S_B + 2 s^2 I).
    pub fn difference(self, whole: &PictureGaussian, a: &PictureGaussian, b: &PictureGaussian) -> f64 {
        let same = self.product(whole, whole) + self.product(a, a) + self.product(b, b);
        same + 2.0 * (self.product(a, b) - self.product(whole, a) - self.product(whole, b))
    }

    /// Sum over the axis planes of the product of two blurred projections.
    fn product(self, a: &PictureGaussian, b: &PictureGaussian) -> f64 {
        let both = 2.0 * self.variance;
        let mut sum = 0.0;
        for ([u, v], [uu, uv, vv]) in PLANES {
            let s = [a.cov.0[uu] + b.cov.0[uu] + both, a.cov.0[uv] + b.cov.0[uv], a.cov.0[vv] + b.cov.0[vv] + both];
            let d = [a.mean[u] - b.mean[u], a.mean[v] - b.mean[v]];
            let det = s[0] * s[2] - s[1] * s[1];
            let form = (s[2] * d[0] * d[0] - 2.0 * s[1] * d[0] * d[1] + s[0] * d[1] * d[1]) / det;
            // Half of the products are of one Gaussian with itself.
            let peak = if form == 0.0 { 1.0 } else { libm::exp(-0.5 * form) };
            sum += peak / (TAU * det.sqrt());
        }
        a.count * b.count * sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian(count: f64, x: f64) -> PictureGaussian {
        PictureGaussian { count, mean: [x, 0.0, 0.0], cov: Sym3::scaled_identity(0.01) }
    }

    #[test]
    fn equal_halves_gain_nothing_and_distant_ones_much() {
        let (a, b) = (gaussian(10.0, 0.0), gaussian(30.0, 0.0));
        let under =
            |variance, a: &PictureGaussian, b: &PictureGaussian| Blur { variance }.difference(&a.union(b), a, b);
        assert!(under(0.01, &a, &b).abs() < 1e-9);
        let b = gaussian(30.0, 1.0);
        let (far, softer) = (under(0.01, &a, &b), under(0.1, &a, &b));
        assert!(far > softer && softer > 0.0);
    }
}
