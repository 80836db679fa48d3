//! Truncated expectation-maximisation: each group of particles knows a few candidate Gaussians.
//!
//! The E step runs group by group (see `em_kernel`), the M step gathers each Gaussian's sums from
//! the groups that hold it as a candidate, always in the order of the groups.

use super::candidates::{Ellipsoid, OverlapTree};
use super::em_kernel::{self, SUMS, Scratch, Sums, Whitened};
use crate::math::Sym3;
use crate::{Result, progress::Progress};
use rayon::prelude::*;
use std::ops::Range;

/// Gaussians under refinement, in the store's scaled coordinates.
#[derive(Clone, Debug, Default)]
pub struct Gaussians {
    pub mean: Vec<[f64; 3]>,
    /// As measured, without the floor.
    pub cov: Vec<Sym3>,
    pub count: Vec<f64>,
    /// Sum of weights; zero where particles have none.
    pub mass: Vec<f64>,
}

impl Gaussians {
    pub fn len(&self) -> usize {
        self.count.len()
    }

    pub fn push(&mut self, mean: [f64; 3], cov: Sym3, count: f64, mass: f64) {
        self.mean.push(mean);
        self.cov.push(cov);
        self.count.push(count);
        self.mass.push(mass);
    }
}

/// Runs of particles that lie together.
#[derive(Clone, Debug, Default)]
pub struct Groups {
    pub range: Vec<Range<usize>>,
    /// Moments of their particles, f64; the means of empty groups mean nothing.
    pub mean: Vec<[f64; 3]>,
    pub cov: Vec<Sym3>,
}

/// Particles in the order of their groups.
pub struct Cloud {
    pub xyz: Vec<[f32; 3]>,
    pub weight: Option<Vec<f32>>,
}

/// Mean and covariance of points, in f64 about their first.
pub fn moments(points: &[[f32; 3]]) -> ([f64; 3], Sym3) {
    let Some(&first) = points.first() else { return ([0.0; 3], Sym3::default()) };
    let origin = first.map(f64::from);
    let (mut s, mut q) = ([0f64; 3], [0f64; 6]);
    for p in points {
        let d: [f64; 3] = std::array::from_fn(|k| f64::from(p[k]) - origin[k]);
        for k in 0..3 {
            s[k] += d[k];
        }
        for (k, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
            q[k] += d[i] * d[j];
        }
    }
    let n = points.len() as f64;
    let d = s.map(|v| v / n);
    let cov = Sym3(q.map(|v| v / n)).add(&Sym3::outer(d).scale(-1.0));
    (std::array::from_fn(|k| origin[k] + d[k]), cov)
}

impl Groups {
    pub fn new(range: Vec<Range<usize>>, xyz: &[[f32; 3]]) -> Self {
        let parts: Vec<_> = range.par_iter().map(|r| moments(&xyz[r.clone()])).collect();
        let (mean, cov) = parts.into_iter().unzip();
        Groups { range, mean, cov }
    }
}

/// Which Gaussians each group may belong to, and for each Gaussian the groups that hold it.
pub struct Candidates {
    /// Group g holds `index[start[g]..start[g + 1]]`.
    start: Vec<usize>,
    index: Vec<u32>,
    /// Gaussian j stands at the entries `entry[entry_start[j]..entry_start[j + 1]]`, ascending.
    entry_start: Vec<usize>,
    entry: Vec<u32>,
    /// The group of each entry.
    group: Vec<u32>,
}

/// How candidates are chosen.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    /// At most so many a group.
    pub most: usize,
    /// Largest difference of separations from the best (2 ln of the ratio of overlaps).
    pub reach: f64,
    /// Added to every variance, scaled units squared.
    pub floor: f64,
}

/// Work items of one rayon task.
const TASK: usize = 64;

impl Candidates {
    /// Finds each group's candidates among Gaussians with a count above zero.
    pub fn find(groups: &Groups, gaussians: &Gaussians, reach: Reach) -> Self {
        let floor = Sym3::scaled_identity(reach.floor);
        let items: Vec<Ellipsoid> = (0..gaussians.len())
            .into_par_iter()
            .map(|j| Ellipsoid::new(gaussians.mean[j], gaussians.cov[j].add(&floor), gaussians.count[j]))
            .collect();
        let tree = OverlapTree::new(&items);
        let lists: Vec<Vec<u32>> = (0..groups.range.len())
            .into_par_iter()
            .with_min_len(TASK)
            .map_init(Vec::new, |found, g| {
                if groups.range[g].is_empty() {
                    return Vec::new();
                }
                let group = Ellipsoid::new(groups.mean[g], groups.cov[g].add(&floor), 1.0);
                tree.nearest(&group, reach.most, reach.reach, found);
                found.iter().map(|f| f.1).collect()
            })
            .collect();
        Self::from_lists(&lists, gaussians.len())
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
        let mut entry_start = vec![0usize; gaussians + 1];
        for &j in &index {
            entry_start[j as usize + 1] += 1;
        }
        for j in 0..gaussians {
            entry_start[j + 1] += entry_start[j];
        }
        let mut next = entry_start.clone();
        let mut entry = vec![0u32; index.len()];
        for (e, &j) in index.iter().enumerate() {
            entry[next[j as usize]] = e as u32;
            next[j as usize] += 1;
        }
        Candidates { start, index, entry_start, entry, group }
    }

