//! Adaptive symbol models and the coding of signed residuals with them (docs/format.md, section 8).

use super::rans::{Coder, PROBABILITY_BITS};
use crate::math::exp;

/// Cumulative counts are kept in 30 bits and used in 15.
const TOTAL: i32 = 1 << 30;
const FLOOR: i32 = TOTAL >> PROBABILITY_BITS;
/// The narrowest law that a model starts from, in steps.
const NARROWEST: f64 = 0.25;
/// Symbols after which a model follows half as quickly: first 1/16 of the way a symbol, at last 1/512.
const SLOWER_AFTER: [u32; 5] = [12, 40, 120, 360, 1000];

/// Probabilities of `N` symbols that follow what was coded.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SymbolModel<const N: usize> {
    /// `cumulative[s]`: below symbol `s`, out of 2^30. Neighbours differ by 2^15 at least.
    cumulative: [i32; N],
    seen: u32,
}

impl<const N: usize> SymbolModel<N> {
    /// Starts from weights; every symbol gets at least 2^-15.
    pub(crate) fn from_weights(weights: [u32; N]) -> Self {
        let sum: u64 = weights.iter().map(|&w| u64::from(w)).sum();
        let room = (TOTAL - N as i32 * FLOOR) as u64;
        let mut cumulative = [0; N];
        let mut below = 0u64;
        for s in 0..N {
            cumulative[s] = (below * room / sum) as i32 + s as i32 * FLOOR;
            below += u64::from(weights[s]);
        }
        SymbolModel { cumulative, seen: 0 }
    }

    #[inline(always)]
    fn interval(&self, s: usize) -> (u32, u32) {
        const { assert!(N.is_power_of_two() && N > 1) };
        let at = |i: usize| (self.cumulative[i % N] >> PROBABILITY_BITS) as u32;
        // Past the last symbol stands 0 for 2^15: the same in 15 bits.
        let size = at(s + 1).wrapping_sub(at(s)) & ((1 << PROBABILITY_BITS) - 1);
        (at(s), size)
    }

    #[inline(always)]
    fn find(&self, slot: u32) -> usize {
        let limit = ((slot as i32) << PROBABILITY_BITS) | (FLOOR - 1);
        // All N are counted (the first always passes), since whole vectors are quick; the sign of a
        // difference is added up more quickly than the outcome of a comparison.
        let mut below = 0;
        for i in 0..N {
            below += ((self.cumulative[i] - limit - 1) as u32) >> 31;
        }
        below as usize - 1
    }

    /// Moves towards certainty of `s`.
    #[inline(always)]
    fn update(&mut self, s: usize) {
        let slower: u32 = SLOWER_AFTER.iter().map(|&n| u32::from(self.seen >= n)).sum();
        let shift = 4 + slower;
        self.seen += 1;
        let room = TOTAL - N as i32 * FLOOR;
        for i in 0..N {
            // The first stays 0.
            let target = i as i32 * FLOOR + if i as i32 > s as i32 { room } else { 0 };
            self.cumulative[i] += (target - self.cumulative[i]) >> shift;
        }
    }

    #[inline(always)]
    pub(crate) fn code(&mut self, c: &mut impl Coder, value: usize) -> usize {
        let s = match c.slot() {
            Some(slot) => self.find(slot),
            None => value,
        };
        let (start, size) = self.interval(s);
        c.interval(start, size);
        self.update(s);
        s
    }
}

/// A model of residuals around 0: `N - 1` symbols for `-(N / 2 - 1) ..= N / 2 - 1`, and the escape.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Residual<const N: usize>(SymbolModel<N>);

impl<const N: usize> Residual<N> {
    const CENTRE: i32 = N as i32 / 2 - 1;

