//! Shares of particles in the Gaussians: soft responsibilities of a mixture that is fixed. Particles are sorted by the
//! leaves of a tree of the means, and the fit's kernel takes a leaf at a time.

use super::em::{CountingSort, RefinedGaussians, Regularisation, Whitening};
use super::em_kernel::{self, GroupShare, KernelScratch, ParticleGroup};
use super::overlap_tree::{Ellipsoid, OverlapSearch, OverlapTree, SearchReach};
use super::prior::Prior;
use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use particlegs_core::math::{Sym3, each_axis, exp2};
use particlegs_core::model::Mixture;
use particlegs_core::parallel;
use std::ops::Range;

/// Gaussians in a leaf of the tree of means, and candidates that its particles have.
const LEAF: usize = 2;
const CANDIDATES: SearchReach = SearchReach { most: 24, beyond: 24.0 };
/// Standard deviations that Gaussians reach.
const REACH: f64 = 3.0;
/// Smaller shares are left out.
const LEAST_SHARE: f32 = 1.0 / 1024.0;
/// Added to all variances: this part of their sum, and this part of the square of the whole extent, so that none is 0.
const FLATTEST: f64 = 1e-12;
const FLOOR: f64 = 1e-18;
/// Responsibilities as they are.
const PLAIN: Regularisation = Regularisation { floor: 0.0, focus: 0.0, blur: 0.0, prior: Prior::REFINED, stride: 1.0 };

/// A tree of a mixture's means, whose leaves know which Gaussians their particles can belong to.
pub(crate) struct SoftAssignment {
    /// Inner nodes: axis, place of the cut, the nodes below and above it. A child from `LEAVES` on is a leaf.
    nodes: Vec<(u8, f64, [u32; 2])>,
    leaves: Vec<AssignmentLeaf>,
    root: u32,
    whitened: Vec<Whitening>,
    /// The tree and Gaussians have coordinates `(world - origin) * scale`.
    origin: [f64; 3],
    scale: f64,
    simd: Level,
}

const LEAVES: u32 = 1 << 31;

struct AssignmentLeaf {
    centre: [f32; 3],
    candidates: Vec<u32>,
}

/// Shares of particles, Gaussian by Gaussian.
pub(crate) struct PlaceShares {
    /// The particles in an order in which neighbours stand together.
    pub(crate) order: Vec<u32>,
    /// Where the shares of each Gaussian begin; one more at the end.
    start: Vec<usize>,
    /// Place of each share's particle in the order.
    pub(crate) particle: Vec<u32>,
    /// The shares of a particle sum to 1.
    pub(crate) share: Vec<f32>,
}

impl PlaceShares {
    /// The shares of a Gaussian.
    pub(crate) fn of(&self, gaussian: usize) -> Range<usize> {
        self.start[gaussian]..self.start[gaussian + 1]
    }

    /// The number of a share's particle.
    pub(crate) fn particle(&self, share: usize) -> usize {
        self.order[self.particle[share] as usize] as usize
    }

    /// The shares times how likely something else is in each Gaussian, given by its logarithm (NaN counts for nothing),
    /// scaled to a sum of 1 for each particle.
    pub(crate) fn weighed(&self, logs: &[f64], simd: Level) -> Vec<f32> {
        let entries = || self.particle.iter().map(|p| *p as usize);
        // Relative to a particle's largest: what is far from all Gaussians would have densities of 0.
        let mut largest = vec![f64::NEG_INFINITY; self.order.len()];
        entries().zip(logs).for_each(|(p, log)| largest[p] = largest[p].max(*log));
        let mut weighed: Vec<f32> =
            entries().zip(logs).map(|(p, log)| ((log - largest[p]) * std::f64::consts::LOG2_E) as f32).collect();
        dispatch!(simd, simd => exponentials(simd, &mut weighed));
        let mut sum = vec![0.0f32; self.order.len()];
        for (((p, weighed), share), log) in entries().zip(&mut weighed).zip(&self.share).zip(logs) {
            *weighed = if *log > f64::NEG_INFINITY { *weighed * share } else { 0.0 };
            sum[p] += *weighed;
        }
        entries().zip(&mut weighed).filter(|(_, w)| **w > 0.0).for_each(|(p, w)| *w /= sum[p]);
        weighed
    }
}

