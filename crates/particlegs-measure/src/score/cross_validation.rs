//! Cross-validation of a method: models of halves of the particles against the other halves, which they have not seen.
//!
//! Measured on the particles that were fitted, memorised noise counts as signal. The cross power of a model of A with
//! the particles B over that of A with B needs no shot noise subtracted and tells bias from noise.

use crate::stats::{Likelihood, Shell, SpectrumOptions, Subject, likelihood, power_spectra};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::{BANDS, CrossValidation, Model, Transfer};
use particlegs_particles::{Domain, Particles};

/// The halves, and the model of each.
pub struct Halves<'a> {
    /// Particles of each half.
    pub particles: [&'a Particles; 2],
    /// The model fitted to each half.
    pub models: [&'a Model; 2],
    /// Box of the whole.
    pub domain: &'a Domain,
    /// Options of P(k).
    pub spectrum: &'a SpectrumOptions,
    /// Seed of the draws.
    pub seed: u64,
}

impl Halves<'_> {
    /// Scores each model by the other half.
    pub fn measure(&self, context: &Context<'_>) -> Result<CrossValidation> {
        let scored = |i: usize| likelihood(self.models[i], self.particles[1 - i], self.domain, self.seed, context);
        let kernel = |i: usize| {
            Likelihood::kernel_bits(self.particles[i], self.particles[1 - i], self.domain, self.seed, context)
        };
        let (a, b) = (scored(0)?, scored(1)?);
        // The difference of the halves has errors that samples of their particles do not show.
        let sampling = 0.5 * libm::hypot(a.error, b.error);
        Ok(CrossValidation {
            bits: 0.5 * (a.bits + b.bits),
            kernel_bits: 0.5 * (kernel(0)? + kernel(1)?),
            error: sampling.max(0.5 * (a.bits - b.bits).abs()),
            volume: a.volume,
            k_max: self.spectrum.k_max,
            transfer: self.transfer(context)?,
        })
    }

    fn transfer(&self, context: &Context<'_>) -> Result<[Transfer; BANDS.len()]> {
        let shells = |pair| Ok(power_spectra(pair, self.domain, self.spectrum, context)?.shells);
        let [a, b] = self.particles.map(Subject::Particles);
        let truth = shells([a, b])?;
        let models = [shells([Subject::Model(self.models[0]), b])?, shells([Subject::Model(self.models[1]), a])?];
        let mut from = 0.0;
        Ok(BANDS.map(|share| {
            // A shell at the very end of a band belongs to it, whatever the rounding.
            let to = share * self.spectrum.k_max * (1.0 + 1e-9);
            let power = |shells: &[Shell]| cross_power(shells, from, to);
            let (truth, models) = (power(&truth), [power(&models[0]), power(&models[1])]);
            from = to;
            band(truth, models)
        }))
    }
}

/// Cross power of the modes in a band of wave numbers, and the modes.
fn cross_power(shells: &[Shell], from: f64, to: f64) -> (f64, f64) {
    let inside = shells.iter().filter(|s| s.k > from && s.k <= to);
    inside.fold((0.0, 0.0), |sum, s| (sum.0 + s.cross * s.modes as f64, sum.1 + s.modes as f64))
}

fn band((truth, modes): (f64, f64), models: [(f64, f64); 2]) -> Transfer {
    if modes == 0.0 || truth <= 0.0 {
        return Transfer::default();
    }
    let [a, b] = models.map(|m| m.0 / truth - 1.0);
    Transfer { deviation: Some(0.5 * (a + b)), scatter: 0.5 * (a - b).abs() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_weigh_modes_and_have_no_value_without_power() {
        let t = band((100.0, 10.0), [(101.0, 10.0), (99.5, 10.0)]);
        assert!((t.deviation.unwrap() - 0.0025).abs() < 1e-12 && (t.scatter - 0.0075).abs() < 1e-12);
        assert_eq!(band((-1.0, 10.0), [(1.0, 10.0); 2]).deviation, None);
        assert_eq!(band((0.0, 0.0), [(0.0, 0.0); 2]).deviation, None);
    }
}
