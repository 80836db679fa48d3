//! Coding to a size: the step factor at which coded Gaussians just fit, and the number of Gaussians
//! whose steps are then near nominal. Every way to a file of a given size goes through here.

use particlegs_core::Result;
use particlegs_core::codec::{Encoder, Precision};
use particlegs_fit::Effort;

/// A file may fall short of its target by this share ...
const SHARE_BELOW: f64 = 0.02;
/// ... or by this many bytes, whichever is more.
const BYTES_BELOW: u64 = 256;
/// Encodings tried at most; secant steps need about five.
const ENCODINGS: usize = 14;
/// Fits tried at most to find a number of Gaussians whose steps are near nominal.
const FITS: usize = 3;
/// Step factors between these cost less than another fit gains.
const CHEAP_STEP_FACTORS: std::ops::Range<f64> = 0.75..1.4;

/// Bytes a Gaussian that lose least at a given size: of nbody64 at eight ratios 3.75 to 4 score alike, 3.5 loses 0.03
/// dB; cells of a partition are rounder and take fewer.
pub fn bytes_a_gaussian(effort: Effort) -> f64 {
    if effort == Effort::Fast { 3.2 } else { 3.85 }
}

/// Particles for each Gaussian of a file of a given size, at least: on a half of nbody64, 25, 20, 15, 12 and 10 give
/// 4.650, 4.640, 4.632, 4.585 and 4.520 bits a held-out particle, and pictures gain nothing either.
const PARTICLES_A_GAUSSIAN: u64 = 16;
/// At least this many Gaussians, some 10 kB, are always made where there are particles: pictures of few are better for
/// it.
const ALWAYS: u64 = 2500;

/// The most Gaussians that `particles` support: more would fit the noise of their sample.
pub(super) fn most_gaussians(particles: u64) -> u64 {
    (particles / PARTICLES_A_GAUSSIAN).max(ALWAYS.min(particles))
}

/// The size of coded Gaussians against the one that was asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SizeOutcome {
    /// They are at most as large, and close to it.
    #[default]
    Met,
    /// They are larger, even at the coarsest steps.
    TooLarge,
    /// They stay well below it, even at the finest steps.
    TooSmall,
}

#[derive(Debug)]
pub(super) struct CodedGaussians {
    pub bytes: Vec<u8>,
    pub gaussians: u64,
    pub step_factor: f64,
    pub size_met: SizeOutcome,
    pub nominal_bytes: u64,
}

impl CodedGaussians {
    /// Gaussians at the nominal steps, whatever bytes they take.
    pub fn at_nominal_steps(encoder: &Encoder) -> CodedGaussians {
        let bytes = encoder.encode(&Precision::BALANCED);
        let (gaussians, nominal_bytes) = (encoder.len() as u64, bytes.len() as u64);
        CodedGaussians { bytes, gaussians, step_factor: 1.0, size_met: SizeOutcome::Met, nominal_bytes }
    }

    /// Gaussians at the finest steps at which they have at most `size` bytes. A step factor that is
    /// `wanted` is taken if its bytes are close enough to the size. `check` is asked before each encoding.
    pub fn to_size(
        encoder: &Encoder,
        size: u64,
        wanted: Option<f64>,
        mut check: impl FnMut() -> Result<()>,
    ) -> Result<CodedGaussians> {
        let size = size.saturating_sub(encoder.stage_bytes() as u64);
        meet_size(size, encoder.len(), wanted, |factor| {
            check()?;
            Ok(encoder.encode(&Precision::BALANCED.scaled(factor)))
        })
    }
}

/// A size to be met by a number of Gaussians that is to be found.
#[derive(Clone, Copy, Debug)]
pub(super) struct SizeTarget {
    pub bytes: u64,
    /// Bytes that a Gaussian may take, to begin with.
    pub bytes_a_gaussian: f64,
    /// Gaussians at most.
    pub most: u64,
}

impl SizeTarget {
    /// Gaussians that have this size, if each takes `bytes`.
    pub fn number(&self, bytes: f64) -> u64 {
        ((self.bytes as f64 / bytes) as u64).clamp(1, self.most)
    }