    /// Starts at a two-sided geometric law of ratio 3/4.
    pub(crate) fn geometric() -> Self {
        let mut weights = [1; N];
        let centre = Self::CENTRE as usize;
        let mut w = 65_536u32;
        for d in 0..=centre {
            weights[centre - d] = w;
            weights[centre + d] = w;
            w = w * 3 / 4;
        }
        weights[N - 1] = w;
        Residual(SymbolModel::from_weights(weights))
    }

    /// Starts at a bell with longer tails of a width of `spread` steps.
    pub(crate) fn bell(spread: f64) -> Self {
        let centre = Self::CENTRE as usize;
        let spread = spread.max(NARROWEST);
        let weight = |steps: usize| {
            let x = steps as f64 / spread;
            1 + (65_536.0 * exp(-(x * x) / (2.0 + 0.6 * x))) as u32
        };
        let mut weights: [u32; N] = std::array::from_fn(|s| weight(s.abs_diff(centre)));
        weights[N - 1] = weight(centre + 1);
        Residual(SymbolModel::from_weights(weights))
    }

    /// Codes a residual whose lowest `low` bits are plain.
    #[inline(always)]
    pub(crate) fn code(&mut self, c: &mut impl Coder, low: u32, value: i32) -> i32 {
        let high = value >> low;
        let symbol = if high.abs() <= Self::CENTRE { (high + Self::CENTRE) as usize } else { N - 1 };
        let symbol = self.0.code(c, symbol);
        let high = if symbol == N - 1 { escape(c, Self::CENTRE, high) } else { symbol as i32 - Self::CENTRE };
        (high << low) | c.bits(low, (value & ((1 << low) - 1)) as u32) as i32
    }
}

/// |value| > centre: sign, then |value| - centre in Elias gamma (at most 22 bits).
#[cold]
fn escape(c: &mut impl Coder, centre: i32, value: i32) -> i32 {
    let negative = c.bits(1, u32::from(value < 0));
    // A decoder has no value: 1 keeps the logarithm below defined.
    let magnitude = (value.unsigned_abs()).saturating_sub(centre as u32).max(1);
    let length = c.uniform(22, magnitude.ilog2().min(21));
    let magnitude = (1u64 << length) | c.long_bits(length, u64::from(magnitude) & ((1 << length) - 1));
    let magnitude = magnitude as i32 + centre;
    if negative == 1 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::super::rans::{RansReader, RansWriter};
    use super::*;
    use crate::math::Random;

    fn walk(c: &mut impl Coder, values: &[i32], low: u32) -> Vec<i32> {
        let mut model = Residual::<32>::geometric();
        values.iter().map(|&v| model.code(c, low, v)).collect()
    }

    #[test]
    fn coded_size_is_the_models_entropy() {
        let values: Vec<i32> = (0..50_000).map(|i| (Random::new(3, 0, i).normal() * 2.5).round() as i32).collect();
        let mut writer = RansWriter::default();
        walk(&mut writer, &values, 0);
        let entropy = writer.entropy_bits() / 8.0;
        let stream = writer.finish();
        assert!((stream.len() as f64) < entropy * 1.005, "{} bytes, entropy {entropy}", stream.len());
        // And the model itself is close to the law of the values: H(normal, 2.5) = 3.369 bits.
        let bits = stream.len() as f64 * 8.0 / values.len() as f64;
        assert!(bits < 3.369 * 1.03, "{bits} bits");
        let mut reader = RansReader::new(&stream).unwrap();
        assert_eq!(walk(&mut reader, &vec![0; values.len()], 0), values);
        assert!(reader.finished());
    }

    #[test]
    fn far_residuals_escape() {
        for low in [0, 3] {
            let values = [0, -1, 15, 16, -16, 17, -1000, 1 << 20, -(1 << 20), 5, (1 << 21) + 14];
            let mut writer = RansWriter::default();
            walk(&mut writer, &values, low);
            let stream = writer.finish();
            let mut reader = RansReader::new(&stream).unwrap();
            assert_eq!(walk(&mut reader, &[0; 11], low), values);
            assert!(reader.finished());
        }
    }
}
