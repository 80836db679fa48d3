//! Random draws indexed by what is drawn, so that order and threads do not matter.

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};

/// Purposes of streams of draws: streams of different purposes have nothing in common, whatever their
/// seed. Numbers are four letters, and never change: pictures and files follow from them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// The rotation of an orbit's spiral.
    OrbitTurn = u32::from_be_bytes(*b"turn"),
    /// The first weights of a VizMapper.
    VizMapperStart = u32::from_be_bytes(*b"vizm"),
    /// Particles drawn from a snapshot.
    ParticleSample = u32::from_be_bytes(*b"samp"),
    /// Particles of each cell that a refinement looks at.
    RefinementSample = u32::from_be_bytes(*b"ZMPL"),
    /// Particles drawn from a model.
    Recovery = u32::from_be_bytes(*b"reco"),
    /// Fields of particles drawn from a model.
    RecoveredField = u32::from_be_bytes(*b"refi"),
    /// Particles whose nearest neighbours are looked for.
    NeighbourSample = u32::from_be_bytes(*b"near"),
    /// Particles whose likelihood is looked at.
    LikelihoodSample = u32::from_be_bytes(*b"like"),
    /// Particles whose pairs are counted.
    PairSample = u32::from_be_bytes(*b"pair"),
    /// Turns of the orbits of evaluation views.
    EvaluationTurn = u32::from_be_bytes(*b"evtu"),
    /// Radii and opacities of evaluation views.
    EvaluationLook = u32::from_be_bytes(*b"evra"),
    /// Turns of the orbits of views held out.
    HeldOutTurn = u32::from_be_bytes(*b"hotu"),
    /// Radii and opacities of views held out.
    HeldOutLook = u32::from_be_bytes(*b"hora"),
    /// Turns of the orbits of a certificate's views.
    CertificateTurn = u32::from_be_bytes(*b"cetu"),
    /// Particles of the subset that a certificate compares with.
    CertificateSubset = u32::from_be_bytes(*b"cesu"),
    /// The half of the particles that a field is gathered from, to be compared with the other.
    FieldHalves = u32::from_be_bytes(*b"cefi"),
    /// Parts of a large box in which that is done.
    FieldRegions = u32::from_be_bytes(*b"cefr"),
    /// The order of a training run's cameras.
    TrainingShuffle = u32::from_be_bytes(*b"trsh"),
    /// Radii and opacities of a training run's pictures.
    TrainingDraw = u32::from_be_bytes(*b"trdr"),
    /// A training run's cameras inside the bounds.
    TrainingInside = u32::from_be_bytes(*b"trin"),
    /// The picture of a training step, and the part of it that is seen.
    TrainingStep = u32::from_be_bytes(*b"trst"),
    /// Particles at which Gaussians of the alpha-blend law begin.
    AlphaStart = u32::from_be_bytes(*b"alsa"),
    /// Places of the pieces of a Gaussian that is split.
    AlphaSplit = u32::from_be_bytes(*b"alsp"),
    /// Places of particles in their bins, of a compressor with a bound.
    Jitter = u32::from_be_bytes(*b"jitt"),
}

/// A stream of draws that belongs to (seed, purpose, index). ChaCha with 8 rounds.
pub struct Random(ChaCha8Rng);

impl Random {
    /// The stream of draw `index` of a purpose under `seed`.
    pub fn from_purpose(purpose: Purpose, seed: u64, index: u64) -> Self {
        Random::new(seed, purpose as u32, index)
    }

    /// The stream of draw `index` of a purpose by its number: for data of tests, which have no purpose.
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
        // The stream is one of bytes: its words are little-endian on every machine.
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
        // In (0, 1], as 0 has no logarithm.
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

    /// A purpose is its four letters: what was drawn once is drawn again.
    #[test]
    fn purposes_are_their_letters() {
        for (purpose, number) in [(Purpose::OrbitTurn, 0x7475_726e), (Purpose::TrainingStep, 0x7472_7374)] {
            assert_eq!(Random::from_purpose(purpose, 5, 7).bits(), Random::new(5, number, 7).bits());
        }
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