    /// The candidates of a group, best first.
    pub fn of(&self, group: usize) -> &[u32] {
        &self.index[self.start[group]..self.start[group + 1]]
    }

    /// Mean number of candidates a group.
    pub fn mean_count(&self) -> f64 {
        self.index.len() as f64 / (self.start.len() - 1).max(1) as f64
    }
}

/// What one E step found.
pub struct Expectation {
    sums: Vec<Sums>,
    /// The likeliest Gaussian of each particle, where asked for.
    pub owner: Vec<u32>,
    /// Sum of natural log likelihoods (up to a constant), where asked for.
    pub likelihood: f64,
}

/// One E step over all groups.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn expect(
    cloud: &Cloud,
    groups: &Groups,
    candidates: &Candidates,
    gaussians: &Gaussians,
    floor: f64,
    owners: bool,
    likelihood: bool,
    progress: &dyn Progress,
) -> Result<Expectation> {
    let whitened: Vec<_> = (0..gaussians.len()).into_par_iter().map(|j| Whitening::new(gaussians, j, floor)).collect();
    let mut sums = vec![[0f32; SUMS]; candidates.index.len()];
    let mut owner = vec![0u32; if owners { cloud.xyz.len() } else { 0 }];
    let work = split_by_groups(&mut sums, &mut owner, groups, candidates);
    let parts: Result<Vec<f64>> = work
        .into_par_iter()
        .map_init(
            || (Scratch::default(), Vec::new()),
            |(scratch, local), task| {
                progress.check()?;
                let mut total = 0.0;
                let (mut sums, mut owner) = (task.sums, task.owner);
                for g in task.groups {
                    let range = groups.range[g].clone();
                    let list = candidates.of(g);
                    let (mine, rest) = sums.split_at_mut(list.len());
                    sums = rest;
                    let (named, rest) = owner.split_at_mut(if owners { range.len() } else { 0 });
                    owner = rest;
                    let centre = groups.mean[g].map(|v| v as f32);
                    local.clear();
                    local.extend(list.iter().map(|&j| whitened[j as usize].about(centre)));
                    let weight = cloud.weight.as_ref().map(|w| &w[range.clone()]);
                    let asked = owners.then_some(&mut named[..]);
                    total +=
                        em_kernel::expect(&cloud.xyz[range], weight, centre, local, scratch, mine, asked, likelihood);
                    named.iter_mut().for_each(|n| *n = list[*n as usize]);
                }
                Ok(total)
            },
        )
        .collect();
    let likelihood = parts?.iter().sum::<f64>() * std::f64::consts::LN_2;
    Ok(Expectation { sums, owner, likelihood })
}

struct Task<'a> {
    groups: Range<usize>,
    sums: &'a mut [Sums],
    owner: &'a mut [u32],
}

/// Cuts the outputs at fixed runs of groups.
fn split_by_groups<'a>(
    mut sums: &'a mut [Sums],
    mut owner: &'a mut [u32],
    groups: &Groups,
    candidates: &Candidates,
) -> Vec<Task<'a>> {
    let n = groups.range.len();
    let mut tasks = Vec::with_capacity(n.div_ceil(TASK));
    for first in (0..n).step_by(TASK) {
        let end = n.min(first + TASK);
        let (mine, rest) = sums.split_at_mut(candidates.start[end] - candidates.start[first]);
        sums = rest;
        let particles = if owner.is_empty() { 0 } else { groups.range[end - 1].end - groups.range[first].start };
        let (named, rest) = owner.split_at_mut(particles);
        owner = rest;
        tasks.push(Task { groups: first..end, sums: mine, owner: named });
    }
    tasks
}

/// A Gaussian's whitening transform in f64, to be placed relative to a group.
struct Whitening {
    mean: [f64; 3],
    rows: [f32; 6],
    level: f32,
}

