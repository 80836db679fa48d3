//! Count, mass, mean and covariance of a run of particles.

use fearless_simd::{Level, Simd, SimdBase, f32x8};
use particlegs_core::math::{Sym3, each_axis};

/// Moments of a set of particles, store units. The geometry counts particles; mass is a sum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of particles.
    pub count: u64,
    /// Sum of their weights; the count where they have none.
    pub mass: f64,
    /// Mean position.
    pub mean: [f64; 3],
    /// Covariance of the positions (divided by the count).
    pub cov: Sym3,
}

/// Particles whose sums are kept in f32; sums of blocks are f64.
const BLOCK: usize = 128;
/// Numbers in eight particles.
const ROW: usize = 24;

impl Moments {
    /// Moments of `xyz` (and `weight`), summed in f64 about the first particle.
    pub fn from_points(xyz: &[[f32; 3]], weight: Option<&[f32]>) -> Self {
        let Some(first) = xyz.first() else { return Moments::default() };
        let reference = first.map(f64::from);
        let mut sums = [0f64; 9];
        for p in xyz {
            let d: [f64; 3] = each_axis(|k| f64::from(p[k]) - reference[k]);
            let o = Sym3::outer(d).0;
            for k in 0..9 {
                sums[k] += if k < 3 { d[k] } else { o[k - 3] };
            }
        }
        let mass = weight.map(|w| w.iter().map(|&v| f64::from(v)).sum());
        Moments::from_sums(xyz.len(), mass, reference, sums)
    }

    /// The fast twin of [`Moments::from_points`], for choosing cuts: of as many particles as a cut looks at
    /// ([`stride`]), f32 differences from the first one, f32 sums over short blocks, f64 sums of those. Covariances
    /// to about 1e-6 of their trace where every particle is looked at.
    pub(super) fn quick(level: Level, xyz: &[[f32; 3]]) -> Self {
        let Some(&reference) = xyz.first() else { return Moments::default() };
        let stride = super::cut::stride(xyz.len());
        let sampled: Vec<[f32; 3]> =
            if stride > 1 { xyz.iter().step_by(stride).copied().collect() } else { Vec::new() };
        let points = if stride > 1 { &sampled } else { xyz };
        let sums = sums(level, points, reference);
        let sample = Moments::from_sums(points.len(), None, reference.map(f64::from), sums);
        Moments { count: xyz.len() as u64, mass: xyz.len() as f64, ..sample }
    }

    /// From sums of differences (x, y, z) and their products (xx, xy, xz, yy, yz, zz).
    fn from_sums(count: usize, mass: Option<f64>, reference: [f64; 3], sums: [f64; 9]) -> Self {
        let n = count as f64;
        let d: [f64; 3] = each_axis(|k| sums[k] / n);
        let o = Sym3::outer(d).0;
        let mut cov = Sym3(std::array::from_fn(|k| sums[3 + k] / n - o[k]));
        for k in [0, 3, 5] {
            cov.0[k] = cov.0[k].max(0.0);
        }
        Moments { count: count as u64, mass: mass.unwrap_or(n), mean: each_axis(|k| reference[k] + d[k]), cov }
    }
}

fn sums(level: Level, xyz: &[[f32; 3]], reference: [f32; 3]) -> [f64; 9] {
    fearless_simd::dispatch!(level, simd => sums_kernel(simd, xyz, reference))
}

/// Works on the flat run x, y, z, x, ...: a difference times itself, the next and the one after
/// give xx, yy, zz; xy, yz; xz in their places (other places hold nothing of use), without shuffles.
#[inline(always)]
fn sums_kernel<S: Simd>(simd: S, xyz: &[[f32; 3]], reference: [f32; 3]) -> [f64; 9] {
    let pattern: [f32; ROW] = std::array::from_fn(|l| reference[l % 3]);
    let mut total = [0f64; 9];
    // The reference itself adds nothing to any sum: it fills the last block, and two zeros follow.
    let mut rest = [reference; BLOCK];
    let mut diff = [0f32; 3 * BLOCK + 2];
    for block in xyz.chunks(BLOCK) {
        let full: &[[f32; 3]; BLOCK] = block.try_into().unwrap_or_else(|_| {
            rest[..block.len()].copy_from_slice(block);
            &rest
        });
        let rows = block.len().div_ceil(ROW / 3);
        let flat = full.as_flattened();
        for row in 0..rows {
            let (from, to) = (&flat[row * ROW..][..ROW], &mut diff[row * ROW..][..ROW]);
            for l in 0..ROW {
                to[l] = from[l] - pattern[l];
            }
        }
        diff[rows * ROW..rows * ROW + 2].fill(0.0);
        let mut a = [[f32x8::splat(simd, 0.0); 3]; 4];
        for row in 0..rows {
            let d = &diff[row * ROW..][..ROW + 2];
            for v in 0..3 {
                let [one, next, after] = [0, 1, 2].map(|k| f32x8::from_slice(simd, &d[8 * v + k..][..8]));
                a[0][v] += one;
                a[1][v] += one * one;
                a[2][v] += one * next;
                a[3][v] += one * after;
            }
        }
        let mut acc = [[0f32; ROW]; 4];
        for (row, sums) in acc.iter_mut().zip(&a) {
            for v in 0..3 {
                sums[v].store_slice(&mut row[8 * v..][..8]);
            }
        }
        // Sum k is found in its row at lanes `at`, `at + 3`, ...
        const PLACES: [(usize, usize); 9] = [(0, 0), (0, 1), (0, 2), (1, 0), (2, 0), (3, 0), (1, 1), (2, 1), (1, 2)];
        for (k, (row, at)) in PLACES.into_iter().enumerate() {
            let lane = |l: usize| acc[row][at + 3 * l];
            // In a fixed order: the same bits with and without vector instructions.
            let sum = ((lane(0) + lane(4)) + (lane(2) + lane(6))) + ((lane(1) + lane(5)) + (lane(3) + lane(7)));
            total[k] += f64::from(sum);
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    #[test]
    fn fast_and_plain_agree() {
        for (n, centre) in [(1, 0.3f32), (2, 0.0), (7, 0.9), (8, 0.1), (300, 0.5), (5000, 0.7), (16_000, 0.2)] {
            let xyz: Vec<[f32; 3]> = (0..n)
                .map(|i| {
                    let mut r = Random::new(1, 2, i);
                    [1e-2, 3e-3, 1e-4].map(|s| centre + s * r.normal() as f32)
                })
                .collect();
            let (fast, plain) = (Moments::quick(Level::new(), &xyz), Moments::from_points(&xyz, None));
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
    fn moments_of_many_are_those_of_a_sample() {
        let xyz: Vec<[f32; 3]> = (0..300_000)
            .map(|i| {
                let mut r = Random::new(1, 2, i);
                [1e-2, 3e-3, 1e-4].map(|s| 0.2 + s * r.normal() as f32)
            })
            .collect();
        let (fast, plain) = (Moments::quick(Level::new(), &xyz), Moments::from_points(&xyz, None));
        assert_eq!((fast.count, fast.mass), (plain.count, plain.mass));
        for (k, axis) in [(0, 0), (3, 1), (5, 2)] {
            assert!((fast.cov.0[k] / plain.cov.0[k] - 1.0).abs() < 0.06);
            assert!((fast.mean[axis] - plain.mean[axis]).abs() < 0.05 * plain.cov.0[k].sqrt());
        }
    }
}
