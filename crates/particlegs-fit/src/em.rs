//! Truncated expectation-maximisation: each group of particles knows a few candidate Gaussians.
//!
//! The E step runs group by group (see `em_kernel`), the M step gathers each Gaussian's sums from
//! the groups that hold it as a candidate, always in the order of the groups.

use super::Moments;
use super::em_kernel::{self, CandidateSums, KernelScratch, ParticleGroup, SUMS, WhitenedGaussian};
use super::overlap_tree::{Ellipsoid, OverlapSearch, OverlapTree, SearchReach};
use super::prior::{Neighbourhood, Prior};
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::{Error, Result, parallel};
use std::ops::Range;

/// Gaussians under refinement, in the store's scaled coordinates.
#[derive(Clone, Debug, Default)]
pub(crate) struct RefinedGaussians {
    pub(crate) mean: Vec<[f64; 3]>,
    /// As measured, without the floor.
    pub(crate) cov: Vec<Sym3>,
    pub(crate) count: Vec<f64>,
    /// Sum of weights; zero where particles have none.
    pub(crate) mass: Vec<f64>,
}

impl RefinedGaussians {
    pub(crate) fn len(&self) -> usize {
        self.count.len()
    }

    pub(crate) fn push(&mut self, mean: [f64; 3], cov: Sym3, count: f64, mass: f64) {
        self.mean.push(mean);
        self.cov.push(cov);
        self.count.push(count);
        self.mass.push(mass);
    }

    /// Some of them as neighbours of one.
    pub(crate) fn neighbourhood(&self, of: impl Iterator<Item = usize>) -> Neighbourhood {
        Neighbourhood::of(of.map(|i| (self.cov[i], self.count[i])))
    }
}

/// Runs of particles that lie together.
#[derive(Clone, Debug, Default)]
pub(crate) struct ParticleGroups {
    pub(crate) range: Vec<Range<usize>>,
    /// Moments of their particles, f64; the means of empty groups mean nothing.
    pub(crate) mean: Vec<[f64; 3]>,
    pub(crate) cov: Vec<Sym3>,
}

/// Particles in the order of their groups.
#[derive(Clone, Copy)]
pub(crate) struct GroupedParticles<'a> {
    pub(crate) xyz: &'a [[f32; 3]],
    /// One a particle, where they have weights.
    pub(crate) weight: Option<&'a [f32]>,
    pub(crate) groups: &'a ParticleGroups,
}

/// Particles in the order of their groups, on their own.
#[derive(Default)]
pub(crate) struct GroupStore {
    pub(crate) xyz: Vec<[f32; 3]>,
    /// One a particle, where they have weights.
    pub(crate) weight: Option<Vec<f32>>,
    pub(crate) groups: ParticleGroups,
}

impl GroupStore {
    pub(crate) fn view(&self) -> GroupedParticles<'_> {
        GroupedParticles { xyz: &self.xyz, weight: self.weight.as_deref(), groups: &self.groups }
    }
}

/// Terms that regularise the E and the M step; lengths are store units, squared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Regularisation {
    /// Added to every variance.
    pub(crate) floor: f64,
    /// Strength with which moments are taken from a Gaussian's core: a particle counts by
    /// `exp(-focus/2 d^T (S + blur)^-1 d)`, and the covariance is put right for what that would do
    /// to a true Gaussian. 0 is plain maximum likelihood, which lets outskirts swell the cores
    /// that a picture shows.
    pub(crate) focus: f64,
    /// Variance below which details do not show: smaller Gaussians keep their plain moments.
    pub(crate) blur: f64,
    pub(crate) prior: Prior,
    /// Times as far as a step of EM that the M step goes (overrelaxed EM: Salakhutdinov and Roweis 2003).
    pub(crate) stride: f64,
}

impl ParticleGroups {
    pub(crate) fn new(range: Vec<Range<usize>>, xyz: &[[f32; 3]]) -> Self {
        let parts: Vec<Moments> =
            parallel::map_range(range.len(), |g| Moments::from_points(&xyz[range[g].clone()], None));
        let (mean, cov) = parts.into_iter().map(|m| (m.mean, m.cov)).unzip();
        ParticleGroups { range, mean, cov }
    }
}

