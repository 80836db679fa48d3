//! The order of the Gaussians and the cells that their means lie in: boxes halved along their
//! longest edge until each holds one mean (docs/format.md, section 5).

use crate::particles::Bounds;

/// Halvings of an axis at most.
pub(crate) const DEEPEST: u8 = 40;

/// A box of the tree: bounds halved `depth[k]` times along axis k, number `index[k]` of those.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Cell {
    pub index: [u64; 3],
    pub depth: [u8; 3],
}

impl Cell {
    /// Edge lengths.
    pub(crate) fn widths(&self, extent: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| extent[k] * power_of_half(self.depth[k]))
    }

    /// The axis to halve: the longest edge, x before y before z; `None` where all are done.
    pub(crate) fn axis(&self, extent: [f64; 3]) -> Option<usize> {
        let w = self.widths(extent);
        (0..3).filter(|&k| w[k] > 0.0 && self.depth[k] < DEEPEST).fold(None, |best, k| match best {
            Some(b) if w[b] >= w[k] => best,
            _ => Some(k),
        })
    }

    /// The lower (0) or upper (1) half.
    pub(crate) fn half(&self, axis: usize, side: u64) -> Cell {
        let mut c = *self;
        c.index[axis] = 2 * c.index[axis] + side;
        c.depth[axis] += 1;
        c
    }

    /// Halvings in all.
    pub(crate) fn level(&self) -> i32 {
        self.depth.iter().map(|&d| i32::from(d)).sum()
    }

    /// World coordinate of the point a fraction `f` along the cell's axis `k`.
    #[inline]
    pub(crate) fn point(&self, bounds: &Bounds, extent: [f64; 3], k: usize, f: f64) -> f64 {
        bounds.min[k] + extent[k] * ((self.index[k] as f64 + f) * power_of_half(self.depth[k]))
    }
}

/// 2^-d, exactly.
#[inline]
fn power_of_half(d: u8) -> f64 {
    f64::from_bits((1023 - u64::from(d)) << 52)
}

/// A node that waits for its turn: its box, its Gaussians, and how its parent fell apart.
#[derive(Clone, Copy)]
pub(crate) struct Node {
    pub cell: Cell,
    pub count: u32,
    /// 0: all of the parent's are here (or this is the root); 1: fewer than half; 2: half or more.
    pub share: u8,
}

impl Node {
    /// The two halves after `low` of the Gaussians fell into the lower.
    pub(crate) fn halves(&self, axis: usize, low: u32) -> [Node; 2] {
        let side = |side: u64, count: u32| Node {
            cell: self.cell.half(axis, side),
            count,
            share: if count == self.count { 0 } else { 1 + u8::from(2 * u64::from(count) >= u64::from(self.count)) },
        };
        [side(0, low), side(1, self.count - low)]
    }
}

/// The tree of a set of means: what the walk over it will ask for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    /// Gaussians in the order of the leaves.
    pub order: Vec<u32>,
    /// How many of each node's fall into its lower half, nodes in the order of the walk.
    pub splits: Vec<u32>,
    /// The leaf of each Gaussian, in `order`.
    pub cells: Vec<Cell>,
}

impl Tree {
    /// Builds it. Means outside the bounds count as on their faces.
    pub(crate) fn build(mean: &[Vec<f64>; 3], bounds: &Bounds) -> Tree {
        let extent = bounds.extent();
        let n = mean[0].len();
        let mut tree = Tree { order: (0..n as u32).collect(), splits: Vec::new(), cells: Vec::with_capacity(n) };
        // Whole coordinates of 2^-40 of the extent: comparing them is exact.
        let fine: [Vec<u64>; 3] =
            std::array::from_fn(|k| mean[k].iter().map(|&v| grid(v, bounds.min[k], extent[k])).collect());
        let mut stack = vec![(0usize, Node { cell: Cell::default(), count: n as u32, share: 0 })];
        while let Some((start, node)) = stack.pop() {
            let end = start + node.count as usize;
            match node.cell.axis(extent).filter(|_| node.count > 1) {
                None => tree.cells.extend((start..end).map(|_| node.cell)),
                Some(axis) => {
                    let bit = DEEPEST - 1 - node.cell.depth[axis];
                    let low = partition(&mut tree.order[start..end], |i| (fine[axis][i as usize] >> bit) & 1 == 0);
                    tree.splits.push(low as u32);
                    let [a, b] = node.halves(axis, low as u32);
                    if b.count > 0 {
                        stack.push((start + low, b));
                    }
                    if a.count > 0 {
                        stack.push((start, a));
                    }
                }
            }
        }
        tree
    }
}

/// A coordinate in 2^-40 of the extent, within 0 .. 2^40.
fn grid(v: f64, min: f64, extent: f64) -> u64 {
    let cells = (1u64 << DEEPEST) as f64;
    let x = if extent > 0.0 { (v - min) / extent * cells } else { 0.0 };
    (x.max(0.0) as u64).min((1 << DEEPEST) - 1)
}

/// Stable partition; returns how many pass.
fn partition(order: &mut [u32], passes: impl Fn(u32) -> bool) -> usize {
    let mut rest = Vec::new();
    let mut low = 0;
    for i in 0..order.len() {
        let v = order[i];
        if passes(v) {
            order[low] = v;
            low += 1;
        } else {
            rest.push(v);
        }
    }
    order[low..].copy_from_slice(&rest);
    low
}
