//! Standard normal numbers, many at once: Box and Muller's method on words of a counter-based
//! stream. Sums and products in a fixed order, square roots and divisions alone, so that every
//! machine and instruction set gets the same bits; no table, no branch, so that compilers make
//! vectors of it.

use particlegs_core::context::Level;
use particlegs_core::math::Random;

#[derive(Default)]
pub(super) struct Draws {
    words: Vec<u32>,
}

impl Draws {
    /// Fills `out` with standard normals (to 6.8 standard deviations: words have 32 bits).
    pub(super) fn normals(&mut self, level: Level, random: &mut Random, out: &mut [f64]) {
        // Pairs come from blocks that stay in the cache.
        for block in out.chunks_mut(2 * BLOCK) {
            let pairs = block.len().div_ceil(2);
            self.words.resize(2 * pairs, 0);
            random.fill(&mut self.words);
            let (radii, angles) = self.words.split_at(pairs);
            let (first, second) = block.split_at_mut(pairs);
            fearless_simd::dispatch!(level, _simd => pairs_kernel(radii, angles, first, second));
        }
    }

    /// Fills `out` with uniform numbers in (0, 1): the middles of 2^32 steps.
    pub(super) fn uniforms(&mut self, level: Level, random: &mut Random, out: &mut [f64]) {
        for block in out.chunks_mut(2 * BLOCK) {
            self.words.resize(block.len(), 0);
            random.fill(&mut self.words);
            fearless_simd::dispatch!(level, _simd => uniform_kernel(&self.words, block));
        }
    }
}

/// Pairs made at once.
const BLOCK: usize = 1024;
const STEP: f64 = 1.0 / (1u64 << 32) as f64;

#[inline(always)]
fn uniform_kernel(words: &[u32], out: &mut [f64]) {
    for (to, &word) in out.iter_mut().zip(words) {
        *to = (f64::from(word) + 0.5) * STEP;
    }
}

/// `second` may be one shorter.
#[inline(always)]
fn pairs_kernel(radii: &[u32], angles: &[u32], first: &mut [f64], second: &mut [f64]) {
    let n = second.len();
    for i in 0..n {
        (first[i], second[i]) = pair(radii[i], angles[i]);
    }
    if n < first.len() {
        first[n] = pair(radii[n], angles[n]).0;
    }
}

/// Two normals of two words.
#[inline(always)]
fn pair(radius: u32, angle: u32) -> (f64, f64) {
    let r = (-2.0 * ln((f64::from(radius) + 0.5) * STEP)).sqrt();
    let (sin, cos) = sin_cos((f64::from(angle) * STEP - 0.5) * std::f64::consts::PI);
    (r * cos, r * sin)
}

/// ln u for 2^-33 <= u < 1, to 1e-15: u = 2^k m, m about 1, and the series of artanh.
#[inline(always)]
pub(super) fn ln(u: f64) -> f64 {
    // Half an octave below 1: m lies in sqrt(1/2) to sqrt(2).
    const MIDDLE: u64 = std::f64::consts::FRAC_1_SQRT_2.to_bits();
    let (shifted, lowest) = (u.to_bits().wrapping_sub(MIDDLE), 1u64 << 52);
    // Biased by 64, so that it is a whole number that needs no sign.
    let k = shifted.wrapping_add(64 * lowest) >> 52;
    let m = f64::from_bits((shifted & (lowest - 1)).wrapping_add(MIDDLE));
    let k = f64::from_bits(k | 0x4330_0000_0000_0000) - (4_503_599_627_370_496.0 + 64.0);
    let f = (m - 1.0) / (m + 1.0);
    let g = f * f;
    let mut p = 1.0 / 19.0;
    for n in [17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        p = p * g + 1.0 / n;
    }
    k * std::f64::consts::LN_2 + 2.0 * f * p
}

/// Sine and cosine of twice `h`, |h| <= pi / 2, to 1e-13: the series at h, then the double angle.
#[inline(always)]
fn sin_cos(h: f64) -> (f64, f64) {
    let g = h * h;
    let (mut s, mut c) = (1.0, 1.0);
    // 1 - g / (n (n + 1)) (1 - ...), from the inside out.
    for n in [20.0, 18.0, 16.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0, 2.0] {
        s = 1.0 - g * (1.0 / (n * (n + 1.0))) * s;
        c = 1.0 - g * (1.0 / (n * (n - 1.0))) * c;
    }
    let s = h * s;
    (2.0 * s * c, 1.0 - 2.0 * s * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_agree_with_the_library() {
        for i in 0..100_000u32 {
            let word = i.wrapping_mul(0x9e37_79b9);
            let u = (f64::from(word) + 0.5) * STEP;
            assert!((ln(u) - u.ln()).abs() <= 4e-15 * (1.0 + u.ln().abs()), "ln {u}");
            let h = (f64::from(word) * STEP - 0.5) * std::f64::consts::PI;
            let (s, c) = sin_cos(h);
            assert!((s - (2.0 * h).sin()).abs() < 1e-13 && (c - (2.0 * h).cos()).abs() < 1e-13, "angle {h}");
        }
        for u in [0.5 * STEP, STEP, 1.0 - 0.5 * STEP, 0.5, std::f64::consts::FRAC_1_SQRT_2] {
            assert!((ln(u) - u.ln()).abs() <= 4e-15 * u.ln().abs() + 1e-25, "ln {u}: {} {}", ln(u), u.ln());
        }
    }

    #[test]
    fn moments_are_those_of_a_normal() {
        let mut z = vec![0.0; 400_001];
        Draws::default().normals(Level::new(), &mut Random::new(1, 2, 3), &mut z);
        let moment = |k: i32| z.iter().map(|v| v.powi(k)).sum::<f64>() / z.len() as f64;
        assert!(moment(1).abs() < 0.006 && (moment(2) - 1.0).abs() < 0.01);
        assert!(moment(3).abs() < 0.03 && (moment(4) - 3.0).abs() < 0.08);
        let pairs: f64 = z.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / z.len() as f64;
        assert!(pairs.abs() < 0.006);
        let beyond = z.iter().filter(|v| v.abs() > 3.0).count() as f64 / z.len() as f64;
        assert!((beyond - 0.0027).abs() < 0.0004, "{beyond}");
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let draw = |level| {
            let mut z = vec![0.0; 5001];
            Draws::default().normals(level, &mut Random::new(7, 0, 0), &mut z);
            z
        };
        assert_eq!(draw(Level::new()), draw(Level::baseline()));
    }
}