/// The Gaussians that each group may belong to, and for each Gaussian the groups that hold it.
pub(crate) struct Candidates {
    /// Group g holds `index[start[g]..start[g + 1]]`.
    start: Vec<usize>,
    index: Vec<u32>,
    /// Gaussian j stands at the entries `entry[entry_start[j]..entry_start[j + 1]]`, ascending.
    entry_start: Vec<usize>,
    entry: Vec<u32>,
    /// The group of each entry of `index`.
    group: Vec<u32>,
}

/// One exchange: `freed` went into `kept` (itself where it was dead) and became a half of `split`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GaussianExchange {
    pub(crate) split: u32,
    pub(crate) kept: u32,
    pub(crate) freed: u32,
}

/// Neighbours whose shape is expected of a Gaussian, itself among them: 8 or 24 make no difference.
const NEIGHBOURS: usize = 8;
/// Groups of one piece of parallel work.
const TASK: usize = 64;

impl Candidates {
    /// Finds each group's candidates among Gaussians with a count above zero. `floor` is added to every
    /// variance, scaled units squared.
    pub(crate) fn find(
        groups: &ParticleGroups,
        gaussians: &RefinedGaussians,
        reach: SearchReach,
        floor: f64,
        context: &Context<'_>,
    ) -> Result<Self> {
        let floor = Sym3::scaled_identity(floor);
        let items = parallel::map_range(gaussians.len(), |j| {
            Ellipsoid::new(gaussians.mean[j], gaussians.cov[j].add(&floor), gaussians.count[j])
        });
        let tree = OverlapTree::new(&items, context.simd());
        let scratch = parallel::Scratch::<OverlapSearch>::default();
        let lists = parallel::try_map_range(groups.range.len(), |g| {
            if groups.range[g].is_empty() {
                return Ok(Vec::new());
            }
            context.check()?;
            let group = Ellipsoid::new(groups.mean[g], groups.cov[g].add(&floor), 1.0);
            Ok::<_, Error>(scratch.with(|search| {
                tree.nearest(&group, reach, search);
                search.neighbours.iter().map(|f| f.1).collect()
            }))
        })?;
        Ok(Self::from_lists(&lists, gaussians.len()))
    }

    fn from_lists(lists: &[Vec<u32>], gaussians: usize) -> Self {
        let mut start = Vec::with_capacity(lists.len() + 1);
        start.push(0);
        let (mut index, mut group) = (Vec::new(), Vec::new());
        for (g, list) in lists.iter().enumerate() {
            index.extend_from_slice(list);
            group.resize(index.len(), g as u32);
            start.push(index.len());
        }
        // The same lists by Gaussian: the M step gathers in the order of the groups, whatever the threads.
        let CountingSort { start: entry_start, order: entry } = CountingSort::new(&index, gaussians);
        Candidates { start, index, entry_start, entry, group }
    }

    /// The same lists after an exchange: a group that held a Gaussian that was merged away holds the one it
    /// went into, a group that held one that was split holds both halves.
    pub(crate) fn after(&self, moves: &[GaussianExchange], gaussians: usize) -> Self {
        let (mut into, mut half): (Vec<Option<u32>>, Vec<Option<u32>>) = (vec![None; gaussians], vec![None; gaussians]);
        for m in moves {
            into[m.freed as usize] = Some(m.kept);
            half[m.split as usize] = Some(m.freed);
        }
        let lists: Vec<Vec<u32>> = parallel::map_range(self.start.len() - 1, |g| {
            let mut list = Vec::with_capacity(self.of(g).len() + 4);
            let mut add = |j: u32| {
                if !list.contains(&j) {
                    list.push(j);
                }
            };
            for &j in self.of(g) {
                add(into[j as usize].unwrap_or(j));
                if let Some(h) = half[j as usize] {
                    add(h);
                }
            }
            list
        });
        Self::from_lists(&lists, gaussians)
    }

    /// The same lists where group j is Gaussian j's, once the particles are grouped anew: a half that was made has those
    /// of the whole.
    pub(crate) fn regrouped(&self, exchanges: &[GaussianExchange], gaussians: usize) -> Self {
        let mut source: Vec<u32> = (0..gaussians as u32).collect();
        exchanges.iter().for_each(|m| source[m.freed as usize] = m.split);
        let lists: Vec<Vec<u32>> = source.iter().map(|&g| self.of(g as usize).to_vec()).collect();
        Self::from_lists(&lists, gaussians)
    }

