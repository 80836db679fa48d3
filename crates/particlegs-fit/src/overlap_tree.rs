//! The Gaussians that a group of particles can belong to: the K of largest overlap.
//!
//! Ranked by `d^T (A + B)^-1 d + ln det(A + B) - 2 ln m`, minus twice the logarithm of the
//! overlap of the group's ellipsoid with the Gaussian. Ranking by the group's mean alone, or by a
//! distance, loses quality. Found by branch and bound in a tree over the means.

use super::eigen::largest_eigenvalue;
use fearless_simd::{Level, Simd, dispatch, f64x8, prelude::*, u64x8};
use particlegs_core::math::{Sym3, each_axis};

/// Gaussians in a leaf and parts of a node, at most: those of one vector.
const WIDTH: usize = 8;
/// Leaves that a search from one of the Gaussians looks at, at most.
const MOST_LEAVES: usize = 1024;

#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchReach {
    /// At most so many are found.
    pub(crate) most: usize,
    /// Largest difference of separations from the best (2 ln of the ratio of overlaps).
    pub(crate) beyond: f64,
}

/// An ellipsoid with all that its overlaps need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ellipsoid {
    pub(crate) mean: [f64; 3],
    pub(crate) cov: Sym3,
    /// Largest eigenvalue.
    pub(crate) widest: f64,
    pub(crate) det_cbrt: f64,
    /// 2 ln(count); -infinity for none.
    pub(crate) log_count2: f64,
}

impl Ellipsoid {
    /// `cov` must be positive definite.
    pub(crate) fn new(mean: [f64; 3], cov: Sym3, count: f64) -> Self {
        Ellipsoid {
            mean,
            cov,
            widest: largest_eigenvalue(&cov, cov.trace() / 3.0).0,
            det_cbrt: libm::cbrt(cov.det().max(0.0)),
            log_count2: 2.0 * libm::log(count),
        }
    }
}

/// Eight ellipsoids side by side; those beyond `len` mean nothing.
#[derive(Default)]
struct OverlapLeaf {
    mean: [[f64; WIDTH]; 3],
    cov: [[f64; WIDTH]; 6],
    log_count2: [f64; WIDTH],
    id: [u32; WIDTH],
    len: usize,
}

impl OverlapLeaf {
    fn new(items: &[Ellipsoid], ids: &[u32]) -> Self {
        let mut leaf = OverlapLeaf { len: ids.len(), ..OverlapLeaf::default() };
        for (i, &id) in ids.iter().enumerate() {
            let e = &items[id as usize];
            (0..3).for_each(|k| leaf.mean[k][i] = e.mean[k]);
            (0..6).for_each(|k| leaf.cov[k][i] = e.cov.0[k]);
            (leaf.log_count2[i], leaf.id[i]) = (e.log_count2, id);
        }
        leaf
    }

    /// Of each separation from `other` the squared distance, the determinant, and a number that is not above it.
    #[inline(always)]
    fn separations<S: Simd>(&self, simd: S, other: &Ellipsoid) -> [[f64; WIDTH]; 3] {
        let (cov, mean) = (&self.cov, &self.mean);
        let [a, b, c, d, e, f] = other.cov.0;
        let (a, b, c) = (lanes(simd, &cov[0]) + a, lanes(simd, &cov[1]) + b, lanes(simd, &cov[2]) + c);
        let (d, e, f) = (lanes(simd, &cov[3]) + d, lanes(simd, &cov[4]) + e, lanes(simd, &cov[5]) + f);
        let (xx, xy, xz) = (d * f - e * e, c * e - b * f, b * e - c * d);
        let (yy, yz, zz) = (a * f - c * c, b * c - a * e, a * d - b * b);
        let det = a * xx + b * xy + c * xz;
        let [x, y, z] = other.mean;
        let (x, y, z) = (lanes(simd, &mean[0]) - x, lanes(simd, &mean[1]) - y, lanes(simd, &mean[2]) - z);
        let q = xx * x * x + yy * y * y + zz * z * z + (xy * x * y + xz * x * z + yz * y * z) * 2.0;
        let apart = q / det;
        let bound = apart + log_at_most(simd, det) - lanes(simd, &self.log_count2);
        [apart.into(), det.into(), bound.into()]
    }
}

/// Bounds of some ellipsoids, of each number the extreme that makes their separations smallest.
#[derive(Clone, Copy)]
struct OverlapBounds {
    min: [f64; 3],
    max: [f64; 3],
    widest: f64,
    det_cbrt: f64,
    log_count2: f64,
}

impl OverlapBounds {
    fn of(e: &Ellipsoid) -> Self {
        let &Ellipsoid { mean, widest, det_cbrt, log_count2, .. } = e;
        OverlapBounds { min: mean, max: mean, widest, det_cbrt, log_count2 }
    }

