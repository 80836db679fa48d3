//! Shares of a particle in the Gaussians: soft responsibilities of a mixture that is fixed.

use super::overlap_tree::{Ellipsoid, OverlapSearch, OverlapTree, SearchReach};
use fearless_simd::Level;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::Mixture;
use particlegs_core::parallel;

/// Gaussians in a leaf of the tree of means, and candidates that its particles have.
const LEAF: usize = 2;
const CANDIDATES: SearchReach = SearchReach { most: 24, beyond: 24.0 };
/// Standard deviations that Gaussians reach.
const REACH: f64 = 3.0;
/// Smaller shares are left out.
const LEAST_SHARE: f64 = 1.0 / 1024.0;
/// Variances no smaller than this part of the largest.
const FLATTEST: f64 = 1e-12;

/// A tree of the Gaussians' means whose leaves know which Gaussians their particles can belong to.
pub(crate) struct SoftAssignment {
    /// Inner nodes: axis, place of the cut, node below it, node above it. A child from `LEAVES` on is a leaf.
    nodes: Vec<(u8, f64, u32, u32)>,
    leaves: Vec<Vec<u32>>,
    root: u32,
    densities: Vec<LogDensity>,
}

const LEAVES: u32 = 1 << 31;

/// The logarithm of a Gaussian's density: `log - 0.5 |t (x - mean)|^2`, t lower triangular.
#[derive(Clone, Copy)]
struct LogDensity {
    mean: [f64; 3],
    inverse: [f64; 6],
    log: f64,
}

impl LogDensity {
    fn new(m: &Mixture, i: usize) -> Self {
        let cov = sound(&m.cov_of(i));
        let inverse = cov.inverse().unwrap_or(Sym3::scaled_identity(0.0));
        let log = libm::log(m.count[i].max(1e-300)) - 0.5 * libm::log(cov.det().max(f64::MIN_POSITIVE));
        LogDensity { mean: m.mean_of(i), inverse: inverse.0, log }
    }

    #[inline(always)]
    fn at(&self, x: [f64; 3]) -> f64 {
        let d: [f64; 3] = each_axis(|k| x[k] - self.mean[k]);
        let [xx, xy, xz, yy, yz, zz] = self.inverse;
        let q = d[0] * (xx * d[0] + 2.0 * (xy * d[1] + xz * d[2]))
            + d[1] * (yy * d[1] + 2.0 * yz * d[2])
            + zz * d[2] * d[2];
        self.log - 0.5 * q
    }
}

/// The box that the Gaussians reach to: where particles can be.
fn reach(m: &Mixture) -> [[f64; 3]; 2] {
    let variance = [&m.cov[0], &m.cov[3], &m.cov[5]];
    let end = |k: usize, side: f64, furthest: fn(f64, f64) -> f64| {
        let ends = m.mean[k].iter().zip(variance[k]).map(|(x, v)| x + side * REACH * v.max(0.0).sqrt());
        ends.reduce(furthest).unwrap_or(0.0)
    };
    [each_axis(|k| end(k, -1.0, f64::min)), each_axis(|k| end(k, 1.0, f64::max))]
}

/// A covariance without variances of 0.
fn sound(cov: &Sym3) -> Sym3 {
    let mut eigen = cov.eigen();
    let least = (FLATTEST * eigen.values[0]).max(f64::MIN_POSITIVE);
    if eigen.values[2] > least {
        return *cov;
    }
    eigen.values = eigen.values.map(|v| v.max(least));
    Sym3::from_eigen(&eigen)
}

impl SoftAssignment {
    pub(crate) fn new(m: &Mixture) -> Self {
        let ellipsoids: Vec<Ellipsoid> =
            parallel::map_range(m.len(), |i| Ellipsoid::new(m.mean_of(i), sound(&m.cov_of(i)), m.count[i]));
        let tree = OverlapTree::new(&ellipsoids, Level::new());
        let mut order: Vec<u32> = tree.order().to_vec();
        let mut cuts = CutTree { mean: &m.mean, nodes: Vec::new(), boxes: Vec::new() };
        let root = cuts.grow(&mut order, reach(m));
        let leaves = parallel::map_range(cuts.boxes.len(), |leaf| {
            let mut search = OverlapSearch::default();
            let (low, high) = cuts.boxes[leaf];
            let center = each_axis(|k| 0.5 * (low[k] + high[k]));
            let [x, y, z] = each_axis(|k| ((high[k] - low[k]) * (high[k] - low[k]) / 12.0).max(f64::MIN_POSITIVE));
            tree.nearest(&Ellipsoid::new(center, Sym3([x, 0.0, 0.0, y, 0.0, z]), 1.0), CANDIDATES, &mut search);
            search.neighbours.into_iter().map(|f| f.1).collect()
        });
        let densities = parallel::map_range(m.len(), |i| LogDensity::new(m, i));
        SoftAssignment { nodes: cuts.nodes, leaves, root, densities }
    }

