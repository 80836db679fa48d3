//! The E step of one group of particles, vectorised over particles.
//!
//! Sixteen particles stand in one vector; every level does the same operations in the same order
//! (no fused multiply-add), so the sums are the same bits with and without vector instructions.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use particlegs_core::math::each_axis;
use particlegs_core::math::exp2;

/// Particles in one vector.
const LANES: usize = 16;

/// Particles whose sums are kept in f32 before they go to f64.
const RUN: usize = 512;

/// Columns of [`CandidateSums`]: responsibility, weight times responsibility, then the focused responsibility
/// (see [`WhitenedGaussian::focus`]) times 1, x, y, z, xx, xy, xz, yy, yz, zz (relative to the group's centre).
pub(crate) const SUMS: usize = 12;

/// Sums that a group gives to one candidate.
pub(crate) type CandidateSums = [f32; SUMS];

/// A Gaussian as the kernel wants it: log2 of its density at x is `level - |rows (x - mean)|^2`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WhitenedGaussian {
    /// Relative to the group's centre.
    pub(crate) mean: [f32; 3],
    /// Lower triangle by rows.
    pub(crate) rows: [f32; 6],
    /// Lower triangle of the focus: a particle counts in the moments by its responsibility times
    /// 2^-|focus (x - mean)|^2.
    pub(crate) focus: [f32; 6],
    /// log2 of count and norm.
    pub(crate) level: f32,
}

/// One vector in memory, aligned so that no load crosses a cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Lanes([f32; LANES]);

const ZERO: Lanes = Lanes([0.0; LANES]);

/// Vectors whose sums stay in registers.
const BATCH: usize = 4;

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct KernelScratch {
    share: Vec<[Lanes; BATCH]>,
    sums: Vec<[Lanes; SUMS]>,
}

/// Particles that lie together, and the Gaussians that they may belong to.
pub(crate) struct ParticleGroup<'a> {
    pub(crate) points: &'a [[f32; 3]],
    /// One a particle, where they have weights.
    pub(crate) weight: Option<&'a [f32]>,
    /// Origin of the sums and of the candidates' means.
    pub(crate) centre: [f32; 3],
    /// The Gaussians, best first.
    pub(crate) candidates: &'a [WhitenedGaussian],
}

/// The E step of one group: adds each particle's responsibilities for the candidates into `sums`
/// (overwritten) and names each particle's likeliest candidate in `owner` where that is asked for.
/// Returns the sum of log2 likelihoods where `likelihood` is set, else 0.
pub(crate) fn expect(
    level: Level,
    group: &ParticleGroup<'_>,
    scratch: &mut KernelScratch,
    sums: &mut [CandidateSums],
    owner: Option<&mut [u32]>,
    likelihood: bool,
) -> f64 {
    let owner = owner.unwrap_or(&mut []);
    dispatch!(level, simd => kernel(simd, group, scratch, sums, owner, likelihood))
}

#[inline(always)]
fn kernel<S: Simd>(
    simd: S,
    group: &ParticleGroup<'_>,
    scratch: &mut KernelScratch,
    sums: &mut [CandidateSums],
    owner: &mut [u32],
    likelihood: bool,
) -> f64 {
    let &ParticleGroup { points, weight, centre, candidates } = group;
    let k = candidates.len();
    scratch.share.resize(k, [ZERO; BATCH]);
    // A group of one run needs no sums in f64: those of its run are the result.
    let mut total = vec![[0f64; SUMS]; if points.len() > RUN { k } else { 0 }];
    let mut log_likelihood = likelihood.then_some(0.0);
    for first in (0..points.len()).step_by(RUN) {
        let end = points.len().min(first + RUN);
        // Resizing alone would keep the sums of the run before.
        scratch.sums.clear();
        scratch.sums.resize(k, [ZERO; SUMS]);
        for start in (first..end).step_by(BATCH * LANES) {
            let stop = end.min(start + BATCH * LANES);
            let owner = if owner.is_empty() { &mut [] } else { &mut owner[start..stop] };
            let batch = ParticleBatch::new(&points[start..stop], weight.map(|w| &w[start..stop]), centre);
            let share = &mut scratch.share[..k];
            let invert = responsibilities(simd, &batch, candidates, share, owner, log_likelihood.as_mut());
            add_moments(simd, &batch, &invert, candidates, share, &mut scratch.sums[..k]);
        }
        for (c, lanes) in scratch.sums.iter().enumerate() {
            let part: CandidateSums = std::array::from_fn(|q| across(&lanes[q]));
            if total.is_empty() {
                sums[c] = part;
            } else {
                for q in 0..SUMS {
                    total[c][q] += f64::from(part[q]);
                }
            }
        }
    }
    for (out, t) in sums.iter_mut().zip(&total) {
        *out = t.map(|v| v as f32);
    }
    log_likelihood.unwrap_or(0.0)
}

