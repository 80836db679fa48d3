//! What shape a few particles support: a covariance is drawn towards a sphere of the same size.
//!
//! The mode of the posterior under an inverse Wishart prior whose centre is that sphere (Ormoneit and Tresp 1996;
//! Fraley and Raftery 2007). Without it Gaussians of few particles are needles that fit the noise of their sample.

use crate::math::Sym3;

/// Particles that the sphere counts as, in fits.
pub(crate) const PRIOR: f64 = 5.0;

/// The covariance of `count` particles that is most probable where the sample's is `cov` and the sphere counts as
/// `prior` particles. Its trace stays.
pub(crate) fn most_probable(cov: &Sym3, count: f64, prior: f64) -> Sym3 {
    let all = count + prior;
    if all <= 0.0 {
        return *cov;
    }
    let sphere = prior / all;
    cov.scale(1.0 - sphere).add(&Sym3::scaled_identity(sphere * cov.trace() / 3.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_particles_are_round_and_many_keep_their_shape() {
        let needle = Sym3([100.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        let ratio = |count| {
            let e = most_probable(&needle, count, 5.0).eigen();
            (e.values[0] / e.values[1]).sqrt()
        };
        assert!(ratio(0.0) < 1.0 + 1e-12 && ratio(5.0) < 2.0 && ratio(1e5) > 9.9);
        assert!((most_probable(&needle, 7.0, 5.0).trace() - 102.0).abs() < 1e-12);
    }
}
