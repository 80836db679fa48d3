//! The precision of a block's numbers.

/// Quantisation steps; rate control scales them together ([`Precision::scaled`]).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Precision {
    /// Edge of a position's cell, in geometric mean radii of the Gaussian.
    pub position: f64,
    /// Step of ln of the geometric mean radius.
    pub size: f64,
    /// Step of the five shape numbers (coordinates of half the trace-free matrix logarithm).
    pub shape: f64,
    /// Step of ln count; in models of the alpha-blend law of ln(-ln(1 - opacity)).
    pub count: f64,
    /// Step of ln (mass / count), where particles have weights; of ln grey in the alpha-blend law.
    pub mass: f64,
    /// Power by which the steps of position and shape fall with count / radius: a Gaussian's step is
    /// the above times (count / radius)^-importance, 1 for a middling Gaussian; in the alpha-blend
    /// law times (depth radius)^-importance.
    pub importance: f64,
}

impl Precision {
    /// The balance of the steps that loses least at a given size (docs/format.md, section 11).
    pub const BALANCED: Precision =
        Precision { position: 0.5, size: 0.22, shape: 0.5, count: 0.22, mass: 0.22, importance: 0.45 };

    /// Multiples of these steps that are of use: from the finest to the coarsest. Steps of a quarter of the
    /// finest gain less than 0.01 dB and 0.001 bits a held-out particle.
    pub const FACTORS: [f64; 2] = [1.0 / 8.0, 32.0];

    /// Doublings of all steps that save about so many bytes: each takes a bit off each of a Gaussian's
    /// ten numbers.
    pub fn doublings(bytes: f64, gaussians: usize) -> f64 {
        8.0 * bytes / (10.0 * gaussians as f64)
    }

    /// All steps times `q`.
    pub fn scaled(self, q: f64) -> Precision {
        Precision {
            position: self.position * q,
            size: self.size * q,
            shape: self.shape * q,
            count: self.count * q,
            mass: self.mass * q,
            importance: self.importance,
        }
    }

    /// The steps as a block holds them: f32 within 1e-6 to 16.
    pub(crate) fn steps(&self) -> [f32; 5] {
        [self.position, self.size, self.count, self.shape, self.mass].map(|s| (s as f32).clamp(1e-6, 16.0))
    }
}

impl Precision {
    /// From a block's steps (position, size, count, shape, mass).
    pub(crate) fn from_header(s: [f32; 5], importance: f32) -> Precision {
        let [position, size, count, shape, mass] = s.map(f64::from);
        Precision { position, size, shape, count, mass, importance: f64::from(importance) }
    }
}