    /// Whether every group of particles has candidates.
    pub(crate) fn cover(&self, groups: &ParticleGroups) -> bool {
        groups.range.iter().enumerate().all(|(g, range)| range.is_empty() || !self.of(g).is_empty())
    }

    /// The candidates of each group, where group j is Gaussian j's.
    pub(crate) fn neighbourhoods(&self, gaussians: &RefinedGaussians) -> Vec<Neighbourhood> {
        parallel::map_range(gaussians.len(), |j| {
            gaussians.neighbourhood(self.of(j).iter().take(NEIGHBOURS).map(|&i| i as usize))
        })
    }

    /// The candidates of a group, best first.
    pub(crate) fn of(&self, group: usize) -> &[u32] {
        &self.index[self.start[group]..self.start[group + 1]]
    }
}

/// Result of an E step.
#[derive(Default)]
pub(crate) struct Expectation {
    /// What it is to give.
    pub(crate) options: ExpectationOptions,
    sums: Vec<CandidateSums>,
    /// The likeliest Gaussian of each particle, where asked for.
    pub(crate) owner: Vec<u32>,
    /// Sum of natural log likelihoods (up to a constant), where asked for.
    pub(crate) likelihood: f64,
}

/// Results of an E step besides the sums of the M step.
#[derive(Clone, Copy, Default)]
pub(crate) struct ExpectationOptions {
    pub(crate) owner: bool,
    pub(crate) likelihood: bool,
}

/// The E step, in the memory of an earlier one.
pub(crate) fn expect(
    particles: GroupedParticles<'_>,
    candidates: &Candidates,
    gaussians: &RefinedGaussians,
    shape: Regularisation,
    expectation: &mut Expectation,
    context: &Context<'_>,
) -> Result<()> {
    let groups = particles.groups;
    // Each Gaussian is whitened once, in f64; groups only move it to their centre, where f32 has digits left.
    let whitened: Vec<_> = parallel::map_range(gaussians.len(), |j| Whitening::new(gaussians, j, shape));
    let Expectation { options, sums, owner, .. } = expectation;
    let options = *options;
    sums.resize(candidates.index.len(), [0.0; SUMS]);
    owner.resize(if options.owner { particles.xyz.len() } else { 0 }, 0);
    let work = split_by_groups(sums, owner, groups, candidates);
    let simd = context.simd();
    let scratch_pool = parallel::Scratch::<(KernelScratch, Vec<_>)>::default();
    let parts = parallel::try_map(work, |task| {
        context.check()?;
        let mut total = 0.0;
        scratch_pool.with(|(scratch, local_candidates)| {
            let (mut sums, mut owner) = (task.sums, task.owner);
            for g in task.groups {
                let range = groups.range[g].clone();
                let list = candidates.of(g);
                // A task's sums lie in the order of its groups' lists: those of this group are the next.
                let (group_sums, rest) = sums.split_at_mut(list.len());
                sums = rest;
                let (group_owners, rest) = owner.split_at_mut(if options.owner { range.len() } else { 0 });
                owner = rest;
                // `gather` moves the sums back by this same rounded centre.
                let centre = groups.mean[g].map(|v| v as f32);
                local_candidates.clear();
                local_candidates.extend(list.iter().map(|&j| whitened[j as usize].about(centre)));
                let weight = particles.weight.map(|w| &w[range.clone()]);
                let group =
                    ParticleGroup { points: &particles.xyz[range], weight, centre, candidates: local_candidates };
                let owner_buffer = options.owner.then_some(&mut group_owners[..]);
                total += em_kernel::expect(simd, &group, scratch, group_sums, owner_buffer, options.likelihood);
                // The kernel names a candidate by its place in the list.
                group_owners.iter_mut().for_each(|n| *n = list[*n as usize]);
            }
        });
        Ok(total)
    })?;
    // Summed in the order of the tasks, whatever the threads; the kernel's logarithms are to base 2.
    expectation.likelihood = parts.iter().sum::<f64>() * std::f64::consts::LN_2;
    Ok(())
}

struct GroupTask<'a> {
    groups: Range<usize>,
    sums: &'a mut [CandidateSums],
    owner: &'a mut [u32],
}

