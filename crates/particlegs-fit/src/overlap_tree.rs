//! The Gaussians that a group of particles can belong to: the K of largest overlap.
//!
//! Ranked by `d^T (A + B)^-1 d + ln det(A + B) - 2 ln m`, minus twice the logarithm of the
//! overlap of the group's ellipsoid with the Gaussian. Ranking by the group's mean alone, or by a
//! distance, loses quality. Found by branch and bound in a tree over the means.

use super::eigen::largest_eigenvalue;
use particlegs_core::math::{Sym3, each_axis};

/// Gaussians in a leaf of the tree.
const LEAF: usize = 8;
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

    /// Minus twice the logarithm of the overlap, constants left out; `None` where it is above `limit`.
    #[inline]
    fn separation(&self, other: &Ellipsoid, limit: f64) -> Option<f64> {
        let s = self.cov.add(&other.cov);
        let [a, b, c, d, e, f] = s.0;
        let (xx, xy, xz) = (d * f - e * e, c * e - b * f, b * e - c * d);
        let (yy, yz, zz) = (a * f - c * c, b * c - a * e, a * d - b * b);
        let det = a * xx + b * xy + c * xz;
        let v: [f64; 3] = each_axis(|k| self.mean[k] - other.mean[k]);
        let q = xx * v[0] * v[0]
            + yy * v[1] * v[1]
            + zz * v[2] * v[2]
            + 2.0 * (xy * v[0] * v[1] + xz * v[0] * v[2] + yz * v[1] * v[2]);
        let apart = q / det;
        // Most are too far, and need no logarithm to say so.
        if apart + log_at_most(det) - other.log_count2 > limit {
            return None;
        }
        let separation = apart + libm::log(det) - other.log_count2;
        (separation <= limit).then_some(separation)
    }
}

/// A number below the logarithm of `x`, by at most 0.06: its bits as a number are the logarithm to base 2 at powers of two,
/// and a chord below it between them.
#[inline]
fn log_at_most(x: f64) -> f64 {
    const ONE: i64 = 1023 << 52;
    const SCALE: f64 = std::f64::consts::LN_2 / (1u64 << 52) as f64;
    if x >= f64::MIN_POSITIVE { (x.to_bits() as i64 - ONE) as f64 * SCALE - 1e-9 } else { f64::NEG_INFINITY }
}

struct OverlapNode {
    min: [f64; 3],
    max: [f64; 3],
    widest: f64,
    det_cbrt: f64,
    log_count2: f64,
    /// Leaf: the range in `order`; inner node: children are the next node and `right`.
    start: u32,
    end: u32,
    right: u32,
}

pub(crate) struct OverlapTree<'a> {
    items: &'a [Ellipsoid],
    order: Vec<u32>,
    nodes: Vec<OverlapNode>,
}

impl<'a> OverlapTree<'a> {
    /// Builds the tree over those with a count above zero.
    pub(crate) fn new(items: &'a [Ellipsoid]) -> Self {
        let order: Vec<u32> = (0..items.len() as u32).filter(|&i| items[i as usize].log_count2.is_finite()).collect();
        let mut tree = OverlapTree { items, order, nodes: Vec::new() };
        if !tree.order.is_empty() {
            let mut order = std::mem::take(&mut tree.order);
            tree.build(&mut order, 0);
            tree.order = order;
        }
        tree
    }

    fn build(&mut self, order: &mut [u32], offset: usize) -> u32 {
        let id = self.nodes.len() as u32;
        let mut node = OverlapNode {
            min: [f64::INFINITY; 3],
            max: [f64::NEG_INFINITY; 3],
            widest: 0.0,
            det_cbrt: f64::INFINITY,
            log_count2: f64::NEG_INFINITY,
            start: offset as u32,
            end: (offset + order.len()) as u32,
            right: 0,
        };
        for &i in order.iter() {
            let e = &self.items[i as usize];
            for k in 0..3 {
                node.min[k] = node.min[k].min(e.mean[k]);
                node.max[k] = node.max[k].max(e.mean[k]);
            }
            // Of each number the extreme that makes `bound` smallest.
            node.widest = node.widest.max(e.widest);
            node.det_cbrt = node.det_cbrt.min(e.det_cbrt);
            node.log_count2 = node.log_count2.max(e.log_count2);
        }
        let extent: [f64; 3] = each_axis(|k| node.max[k] - node.min[k]);
        let n = order.len();
        self.nodes.push(node);
        if n > LEAF {
            let axis = (0..3).fold(0, |a, k| if extent[k] > extent[a] { k } else { a });
            let items = self.items;
            let (low, high) = {
                // Ties by number, so that the tree is the same every time.
                order.select_nth_unstable_by(n / 2, |&i, &j| {
                    items[i as usize].mean[axis].total_cmp(&items[j as usize].mean[axis]).then(i.cmp(&j))
                });
                order.split_at_mut(n / 2)
            };
            self.build(low, offset);
            let right = self.build(high, offset + n / 2);
            self.nodes[id as usize].right = right;
        }
        id
    }

