//! Count, mass, mean and covariance of a run of particles.

use crate::math::Sym3;

/// Moments of a set of particles, store units. The geometry counts particles; mass is a sum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Particles.
    pub count: u64,
    /// Sum of their weights; the count where they have none.
    pub mass: f64,
    /// Mean position.
    pub mean: [f64; 3],
    /// Covariance of the positions (divided by the count).
    pub cov: Sym3,
}

impl Moments {
    /// Moments of `xyz`, summed in f64 about the first particle.
    pub fn of(xyz: &[[f32; 3]], weight: Option<&[f32]>) -> Self {
        let Some(first) = xyz.first() else { return Moments::default() };
        let reference = first.map(f64::from);
        let (mut s, mut q) = ([0f64; 3], [0f64; 6]);
        for p in xyz {
            let d: [f64; 3] = std::array::from_fn(|k| f64::from(p[k]) - reference[k]);
            for k in 0..3 {
                s[k] += d[k];
            }
            let o = Sym3::outer(d).0;
            for k in 0..6 {
                q[k] += o[k];
            }
        }
        let n = xyz.len() as f64;
        let d = s.map(|v| v / n);
        let o = Sym3::outer(d).0;
        let mut cov = Sym3(std::array::from_fn(|k| q[k] / n - o[k]));
        for k in [0, 3, 5] {
            cov.0[k] = cov.0[k].max(0.0);
        }
        Moments {
            count: xyz.len() as u64,
            mass: weight.map_or(n, |w| w.iter().map(|&v| f64::from(v)).sum()),
            mean: std::array::from_fn(|k| reference[k] + d[k]),
            cov,
        }
    }

    /// Moments of both sets together.
    pub fn merged(&self, other: &Moments) -> Moments {
        let (a, b) = (self.count as f64, other.count as f64);
        let n = a + b;
        if n == 0.0 {
            return Moments::default();
        }
        let d: [f64; 3] = std::array::from_fn(|k| other.mean[k] - self.mean[k]);
        let spread = Sym3::outer(d).scale(a * b / (n * n));
        Moments {
            count: self.count + other.count,
            mass: self.mass + other.mass,
            mean: std::array::from_fn(|k| self.mean[k] + d[k] * (b / n)),
            cov: self.cov.scale(a / n).add(&other.cov.scale(b / n)).add(&spread),
        }
    }
}