    fn union(self, other: Self) -> Self {
        OverlapBounds {
            min: each_axis(|k| self.min[k].min(other.min[k])),
            max: each_axis(|k| self.max[k].max(other.max[k])),
            widest: self.widest.max(other.widest),
            det_cbrt: self.det_cbrt.min(other.det_cbrt),
            log_count2: self.log_count2.max(other.log_count2),
        }
    }
}

/// Up to eight parts of the tree side by side.
#[derive(Default)]
struct OverlapNode {
    min: [[f64; WIDTH]; 3],
    max: [[f64; WIDTH]; 3],
    widest: [f64; WIDTH],
    det_cbrt: [f64; WIDTH],
    log_count2: [f64; WIDTH],
    part: [TreePart; WIDTH],
    len: usize,
}

/// A leaf or a node, and its run in the order.
#[derive(Clone, Copy, Default)]
struct TreePart {
    index: u32,
    is_leaf: bool,
    start: u32,
    end: u32,
}

impl TreePart {
    /// How far the run is from a place in the order.
    fn gap(&self, place: u32) -> u32 {
        self.start.saturating_sub(place).max((place + 1).saturating_sub(self.end))
    }
}

impl OverlapNode {
    fn new(parts: &[(TreePart, OverlapBounds)]) -> Self {
        let mut node = OverlapNode { len: parts.len(), ..OverlapNode::default() };
        for (i, (part, bounds)) in parts.iter().enumerate() {
            (0..3).for_each(|k| (node.min[k][i], node.max[k][i]) = (bounds.min[k], bounds.max[k]));
            (node.widest[i], node.det_cbrt[i], node.log_count2[i]) =
                (bounds.widest, bounds.det_cbrt, bounds.log_count2);
            node.part[i] = *part;
        }
        node
    }

    /// No Gaussian of a part has a smaller separation: the distance over the widest sum of variances, and Minkowski's
    /// det(A + B)^(1/3) >= det(A)^(1/3) + det(B)^(1/3).
    #[inline(always)]
    fn bounds<S: Simd>(&self, simd: S, group: &Ellipsoid) -> [f64; WIDTH] {
        let mut d2 = f64x8::splat(simd, 0.0);
        for k in 0..3 {
            let place = f64x8::splat(simd, group.mean[k]);
            let (below, above) = (lanes(simd, &self.min[k]) - place, place - lanes(simd, &self.max[k]));
            let d = below.max(above).max(f64x8::splat(simd, 0.0));
            d2 += d * d;
        }
        let apart = d2 / (lanes(simd, &self.widest) + group.widest);
        let logarithm = log_at_most(simd, lanes(simd, &self.det_cbrt) + group.det_cbrt);
        (apart + logarithm * 3.0 - lanes(simd, &self.log_count2) - 1e-6).into()
    }
}

#[inline(always)]
fn lanes<S: Simd>(simd: S, values: &[f64; WIDTH]) -> f64x8<S> {
    f64x8::load_array_ref(simd, values)
}

/// Numbers below the logarithms of `x`, by at most 0.06: the bits of a number are its logarithm to base 2 at powers of
/// two, and a chord below it between them.
#[inline(always)]
fn log_at_most<S: Simd>(simd: S, x: f64x8<S>) -> f64x8<S> {
    // With these bits before it an integer below 2^52 is a number of 2^52 more.
    const INTEGER: f64 = (1u64 << 52) as f64;
    const DIGITS: u32 = 40;
    const ONE: f64 = INTEGER + (1023u64 << DIGITS) as f64;
    const SCALE: f64 = std::f64::consts::LN_2 / (1u64 << DIGITS) as f64;
    let bits: u64x8<S> = (x.to_bits() >> (52 - DIGITS)) | INTEGER.to_bits();
    let log = (f64x8::from_bits(bits) - ONE) * SCALE - 1e-9;
    x.simd_ge(f64x8::splat(simd, f64::MIN_POSITIVE)).select(log, f64x8::splat(simd, f64::NEG_INFINITY))
}

pub(crate) struct OverlapTree {
    /// Numbers of the Gaussians, those of a leaf or a node side by side.
    order: Vec<u32>,
    nodes: Vec<OverlapNode>,
    leaves: Vec<OverlapLeaf>,
    root: Option<TreePart>,
    simd: Level,
}

/// A search's neighbours, best first, each with its separation, and the parts of the tree that it has still to see.
#[derive(Default)]
pub(crate) struct OverlapSearch {
    pub(crate) neighbours: Vec<(f64, u32)>,
    parts: Vec<(f64, TreePart)>,
}

