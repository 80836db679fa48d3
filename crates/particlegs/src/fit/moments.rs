//! Count, mass, mean and covariance of a run of particles.

use crate::math::{Sym3, simd_level};
use rayon::prelude::*;

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

/// Particles whose sums are kept in f32; sums of blocks are f64.
const BLOCK: usize = 256;
const LANES: usize = 8;
/// Particles in one parallel step of a long run.
const STEP: usize = 1 << 18;

impl Moments {
    /// Moments of `xyz` (and `weight`), summed in f64 about the first particle.
    pub fn of(xyz: &[[f32; 3]], weight: Option<&[f32]>) -> Self {
        let Some(first) = xyz.first() else { return Moments::default() };
        let reference = first.map(f64::from);
        let mut sums = [0f64; 9];
        for p in xyz {
            let d: [f64; 3] = std::array::from_fn(|k| f64::from(p[k]) - reference[k]);
            let o = Sym3::outer(d).0;
            for k in 0..9 {
                sums[k] += if k < 3 { d[k] } else { o[k - 3] };
            }
        }
        let mass = weight.map(|w| w.iter().map(|&v| f64::from(v)).sum());
        Moments::from_sums(xyz.len(), mass, reference, sums)
    }

    /// The fast twin of [`Moments::of`], for choosing cuts: f32 differences from the first particle,
    /// f32 sums over short blocks, f64 sums of those. Covariances to about 1e-6 of their trace.
    pub(super) fn quick(xyz: &[[f32; 3]]) -> Self {
        let Some(&reference) = xyz.first() else { return Moments::default() };
        let sums = if xyz.len() <= STEP {
            sums(xyz, reference)
        } else {
            let parts: Vec<_> = xyz.par_chunks(STEP).map(|c| sums(c, reference)).collect();
            parts.iter().fold([0.0; 9], |a, b| std::array::from_fn(|k| a[k] + b[k]))
        };
        Moments::from_sums(xyz.len(), None, reference.map(f64::from), sums)
    }

    /// From sums of differences (x, y, z) and their products (xx, xy, xz, yy, yz, zz).
    fn from_sums(count: usize, mass: Option<f64>, reference: [f64; 3], sums: [f64; 9]) -> Self {
        let n = count as f64;
        let d: [f64; 3] = std::array::from_fn(|k| sums[k] / n);
        let o = Sym3::outer(d).0;
        let mut cov = Sym3(std::array::from_fn(|k| sums[3 + k] / n - o[k]));
        for k in [0, 3, 5] {
            cov.0[k] = cov.0[k].max(0.0);
        }
        Moments {
            count: count as u64,
            mass: mass.unwrap_or(n),
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

fn sums(xyz: &[[f32; 3]], reference: [f32; 3]) -> [f64; 9] {
    fearless_simd::dispatch!(simd_level(), _simd => sums_kernel(xyz, reference))
}

#[inline(always)]
fn sums_kernel(xyz: &[[f32; 3]], reference: [f32; 3]) -> [f64; 9] {
    let mut total = [0f64; 9];
    for block in xyz.chunks(BLOCK) {
        let mut acc = [[0f32; LANES]; 9];
        let mut eights = block.chunks_exact(LANES);
        for eight in &mut eights {
            add_eight(&mut acc, eight.try_into().expect("eight"), reference);
        }
        let rest = eights.remainder();
        if !rest.is_empty() {
            // The reference itself adds nothing to any sum.
            let mut eight = [reference; LANES];
            eight[..rest.len()].copy_from_slice(rest);
            add_eight(&mut acc, &eight, reference);
        }
        for k in 0..9 {
            let a = &acc[k];
            total[k] += f64::from(((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7])));
        }
    }
    total
}

#[inline(always)]
fn add_eight(acc: &mut [[f32; LANES]; 9], p: &[[f32; 3]; LANES], reference: [f32; 3]) {
    let [mut x, mut y, mut z] = [[0f32; LANES]; 3];
    for l in 0..LANES {
        x[l] = p[l][0] - reference[0];
        y[l] = p[l][1] - reference[1];
        z[l] = p[l][2] - reference[2];
    }
    for l in 0..LANES {
        acc[0][l] += x[l];
        acc[1][l] += y[l];
        acc[2][l] += z[l];
        acc[3][l] += x[l] * x[l];
        acc[4][l] += x[l] * y[l];
        acc[5][l] += x[l] * z[l];
        acc[6][l] += y[l] * y[l];
        acc[7][l] += y[l] * z[l];
        acc[8][l] += z[l] * z[l];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    #[test]
    fn fast_and_plain_agree() {
        for (n, centre) in [(1, 0.3f32), (2, 0.0), (7, 0.9), (8, 0.1), (300, 0.5), (5000, 0.7), (600_000, 0.2)] {
            let xyz: Vec<[f32; 3]> = (0..n)
                .map(|i| {
                    let mut r = Random::new(1, 2, i);
                    [1e-2, 3e-3, 1e-4].map(|s| centre + s * r.normal() as f32)
                })
                .collect();
            let (fast, plain) = (Moments::quick(&xyz), Moments::of(&xyz, None));
            for k in 0..3 {
                assert!((fast.mean[k] - plain.mean[k]).abs() < 1e-6 * 1e-2);
            }
            for k in 0..6 {
                let size = (plain.cov.0[[0, 0, 0, 3, 3, 5][k]] * plain.cov.0[[0, 3, 5, 3, 5, 5][k]]).sqrt();
                assert!((fast.cov.0[k] - plain.cov.0[k]).abs() <= 1e-5 * size, "{n} {k}");
            }
        }
    }

    #[test]
    fn merging_is_exact() {
        let xyz: Vec<[f32; 3]> = (0..100).map(|i| [(i % 7) as f32, (i % 11) as f32, (i * i % 13) as f32]).collect();
        let (a, b) = xyz.split_at(37);
        let (whole, merged) = (Moments::of(&xyz, None), Moments::of(a, None).merged(&Moments::of(b, None)));
        for k in 0..6 {
            assert!((whole.cov.0[k] - merged.cov.0[k]).abs() < 1e-12);
        }
    }
}