/// Cuts the outputs at fixed runs of groups.
fn split_by_groups<'a>(
    mut sums: &'a mut [CandidateSums],
    mut owner: &'a mut [u32],
    groups: &ParticleGroups,
    candidates: &Candidates,
) -> Vec<GroupTask<'a>> {
    let n = groups.range.len();
    let mut tasks = Vec::with_capacity(n.div_ceil(TASK));
    for first in (0..n).step_by(TASK) {
        let end = n.min(first + TASK);
        let (task_sums, rest) = sums.split_at_mut(candidates.start[end] - candidates.start[first]);
        sums = rest;
        let particles = if owner.is_empty() { 0 } else { groups.range[end - 1].end - groups.range[first].start };
        let (task_owners, rest) = owner.split_at_mut(particles);
        owner = rest;
        tasks.push(GroupTask { groups: first..end, sums: task_sums, owner: task_owners });
    }
    tasks
}

/// A Gaussian's whitening transforms in f64, to be placed relative to a group.
pub(crate) struct Whitening {
    mean: [f64; 3],
    rows: [f32; 6],
    focus: [f32; 6],
    level: f32,
}

impl Whitening {
    pub(crate) fn new(g: &RefinedGaussians, j: usize, shape: Regularisation) -> Self {
        let (rows, det) = whiten(&g.cov[j], shape.floor, 1.0);
        let (focus, _) = whiten(&g.cov[j], shape.floor + shape.blur, shape.focus);
        let level = libm::log2(g.count[j].max(1e-30)) - libm::log2(det);
        Whitening { mean: g.mean[j], rows, focus, level: level as f32 }
    }

    pub(crate) fn about(&self, centre: [f32; 3]) -> WhitenedGaussian {
        let mean = each_axis(|k| (self.mean[k] - f64::from(centre[k])) as f32);
        WhitenedGaussian { mean, rows: self.rows, focus: self.focus, level: self.level }
    }
}

/// Rows of L^-1 with `cov + floor = L L^T`, times sqrt(`share` log2(e) / 2), so that their squares
/// are logarithms to base 2; and the determinant of L.
fn whiten(cov: &Sym3, floor: f64, share: f64) -> ([f32; 6], f64) {
    let [a, b, c, d, e, f] = cov.add(&Sym3::scaled_identity(floor)).0;
    let positive = |v: f64| v.max(0.25 * floor).sqrt();
    let l00 = positive(a);
    let (l10, l20) = (b / l00, c / l00);
    let l11 = positive(d - l10 * l10);
    let l21 = (e - l20 * l10) / l11;
    let l22 = positive(f - l20 * l20 - l21 * l21);
    let s = (0.5 * std::f64::consts::LOG2_E * share).sqrt();
    let (i00, i11, i22) = (s / l00, s / l11, s / l22);
    let i10 = -l10 * i00 / l11;
    let i21 = -l21 * i11 / l22;
    let i20 = (-l20 * i00 - l21 * i10) / l22;
    ([i00, i10, i11, i20, i21, i22].map(|v| v as f32), l00 * l11 * l22)
}

/// The M step: each Gaussian becomes the moments of the responsibilities it got, its shape as far as they support
/// it against that of its neighbours, or goes further than that. One that got (nearly) nothing keeps its shape with a count of
/// zero.
pub(crate) fn maximise(
    expectation: &Expectation,
    groups: &ParticleGroups,
    candidates: &Candidates,
    gaussians: &mut RefinedGaussians,
    shape: Regularisation,
    neighbourhoods: &[Neighbourhood],
) {
    let updates = parallel::map_range(gaussians.len(), |j| {
        let total = gather(expectation, groups, candidates, j, gaussians.mean[j]);
        let (count, focused) = (total[0], total[2]);
        // Moments are divided by the focused sum, which may vanish where the count does not.
        if count < LEAST || focused < LEAST * LEAST {
            return (gaussians.mean[j], gaussians.cov[j], 0.0, 0.0);
        }
        let d: [f64; 3] = each_axis(|k| total[3 + k] / focused);
        let cov = Sym3(std::array::from_fn(|k| total[6 + k] / focused)).add(&Sym3::outer(d).scale(-1.0));
        let mean = each_axis(|k| gaussians.mean[j][k] + d[k]);
        // What the focus took off is put back before the prior, which is of whole Gaussians.
        let sample_cov = nonnegative(unfocus(cov, &gaussians.cov[j], shape));
        let cov = shape.prior.most_probable(&sample_cov, count, &neighbourhoods[j]);
        let step = GaussianStep { mean, cov, count };
        let old = GaussianStep { mean: gaussians.mean[j], cov: gaussians.cov[j], count: gaussians.count[j] };
        let GaussianStep { mean, cov, count: reached } = old.beyond(step, shape.stride).unwrap_or(step);
        (mean, cov, reached, total[1] * reached / count)
    });
    for (j, (mean, cov, count, mass)) in updates.into_iter().enumerate() {
        gaussians.mean[j] = mean;
        gaussians.cov[j] = cov;
        gaussians.count[j] = count;
        gaussians.mass[j] = mass;
    }
}