impl OverlapTree {
    /// Builds the tree over those with a count above zero.
    pub(crate) fn new(items: &[Ellipsoid], simd: Level) -> Self {
        let mut order: Vec<u32> =
            (0..items.len() as u32).filter(|&i| items[i as usize].log_count2.is_finite()).collect();
        let mut tree = OverlapTree { order: Vec::new(), nodes: Vec::new(), leaves: Vec::new(), root: None, simd };
        if !order.is_empty() {
            tree.root = Some(tree.build(items, &mut order, 0).0);
        }
        tree.order = order;
        tree
    }

    fn build(&mut self, items: &[Ellipsoid], order: &mut [u32], offset: usize) -> (TreePart, OverlapBounds) {
        let (start, end) = (offset as u32, (offset + order.len()) as u32);
        if order.len() <= WIDTH {
            let bounds = order.iter().map(|&i| OverlapBounds::of(&items[i as usize]));
            let bounds = bounds.reduce(OverlapBounds::union).expect("a leaf holds a Gaussian");
            self.leaves.push(OverlapLeaf::new(items, order));
            return (TreePart { index: self.leaves.len() as u32 - 1, is_leaf: true, start, end }, bounds);
        }
        let mut parts = Vec::with_capacity(WIDTH);
        self.build_parts(items, order, offset, WIDTH, &mut parts);
        let bounds = parts.iter().map(|p| p.1).reduce(OverlapBounds::union).expect("a node has two parts or more");
        self.nodes.push(OverlapNode::new(&parts));
        (TreePart { index: self.nodes.len() as u32 - 1, is_leaf: false, start, end }, bounds)
    }

    /// Cuts a run in halves until there are `most` parts or none is larger than a leaf.
    fn build_parts(
        &mut self,
        items: &[Ellipsoid],
        order: &mut [u32],
        offset: usize,
        most: usize,
        parts: &mut Vec<(TreePart, OverlapBounds)>,
    ) {
        if most == 1 || order.len() <= WIDTH {
            parts.push(self.build(items, order, offset));
            return;
        }
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for &i in order.iter() {
            for k in 0..3 {
                min[k] = min[k].min(items[i as usize].mean[k]);
                max[k] = max[k].max(items[i as usize].mean[k]);
            }
        }
        let extent: [f64; 3] = each_axis(|k| max[k] - min[k]);
        let axis = (0..3).fold(0, |a, k| if extent[k] > extent[a] { k } else { a });
        let half = order.len() / 2;
        // Ties by number, so that the tree is the same every time.
        order.select_nth_unstable_by(half, |&i, &j| {
            items[i as usize].mean[axis].total_cmp(&items[j as usize].mean[axis]).then(i.cmp(&j))
        });
        let (low, high) = order.split_at_mut(half);
        self.build_parts(items, low, offset, most / 2, parts);
        self.build_parts(items, high, offset + half, most / 2, parts);
    }

    /// The Gaussians that overlap most with `group`, as far as `reach`.
    pub(crate) fn nearest(&self, group: &Ellipsoid, reach: SearchReach, search: &mut OverlapSearch) {
        dispatch!(self.simd, simd => self.search(simd, group, None, reach, search));
    }

    /// [`Self::nearest`] to one of the Gaussians themselves, which is the `at`-th in the tree's order, by a look
    /// at no more than [`MOST_LEAVES`] leaves. Where so many overlap alike that no bound tells them
    /// apart (thousands at one place), those are taken that lie beside it in the tree.
    pub(crate) fn nearest_to(&self, ellipsoid: &Ellipsoid, at: u32, reach: SearchReach, search: &mut OverlapSearch) {
        dispatch!(self.simd, simd => self.search(simd, ellipsoid, Some(at), reach, search));
    }

