//! The encoder's side of a walk over levels: a segment's tree, with the numbers of its nodes.

use super::fine::Leaf;
use super::levels::{CountSums, Division, LeafGaussian, NodeHalves, NodeSource};
use super::tree::{SplitNode, TreeCell};

#[derive(Clone, Copy, Debug)]
enum Fork {
    Leaf(u32),
    /// All in one half (whether it is the upper one): the node that it is.
    One(bool, u32),
    Two([u32; 2]),
}

/// The tree of a segment, whatever the precision. Nodes stand before their halves, roots first.
#[derive(Clone, Debug)]
pub(crate) struct SegmentTree {
    forks: Vec<Fork>,
    roots: usize,
}

impl SegmentTree {
    /// Of a segment's nodes, and the cells of its Gaussians in the order of the tree.
    pub(crate) fn new(nodes: &[SplitNode], cells: &[TreeCell], extent: [f64; 3]) -> Self {
        let mut forks = vec![Fork::Leaf(0); nodes.len()];
        let mut start = 0u32;
        let mut stack = Vec::with_capacity(nodes.len());
        for (i, node) in nodes.iter().enumerate() {
            stack.push((i, node.cell, start, start + node.count));
            start += node.count;
        }
        while let Some((number, cell, from, to)) = stack.pop() {
            if to - from == 1 {
                forks[number] = Fork::Leaf(from);
                continue;
            }
            let axis = cell.axis(extent);
            let middle = match axis {
                // The bit of a leaf's index that says which half it lies in.
                Some(k) => {
                    let lower = |leaf: &TreeCell| leaf.index[k] >> (leaf.depth[k] - cell.depth[k] - 1) & 1 == 0;
                    from + cells[from as usize..to as usize].partition_point(lower) as u32
                }
                // Gaussians in one place: half of them each.
                None => from + (to - from) / 2,
            };
            let half = |side: u64| axis.map_or(cell, |axis| cell.half(axis, side));
            let first = forks.len();
            if middle == from || middle == to {
                forks[number] = Fork::One(middle == from, first as u32);
                forks.push(Fork::Leaf(0));
                stack.push((first, half(u64::from(middle == from)), from, to));
            } else {
                forks[number] = Fork::Two([first as u32, first as u32 + 1]);
                forks.extend([Fork::Leaf(0); 2]);
                stack.push((first, half(0), from, middle));
                stack.push((first + 1, half(1), middle, to));
            }
        }
        SegmentTree { forks, roots: nodes.len() }
    }
}

/// A segment's tree with the numbers of a precision.
pub(crate) struct SegmentSource<'a> {
    tree: &'a SegmentTree,
    leaves: &'a [Leaf],
    /// Log count and mean log mass of each node, whole steps.
    counts: Vec<i32>,
    masses: Vec<i32>,
    /// Nodes of the tree by their numbers in the walk.
    numbers: Vec<u32>,
}

impl<'a> SegmentSource<'a> {
    /// Of the Gaussians on half steps, log counts in whole steps of `count_step`.
    pub(crate) fn new(tree: &'a SegmentTree, leaves: &'a [Leaf], count_step: f32) -> Self {
        let sums = CountSums::new(f64::from(count_step));
        let (mut counts, mut masses) = (vec![0; tree.forks.len()], vec![0; tree.forks.len()]);
        // Nodes stand before their halves: backwards, the halves of each are done.
        for (i, fork) in tree.forks.iter().enumerate().rev() {
            (counts[i], masses[i]) = match *fork {
                Fork::Leaf(leaf) => (leaves[leaf as usize].m >> 1, leaves[leaf as usize].w >> 1),
                Fork::One(_, below) => (counts[below as usize], masses[below as usize]),
                Fork::Two(halves) => {
                    // The mean is rounded down, as the decoder halves the difference (section 6).
                    let [a, b] = halves.map(|h| masses[h as usize]);
                    (sums.whole(halves.map(|h| counts[h as usize])), b + ((a - b) >> 1))
                }
            };
        }
        SegmentSource { tree, leaves, counts, masses, numbers: Vec::new() }
    }

    /// Calls `divided` with the division of each node that falls into two halves, `single` with each Gaussian's number,
    /// its log count and that of the node above it.
    pub(crate) fn visit(&self, mut divided: impl FnMut(&Division), mut single: impl FnMut(usize, i32, i32)) {
        let mut above: Vec<i32> = self.counts.clone();
        for (i, fork) in self.tree.forks.iter().enumerate() {
            match *fork {
                Fork::Leaf(leaf) => single(leaf as usize, self.counts[i], above[i]),
                Fork::One(_, below) => above[below as usize] = above[i],
                Fork::Two(halves) => {
                    halves.iter().for_each(|&h| above[h as usize] = self.counts[i]);
                    divided(&self.division_of(halves));
                }
            }
        }
    }

    fn division_of(&self, halves: [u32; 2]) -> Division {
        let [a, b] = halves.map(|h| h as usize);
        let single = |node: usize| matches!(self.tree.forks[node], Fork::Leaf(_));
        let kind = match (single(a), single(b)) {
            (true, true) => NodeHalves::Singles,
            (true, false) => NodeHalves::Single(true),
            (false, true) => NodeHalves::Single(false),
            (false, false) => NodeHalves::Several,
        };
        let (count, mass) = (self.counts[a] - self.counts[b], self.masses[a] - self.masses[b]);
        Division { halves: kind, count, mass }
    }
}

impl NodeSource for SegmentSource<'_> {
    fn root(&mut self, node: usize) -> [i32; 2] {
        if node == 0 {
            self.numbers = (0..self.tree.roots as u32).collect();
        }
        [self.counts[node], self.masses[node]]
    }

    fn division(&mut self, node: usize) -> Division {
        match self.tree.forks[self.numbers[node] as usize] {
            Fork::One(upper, below) => {
                self.numbers[node] = below;
                Division { halves: NodeHalves::One(upper), ..Division::default() }
            }
            Fork::Two(halves) => {
                self.numbers.extend(halves);
                self.division_of(halves)
            }
            Fork::Leaf(_) => Division::default(),
        }
    }

    fn single(&mut self, node: usize) -> LeafGaussian {
        let Fork::Leaf(leaf) = self.tree.forks[self.numbers[node] as usize] else {
            return LeafGaussian::NONE;
        };
        let leaf = &self.leaves[leaf as usize];
        LeafGaussian { size: leaf.t >> 1, place: leaf.place, levels: leaf.levels }
    }
}
