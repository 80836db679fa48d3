//! Clumps put back below a Gaussian's size, so that spacings come near the truth.
//!
//! A mixture smooths what is smaller than its Gaussians; particles drawn from it are too evenly
//! spread (nearest neighbours of nbody128 at ratio 300: 1.13 times the true mean distance, 1.33
//! times the median), and blue noise makes that worse. So each Gaussian is halved again and again,
//! in turn along its three own axes, at equal probability, and a half gets a random share of the
//! particles instead of 1/2: a multiplicative cascade, as matter clusters in clusters. Shares belong
//! to (seed, layer, Gaussian, node), so that nothing is stored, and a particle's uniform numbers
//! choose its path. How uneven shares are falls away from the densities at which groups form:
//! cores of haloes are smooth, and so are voids.

use super::quantile::quantile;

/// Levels beyond one particle a node, so that clumps have an inside.
const BEYOND: u32 = 3;
/// Levels at most: seven halvings an axis.
const MOST_LEVELS: u32 = 21;
/// A share is 1/2 -+ half an amplitude times the root of a uniform number. The amplitude is greatest
/// at this multiple of the snapshot's mean density, ...
const PEAK_DENSITY: f64 = 10.0;
/// ... falls off as a normal curve of ln density of this width, ...
const WIDTH: f64 = 2.0;
/// ... between this greatest amplitude ...
const GREATEST: f64 = 0.95;
/// ... and this least one. Found on nbody128 at ratio 300, where distances to the nearest neighbour come to 1.03
/// (mean) and 1.04 (median) of the truth, and 0.97, 0.97, 1.31 and 0.99 at its 10, 25, 75 and 90 %.
const LEAST: f64 = 0.3;

/// Particles placed at once.
const BLOCK: usize = 64;

/// The halvings of one Gaussian.
pub(super) struct Cascade {
    key: u64,
    levels: u32,
    amplitude: f64,
}

impl Cascade {
    /// For a Gaussian of `count` particles and so many times the mean density; `key` says which.
    pub(super) fn new(key: [u64; 2], count: u64, density: f64) -> Cascade {
        let levels = (u64::BITS - count.leading_zeros() + BEYOND).min(MOST_LEVELS);
        // Gaussians without extent are denser than all else.
        let from_peak = libm::log(density.clamp(1e-12, 1e12) / PEAK_DENSITY) / WIDTH;
        let amplitude = (GREATEST * libm::exp(-0.5 * from_peak * from_peak)).max(LEAST);
        Cascade { key: mixed(key[0] ^ mixed(key[1])), levels, amplitude }
    }

    /// Uniform numbers in (0, 1) to numbers that are standard normal over all Gaussians, clumped
    /// within one.
    pub(super) fn apply(&self, raw: &mut [&mut [f64]; 3]) {
        let n = raw[0].len();
        for first in (0..n).step_by(BLOCK) {
            let block = first..n.min(first + BLOCK);
            let [x, y, z] = raw;
            self.place([&mut x[block.clone()], &mut y[block.clone()], &mut z[block]]);
        }
    }

    /// Places of particles from uniform numbers `u`, at most [`BLOCK`]: level by level, so that
    /// one particle's chain of roots and divisions does not wait for another's.
    fn place(&self, u: [&mut [f64]; 3]) {
        let (mut low, mut width) = ([[0.0; BLOCK]; 3], [1.0; 3]);
        let mut node = [self.key; BLOCK];
        for level in 0..self.levels {
            let axis = (level % 3) as usize;
            width[axis] *= 0.5;
            let columns = u[axis].iter_mut().zip(&mut low[axis]).zip(&mut node);
            for ((u, low), node) in columns {
                let side = 2.0 * unit(*node) - 1.0;
                let share = 0.5 + 0.5 * self.amplitude * side.abs().sqrt().copysign(side);
                let upper = *u >= share;
                let (part, whole) = if upper { (*u - share, 1.0 - share) } else { (*u, share) };
                *u = part / whole;
                *low += if upper { width[axis] } else { 0.0 };
                *node = mixed(node.wrapping_add(1 + u64::from(upper)));
            }
        }
        for (k, u) in u.into_iter().enumerate() {
            u.iter_mut().zip(&low[k]).for_each(|(u, low)| *u = quantile(low + width[k] * *u));
        }
    }
}

/// A well-mixed number (the finaliser of SplitMix64).
pub(super) fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// In (0, 1): never a share of nothing.
pub(super) fn unit(x: u64) -> f64 {
    ((x >> 12) as f64 + 0.5) * (1.0 / (1u64 << 52) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    /// Draws of `gaussians` Gaussians of `count` particles, 20 times denser than the mean.
    fn draws(gaussians: u64, count: usize) -> Vec<[f64; 3]> {
        let mut all = Vec::new();
        for g in 0..gaussians {
            let mut r = Random::new(3, 1, g);
            let mut columns = [0; 3].map(|_| (0..count).map(|_| r.uniform()).collect::<Vec<f64>>());
            let [x, y, z] = &mut columns;
            Cascade::new([1, g], count as u64, 20.0).apply(&mut [x, y, z]);
            all.extend((0..count).map(|i| [columns[0][i], columns[1][i], columns[2][i]]));
        }
        all
    }

    #[test]
    fn over_many_gaussians_draws_are_normal() {
        let all = draws(4000, 50);
        for k in 0..3 {
            let mean = all.iter().map(|p| p[k]).sum::<f64>() / all.len() as f64;
            let square = all.iter().map(|p| p[k] * p[k]).sum::<f64>() / all.len() as f64;
            assert!(mean.abs() < 0.04 && (square - 1.0).abs() < 0.05, "{mean} {square}");
        }
    }

    #[test]
    fn neighbours_come_closer() {
        let nearest = |points: &[[f64; 3]]| {
            let distance = |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
            let mut all: Vec<f64> = (0..points.len())
                .map(|i| {
                    (0..points.len())
                        .filter(|&j| j != i)
                        .map(|j| distance(&points[i], &points[j]))
                        .fold(f64::MAX, f64::min)
                })
                .collect();
            all.sort_by(f64::total_cmp);
            all[all.len() / 2].sqrt()
        };
        let mut r = Random::new(3, 2, 0);
        let plain: Vec<[f64; 3]> = (0..500).map(|_| [r.normal(), r.normal(), r.normal()]).collect();
        let clumped = draws(1, 500);
        assert!(nearest(&clumped) < 0.8 * nearest(&plain));
    }
}