    /// The shares of a particle, which sum to 1; none where there is no Gaussian.
    #[inline]
    pub(crate) fn shares(&self, x: [f64; 3], shares: &mut Vec<(u32, f64)>) {
        shares.clear();
        let mut node = self.root;
        while node < LEAVES {
            let (axis, cut, low, high) = self.nodes[node as usize];
            node = if x[axis as usize] < cut { low } else { high };
        }
        let Some(candidates) = self.leaves.get((node - LEAVES) as usize) else { return };
        let mut largest = f64::NEG_INFINITY;
        for &i in candidates {
            let log = self.densities[i as usize].at(x);
            largest = largest.max(log);
            shares.push((i, log));
        }
        let mut sum = 0.0;
        for s in shares.iter_mut() {
            s.1 = libm::exp(s.1 - largest);
            sum += s.1;
        }
        shares.retain(|s| s.1 >= LEAST_SHARE * sum);
        let kept_sum: f64 = shares.iter().map(|s| s.1).sum();
        shares.iter_mut().for_each(|s| s.1 /= kept_sum);
    }

    /// The Gaussian that a particle is likeliest to have; 0 where there is none.
    pub(crate) fn likeliest(&self, x: [f64; 3], shares: &mut Vec<(u32, f64)>) -> u32 {
        self.shares(x, shares);
        shares.iter().fold((0, 0.0), |best, s| if s.1 > best.1 { *s } else { best }).0
    }
}

struct CutTree<'a> {
    mean: &'a [Vec<f64>; 3],
    nodes: Vec<(u8, f64, u32, u32)>,
    boxes: Vec<([f64; 3], [f64; 3])>,
}

impl CutTree<'_> {
    /// Grows the tree over the Gaussians of `order` in a box; the node's number.
    fn grow(&mut self, order: &mut [u32], within: [[f64; 3]; 2]) -> u32 {
        let ends = |k: usize| {
            let means = order.iter().map(|&i| self.mean[k][i as usize]);
            means.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
        };
        let ends = [ends(0), ends(1), ends(2)];
        let axis = (0..3).fold(0, |a, k| if ends[k].1 - ends[k].0 > ends[a].1 - ends[a].0 { k } else { a });
        if order.len() <= LEAF || ends[axis].1 <= ends[axis].0 {
            self.boxes.push((within[0], within[1]));
            return LEAVES + self.boxes.len() as u32 - 1;
        }
        let middle = order.len() / 2;
        let mean = &self.mean[axis];
        order.select_nth_unstable_by(middle, |&i, &j| mean[i as usize].total_cmp(&mean[j as usize]).then(i.cmp(&j)));
        let above = mean[order[middle] as usize];
        let below = order[..middle].iter().map(|&i| mean[i as usize]).fold(f64::NEG_INFINITY, f64::max);
        let cut = 0.5 * (above + below);
        let (low, high) = order.split_at_mut(middle);
        let [mut lower, mut upper] = [within; 2];
        (lower[1][axis], upper[0][axis]) = (cut, cut);
        let node = self.nodes.len();
        self.nodes.push((axis as u8, cut, 0, 0));
        let low = self.grow(low, lower);
        let high = self.grow(high, upper);
        (self.nodes[node].2, self.nodes[node].3) = (low, high);
        node as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

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
        let assignment = SoftAssignment::new(&m);
        let mut shares = Vec::new();
        let (mut worst, mut sum) = (0.0f64, 0.0);
        const POINTS: u64 = 600;
        for i in 0..POINTS {
            // A particle of one of the Gaussians.
            let (mut r, gaussian) = (Random::new(6, 0, i), i as usize % m.len());
            let eigen = m.cov_of(gaussian).eigen();
            let z = eigen.values.map(|v| v.sqrt() * r.normal());
            let x = each_axis(|k| m.mean[k][gaussian] + (0..3).map(|a| eigen.vectors[a][k] * z[a]).sum::<f64>());
            assignment.shares(x, &mut shares);
            assert!((shares.iter().map(|s| s.1).sum::<f64>() - 1.0).abs() < 1e-12);
            let logs: Vec<f64> = (0..m.len()).map(|k| LogDensity::new(&m, k).at(x)).collect();
            let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let all: f64 = logs.iter().map(|l| (l - top).exp()).sum();
            let share_of = |k: usize| shares.iter().find(|s| s.0 == k as u32).map_or(0.0, |s| s.1);
            let missed = (0..m.len()).map(|k| ((logs[k] - top).exp() / all - share_of(k)).abs()).fold(0.0, f64::max);
            (worst, sum) = (worst.max(missed), sum + missed);
        }
        let mean = sum / POINTS as f64;
        assert!(mean < 0.003 && worst < 0.25, "{mean} {worst}");
    }
}
