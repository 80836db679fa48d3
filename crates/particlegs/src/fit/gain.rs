//! How much a picture gains when one Gaussian is replaced by two.

use super::Moments;
use crate::splat::PIXEL_VARIANCE;
use std::f64::consts::TAU;

/// The blur under which pictures are compared: its variance on the picture plane, store units squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blur(pub f64);

/// The axis planes, each by its two axes' places in mean and covariance: (u, v, uu, uv, vv).
const PLANES: [(usize, usize, usize, usize, usize); 3] = [(0, 1, 0, 1, 3), (0, 2, 0, 2, 5), (1, 2, 3, 4, 5)];

impl Blur {
    /// Standard deviation of a splat's blur and a square pixel's together.
    pub(crate) fn of_picture(splat: f64, pixel: f64) -> f64 {
        (splat * splat + PIXEL_VARIANCE * pixel * pixel).sqrt()
    }

    /// Sum over the three axis planes of ||P(G) - P(A) - P(B)||^2, where P projects along an axis
    /// and blurs. Products are closed: <A,B> = n_A n_B N2(mu_A - mu_B; S_A + S_B + 2 s^2 I).
    pub fn split_gain(&self, whole: &Moments, a: &Moments, b: &Moments) -> f64 {
        let same = self.product(whole, whole) + self.product(a, a) + self.product(b, b);
        let cross = self.product(a, b) - self.product(whole, a) - self.product(whole, b);
        same + 2.0 * cross
    }

    /// Sum over the axis planes of the product of two blurred projections.
    pub fn product(&self, a: &Moments, b: &Moments) -> f64 {
        let d: [f64; 3] = std::array::from_fn(|k| a.mean[k] - b.mean[k]);
        let s: [f64; 6] = std::array::from_fn(|k| a.cov.0[k] + b.cov.0[k]);
        let mut sum = 0.0;
        for (u, v, uu, uv, vv) in PLANES {
            let (p, q, r) = (s[uu] + 2.0 * self.0, s[uv], s[vv] + 2.0 * self.0);
            let det = p * r - q * q;
            let form = (r * d[u] * d[u] - 2.0 * q * d[u] * d[v] + p * d[v] * d[v]) / det;
            sum += (-0.5 * form).exp() / (TAU * det.sqrt());
        }
        a.count as f64 * b.count as f64 * sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Sym3;

    fn gaussian(n: u64, x: f64) -> Moments {
        Moments { count: n, mass: n as f64, mean: [x, 0.0, 0.0], cov: Sym3::scaled_identity(0.01) }
    }

    #[test]
    fn equal_halves_gain_nothing_and_distant_ones_much() {
        let (a, b) = (gaussian(10, 0.0), gaussian(30, 0.0));
        assert!(Blur(0.01).split_gain(&a.merged(&b), &a, &b).abs() < 1e-9);
        let b = gaussian(30, 1.0);
        let far = Blur(0.01).split_gain(&a.merged(&b), &a, &b);
        let softer = Blur(0.1).split_gain(&a.merged(&b), &a, &b);
        assert!(far > softer && softer > 0.0);
    }
}