/// Sum over lanes, halves onto halves.
#[inline(always)]
fn across(lanes: &Lanes) -> f32 {
    let l = &lanes.0;
    let a: [f32; 8] = std::array::from_fn(|i| l[i] + l[i + 8]);
    let b: [f32; 4] = std::array::from_fn(|i| a[i] + a[i + 4]);
    (b[0] + b[2]) + (b[1] + b[3])
}

/// Particles side by side; places beyond `n` are empty.
struct ParticleBatch {
    n: usize,
    position: [[Lanes; 3]; BATCH],
    present: [Lanes; BATCH],
    mass: [Lanes; BATCH],
}

impl ParticleBatch {
    #[inline(always)]
    fn new(points: &[[f32; 3]], weight: Option<&[f32]>, centre: [f32; 3]) -> Self {
        let mut b = ParticleBatch {
            n: points.len(),
            position: [[ZERO; 3]; BATCH],
            present: [ZERO; BATCH],
            mass: [ZERO; BATCH],
        };
        for (i, p) in points.iter().enumerate() {
            let (v, lane) = (i / LANES, i % LANES);
            for axis in 0..3 {
                b.position[v][axis].0[lane] = p[axis] - centre[axis];
            }
            b.present[v].0[lane] = 1.0;
        }
        for (i, &w) in weight.unwrap_or(&[]).iter().enumerate() {
            b.mass[i / LANES].0[i % LANES] = w;
        }
        b
    }

    #[inline(always)]
    fn vectors(&self) -> usize {
        self.n.div_ceil(LANES)
    }

    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, v: usize) -> [f32x16<S>; 3] {
        each_axis(|axis| f32x16::load_array_ref(simd, &self.position[v][axis].0))
    }
}

/// Densities relative to each particle's largest into `share`; returns what they are to be
/// multiplied by (0 in empty places). Log2 likelihoods are added where there is a sum for them.
#[inline(always)]
fn responsibilities<S: Simd>(
    simd: S,
    batch: &ParticleBatch,
    candidates: &[WhitenedGaussian],
    share: &mut [[Lanes; BATCH]],
    owner: &mut [u32],
    mut log_likelihood: Option<&mut f64>,
) -> [Lanes; BATCH] {
    let mut invert = [ZERO; BATCH];
    for v in 0..batch.vectors() {
        let [x, y, z] = batch.at(simd, v);
        let mut best = f32x16::splat(simd, f32::MIN);
        for (c, out) in candidates.iter().zip(share.iter_mut()) {
            let log = f32x16::splat(simd, c.level) - squared(&c.rows, [x - c.mean[0], y - c.mean[1], z - c.mean[2]]);
            best = best.max(log);
            log.store_slice(&mut out[v].0);
        }
        let particle_range = v * LANES..batch.n.min((v + 1) * LANES);
        // `share` still holds logarithms, which the densities below overwrite.
        if !owner.is_empty() {
            name_owners(share, v, &<[f32; LANES]>::from(best), &mut owner[particle_range.clone()]);
        }
        // Relative to the largest density, which gives 1: the norm of a particle is never 0.
        let mut norm = f32x16::splat(simd, 0.0);
        for s in share.iter_mut() {
            let p = exp2(simd, f32x16::load_array_ref(simd, &s[v].0) - best);
            norm += p;
            p.store_slice(&mut s[v].0);
        }
        (f32x16::load_array_ref(simd, &batch.present[v].0) / norm).store_slice(&mut invert[v].0);
        if let Some(sum) = log_likelihood.as_deref_mut() {
            let (best, norm) = (<[f32; LANES]>::from(best), <[f32; LANES]>::from(norm));
            *sum += (0..particle_range.len()).map(|i| f64::from(best[i]) + libm::log2(f64::from(norm[i]))).sum::<f64>();
        }
    }
    invert
}

/// Adds the batch's responsibilities and focused moments to each candidate's sums.
#[inline(always)]
fn add_moments<S: Simd>(
    simd: S,
    batch: &ParticleBatch,
    invert: &[Lanes; BATCH],
    candidates: &[WhitenedGaussian],
    share: &[[Lanes; BATCH]],
    sums: &mut [[Lanes; SUMS]],
) {
    for ((s, sum), c) in share.iter().zip(sums.iter_mut()).zip(candidates) {
        let mut total: [f32x16<S>; SUMS] = std::array::from_fn(|_| f32x16::splat(simd, 0.0));
        for v in 0..batch.vectors() {
            let [x, y, z] = batch.at(simd, v);
            let r = f32x16::load_array_ref(simd, &s[v].0) * f32x16::load_array_ref(simd, &invert[v].0);
            let focus_square = squared(&c.focus, [x - c.mean[0], y - c.mean[1], z - c.mean[2]]);
            let w = r * exp2(simd, -focus_square);
            let (wx, wy, wz) = (w * x, w * y, w * z);
            let mass = f32x16::load_array_ref(simd, &batch.mass[v].0);
            let add = [r, r * mass, w, wx, wy, wz, wx * x, wx * y, wx * z, wy * y, wy * z, wz * z];
            for q in 0..SUMS {
                total[q] += add[q];
            }
        }
        for q in 0..SUMS {
            (f32x16::load_array_ref(simd, &sum[q].0) + total[q]).store_slice(&mut sum[q].0);
        }
    }
}