/// A Gaussian before or after a step of EM.
#[derive(Clone, Copy)]
struct GaussianStep {
    mean: [f64; 3],
    cov: Sym3,
    count: f64,
}

impl GaussianStep {
    /// `stride` times as far as from here to `next`; `None` for a stride of 1, and where that would leave no sound
    /// Gaussian, or one much smaller than the next.
    fn beyond(&self, next: GaussianStep, stride: f64) -> Option<GaussianStep> {
        const LEAST_SHARE: f64 = 0.4;
        let further = |old: f64, new: f64| old + stride * (new - old);
        let cov = Sym3(std::array::from_fn(|k| further(self.cov.0[k], next.cov.0[k])));
        let count = further(self.count, next.count);
        // The leading minors: all are positive where the covariance is.
        let minors = |c: &Sym3| [c.0[0], c.0[0] * c.0[3] - c.0[1] * c.0[1], c.det()];
        let is_sound = minors(&cov).iter().zip(minors(&next.cov)).all(|(m, next)| *m > LEAST_SHARE * next);
        let is_alive = self.count > LEAST && count > LEAST_SHARE * next.count;
        let mean = each_axis(|k| further(self.mean[k], next.mean[k]));
        (stride != 1.0 && is_sound && is_alive).then_some(GaussianStep { mean, cov, count })
    }
}

/// A Gaussian of fewer particles is dead.
const LEAST: f64 = 1e-6;

/// Gaussian j's sums over all groups, about its old mean.
fn gather(e: &Expectation, groups: &ParticleGroups, candidates: &Candidates, j: usize, about: [f64; 3]) -> [f64; SUMS] {
    let mut total = [0f64; SUMS];
    for &entry in &candidates.entry[candidates.entry_start[j]..candidates.entry_start[j + 1]] {
        let part = e.sums[entry as usize].map(f64::from);
        // The kernel's centre: the group's mean rounded to f32.
        let centre = groups.mean[candidates.group[entry as usize] as usize].map(|v| f64::from(v as f32));
        let g: [f64; 3] = each_axis(|k| centre[k] - about[k]);
        for k in 0..3 {
            total[k] += part[k];
            total[3 + k] += part[3 + k] + part[2] * g[k];
        }
        for (k, (a, b)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
            total[6 + k] += part[6 + k] + g[a] * part[3 + b] + g[b] * part[3 + a] + part[2] * g[a] * g[b];
        }
    }
    total
}

/// Puts right what the focus does to a covariance: with T = 1 + focus S (S + blur)^-1 a true
/// Gaussian's focused covariance is S T^-1, so T^1/2 C T^1/2 is its own. S is the old covariance.
fn unfocus(cov: Sym3, old: &Sym3, shape: Regularisation) -> Sym3 {
    if shape.focus == 0.0 {
        return cov;
    }
    // T is 1 + focus - focus blur (S + blur)^-1.
    let (blur, most) = (shape.floor + shape.blur, 1.0 + shape.focus);
    let identity = Sym3::scaled_identity;
    let Some(precision) = old.add(&identity(blur)).inverse() else { return cov };
    // Over the root of the largest that they can be, its eigenvalues lie about 1: two of Newton's steps from the mean
    // with 1 give the root to nine digits.
    let size = most.sqrt();
    let t = identity(most).add(&precision.scale(-shape.focus * blur)).scale(1.0 / size);
    let mut root = t.add(&identity(1.0)).scale(0.5);
    for _ in 0..2 {
        let Some(inverse) = root.inverse() else { return cov };
        root = root.add(&symmetric(product(inverse.rows(), &t))).scale(0.5);
    }
    symmetric(product(product(root.rows(), &cov), &root)).scale(size)
}

