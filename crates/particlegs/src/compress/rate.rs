//! Rate control: the step factor at which a coded file just fits.

use crate::Result;
use crate::codec::Precision;

/// A file may fall short of its target by this share ...
const SHARE_BELOW: f64 = 0.02;
/// ... or by this many bytes, whichever is more.
const BYTES_BELOW: u64 = 256;
/// Encodings tried at most; secant steps need about five.
const TRIES: usize = 14;

/// The outcome of [`meet_size`].
pub struct Met {
    /// The file.
    pub bytes: Vec<u8>,
    /// Its step factor.
    pub factor: f64,
    /// Did the file at the coarsest steps still exceed the target? Then `bytes` is that file.
    pub too_large: bool,
    /// Does the file at the finest steps stay well below the target?
    pub too_small: bool,
}

/// Is a file of `bytes` close enough below `target`?
pub fn close_enough(bytes: u64, target: u64) -> bool {
    bytes <= target && target - bytes <= BYTES_BELOW.max((target as f64 * SHARE_BELOW) as u64)
}

/// Finds the step factor at which `encode` gives the largest file that is not above `target`:
/// secant steps on log(factor), kept inside a shrinking bracket. Begins at the nominal steps and
/// gives the bytes there beside the outcome. Where a factor is `wanted` and its file fits, it is
/// taken.
pub fn meet_size(
    target: u64,
    gaussians: usize,
    wanted: Option<f64>,
    mut encode: impl FnMut(f64) -> Result<Vec<u8>>,
) -> Result<(Met, usize)> {
    let [mut fine, mut coarse] = Precision::FACTORS.map(f64::log2);
    let mut at = 0.0f64;
    let mut kept = (at, encode(1.0)?);
    let nominal = kept.1.len();
    if let Some(factor) = wanted {
        let bytes = encode(factor)?;
        if close_enough(bytes.len() as u64, target) {
            return Ok((Met { bytes, factor, too_large: false, too_small: false }, nominal));
        }
    }
    let mut size = nominal as u64;
    for _ in 0..TRIES {
        let fits = size <= target;
        *(if fits { &mut coarse } else { &mut fine }) = at;
        // Leave when what remains could not buy anything worth another encoding.
        if fits && target - size <= 16.max(target / 2000) || coarse - fine < 1e-4 {
            break;
        }
        // Aim a little below the target, so that the next step is likely to fit.
        let aim = target as f64 - 8.0_f64.max(target as f64 / 5000.0);
        let next = at + Precision::doublings(size as f64 - aim, gaussians);
        let margin = 0.02 * (coarse - fine);
        at = if next > fine + margin && next < coarse - margin { next } else { 0.5 * (fine + coarse) };
        let bytes = encode(at.exp2())?;
        size = bytes.len() as u64;
        if better(&bytes, &kept.1, target) {
            kept = (at, bytes);
        }
    }
    let (at, bytes) = kept;
    let too_large = bytes.len() as u64 > target;
    let too_small = !too_large && !close_enough(bytes.len() as u64, target);
    Ok((Met { bytes, factor: at.exp2(), too_large, too_small }, nominal))
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
    use crate::codec::Encoder;
    use crate::math::Sym3;
    use crate::model::{AlphaBlend, Block, Law, Mixture};
    use crate::particles::Bounds;
    use proptest::prelude::*;

    proptest! {
        /// Whatever the true slope of the size, the file found is close below the target.
        #[test]
        fn sizes_are_met(gaussians in 100usize..100_000, bits in 20.0f64..60.0, slope in 3.0f64..12.0, want in 0.7f64..1.3) {
            let size = |q: f64| (400.0 + gaussians as f64 * (bits - slope * q.log2()).max(1.0) / 8.0) as usize;
            let target = (size(1.0) as f64 * want) as u64;
            let met = meet_size(target, gaussians, None, |q| Ok(vec![0; size(q)])).unwrap().0;
            prop_assert!(!met.too_large);
            prop_assert!(met.too_small || close_enough(met.bytes.len() as u64, target));
            prop_assert!(met.bytes.len() as u64 <= target);
            // A precision that was found is taken again; one that is too fine is not.
            let again = meet_size(target, gaussians, Some(met.factor), |q| Ok(vec![0; size(q)])).unwrap().0;
            prop_assert!(met.too_small || again.factor == met.factor);
            let finer = meet_size(target, gaussians, Some(0.25 * met.factor), |q| Ok(vec![0; size(q)])).unwrap().0;
            prop_assert!(finer.bytes.len() as u64 <= target);
        }
    }

    #[test]
    fn a_target_out_of_reach_says_so() {
        let met = meet_size(100, 10, None, |q| Ok(vec![0; 500 + (10.0 / q) as usize])).unwrap().0;
        assert!(met.too_large);
        assert!(meet_size(1_000_000, 10, None, |q| Ok(vec![0; 500 + (10.0 / q) as usize])).unwrap().0.too_small);
    }

    /// A block of the alpha-blend law meets a size by its steps as any other.
    #[test]
    fn shaded_blocks_meet_their_size() {
        let mut g = Mixture::default();
        let mut law = AlphaBlend::default();
        for i in 0..2000 {
            let mut r = crate::math::Random::new(1, 1, i);
            let mean = std::array::from_fn(|_| 10.0 * r.uniform());
            g.push(mean, Sym3([0.01, 0.002 * r.normal(), 0.0, 0.02, 0.0, 0.01 + 0.01 * r.uniform()]), 50.0, 50.0);
            law.opacity.push(0.01 + 0.5 * r.uniform());
            law.grey.push(1.0);
        }
        g.law = Law::AlphaBlend(law);
        let bounds = Bounds { min: [0.0; 3], max: [10.0; 3] };
        let encoder = Encoder::new(&Block { bounds, count: 100_000, mass: 1e5, gaussians: g }).unwrap();
        for target in [5000u64, 6500, 9000] {
            let (met, _) =
                meet_size(target, 2000, None, |q| Ok(encoder.encode(&Precision::BALANCED.scaled(q)))).unwrap();
            assert!(!met.too_large && close_enough(met.bytes.len() as u64, target), "{target} {}", met.bytes.len());
        }
    }
}
