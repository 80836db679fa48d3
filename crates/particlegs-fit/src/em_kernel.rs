//! The E step of one group of particles, vectorised over particles, and its first half: the particles' shares alone.
//!
//! Sixteen particles stand in one vector; every level does the same operations in the same order
//! (no fused multiply-add), so the sums are the same bits with and without vector instructions.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use particlegs_core::math::exp2;
use std::ops::Range;

/// Particles in one vector.
const LANES: usize = 16;

/// Particles whose sums are kept in f32 before they go to f64: 32 vectors, a bit of a `u32` each.
const RUN: usize = 32 * LANES;

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

/// Logarithm to base 2, relative to each particle's likeliest candidate, below which a candidate gets nothing of a
/// vector of particles.
const NEGLIGIBLE: f32 = -16.0;

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct KernelScratch {
    vectors: Vec<ParticleVector>,
    /// Densities at the vectors of a run, candidate by candidate.
    share: Vec<Lanes>,
    /// The vectors of which a candidate gets anything, a bit each.
    active: Vec<u32>,
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

/// The share that a candidate has of a particle; both by their places in a group.
#[derive(Clone, Copy, Default)]
pub(crate) struct GroupShare {
    pub(crate) candidate: u32,
    pub(crate) particle: u32,
    pub(crate) share: f32,
}

/// The first half of [`expect`]: names each particle's likeliest candidate in `owner` where that is asked for, and adds
/// the particles' shares of at least `least`, candidate by candidate, to `shares` where these are.
pub(crate) fn assign(
    level: Level,
    group: &ParticleGroup<'_>,
    scratch: &mut KernelScratch,
    owner: &mut [u32],
    shares: Option<(f32, &mut Vec<GroupShare>)>,
) {
    dispatch!(level, simd => assign_kernel(simd, group, scratch, owner, shares));
}

#[inline(always)]
fn assign_kernel<S: Simd>(
    simd: S,
    group: &ParticleGroup<'_>,
    scratch: &mut KernelScratch,
    owner: &mut [u32],
    mut shares: Option<(f32, &mut Vec<GroupShare>)>,
) {
    for first in (0..group.points.len()).step_by(RUN) {
        let run = first..group.points.len().min(first + RUN);
        scratch.load(group, run.clone());
        let owner = if owner.is_empty() { &mut [] } else { &mut owner[run] };
        responsibilities(simd, group.candidates, scratch, owner, None);
        let Some((least, shares)) = &mut shares else { continue };
        let KernelScratch { vectors, share, active } = &*scratch;
        for (candidate, active) in active.iter().enumerate() {
            for (v, vector) in vectors.iter().enumerate().filter(|(v, _)| active >> v & 1 == 1) {
                let density = f32x16::load_array_ref(simd, &share[candidate * vectors.len() + v].0);
                let lanes = <[f32; LANES]>::from(density * f32x16::load_array_ref(simd, &vector.norm.0));
                let (mut vector_shares, mut count) = ([GroupShare::default(); LANES], 0);
                for (lane, &share) in lanes.iter().enumerate() {
                    let particle = (first + v * LANES + lane) as u32;
                    vector_shares[count] = GroupShare { candidate: candidate as u32, particle, share };
                    // No branch, which could not be foreseen.
                    count += usize::from(share >= *least);
                }
                shares.extend_from_slice(&vector_shares[..count]);
            }
        }
    }
}

impl KernelScratch {
    /// Takes a run of a group's particles as vectors.
    #[inline(always)]
    fn load(&mut self, group: &ParticleGroup<'_>, run: Range<usize>) {
        self.vectors.clear();
        for start in run.clone().step_by(LANES) {
            let lanes = start..run.end.min(start + LANES);
            let weight = group.weight.map(|w| &w[lanes.clone()]);
            self.vectors.push(ParticleVector::new(&group.points[lanes], weight, group.centre));
        }
    }
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
    let &ParticleGroup { points, candidates, .. } = group;
    let k = candidates.len();
    // A group of one run needs no sums in f64: those of its run are the result.
    let mut total = vec![[0f64; SUMS]; if points.len() > RUN { k } else { 0 }];
    let mut log_likelihood = likelihood.then_some(0.0);
    for first in (0..points.len()).step_by(RUN) {
        let run = first..points.len().min(first + RUN);
        scratch.load(group, run.clone());
        let owner = if owner.is_empty() { &mut [] } else { &mut owner[run] };
        responsibilities(simd, candidates, scratch, owner, log_likelihood.as_mut());
        let KernelScratch { vectors, share, active } = &*scratch;
        for (c, candidate) in candidates.iter().enumerate() {
            let share = &share[c * vectors.len()..][..vectors.len()];
            let part = moments(simd, vectors, candidate, share, active[c]);
            match total.get_mut(c) {
                Some(total) => total.iter_mut().zip(part).for_each(|(t, p)| *t += f64::from(p)),
                None => sums[c] = part,
            }
        }
    }
    for (out, t) in sums.iter_mut().zip(&total) {
        *out = t.map(|v| v as f32);
    }
    log_likelihood.unwrap_or(0.0)
}

/// The sum over the lanes of each of twelve vectors. Two vectors are folded into one that has half of each, until one
/// is left, whose lanes are the sums: with their numbers' bits in reverse.
#[inline(always)]
fn across<S: Simd>(simd: S, vectors: &[f32x16<S>; SUMS]) -> CandidateSums {
    let zero = f32x16::splat(simd, 0.0);
    let [a, b, c, d, e, f, g, h, i, j, k, l] = *vectors;
    let ab = fold(fold(a, b), fold(c, d));
    let ef = fold(fold(e, f), fold(g, h));
    let ij = fold(fold(i, j), fold(k, l));
    let sums = <[f32; LANES]>::from(fold(fold(ab, ef), fold(ij, zero)));
    const PLACE: [usize; SUMS] = [0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13];
    PLACE.map(|p| sums[p])
}

/// The halves of each of two vectors added, lane by lane in turn.
#[inline(always)]
fn fold<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> f32x16<S> {
    a.zip_low(b) + a.zip_high(b)
}

/// Particles side by side; places beyond the last are empty.
struct ParticleVector {
    position: [Lanes; 3],
    mass: Lanes,
    /// 1 where there is a particle; once [`responsibilities`] has seen them, over the sum of its densities.
    norm: Lanes,
    len: usize,
}

impl ParticleVector {
    #[inline(always)]
    fn new(points: &[[f32; 3]], weight: Option<&[f32]>, centre: [f32; 3]) -> Self {
        let mut v = ParticleVector { position: [ZERO; 3], mass: ZERO, norm: ZERO, len: points.len() };
        let mut padded = [centre; LANES];
        // Most vectors are full: of a fixed length they are turned by shuffles.
        let sixteen = <&[[f32; 3]; LANES]>::try_from(points).unwrap_or_else(|_| {
            padded[..points.len()].copy_from_slice(points);
            &padded
        });
        for axis in 0..3 {
            v.position[axis] = Lanes(std::array::from_fn(|lane| sixteen[lane][axis] - centre[axis]));
        }
        v.norm.0[..points.len()].fill(1.0);
        v.mass.0.iter_mut().zip(weight.unwrap_or(&[])).for_each(|(m, w)| *m = *w);
        v
    }

    #[inline(always)]
    fn position<S: Simd>(&self, simd: S) -> [f32x16<S>; 3] {
        let [x, y, z] = &self.position;
        [f32x16::load_array_ref(simd, &x.0), f32x16::load_array_ref(simd, &y.0), f32x16::load_array_ref(simd, &z.0)]
    }
}

/// Densities relative to each particle's largest into the scratch's `share`, what they are to be multiplied by into its
/// vectors' norm (0 in empty places), and into `active` which of the vectors a candidate gets anything of. Log2
/// likelihoods are added where there is a sum for them.
#[inline(always)]
fn responsibilities<S: Simd>(
    simd: S,
    candidates: &[WhitenedGaussian],
    scratch: &mut KernelScratch,
    owner: &mut [u32],
    mut log_likelihood: Option<&mut f64>,
) {
    let KernelScratch { vectors, share, active } = scratch;
    let count = vectors.len();
    share.resize(candidates.len() * count, ZERO);
    active.clear();
    active.resize(candidates.len(), 0);
    for (v, vector) in vectors.iter_mut().enumerate() {
        let [x, y, z] = vector.position(simd);
        let mut best = f32x16::splat(simd, f32::MIN);
        let mut likeliest = f32x16::splat(simd, 0.0);
        for (i, c) in candidates.iter().enumerate() {
            let log = f32x16::splat(simd, c.level) - squared(&c.rows, [x - c.mean[0], y - c.mean[1], z - c.mean[2]]);
            // The first of those that are as likely.
            let is_likelier = log.simd_gt(best);
            likeliest = is_likelier.select(f32x16::splat(simd, i as f32), likeliest);
            best = is_likelier.select(log, best);
            log.store_slice(&mut share[i * count + v].0);
        }
        if !owner.is_empty() {
            let likeliest = <[f32; LANES]>::from(likeliest);
            owner[v * LANES..][..vector.len].iter_mut().zip(likeliest).for_each(|(o, i)| *o = i as u32);
        }
        // Relative to the largest density, which gives 1: the norm of a particle is never 0.
        let mut norm = f32x16::splat(simd, 0.0);
        for (i, active) in active.iter_mut().enumerate() {
            let lanes = &mut share[i * count + v].0;
            let log = f32x16::load_array_ref(simd, lanes) - best;
            if log.simd_gt(f32x16::splat(simd, NEGLIGIBLE)).any_true() {
                let density = exp2(simd, log);
                norm += density;
                density.store_slice(lanes);
                *active |= 1 << v;
            }
        }
        (f32x16::load_array_ref(simd, &vector.norm.0) / norm).store_slice(&mut vector.norm.0);
        if let Some(sum) = log_likelihood.as_deref_mut() {
            let (best, norm) = (<[f32; LANES]>::from(best), <[f32; LANES]>::from(norm));
            *sum += (0..vector.len).map(|i| f64::from(best[i]) + libm::log2(f64::from(norm[i]))).sum::<f64>();
        }
    }
}

/// A candidate's responsibilities and focused moments of the vectors that it gets anything of.
#[inline(always)]
fn moments<S: Simd>(
    simd: S,
    vectors: &[ParticleVector],
    c: &WhitenedGaussian,
    share: &[Lanes],
    active: u32,
) -> CandidateSums {
    if active == 0 {
        return [0.0; SUMS];
    }
    let mut total = [f32x16::splat(simd, 0.0); SUMS];
    for (v, (vector, share)) in vectors.iter().zip(share).enumerate() {
        if active >> v & 1 == 0 {
            continue;
        }
        let [x, y, z] = vector.position(simd);
        let r = f32x16::load_array_ref(simd, &share.0) * f32x16::load_array_ref(simd, &vector.norm.0);
        let focus_square = squared(&c.focus, [x - c.mean[0], y - c.mean[1], z - c.mean[2]]);
        let w = r * exp2(simd, -focus_square);
        let (wx, wy, wz) = (w * x, w * y, w * z);
        let mass = f32x16::load_array_ref(simd, &vector.mass.0);
        let add = [r, r * mass, w, wx, wy, wz, wx * x, wx * y, wx * z, wy * y, wy * z, wz * z];
        for q in 0..SUMS {
            total[q] += add[q];
        }
    }
    across(simd, &total)
}

/// |rows d|^2 with the lower triangle `rows`.
#[inline(always)]
fn squared<S: Simd>(rows: &[f32; 6], [dx, dy, dz]: [f32x16<S>; 3]) -> f32x16<S> {
    let u = dx * rows[0];
    let v = dx * rows[1] + dy * rows[2];
    let w = dx * rows[3] + dy * rows[4] + dz * rows[5];
    u * u + v * v + w * w
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::{Random, each_axis};

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
