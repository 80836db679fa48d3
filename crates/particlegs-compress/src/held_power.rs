//! The power spectrum by construction: counts are coded so that shells of wave numbers have the power of the particles.

use super::size::CodedGaussians;
use particlegs_core::Result;
use particlegs_core::codec::{CountBalance, Encoder, MOST_SUMS, Precision, decode_block};
use particlegs_core::context::Context;
use particlegs_core::model::MASS;
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

/// Codes Gaussians again, at the steps at which they are coded and in at most `size` bytes, with the power of the
/// particles in the box of the snapshot; leaves them as they are where there is no power to be held.
pub(super) fn hold_power(
    encoder: &mut Encoder,
    coded: &mut CodedGaussians,
    (particles, domain): (&Particles, &Domain),
    size: u64,
    context: &Context<'_>,
) -> Result<()> {
    let most = MOST_SUMS.min(encoder.len() / GAUSSIANS_A_SHELL);
    if most == 0 || encoder.len() > MOST_GAUSSIANS {
        return Ok(());
    }
    let Some(target) = PowerTarget::new(particles, domain, most, context)? else { return Ok(()) };
    let precision = Precision::BALANCED.scaled(coded.step_factor);
    let mut bytes = coded.bytes.clone();
    let mut least = f64::INFINITY;
    let (mut deviation, mut responses, mut moved) = (None, Vec::new(), 0);
    for round in 0..=ROUNDS {
        context.check()?;
        let block = decode_block(&bytes, "a block")?;
        let reached = target.deviation(&block.gaussians, deviation.take(), context)?;
        let largest = largest_of(&reached);
        if largest < least && bytes.len() as u64 <= size {
            (least, coded.bytes) = (largest, bytes);
        }
        if largest < TOLERANCE || round == ROUNDS {
            break;
        }
        encoder.settle(&precision, &block)?;
        let within = (LEFT * largest).max(0.5 * TOLERANCE);
        let (mut gaussians, mut balanced) = (block.gaussians, reached);
        for _ in 0..BALANCES {
            if responses.is_empty() || moved > gaussians.len() / MOVED {
                (responses, moved) = (target.responses(&balanced, &gaussians, context)?, 0);
            }
            let wanted: Vec<f64> = balanced.of_shell.iter().map(|d| -d).collect();
            let balance = CountBalance { responses: &responses, wanted: &wanted, within };
            let factors = encoder.balance_counts(&precision, &balance)?;
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
        bytes = encoder.encode(&precision);
        deviation = Some(balanced);
    }
    Ok(())
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