    /// The Gaussians in the tree's order.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    #[inline(always)]
    fn search<S: Simd>(
        &self,
        simd: S,
        group: &Ellipsoid,
        home: Option<u32>,
        reach: SearchReach,
        search: &mut OverlapSearch,
    ) {
        let OverlapSearch { neighbours, parts } = search;
        let mut leaves = if home.is_some() { MOST_LEAVES } else { usize::MAX };
        neighbours.clear();
        parts.clear();
        parts.extend(self.root.map(|root| (f64::NEG_INFINITY, root)));
        while let Some((bound, part)) = parts.pop() {
            if bound > reach.limit(neighbours) {
                continue;
            }
            if !part.is_leaf {
                let node = &self.nodes[part.index as usize];
                let (limit, first) = (reach.limit(neighbours), parts.len());
                for (&part, bound) in node.part[..node.len].iter().zip(node.bounds(simd, group)) {
                    if bound > limit {
                        continue;
                    }
                    // The nearest goes on top of the stack: what it holds tightens the limit for the others.
                    let is_nearer = |other: &(f64, TreePart)| {
                        let gaps = |home| part.gap(home) < other.1.gap(home);
                        bound < other.0 || bound == other.0 && home.is_some_and(gaps)
                    };
                    let place = first + parts[first..].iter().take_while(|other| is_nearer(other)).count();
                    parts.insert(place, (bound, part));
                }
                continue;
            }
            if leaves == 0 {
                break;
            }
            leaves -= 1;
            let leaf = &self.leaves[part.index as usize];
            let [apart, det, bound] = leaf.separations(simd, group);
            for i in 0..leaf.len {
                let limit = reach.limit(neighbours);
                // Most are too far, and need no logarithm to say so.
                if bound[i] > limit {
                    continue;
                }
                let separation = apart[i] + libm::log(det[i]) - leaf.log_count2[i];
                // From home on, those found first stay where others are as near.
                let tie =
                    home.is_some() && neighbours.len() == reach.most && separation == neighbours[reach.most - 1].0;
                if separation <= limit && !tie {
                    let at = neighbours.partition_point(|f| (f.0, f.1) < (separation, leaf.id[i]));
                    neighbours.insert(at, (separation, leaf.id[i]));
                    neighbours.truncate(reach.most);
                }
            }
        }
        let limit = neighbours.first().map_or(0.0, |f| f.0 + reach.beyond);
        neighbours.retain(|f| f.0 <= limit);
    }
}

impl SearchReach {
    /// The largest separation that can still be found.
    fn limit(self, neighbours: &[(f64, u32)]) -> f64 {
        match neighbours.first() {
            None => f64::INFINITY,
            Some(best) if neighbours.len() == self.most => neighbours[self.most - 1].0.min(best.0 + self.beyond),
            Some(best) => best.0 + self.beyond,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    fn ellipsoids(n: u64) -> Vec<Ellipsoid> {
        (0..n)
            .map(|i| {
                let mut random = Random::new(3, 0, i);
                let mut v = || [random.normal(), random.normal(), random.normal()];
                // Sizes over three decades, clustered centres.
                let size = (1.5 * v()[0]).exp() * 0.05;
                let (a, b, m) = (v(), v(), v());
                let cov = Sym3::outer(a).add(&Sym3::outer(b)).add(&Sym3::scaled_identity(0.2)).scale(size * size);
                Ellipsoid::new(m.map(|x| x * x * x), cov, 1.0 + v()[0].abs() * 50.0)
            })
            .collect()
    }

    /// Minus twice the logarithm of the overlap, constants left out, as a reader would write it.
    fn separation(a: &Ellipsoid, b: &Ellipsoid) -> f64 {
        let (sum, v) = (a.cov.add(&b.cov), each_axis(|k| a.mean[k] - b.mean[k]));
        let rows = sum.inverse().expect("it is positive definite").rows();
        let apart: f64 = (0..9).map(|k| rows[k / 3][k % 3] * v[k / 3] * v[k % 3]).sum();
        apart + libm::log(sum.det()) - b.log_count2
    }

    #[test]
    fn the_cheap_logarithm_is_below_the_exact_one_and_close_to_it() {
        let cheap = |x| dispatch!(Level::new(), simd => log_at_most(simd, f64x8::splat(simd, x)).as_slice()[0]);
        for i in 0..200_000 {
            let x = libm::exp(0.007 * f64::from(i) - 700.0);
            let gap = libm::log(x) - cheap(x);
            assert!(gap > 0.0 && gap < 0.06, "{x}: {gap}");
        }
        for odd in [0.0, -1.0, f64::NAN, 1e-310] {
            assert_eq!(cheap(odd), f64::NEG_INFINITY);
        }
    }

    #[test]
    fn the_tree_finds_what_a_full_search_finds_at_every_level() {
        for n in [1, 7, 9, 65, 600] {
            let items = ellipsoids(n);
            let trees = [Level::new(), Level::baseline()].map(|level| OverlapTree::new(&items, level));
            for group in ellipsoids(60) {
                let mut all: Vec<(f64, u32)> =
                    items.iter().enumerate().map(|(i, e)| (separation(&group, e), i as u32)).collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                let cut = all[0].0 + 9.0;
                let expected: Vec<u32> = all.into_iter().take(12).filter(|f| f.0 <= cut).map(|f| f.1).collect();
                let [fast, scalar] = trees.each_ref().map(|tree| {
                    let mut search = OverlapSearch::default();
                    tree.nearest(&group, SearchReach { most: 12, beyond: 9.0 }, &mut search);
                    search.neighbours
                });
                assert_eq!(fast, scalar);
                assert_eq!(fast.iter().map(|f| f.1).collect::<Vec<_>>(), expected);
            }
        }
    }
}