/// Powers of two of numbers.
#[inline(always)]
fn exponentials<S: Simd>(simd: S, values: &mut [f32]) {
    for values in values.chunks_mut(16) {
        let mut lanes = [0.0; 16];
        lanes[..values.len()].copy_from_slice(values);
        let lanes = <[f32; 16]>::from(exp2(simd, f32x16::load_array_ref(simd, &lanes)));
        values.copy_from_slice(&lanes[..values.len()]);
    }
}

/// The box that the Gaussians reach to: where particles can be.
fn reach(gaussians: &RefinedGaussians) -> [[f64; 3]; 2] {
    let end = |k: usize, side: f64, furthest: fn(f64, f64) -> f64| {
        let deviation = |cov: &Sym3| cov.0[[0, 3, 5][k]].max(0.0).sqrt();
        let ends = gaussians.mean.iter().zip(&gaussians.cov).map(|(x, cov)| x[k] + side * REACH * deviation(cov));
        ends.reduce(furthest).unwrap_or(0.0)
    };
    [each_axis(|k| end(k, -1.0, f64::min)), each_axis(|k| end(k, 1.0, f64::max))]
}

impl SoftAssignment {
    /// Of a mixture.
    pub(crate) fn new(mixture: &Mixture, simd: Level) -> Self {
        let mut gaussians = RefinedGaussians::default();
        for i in 0..mixture.len() {
            gaussians.push(mixture.mean_of(i), mixture.cov_of(i), mixture.count[i], 0.0);
        }
        let [origin, high] = reach(&gaussians);
        let extent = (0..3).map(|k| high[k] - origin[k]).fold(0.0, f64::max);
        let scale = if extent > 0.0 { libm::exp2(-libm::log2(extent).ceil()) } else { 1.0 };
        for (mean, cov) in gaussians.mean.iter_mut().zip(&mut gaussians.cov) {
            *mean = each_axis(|k| (mean[k] - origin[k]) * scale);
            *cov = cov.scale(scale).scale(scale);
            *cov = cov.add(&Sym3::scaled_identity(FLATTEST * cov.trace() + FLOOR));
        }
        let ellipsoids: Vec<Ellipsoid> = parallel::map_range(gaussians.len(), |i| {
            Ellipsoid::new(gaussians.mean[i], gaussians.cov[i], gaussians.count[i])
        });
        let tree = OverlapTree::new(&ellipsoids, simd);
        let mut cuts = CutTree { mean: &gaussians.mean, nodes: Vec::new(), boxes: Vec::new() };
        let root = cuts.grow(&mut tree.order().to_vec(), reach(&gaussians));
        let CutTree { nodes, boxes, .. } = cuts;
        let leaves = parallel::map_range(boxes.len(), |leaf| {
            let mut search = OverlapSearch::default();
            let [low, high] = boxes[leaf];
            let centre = each_axis(|k| 0.5 * (low[k] + high[k]));
            let [x, y, z] = each_axis(|k| (high[k] - low[k]).powi(2) / 12.0 + FLOOR);
            tree.nearest(&Ellipsoid::new(centre, Sym3([x, 0.0, 0.0, y, 0.0, z]), 1.0), CANDIDATES, &mut search);
            let candidates = search.neighbours.iter().map(|f| f.1).collect();
            AssignmentLeaf { centre: centre.map(|v| v as f32), candidates }
        });
        let whitened = parallel::map_range(gaussians.len(), |j| Whitening::new(&gaussians, j, PLAIN));
        SoftAssignment { nodes, leaves, root, whitened, origin, scale, simd }
    }

    fn local(&self, x: [f64; 3]) -> [f64; 3] {
        each_axis(|k| (x[k] - self.origin[k]) * self.scale)
    }