/// |rows d|^2 with the lower triangle `rows`.
#[inline(always)]
fn squared<S: Simd>(rows: &[f32; 6], [dx, dy, dz]: [f32x16<S>; 3]) -> f32x16<S> {
    let u = dx * rows[0];
    let v = dx * rows[1] + dy * rows[2];
    let w = dx * rows[3] + dy * rows[4] + dz * rows[5];
    u * u + v * v + w * w
}

/// The first candidate whose logarithm is the largest.
#[inline(always)]
fn name_owners(logs: &[[Lanes; BATCH]], v: usize, best: &[f32; LANES], owner: &mut [u32]) {
    let mut names = [u32::MAX; LANES];
    for (c, log) in logs.iter().enumerate() {
        for i in 0..LANES {
            names[i] = names[i].min(if log[v].0[i] == best[i] { c as u32 } else { u32::MAX });
        }
    }
    for (o, n) in owner.iter_mut().zip(names) {
        *o = if n == u32::MAX { 0 } else { n };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    /// The E step as a reader would write it, f64.
    fn plain(
        points: &[[f32; 3]],
        weight: &[f32],
        centre: [f32; 3],
        candidates: &[WhitenedGaussian],
    ) -> Vec<[f64; SUMS]> {
        let mut sums = vec![[0f64; SUMS]; candidates.len()];
        for (p, &mass) in points.iter().zip(weight) {
            let d: [f64; 3] = each_axis(|k| f64::from(p[k]) - f64::from(centre[k]));
            let squared = |rows: [f32; 6], mean: [f32; 3]| {
                let r = rows.map(f64::from);
                let v: [f64; 3] = each_axis(|k| d[k] - f64::from(mean[k]));
                let w = [r[0] * v[0], r[1] * v[0] + r[2] * v[1], r[3] * v[0] + r[4] * v[1] + r[5] * v[2]];
                w.iter().map(|x| x * x).sum::<f64>()
            };
            let density = |c: &WhitenedGaussian| (f64::from(c.level) - squared(c.rows, c.mean)).exp2();
            let norm: f64 = candidates.iter().map(density).sum();
            for (s, c) in sums.iter_mut().zip(candidates) {
                let r = density(c) / norm;
                let w = r * (-squared(c.focus, c.mean)).exp2();
                let [x, y, z] = d;
                let products = [1.0, x, y, z, x * x, x * y, x * z, y * y, y * z, z * z];
                s[0] += r;
                s[1] += r * f64::from(mass);
                for k in 0..10 {
                    s[2 + k] += w * products[k];
                }
            }
        }
        sums
    }

    fn case(n: usize, k: usize) -> (Vec<[f32; 3]>, Vec<f32>, Vec<WhitenedGaussian>) {
        let mut random = Random::new(n as u64, 1, k as u64);
        let mut f = || random.normal() as f32;
        let points = (0..n).map(|_| [f(), f(), f()]).collect();
        let weight = (0..n).map(|_| 1.0 + f().abs()).collect();
        let mut rows = || [0.5 + f().abs(), f(), 0.5 + f().abs(), f(), f(), 0.5 + f().abs()];
        let pairs: Vec<_> = (0..k).map(|_| (rows(), rows())).collect();
        let candidates = pairs
            .into_iter()
            .map(|(rows, focus)| WhitenedGaussian { mean: [f(), f(), f()], rows, focus, level: 3.0 * f() })
            .collect();
        (points, weight, candidates)
    }

    #[test]
    fn the_kernel_agrees_with_its_plain_twin_and_with_itself_without_simd() {
        for (n, k) in [(1, 1), (15, 3), (16, 2), (100, 7), (1500, 24)] {
            let (points, weight, candidates) = case(n, k);
            let centre = [0.1, -0.2, 0.3];
            let run = |level| {
                let mut sums = vec![[0f32; SUMS]; k];
                let mut owner = vec![0; n];
                let mut scratch = KernelScratch::default();
                let group = ParticleGroup { points: &points, weight: Some(&weight), centre, candidates: &candidates };
                let l = expect(level, &group, &mut scratch, &mut sums, Some(&mut owner), true);
                (sums, owner, l)
            };
            let fast = run(Level::new());
            let scalar = run(Level::baseline());
            assert_eq!(fast, scalar);
            for (a, b) in fast.0.iter().zip(plain(&points, &weight, centre, &candidates)) {
                for q in 0..SUMS {
                    let scale = 1e-5 * (n as f64) + 1e-4 * b[q].abs();
                    assert!((f64::from(a[q]) - b[q]).abs() < scale, "{n} {k} {q}: {} {}", a[q], b[q]);
                }
            }
        }
    }
}
