//! The power spectrum by construction: counts are coded so that shells of wave numbers have the power of the particles.

use super::size::CodedGaussians;
use particlegs_core::Result;
use particlegs_core::codec::{CountBalance, Encoder, MOST_SUMS, Precision, decode_block};
use particlegs_core::context::Context;
use particlegs_core::model::{Block, MASS, Mixture};
use particlegs_measure::stats::{PowerDeviation, PowerTarget};
use particlegs_particles::{Domain, Particles};

/// Codings at most. Shapes and places of the Gaussians whose counts are moved are rounded anew, which moves the power by
/// a tenth of what was mended.
const ROUNDS: usize = 5;
/// Balances of the counts for each coding at most: the power is not in proportion to them.
const BALANCES: usize = 6;
/// Of so many Gaussians one may be moved before the responses are taken anew.
const MOVED: usize = 50;
/// Largest deviation that is left as it is.
const TOLERANCE: f64 = 5e-4;
/// Share of a deviation that a coding leaves of itself: the rounding of what is moved makes as much.
const LEFT: f64 = 0.1;
/// Gaussians for each shell, at least: fewer have no counts to spare.
const GAUSSIANS_A_SHELL: usize = 20;
/// Gaussians at most: more average what rounding does to each.
const MOST_GAUSSIANS: usize = 1_000_000;

/// Bytes of a size that are left for it: moved counts are a little further from what is predicted of them.
pub(super) fn room(size: u64) -> u64 {
    size / 800
}

/// Gaussians that are coded, whose counts can be moved.
pub(super) trait CountCoding {
    fn len(&self) -> usize;
    /// Codes them: the bytes, and the Gaussians as they are decoded.
    fn code(&mut self) -> Result<(Vec<u8>, Mixture)>;
    /// Moves codes of the counts that were decoded last. Returns the factor by which each changes.
    fn balance(&mut self, balance: &CountBalance<'_>) -> Result<Vec<f64>>;
}

/// A block of a model, at the steps at which it was coded first.
pub(super) struct BlockCoding<'a> {
    encoder: &'a mut Encoder,
    precision: Precision,
    first_bytes: Option<Vec<u8>>,
    decoded: Option<Block>,
}

impl<'a> BlockCoding<'a> {
    pub(super) fn new(encoder: &'a mut Encoder, coded: &CodedGaussians) -> BlockCoding<'a> {
        let precision = Precision::BALANCED.scaled(coded.step_factor);
        BlockCoding { encoder, precision, first_bytes: Some(coded.bytes.clone()), decoded: None }
    }
}

impl CountCoding for BlockCoding<'_> {
    fn len(&self) -> usize {
        self.encoder.len()
    }

    fn code(&mut self) -> Result<(Vec<u8>, Mixture)> {
        let bytes = self.first_bytes.take().unwrap_or_else(|| self.encoder.encode(&self.precision));
        let block = decode_block(&bytes, "a block")?;
        Ok((bytes, self.decoded.insert(block).gaussians.clone()))
    }

    fn balance(&mut self, balance: &CountBalance<'_>) -> Result<Vec<f64>> {
        if let Some(block) = self.decoded.take() {
            self.encoder.settle(&self.precision, &block)?;
        }
        self.encoder.balance_counts(&self.precision, balance)
    }
}

/// Codes Gaussians in at most `size` bytes with the power of the particles in the box of the snapshot, as
/// far as they have Gaussians for its shells. Of several codings the best is given; `None` where there is no power to be
/// held.
pub(super) fn hold_power(
    coding: &mut dyn CountCoding,
    (particles, domain): (&Particles, &Domain),
    size: u64,
    context: &Context<'_>,
) -> Result<Option<Vec<u8>>> {
    let most = MOST_SUMS.min(coding.len() / GAUSSIANS_A_SHELL);
    if most == 0 || coding.len() > MOST_GAUSSIANS {
        return Ok(None);
    }
    let Some(target) = PowerTarget::new(particles, domain, most, context)? else { return Ok(None) };
    let mut best = None;
    let mut least = f64::INFINITY;
    let (mut deviation, mut responses, mut moved) = (None, Vec::new(), 0);
    for round in 0..=ROUNDS {
        context.check()?;
        let (bytes, mut gaussians) = coding.code()?;
        let mut balanced = target.deviation(&gaussians, deviation.take(), context)?;
        let largest = largest_of(&balanced);
        if largest < least && bytes.len() as u64 <= size {
            (least, best) = (largest, Some(bytes));
        }
        if largest < TOLERANCE || round == ROUNDS {
            break;
        }
        let within = (LEFT * largest).max(0.5 * TOLERANCE);
        for _ in 0..BALANCES {
            if responses.len() != target.shells * gaussians.len() || moved > gaussians.len() / MOVED {
                (responses, moved) = (target.responses(&balanced, &gaussians, context)?, 0);
            }
            let wanted: Vec<f64> = balanced.of_shell.iter().map(|d| -d).collect();
            let factors = coding.balance(&CountBalance { responses: &responses, wanted: &wanted, within })?;
            moved += factors.iter().filter(|factor| **factor != 1.0).count();
            let masses = gaussians.columns.get_mut(MASS).into_iter();
            for column in masses.chain([&mut gaussians.count]) {
                column.iter_mut().zip(&factors).for_each(|(value, factor)| *value *= factor);
            }
            balanced = target.deviation(&gaussians, Some(balanced), context)?;
            if largest_of(&balanced) <= within {
                break;
            }
        }
        deviation = Some(balanced);
    }
    Ok(best)
}

fn largest_of(deviation: &PowerDeviation) -> f64 {
    deviation.of_shell.iter().fold(0.0, |largest, d| largest.max(d.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Options, compress};
    use particlegs_core::checkpoint::NoCheckpoints;
    use particlegs_core::model::{CertificateLevel, Target};
    use particlegs_particles::testing::sample;

    /// The largest deviation in any shell, and the bytes.
    fn deviation(particles: &Particles, target: Target, blocks: u32) -> (f64, u64) {
        let options =
            Options { target, blocks: Some(blocks), certificate: CertificateLevel::None, ..Options::default() };
        let compressed = compress(particles, &options, &mut NoCheckpoints, &Context::SILENT).unwrap();
        let layer = &compressed.model.layers[0].content;
        let mut mixture = layer[0].gaussians.clone();
        layer[1..].iter().for_each(|b| mixture.append(&b.gaussians));
        let power = PowerTarget::new(particles, &Domain::from_particles(particles), MOST_SUMS, &Context::SILENT)
            .unwrap()
            .unwrap();
        let deviation = power.deviation(&mixture, None, &Context::SILENT).unwrap();
        (largest_of(&deviation), compressed.bytes.len() as u64)
    }

    #[test]
    fn models_have_the_power_of_their_particles_in_every_shell() {
        let particles = sample();
        for (target, most) in [(Target::Ratio(300.0), particles.raw_bytes() / 300), (Target::Gaussians(1500), u64::MAX)]
        {
            let (deviation, bytes) = deviation(&particles, target, 1);
            assert!(deviation < 1e-3 && bytes <= most, "{target:?}: {deviation}, {bytes} of {most}");
        }
        // Parts of the whole are coded on their own: their power is the fit's.
        assert!(deviation(&particles, Target::Ratio(300.0), 2).0 > 2e-3);
    }
}
