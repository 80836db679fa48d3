//! Cuts along the longest axis at balanced counts.

use super::PositionSample;
use crate::Chunk;
use particlegs_core::{Error, Result};
use serde::{Deserialize, Serialize};

/// A binary tree of cuts: every position belongs to exactly one of its blocks. Cuts are about the
/// origin of the sample that made it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KdTree {
    /// The root first; a cut's children come after it.
    nodes: Vec<CutNode>,
    blocks: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum CutNode {
    /// Positions below `at` on `axis` go to node `below`, the others to `above`.
    Cut {
        axis: usize,
        at: f32,
        below: u32,
        above: u32,
    },
    Block(u32),
}

impl KdTree {
    /// Cuts a sample into `blocks` parts of balanced counts, each cut along the longest extent of
    /// what is cut. Particles at one coordinate stay together.
    pub fn new(sample: &PositionSample, blocks: u32) -> Result<Self> {
        let count = sample.position[0].len();
        if blocks == 0 || blocks as usize > count.max(1) {
            return Err(Error::argument(format!("use 1 to {count} blocks, at most one per particle, not {blocks}")));
        }
        let mut tree = KdTree { nodes: Vec::new(), blocks: 0 };
        let mut order: Vec<u32> = (0..count as u32).collect();
        tree.grow(sample, &mut order, blocks)?;
        Ok(tree)
    }

    /// Adds the nodes of `order`'s particles in `blocks` blocks; gives the first one's number.
    fn grow(&mut self, sample: &PositionSample, order: &mut [u32], blocks: u32) -> Result<u32> {
        let here = self.nodes.len() as u32;
        // Its place is taken before those of its children, which must come after it.
        self.nodes.push(CutNode::Block(self.blocks));
        if blocks == 1 {
            self.blocks += 1;
            return Ok(here);
        }
        let axis = longest(sample, order);
        let column = &sample.position[axis];
        let lower = blocks / 2;
        let wanted = (order.len() as f64 * f64::from(lower) / f64::from(blocks)).round() as usize;
        // Equal coordinates stay together, so they are cut before or after the one in the middle.
        let rank = wanted.clamp(1, order.len() - 1);
        let (_, &mut middle, _) = order.select_nth_unstable_by(rank, |a, b| by(column, *a, *b));
        let at = cut(column, order, column[middle as usize])
            .ok_or_else(|| Error::argument("there are fewer distinct positions than blocks: use fewer blocks"))?;
        // Of equal order whatever the sort did: the halves' own order does not matter.
        order.sort_unstable_by(|a, b| (column[*a as usize] >= at).cmp(&(column[*b as usize] >= at)));
        let split = order.partition_point(|&i| column[i as usize] < at);
        let (below, above) = order.split_at_mut(split);
        // Every block gets a particle of the sample at least.
        if below.len() < lower as usize || above.len() < (blocks - lower) as usize {
            return Err(Error::argument("too many particles share one position: use fewer blocks"));
        }
        let below = self.grow(sample, below, lower)?;
        let above = self.grow(sample, above, blocks - lower)?;
        self.nodes[here as usize] = CutNode::Cut { axis, at, below, above };
        Ok(here)
    }

    /// Number of blocks.
    pub fn blocks(&self) -> u32 {
        self.blocks
    }

    /// The block of a position about the tree's origin.
    pub fn block_of(&self, position: [f32; 3]) -> u32 {
        let mut node = 0;
        loop {
            match self.nodes[node as usize] {
                CutNode::Block(block) => return block,
                CutNode::Cut { axis, at, below, above } => node = if position[axis] < at { below } else { above },
            }
        }
    }

    /// The block of each particle of a chunk.
    pub fn blocks_of(&self, chunk: &Chunk<'_>) -> impl Iterator<Item = u32> {
        (0..chunk.len()).map(|i| self.block_of(chunk.position.map(|c| c[i])))
    }

    /// The blocks that a box (its corners included) reaches into, rising.
    pub fn blocks_in(&self, min: [f32; 3], max: [f32; 3]) -> Vec<u32> {
        let (mut blocks, mut open) = (Vec::new(), vec![0u32]);
        while let Some(node) = open.pop() {
            match self.nodes[node as usize] {
                CutNode::Block(block) => blocks.push(block),
                CutNode::Cut { axis, at, below, above } => {
                    open.extend((max[axis] >= at).then_some(above));
                    open.extend((min[axis] < at).then_some(below));
                }
            }
        }
        blocks.sort_unstable();
        blocks
    }

