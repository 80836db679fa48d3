//! Random draws indexed by what is drawn, so that order and threads do not matter.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A stream of draws that belongs to (seed, purpose, index). ChaCha with 8 rounds.
pub struct Random(ChaCha8Rng);

impl Random {
    /// The stream of draw `index` of `purpose` (a constant of the caller's) under `seed`.
    pub fn new(seed: u64, purpose: u32, index: u64) -> Self {
        let mut key = [0u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..12].copy_from_slice(&purpose.to_le_bytes());
        key[12..20].copy_from_slice(b"particle");
        let mut rng = ChaCha8Rng::from_seed(key);
        rng.set_stream(index);
        Random(rng)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Fills `words` with the stream's next bits, 32 each.
    pub fn fill(&mut self, words: &mut [u32]) {
        self.0.fill_bytes(bytemuck::cast_slice_mut(words));
        if cfg!(target_endian = "big") {
            words.iter_mut().for_each(|w| *w = w.swap_bytes());
        }
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Standard normal (Box-Muller, one of the pair).
    pub fn normal(&mut self) -> f64 {
        let u = 1.0 - self.uniform();
        let v = self.uniform();
        (-2.0 * libm::log(u)).sqrt() * libm::cos(2.0 * std::f64::consts::PI * v)
    }

    /// Beta(3, 3): the median of five uniforms.
    pub fn beta33(&mut self) -> f64 {
        let mut u = [0.0; 5];
        u.fill_with(|| self.uniform());
        u.sort_by(f64::total_cmp);
        u[2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_and_repeat() {
        let a = Random::new(1, 2, 3).bits();
        assert_eq!(a, Random::new(1, 2, 3).bits());
        assert_ne!(a, Random::new(1, 2, 4).bits());
        assert_ne!(a, Random::new(1, 3, 3).bits());
        assert_ne!(a, Random::new(2, 2, 3).bits());
    }

    #[test]
    fn beta33_has_its_mean_and_variance() {
        let n = 20_000;
        let x: Vec<f64> = (0..n).map(|i| Random::new(7, 0, i).beta33()).collect();
        let mean = x.iter().sum::<f64>() / n as f64;
        let var = x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.005, "{mean}");
        assert!((var - 1.0 / 28.0).abs() < 0.001, "{var}");
    }
}