    fn leaf_of(&self, x: [f64; 3]) -> u32 {
        let (mut node, place) = (self.root, self.local(x));
        while node < LEAVES {
            let (axis, cut, children) = self.nodes[node as usize];
            // No branch, which could not be foreseen.
            node = children[usize::from(place[axis as usize] >= cut)];
        }
        node - LEAVES
    }

    /// Gives the particles of each leaf as a group, its candidates and its range in the order that is returned.
    fn by_leaf(&self, places: &[[f64; 3]], mut each: impl FnMut(&ParticleGroup<'_>, &[u32], Range<usize>)) -> Vec<u32> {
        let leaf_of_each: Vec<u32> = places.iter().map(|x| self.leaf_of(*x)).collect();
        let CountingSort { start, order } = CountingSort::new(&leaf_of_each, self.leaves.len());
        let (mut points, mut whitened) = (Vec::new(), Vec::new());
        for (number, AssignmentLeaf { centre, candidates }) in self.leaves.iter().enumerate() {
            let range = start[number]..start[number + 1];
            if range.is_empty() {
                continue;
            }
            let about_centre = |i: &u32| {
                let place = self.local(places[*i as usize]);
                each_axis(|k| (place[k] - f64::from(centre[k])) as f32)
            };
            points.clear();
            points.extend(order[range.clone()].iter().map(about_centre));
            whitened.clear();
            whitened.extend(candidates.iter().map(|j| self.whitened[*j as usize].about(*centre)));
            let group = ParticleGroup { points: &points, weight: None, centre: [0.0; 3], candidates: &whitened };
            each(&group, candidates, range);
        }
        order
    }

    /// The shares of particles; none where there is no Gaussian.
    pub(crate) fn shares(&self, places: &[[f64; 3]]) -> PlaceShares {
        let (mut scratch, mut leaf_shares) = (KernelScratch::default(), Vec::<GroupShare>::new());
        let mut shares = Vec::<GroupShare>::with_capacity(4 * places.len());
        let mut sum = vec![0.0f32; places.len()];
        let order = self.by_leaf(places, |group, candidates, range| {
            leaf_shares.clear();
            em_kernel::assign(self.simd, group, &mut scratch, &mut [], Some((LEAST_SHARE, &mut leaf_shares)));
            for &GroupShare { candidate, particle, share } in &leaf_shares {
                let (candidate, particle) = (candidates[candidate as usize], range.start as u32 + particle);
                sum[particle as usize] += share;
                shares.push(GroupShare { candidate, particle, share });
            }
        });
        let gaussians: Vec<u32> = shares.iter().map(|s| s.candidate).collect();
        let CountingSort { start, order: by_gaussian } = CountingSort::new(&gaussians, self.whitened.len());
        let sorted = by_gaussian.iter().map(|i| shares[*i as usize]);
        let (particle, share) = sorted.map(|s| (s.particle, s.share / sum[s.particle as usize])).unzip();
        PlaceShares { order, start, particle, share }
    }

    /// The Gaussian that each particle is likeliest to have; 0 where there is none.
    pub(crate) fn likeliest(&self, places: &[[f64; 3]]) -> Vec<u32> {
        let (mut scratch, mut sorted) = (KernelScratch::default(), vec![0; places.len()]);
        let order = self.by_leaf(places, |group, candidates, range| {
            let owner = &mut sorted[range];
            em_kernel::assign(self.simd, group, &mut scratch, owner, None);
            owner.iter_mut().for_each(|n| *n = candidates.get(*n as usize).copied().unwrap_or(0));
        });
        let mut likeliest = vec![0; places.len()];
        order.iter().zip(sorted).for_each(|(i, gaussian)| likeliest[*i as usize] = gaussian);
        likeliest
    }
}

struct CutTree<'a> {
    mean: &'a [[f64; 3]],
    nodes: Vec<(u8, f64, [u32; 2])>,
    boxes: Vec<[[f64; 3]; 2]>,
}