/// The rows of `a` times a symmetric matrix.
fn product(a: [[f64; 3]; 3], b: &Sym3) -> [[f64; 3]; 3] {
    a.map(|row| b.apply(row))
}

/// A matrix that is symmetric but for rounding.
fn symmetric(r: [[f64; 3]; 3]) -> Sym3 {
    let half = |i: usize, k: usize| 0.5 * (r[i][k] + r[k][i]);
    Sym3([r[0][0], half(0, 1), half(0, 2), r[1][1], half(1, 2), r[2][2]])
}

/// Rounding may leave a flat cluster's variance a little below zero.
fn nonnegative(mut cov: Sym3) -> Sym3 {
    for k in [0, 3, 5] {
        cov.0[k] = cov.0[k].max(0.0);
    }
    cov
}

/// Places sorted by a key below a number; those of one key keep their order, so that sums over them do.
pub(crate) struct CountingSort {
    /// The beginning of each key's places; one more at the end.
    pub(crate) start: Vec<usize>,
    pub(crate) order: Vec<u32>,
}

impl CountingSort {
    pub(crate) fn new(keys: &[u32], below: usize) -> Self {
        let mut start = vec![0usize; below + 1];
        keys.iter().for_each(|&key| start[key as usize + 1] += 1);
        (0..below).for_each(|key| start[key + 1] += start[key]);
        let (mut next, mut order) = (start.clone(), vec![0u32; keys.len()]);
        for (place, &key) in keys.iter().enumerate() {
            order[next[key as usize]] = place as u32;
            next[key as usize] += 1;
        }
        CountingSort { start, order }
    }
}

/// Reorders particles so that each Gaussian's own lie together: group j of `store` is Gaussian j's.
pub(crate) fn regroup(particles: GroupedParticles<'_>, owner: &[u32], gaussians: usize, store: &mut GroupStore) {
    let CountingSort { start, order } = CountingSort::new(owner, gaussians);
    reorder(particles.xyz, &order, &mut store.xyz);
    match particles.weight {
        Some(weight) => reorder(weight, &order, store.weight.get_or_insert_default()),
        None => store.weight = None,
    }
    store.groups = ParticleGroups::new((0..gaussians).map(|j| start[j]..start[j + 1]).collect(), &store.xyz);
}

fn reorder<T: Copy + Default + Send + Sync>(values: &[T], order: &[u32], reordered: &mut Vec<T>) {
    const STEP: usize = 1 << 16;
    reordered.resize(order.len(), T::default());
    parallel::for_each_chunk(reordered, STEP, |c, part| {
        part.iter_mut().zip(&order[c * STEP..]).for_each(|(value, &i)| *value = values[i as usize]);
    });
}

#[cfg(test)]
mod tests {
    use super::super::prior::Neighbourhood;
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::Random;
    use proptest::prelude::*;

    const PLAIN: Regularisation =
        Regularisation { floor: 1e-4, focus: 0.0, blur: 0.0, prior: Prior::NONE, stride: 1.0 };