    /// A number of Gaussians whose steps are near nominal at this size, by trials: `fit` makes so many
    /// Gaussians, or fewer, and codes them to the size.
    pub fn find<T>(&self, mut fit: impl FnMut(u64) -> Result<(CodedGaussians, T)>) -> Result<(CodedGaussians, T)> {
        let mut number = self.number(self.bytes_a_gaussian);
        let mut coded_fit = fit(number)?;
        for _ in 1..FITS {
            let coded = &coded_fit.0;
            let cheap = coded.size_met != SizeOutcome::TooLarge && CHEAP_STEP_FACTORS.contains(&coded.step_factor);
            // What a Gaussian costs at the nominal steps tells the right number.
            let better = self.number(coded.nominal_bytes as f64 / coded.gaussians as f64);
            let there_are_no_more = coded.gaussians < number && better > coded.gaussians;
            if cheap || better == number || there_are_no_more {
                break;
            }
            number = better;
            coded_fit = fit(number)?;
        }
        if coded_fit.0.size_met == SizeOutcome::TooLarge && number > 1 {
            // The smallest file that there is: if it is too large, no other fits.
            coded_fit = fit(1)?;
        }
        Ok(coded_fit)
    }
}

fn close_enough(bytes: u64, target: u64) -> bool {
    bytes <= target && target - bytes <= BYTES_BELOW.max((target as f64 * SHARE_BELOW) as u64)
}

/// Finds the step factor at which `encode` gives the largest file that is not above `target`:
/// secant steps on log(factor), kept inside a shrinking bracket that begins at the nominal steps.
/// A factor that is `wanted` is taken if its file is close enough.
fn meet_size(
    target: u64,
    gaussians: usize,
    wanted: Option<f64>,
    mut encode: impl FnMut(f64) -> Result<Vec<u8>>,
) -> Result<CodedGaussians> {
    // Logarithms of step factors, to base 2, on which bytes depend almost linearly.
    let [mut fine, mut coarse] = Precision::FACTORS.map(libm::log2);
    let mut at = 0.0f64;
    // Nominal steps come first: what a Gaussian costs at them tells how many there should be.
    let mut best = (at, encode(1.0)?);
    let nominal_bytes = best.1.len() as u64;
    let coded = |bytes: Vec<u8>, step_factor, size_met| CodedGaussians {
        bytes,
        gaussians: gaussians as u64,
        step_factor,
        size_met,
        nominal_bytes,
    };
    if let Some(factor) = wanted {
        let bytes = encode(factor)?;
        if close_enough(bytes.len() as u64, target) {
            return Ok(coded(bytes, factor, SizeOutcome::Met));
        }
    }
    let mut size = nominal_bytes;
    for _ in 0..ENCODINGS {
        let fits = size <= target;
        *(if fits { &mut coarse } else { &mut fine }) = at;
        // Leave when what remains could not buy anything worth another encoding.
        if fits && target - size <= 16.max(target / 250) || coarse - fine < 1e-4 {
            break;
        }
        // Aim a little below the target, so that the next step is likely to fit.
        let aim = target as f64 - 8.0_f64.max(target as f64 / 1200.0);
        let next = at + Precision::doublings(size as f64 - aim, gaussians);
        // A step too close to an end would hardly shrink the bracket: it is halved instead.
        let margin = 0.02 * (coarse - fine);
        at = if next > fine + margin && next < coarse - margin { next } else { 0.5 * (fine + coarse) };
        let bytes = encode(libm::exp2(at))?;
        size = bytes.len() as u64;
        if better(&bytes, &best.1, target) {
            best = (at, bytes);
        }
    }
    let (at, bytes) = best;
    let size_met = match bytes.len() as u64 {
        n if n > target => SizeOutcome::TooLarge,
        n if close_enough(n, target) => SizeOutcome::Met,
        _ => SizeOutcome::TooSmall,
    };
    Ok(coded(bytes, libm::exp2(at), size_met))
}