impl CutTree<'_> {
    /// Grows the tree over the Gaussians of `order` in a box; the node's number.
    fn grow(&mut self, order: &mut [u32], within: [[f64; 3]; 2]) -> u32 {
        let ends = |k: usize| {
            let means = order.iter().map(|&i| self.mean[i as usize][k]);
            means.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
        };
        let ends = [ends(0), ends(1), ends(2)];
        let axis = (0..3).fold(0, |a, k| if ends[k].1 - ends[k].0 > ends[a].1 - ends[a].0 { k } else { a });
        if order.len() <= LEAF || ends[axis].1 <= ends[axis].0 {
            self.boxes.push(within);
            return LEAVES + self.boxes.len() as u32 - 1;
        }
        let middle = order.len() / 2;
        let mean = |i: &u32| self.mean[*i as usize][axis];
        order.select_nth_unstable_by(middle, |i, j| mean(i).total_cmp(&mean(j)).then(i.cmp(j)));
        let below = order[..middle].iter().map(mean).fold(f64::NEG_INFINITY, f64::max);
        let cut = 0.5 * (mean(&order[middle]) + below);
        let (low, high) = order.split_at_mut(middle);
        let [mut lower, mut upper] = [within; 2];
        (lower[1][axis], upper[0][axis]) = (cut, cut);
        let node = self.nodes.len();
        self.nodes.push((axis as u8, cut, [0; 2]));
        self.nodes[node].2 = [self.grow(low, lower), self.grow(high, upper)];
        node as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    /// The logarithm of a Gaussian's density, f64.
    fn log_density(m: &Mixture, i: usize, x: [f64; 3]) -> f64 {
        let (cov, d) = (m.cov_of(i), each_axis(|k| x[k] - m.mean[k][i]));
        m.count[i].ln() - 0.5 * cov.det().ln() - 0.5 * cov.inverse().unwrap().quadratic(d)
    }

    #[test]
    fn shares_are_those_of_all_gaussians() {
        let mut m = Mixture::new(false);
        for i in 0..300 {
            let mut r = Random::new(5, 0, i);
            let mut v = || [r.normal(), r.normal(), r.normal()];
            let (a, b) = (v(), v());
            let cov = Sym3::outer(a).add(&Sym3::outer(b)).add(&Sym3::scaled_identity(0.3)).scale(0.01);
            m.push(v(), cov, 1.0 + v()[0].abs() * 20.0, 0.0);
        }
        let assignment = SoftAssignment::new(&m, Level::new());
        const POINTS: usize = 600;
        let place = |i: usize| {
            // A particle of one of the Gaussians.
            let (mut r, gaussian) = (Random::new(6, 0, i as u64), i % m.len());
            let eigen = m.cov_of(gaussian).eigen();
            let z = eigen.values.map(|v| v.sqrt() * r.normal());
            each_axis(|k| m.mean[k][gaussian] + (0..3).map(|a| eigen.vectors[a][k] * z[a]).sum::<f64>())
        };
        let places: Vec<[f64; 3]> = (0..POINTS).map(place).collect();
        let (shares, likeliest) = (assignment.shares(&places), assignment.likeliest(&places));
        let mut share_of_each = vec![[0.0; 300]; POINTS];
        for gaussian in 0..m.len() {
            for s in shares.of(gaussian) {
                share_of_each[shares.order[shares.particle[s] as usize] as usize][gaussian] =
                    f64::from(shares.share[s]);
            }
        }
        let (mut worst, mut sum) = (0.0f64, 0.0);
        for (i, shares) in share_of_each.iter().enumerate() {
            assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-6);
            let logs: Vec<f64> = (0..m.len()).map(|k| log_density(&m, k, places[i])).collect();
            let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let all: f64 = logs.iter().map(|l| (l - top).exp()).sum();
            let missed = (0..m.len()).map(|k| ((logs[k] - top).exp() / all - shares[k]).abs()).fold(0.0, f64::max);
            (worst, sum) = (worst.max(missed), sum + missed);
            let most = shares.iter().copied().fold(0.0, f64::max);
            assert!(shares[likeliest[i] as usize] > most - 1e-6);
        }
        let mean = sum / POINTS as f64;
        assert!(mean < 0.003 && worst < 0.25, "{mean} {worst}");
    }
}