    /// Whether [`KdTree::block_of`] can walk the tree: one that was read from a file may be damaged.
    pub fn is_sound(&self) -> bool {
        let blocks = self.nodes.iter().filter_map(|n| if let CutNode::Block(b) = n { Some(*b) } else { None });
        // Every node but the root has one parent: else walks would take time beyond measure.
        let mut parents = vec![0u32; self.nodes.len()];
        for node in &self.nodes {
            if let CutNode::Cut { below, above, .. } = node {
                for child in [*below, *above] {
                    parents.get_mut(child as usize).into_iter().for_each(|p| *p += 1);
                }
            }
        }
        if parents.iter().skip(1).any(|p| *p != 1) {
            return false;
        }
        let children = |(i, n): (usize, &CutNode)| match n {
            CutNode::Block(_) => true,
            CutNode::Cut { axis, at, below, above } => {
                let inside = |c: u32| (c as usize) > i && (c as usize) < self.nodes.len();
                *axis < 3 && at.is_finite() && inside(*below) && inside(*above)
            }
        };
        self.nodes.iter().enumerate().all(children) && blocks.eq(0..self.blocks) && self.blocks > 0
    }
}

fn by(column: &[f32], a: u32, b: u32) -> std::cmp::Ordering {
    column[a as usize].total_cmp(&column[b as usize])
}

/// The axis of the largest extent, of equal ones the first.
fn longest(sample: &PositionSample, order: &[u32]) -> usize {
    let extent = [0, 1, 2].map(|k| {
        let column = order.iter().map(|&i| sample.position[k][i as usize]);
        let (lo, hi) = column.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        hi - lo
    });
    (1..3).fold(0, |best, k| if extent[k] > extent[best] { k } else { best })
}

/// `middle` where something lies below it, else the next coordinate above; `None` where all are one.
fn cut(column: &[f32], order: &[u32], middle: f32) -> Option<f32> {
    let values = || order.iter().map(|&i| column[i as usize]);
    if values().any(|v| v < middle) {
        return Some(middle);
    }
    values().filter(|v| *v > middle).min_by(f32::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    fn cloud(n: usize) -> PositionSample {
        let mut random = Random::new(3, 7, 0);
        let mut column = |scale: f32| (0..n).map(|_| random.uniform() as f32 * scale).collect::<Vec<f32>>();
        PositionSample { position: [column(1.0), column(4.0), column(2.0)] }
    }

    fn counts(tree: &KdTree, s: &PositionSample) -> Vec<usize> {
        let mut counts = vec![0; tree.blocks() as usize];
        for i in 0..s.position[0].len() {
            counts[tree.block_of([0, 1, 2].map(|k| s.position[k][i])) as usize] += 1;
        }
        counts
    }

    #[test]
    fn any_number_of_blocks_is_balanced() {
        let s = cloud(10_007);
        for blocks in [1, 2, 3, 7, 8, 64] {
            let tree = KdTree::new(&s, blocks).unwrap();
            assert!(tree.is_sound());
            let counts = counts(&tree, &s);
            let fair = 10_007 / blocks as usize;
            assert!(counts.iter().all(|c| c.abs_diff(fair) <= 3), "{blocks}: {counts:?}");
        }
    }

    #[test]
    fn boxes_find_the_blocks_of_what_they_hold() {
        let s = cloud(5_000);
        let tree = KdTree::new(&s, 13).unwrap();
        for part in 0..50 {
            let points: Vec<[f32; 3]> =
                (part * 100..part * 100 + 3).map(|i| [0, 1, 2].map(|k| s.position[k][i])).collect();
            let ends = |f: fn(f32, f32) -> f32| [0, 1, 2].map(|k| points.iter().map(|p| p[k]).reduce(f).unwrap());
            let blocks = tree.blocks_in(ends(f32::min), ends(f32::max));
            assert!(points.iter().all(|p| blocks.contains(&tree.block_of(*p))));
            assert_eq!(tree.blocks_in(points[0], points[0]), [tree.block_of(points[0])]);
        }
        assert_eq!(tree.blocks_in([-1.0; 3], [5.0; 3]).len(), 13);
    }

    #[test]
    fn one_particle_a_block_and_not_more_blocks() {
        let s = cloud(5);
        assert_eq!(counts(&KdTree::new(&s, 5).unwrap(), &s), [1; 5]);
        assert!(KdTree::new(&s, 6).is_err() && KdTree::new(&s, 0).is_err());
        let one_place = PositionSample { position: [0, 1, 2].map(|_| vec![1.0; 9]) };
        assert!(KdTree::new(&one_place, 2).is_err());
        assert!(KdTree::new(&one_place, 1).is_ok());
    }

    #[test]
    fn broken_trees_are_told() {
        let tree = KdTree::new(&cloud(100), 4).unwrap();
        let text = serde_json::to_string(&tree).unwrap();
        assert_eq!(serde_json::from_str::<KdTree>(&text).unwrap(), tree);
        for (from, to) in [
            ("\"axis\":1", "\"axis\":3"),
            ("\"below\":1", "\"below\":0"),
            ("\"above\":4", "\"above\":1"),
            ("\"blocks\":4", "\"blocks\":5"),
        ] {
            assert!(text.contains(from), "{text}");
            assert!(!serde_json::from_str::<KdTree>(&text.replacen(from, to, 1)).unwrap().is_sound());
        }
    }
}