    /// The Gaussians that overlap most with `group`, as far as `reach`, best first.
    pub(crate) fn nearest(&self, group: &Ellipsoid, reach: SearchReach, neighbours: &mut Vec<(f64, u32)>) {
        self.search(group, None, usize::MAX, reach, neighbours);
    }

    /// [`Self::nearest`] to one of the Gaussians themselves, the `at`-th in the tree's order, by a look
    /// at no more than [`MOST_LEAVES`] leaves. Where so many overlap alike that no bound tells them
    /// apart (thousands at one place), those are taken that lie beside it in the tree.
    pub(crate) fn nearest_to(&self, at: usize, reach: SearchReach, neighbours: &mut Vec<(f64, u32)>) {
        let ellipsoid = &self.items[self.order[at] as usize];
        self.search(ellipsoid, Some(at as u32), MOST_LEAVES, reach, neighbours);
    }

    /// The Gaussians in the tree's order.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    fn search(
        &self,
        group: &Ellipsoid,
        home: Option<u32>,
        mut leaves: usize,
        reach: SearchReach,
        neighbours: &mut Vec<(f64, u32)>,
    ) {
        neighbours.clear();
        if self.nodes.is_empty() {
            return;
        }
        let mut stack: Vec<(f64, u32)> = vec![(self.bound(0, group), 0)];
        while let Some((bound, id)) = stack.pop() {
            if bound > reach.limit(neighbours) {
                continue;
            }
            let node = &self.nodes[id as usize];
            if node.right == 0 {
                if leaves == 0 {
                    break;
                }
                leaves -= 1;
                for &i in &self.order[node.start as usize..node.end as usize] {
                    let Some(s) = group.separation(&self.items[i as usize], reach.limit(neighbours)) else { continue };
                    // From home on, those found first stay where others are as near.
                    let tie = home.is_some() && neighbours.len() == reach.most && s == neighbours[reach.most - 1].0;
                    if !tie {
                        let at = neighbours.partition_point(|f| (f.0, f.1) < (s, i));
                        neighbours.insert(at, (s, i));
                        neighbours.truncate(reach.most);
                    }
                }
            } else {
                let (l, r) = (id + 1, node.right);
                let (bl, br) = (self.bound(l, group), self.bound(r, group));
                let left_first = match home {
                    Some(home) if bl == br => home < self.nodes[r as usize].start,
                    _ => bl <= br,
                };
                // The nearer child goes on top of the stack: what it holds tightens the limit for the other.
                if left_first {
                    stack.push((br, r));
                    stack.push((bl, l));
                } else {
                    stack.push((bl, l));
                    stack.push((br, r));
                }
            }
        }
        let limit = neighbours.first().map_or(0.0, |f| f.0 + reach.beyond);
        neighbours.retain(|f| f.0 <= limit);
    }

    /// No Gaussian of the node has a smaller separation: the distance over the widest sum of
    /// variances, and Minkowski's det(A + B)^(1/3) >= det(A)^(1/3) + det(B)^(1/3).
    fn bound(&self, id: u32, group: &Ellipsoid) -> f64 {
        let n = &self.nodes[id as usize];
        let mut d2 = 0.0;
        for k in 0..3 {
            let d = (n.min[k] - group.mean[k]).max(group.mean[k] - n.max[k]).max(0.0);
            d2 += d * d;
        }
        d2 / (group.widest + n.widest) + 3.0 * log_at_most(group.det_cbrt + n.det_cbrt) - n.log_count2 - 1e-6
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

    #[test]
    fn the_cheap_logarithm_is_below_the_exact_one_and_close_to_it() {
        for i in 0..200_000 {
            let x = libm::exp(0.007 * f64::from(i) - 700.0);
            let gap = libm::log(x) - log_at_most(x);
            assert!(gap > 0.0 && gap < 0.06, "{x}: {gap}");
        }
        for odd in [0.0, -1.0, f64::NAN, 1e-310] {
            assert_eq!(log_at_most(odd), f64::NEG_INFINITY);
        }
    }

    #[test]
    fn the_tree_finds_what_a_full_search_finds() {
        let items = ellipsoids(600);
        let tree = OverlapTree::new(&items);
        let mut neighbours = Vec::new();
        for group in ellipsoids(60) {
            let mut all: Vec<(f64, u32)> = items
                .iter()
                .enumerate()
                .map(|(i, e)| (group.separation(e, f64::INFINITY).unwrap(), i as u32))
                .collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let cut = all[0].0 + 9.0;
            let expected: Vec<_> = all.into_iter().take(12).filter(|f| f.0 <= cut).collect();
            tree.nearest(&group, SearchReach { most: 12, beyond: 9.0 }, &mut neighbours);
            assert_eq!(neighbours, expected);
        }
    }
}