impl Whitening {
    /// Rows of L^-1 with S + floor = L L^T, times sqrt(log2(e) / 2), so that logarithms are to base 2.
    fn new(g: &Gaussians, j: usize, floor: f64) -> Self {
        let [a, b, c, d, e, f] = g.cov[j].add(&Sym3::scaled_identity(floor)).0;
        let positive = |v: f64| v.max(0.25 * floor).sqrt();
        let l00 = positive(a);
        let (l10, l20) = (b / l00, c / l00);
        let l11 = positive(d - l10 * l10);
        let l21 = (e - l20 * l10) / l11;
        let l22 = positive(f - l20 * l20 - l21 * l21);
        let s = (0.5 * std::f64::consts::LOG2_E).sqrt();
        let (i00, i11, i22) = (s / l00, s / l11, s / l22);
        let i10 = -l10 * i00 / l11;
        let i21 = -l21 * i11 / l22;
        let i20 = (-l20 * i00 - l21 * i10) / l22;
        let level = g.count[j].max(1e-30).log2() - (l00 * l11 * l22).log2();
        Whitening { mean: g.mean[j], rows: [i00, i10, i11, i20, i21, i22].map(|v| v as f32), level: level as f32 }
    }

    fn about(&self, centre: [f32; 3]) -> Whitened {
        let mean = std::array::from_fn(|k| (self.mean[k] - f64::from(centre[k])) as f32);
        Whitened { mean, rows: self.rows, level: self.level }
    }
}

/// The M step: each Gaussian becomes the moments of the responsibilities it got. One that got
/// (nearly) nothing keeps its shape with a count of zero.
pub fn maximise(
    expectation: &Expectation,
    groups: &Groups,
    candidates: &Candidates,
    gaussians: &mut Gaussians,
    weighted: bool,
) {
    let new: Vec<_> = (0..gaussians.len())
        .into_par_iter()
        .map(|j| {
            let entries = &candidates.entry[candidates.entry_start[j]..candidates.entry_start[j + 1]];
            let (mut n, mut mass, mut s, mut q) = (0f64, 0f64, [0f64; 3], [0f64; 6]);
            let about = gaussians.mean[j];
            for &e in entries {
                let e = e as usize;
                let part = expectation.sums[e].map(f64::from);
                let centre = groups.mean[candidates.group[e] as usize].map(|v| f64::from(v as f32));
                let g: [f64; 3] = std::array::from_fn(|k| centre[k] - about[k]);
                n += part[0];
                mass += part[10];
                for k in 0..3 {
                    s[k] += part[1 + k] + part[0] * g[k];
                }
                for (k, (a, b)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
                    q[k] += part[4 + k] + g[a] * part[1 + b] + g[b] * part[1 + a] + part[0] * g[a] * g[b];
                }
            }
            if n < 1e-6 {
                return (about, gaussians.cov[j], 0.0, 0.0);
            }
            let d = s.map(|v| v / n);
            let cov = Sym3(q.map(|v| v / n)).add(&Sym3::outer(d).scale(-1.0));
            let mean = std::array::from_fn(|k| about[k] + d[k]);
            (mean, nonnegative(cov), n, if weighted { mass } else { 0.0 })
        })
        .collect();
    for (j, (mean, cov, count, mass)) in new.into_iter().enumerate() {
        gaussians.mean[j] = mean;
        gaussians.cov[j] = cov;
        gaussians.count[j] = count;
        gaussians.mass[j] = mass;
    }
}

/// Rounding may leave a flat cluster's variance a little below zero.
fn nonnegative(mut cov: Sym3) -> Sym3 {
    for k in [0, 3, 5] {
        cov.0[k] = cov.0[k].max(0.0);
    }
    cov
}

/// Reorders the cloud so that each Gaussian's own particles lie together: group j is Gaussian j's.
pub fn regroup(cloud: &mut Cloud, owner: &[u32], gaussians: usize) -> Groups {
    let mut start = vec![0usize; gaussians + 1];
    for &o in owner {
        start[o as usize + 1] += 1;
    }
    for j in 0..gaussians {
        start[j + 1] += start[j];
    }
    let mut next = start.clone();
    let mut xyz = vec![[0f32; 3]; cloud.xyz.len()];
    let mut weight = cloud.weight.as_ref().map(|w| vec![0f32; w.len()]);
    for (i, &o) in owner.iter().enumerate() {
        let at = next[o as usize];
        next[o as usize] += 1;
        xyz[at] = cloud.xyz[i];
        if let (Some(new), Some(old)) = (&mut weight, &cloud.weight) {
            new[at] = old[i];
        }
    }
    cloud.xyz = xyz;
    cloud.weight = weight;
    let range = (0..gaussians).map(|j| start[j]..start[j + 1]).collect();
    Groups::new(range, &cloud.xyz)
}