    /// Four clumps cut into eight cells along x.
    fn problem(seed: u64) -> (GroupStore, RefinedGaussians) {
        let mut random = Random::new(seed, 5, 0);
        let mut xyz: Vec<[f32; 3]> =
            (0..400).map(|i| each_axis(|k| ((i % 4 * (k + 1)) as f64 * 0.2 + 0.1 * random.normal()) as f32)).collect();
        xyz.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let groups = ParticleGroups::new((0..8).map(|g| 50 * g..50 * g + 50).collect(), &xyz);
        let mut gaussians = RefinedGaussians::default();
        for g in 0..8 {
            gaussians.push(groups.mean[g], groups.cov[g], 50.0, 0.0);
        }
        (GroupStore { xyz, weight: None, groups }, gaussians)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn an_iteration_never_lowers_the_likelihood(seed in 0u64..1000) {
            let (store, mut gaussians) = problem(seed);
            let (particles, groups) = (store.view(), &store.groups);
            let options = ExpectationOptions { likelihood: true, ..ExpectationOptions::default() };
            let reach = SearchReach { most: 8, beyond: 1e9 };
            let candidates = Candidates::find(groups, &gaussians, reach, PLAIN.floor, &Context::SILENT).unwrap();
            let mut last = f64::NEG_INFINITY;
            for _ in 0..12 {
                let mut e = Expectation { options, ..Expectation::default() };
                expect(particles, &candidates, &gaussians, PLAIN, &mut e, &Context::SILENT).unwrap();
                // The floor is added, not fitted: it may cost a little.
                let least = last - 0.02 * particles.xyz.len() as f64 * PLAIN.floor / 0.01;
                prop_assert!(e.likelihood >= least, "{} {last}", e.likelihood);
                last = e.likelihood;
                maximise(&e, groups, &candidates, &mut gaussians, PLAIN, &[Neighbourhood::UNKNOWN; 8]);
                prop_assert!((gaussians.count.iter().sum::<f64>() - 400.0).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn longer_steps_gain_likelihood_sooner() {
        let gain = |seed, stride| {
            let (store, mut gaussians) = problem(seed);
            let options = ExpectationOptions { likelihood: true, ..ExpectationOptions::default() };
            let reach = SearchReach { most: 8, beyond: 1e9 };
            let candidates = Candidates::find(&store.groups, &gaussians, reach, PLAIN.floor, &Context::SILENT).unwrap();
            let mut e = Expectation { options, ..Expectation::default() };
            let shape = Regularisation { stride, ..PLAIN };
            for _ in 0..5 {
                expect(store.view(), &candidates, &gaussians, shape, &mut e, &Context::SILENT).unwrap();
                maximise(&e, &store.groups, &candidates, &mut gaussians, shape, &[Neighbourhood::UNKNOWN; 8]);
            }
            e.likelihood
        };
        let sooner = (0..20).filter(|&seed| gain(seed, 1.6) > gain(seed, 1.0)).count();
        assert!(sooner >= 18, "{sooner} of 20");
    }

    #[test]
    fn a_longer_step_leaves_a_sound_gaussian_or_is_not_made() {
        let mut random = Random::new(3, 7, 0);
        let mut step = || {
            let mut vector = || each_axis(|_| random.normal());
            let cov = Sym3::outer(vector()).add(&Sym3::outer(vector())).add(&Sym3::scaled_identity(0.01));
            GaussianStep { mean: vector(), cov, count: 1.0 + 50.0 * vector()[0].abs() }
        };
        let mut steps = 0;
        for _ in 0..500 {
            let (old, other) = (step(), step());
            let next = GaussianStep { cov: old.cov.scale(0.7).add(&other.cov.scale(0.3)), ..other };
            assert!(old.beyond(next, 1.0).is_none());
            let Some(further) = old.beyond(next, 1.6) else { continue };
            steps += 1;
            assert!(further.cov.eigen().values[2] > 0.0 && further.count > 0.0);
            (0..3).for_each(|k| {
                assert!((further.mean[k] - next.mean[k] - 0.6 * (next.mean[k] - old.mean[k])).abs() < 1e-12);
            });
        }
        assert!((10..490).contains(&steps), "{steps}");
    }

    #[test]
    fn a_true_gaussian_keeps_its_shape_under_focus() {
        let mut random = Random::new(1, 6, 0);
        let spread = [0.3, 0.1, 0.02];
        let xyz: Vec<[f32; 3]> = (0..40_000).map(|_| spread.map(|s: f64| (s * random.normal()) as f32)).collect();
        let groups = ParticleGroups::new(std::iter::once(0..xyz.len()).collect(), &xyz);
        let mut gaussians = RefinedGaussians::default();
        gaussians.push(groups.mean[0], groups.cov[0], 40_000.0, 0.0);
        let shape = Regularisation { floor: 1e-8, focus: 0.8, blur: 0.04 * 0.04, ..PLAIN };
        let candidates =
            Candidates::find(&groups, &gaussians, SearchReach { most: 4, beyond: 9.0 }, shape.floor, &Context::SILENT)
                .unwrap();
        for _ in 0..10 {
            let particles = GroupedParticles { xyz: &xyz, weight: None, groups: &groups };
            let mut e = Expectation::default();
            expect(particles, &candidates, &gaussians, shape, &mut e, &Context::SILENT).unwrap();
            maximise(&e, &groups, &candidates, &mut gaussians, shape, &[Neighbourhood::UNKNOWN]);
        }
        for (k, s) in [(0, 0.3), (3, 0.1), (5, 0.02)] {
            let sigma = gaussians.cov[0].0[k].sqrt();
            assert!((sigma / s - 1.0).abs() < 0.02, "{sigma} for {s}");
        }
    }
}