/// The larger of two that fit, else the smaller.
fn better(new: &[u8], old: &[u8], target: u64) -> bool {
    match (new.len() as u64 <= target, old.len() as u64 <= target) {
        (true, true) => new.len() > old.len(),
        (fits, false) => fits || new.len() < old.len(),
        (false, true) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::{Sym3, each_axis};
    use particlegs_core::model::{AlphaBlend, Block, Law, Mixture};
    use particlegs_core::space::Bounds;
    use proptest::prelude::*;

    proptest! {
        /// Whatever the true slope of the size, the file found is close below the target.
        #[test]
        fn sizes_are_met(gaussians in 100usize..100_000, bits in 20.0f64..60.0, slope in 3.0f64..12.0, want in 0.7f64..1.3) {
            let size = |q: f64| (400.0 + gaussians as f64 * (bits - slope * q.log2()).max(1.0) / 8.0) as usize;
            let target = (size(1.0) as f64 * want) as u64;
            // The search halves its way to the coarsest steps and never tries the last of them.
            prop_assume!(size(0.5 * Precision::FACTORS[1]) as u64 <= target);
            let met = meet_size(target, gaussians, None, |q| Ok(vec![0; size(q)])).unwrap();
            prop_assert!(met.size_met != SizeOutcome::TooLarge);
            prop_assert!(met.size_met == SizeOutcome::TooSmall || close_enough(met.bytes.len() as u64, target));
            prop_assert!(met.bytes.len() as u64 <= target);
            // A precision that was found is taken again; one that is too fine is not.
            let again = meet_size(target, gaussians, Some(met.step_factor), |q| Ok(vec![0; size(q)])).unwrap();
            prop_assert!(met.size_met == SizeOutcome::TooSmall || again.step_factor == met.step_factor);
            let finer = meet_size(target, gaussians, Some(0.25 * met.step_factor), |q| Ok(vec![0; size(q)])).unwrap();
            prop_assert!(finer.bytes.len() as u64 <= target);
        }
    }

    #[test]
    fn a_target_out_of_reach_says_so() {
        let met = |target| meet_size(target, 10, None, |q| Ok(vec![0; 500 + (10.0 / q) as usize])).unwrap().size_met;
        assert_eq!((met(100), met(1_000_000)), (SizeOutcome::TooLarge, SizeOutcome::TooSmall));
    }

    /// Gaussians of so many bytes each: a first guess that is far off is mended, and where the particles
    /// carry no more Gaussians nothing more is tried.
    #[test]
    fn the_number_is_found_by_what_a_gaussian_costs() {
        let target = SizeTarget { bytes: 10_000, bytes_a_gaussian: 4.0, most: 100_000 };
        let fit = |each: f64, most: u64, tried: &mut Vec<u64>| {
            let coded_fit = target.find(|n| {
                tried.push(n);
                let gaussians = n.min(most);
                let encode =
                    |q: f64| Ok(vec![0; (gaussians as f64 * (8.0 * each - 9.0 * q.log2()).max(1.0) / 8.0) as usize]);
                Ok((meet_size(target.bytes, gaussians as usize, None, encode)?, n))
            });
            coded_fit.unwrap()
        };
        let mut tried = Vec::new();
        let (coded, number) = fit(8.0, u64::MAX, &mut tried);
        assert_eq!((&tried[..], number, coded.size_met), (&[2500, 1250][..], 1250, SizeOutcome::Met));
        tried.clear();
        assert_eq!(fit(4.0, u64::MAX, &mut tried).1, 2500);
        assert_eq!(tried.len(), 1);
        tried.clear();
        let (coded, _) = fit(4.0, 100, &mut tried);
        assert_eq!((tried.len(), coded.gaussians, coded.size_met), (1, 100, SizeOutcome::TooSmall));
        let none = SizeTarget { bytes: 10, ..target };
        let numbers = none.find(|n| Ok((meet_size(10, n as usize, None, |_| Ok(vec![0; 50]))?, n))).unwrap();
        assert_eq!((numbers.0.size_met, numbers.1), (SizeOutcome::TooLarge, 1));
    }

    /// A block of the alpha-blend law meets a size by its steps as any other.
    #[test]
    fn shaded_blocks_meet_their_size() {
        let mut g = Mixture::default();
        let mut law = AlphaBlend::default();
        for i in 0..2000 {
            let mut r = particlegs_core::math::Random::new(1, 1, i);
            let mean = each_axis(|_| 10.0 * r.uniform());
            g.push(mean, Sym3([0.01, 0.002 * r.normal(), 0.0, 0.02, 0.0, 0.01 + 0.01 * r.uniform()]), 50.0, 50.0);
            law.opacity.push(0.01 + 0.5 * r.uniform());
            law.grey.push(1.0);
        }
        g.law = Law::AlphaBlend(law);
        let bounds = Bounds { min: [0.0; 3], max: [10.0; 3] };
        let encoder = Encoder::new(&Block { bounds, count: 100_000, mass: 1e5, gaussians: g }).unwrap();
        for target in [5000u64, 6500, 9000] {
            let met = CodedGaussians::to_size(&encoder, target, None, || Ok(())).unwrap();
            assert_eq!(met.size_met, SizeOutcome::Met, "{target} {}", met.bytes.len());
        }
    }
}
