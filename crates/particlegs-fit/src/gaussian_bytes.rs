//! Gaussians as bytes: a finished piece of a fit.

use super::em::RefinedGaussians;
use particlegs_core::math::Sym3;

/// Numbers of a Gaussian.
const WIDTH: usize = 11;

impl RefinedGaussians {
    /// Mean, covariance, count, mass of each Gaussian, f64, little-endian.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let one = |j: usize| self.mean[j].into_iter().chain(self.cov[j].0).chain([self.count[j], self.mass[j]]);
        (0..self.len()).flat_map(one).flat_map(f64::to_le_bytes).collect()
    }

    /// `None` where the bytes are not whole Gaussians.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        if !bytes.len().is_multiple_of(8 * WIDTH) {
            return None;
        }
        let mut g = RefinedGaussians::default();
        for one in bytes.chunks_exact(8 * WIDTH) {
            let v: [f64; WIDTH] = std::array::from_fn(|i| f64::from_le_bytes(std::array::from_fn(|b| one[8 * i + b])));
            let cov = Sym3([v[3], v[4], v[5], v[6], v[7], v[8]]);
            g.push([v[0], v[1], v[2]], cov, v[9], v[10]);
        }
        Some(g)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_decode_to_what_was_encoded() {
        let mut g = RefinedGaussians::default();
        let cov = Sym3([1.0, 2.0, 3.0, 0.1, -0.2, f64::MIN_POSITIVE]);
        g.push([0.1, -2.0, 1e300], cov, 7.0, 0.5);
        g.push([0.0; 3], cov, 1.0, 1.0);
        let back = RefinedGaussians::from_bytes(&g.to_bytes()).unwrap();
        assert_eq!(
            (back.mean, back.cov, back.count, back.mass),
            (g.mean.clone(), g.cov.clone(), g.count.clone(), g.mass.clone())
        );
        assert!(RefinedGaussians::from_bytes(&g.to_bytes()[1..]).is_none());
    }
}
