//! The order of the Gaussians and the cells that their means lie in: boxes halved along their
//! longest edge until each holds one mean; and the splits of the Gaussians of large nodes, and of points, into the halves
//! of a cell, coded (docs/format.md, section 5).

use super::OutOfRange;
use super::header::BlockHeader;
use super::rans::Coder;
use super::symbols::SymbolModel;
use crate::math::each_axis;
use crate::parallel;
use crate::space::Bounds;
use std::convert::Infallible;

/// Halvings of an axis at most.
pub(crate) const DEEPEST: u8 = 40;

/// A box of the tree: bounds halved `depth[k]` times along axis k, number `index[k]` of those.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TreeCell {
    pub index: [u64; 3],
    pub depth: [u8; 3],
}

impl TreeCell {
    #[inline(always)]
    pub(crate) fn widths(&self, extent: [f64; 3]) -> [f64; 3] {
        each_axis(|k| extent[k] * power_of_half(self.depth[k]))
    }

    /// The axis to halve: the longest edge, x before y before z; `None` where all are done.
    #[inline(always)]
    pub(crate) fn axis(&self, extent: [f64; 3]) -> Option<usize> {
        let w: [f64; 3] =
            each_axis(|k| if self.depth[k] < DEEPEST { extent[k] * power_of_half(self.depth[k]) } else { 0.0 });
        let (best, width) = if w[1] > w[0] { (1, w[1]) } else { (0, w[0]) };
        let (best, width) = if w[2] > width { (2, w[2]) } else { (best, width) };
        (width > 0.0).then_some(best)
    }

    /// The lower (0) or upper (1) half.
    #[inline(always)]
    pub(crate) fn half(&self, axis: usize, side: u64) -> TreeCell {
        let mut c = *self;
        c.index[axis] = 2 * c.index[axis] + side;
        c.depth[axis] += 1;
        c
    }

    #[inline(always)]
    pub(crate) fn level(&self) -> i32 {
        self.depth.iter().map(|&d| i32::from(d)).sum()
    }

    /// World coordinate of the point a fraction `f` along the cell's axis `k`.
    #[inline(always)]
    pub(crate) fn point(&self, bounds: &Bounds, extent: [f64; 3], k: usize, f: f64) -> f64 {
        bounds.min[k] + extent[k] * ((self.index[k] as f64 + f) * power_of_half(self.depth[k]))
    }
}

/// 2^-d, exactly.
#[inline(always)]
fn power_of_half(d: u8) -> f64 {
    f64::from_bits((1023 - u64::from(d)) << 52)
}

/// A node that waits for its turn: its box, its Gaussians, and how its parent fell apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplitNode {
    pub cell: TreeCell,
    pub count: u32,
    /// 0: all of the parent's are here (or this is the root); 1: fewer than half; 2: half or more.
    pub share: u8,
}

impl SplitNode {
    pub(crate) fn root(count: u32) -> SplitNode {
        SplitNode { cell: TreeCell::default(), count, share: 0 }
    }

    /// The two halves after `low` of the Gaussians fell into the lower.
    #[inline(always)]
    pub(crate) fn halves(&self, axis: usize, low: u32) -> [SplitNode; 2] {
        let side = |side: u64, count: u32| SplitNode {
            cell: self.cell.half(axis, side),
            count,
            share: if count == self.count { 0 } else { 1 + u8::from(2 * u64::from(count) >= u64::from(self.count)) },
        };
        [side(0, low), side(1, self.count - low)]
    }
}

/// Gaussians of a segment at most, unless they cannot be told apart: segments are coded on their
/// own, so that several threads read a large block.
pub(crate) const SEGMENT: u32 = 1 << 16;

/// The nodes of each segment: nodes of more than [`SEGMENT`] Gaussians are split (`split` gets the
/// node, its axis and its first Gaussian, and says how many fall into the lower half); what is left
/// is joined, in order, as long as a segment has room.
pub(crate) fn segments<E>(
    count: u32,
    extent: [f64; 3],
    mut split: impl FnMut(&SplitNode, usize, usize) -> Result<u32, E>,
) -> Result<Vec<Vec<SplitNode>>, E> {
    let mut out: Vec<Vec<SplitNode>> = Vec::new();
    let (mut start, mut filled) = (0, 0u64);
    walk(&[SplitNode::root(count)], extent, SEGMENT, |node, axis| {
        if let Some(axis) = axis {
            return split(node, axis, start);
        }
        start += node.count as usize;
        filled += u64::from(node.count);
        match out.last_mut().filter(|_| filled <= u64::from(SEGMENT)) {
            Some(last) => last.push(*node),
            None => {
                out.push(vec![*node]);
                filled = u64::from(node.count);
            }
        }
        Ok(0)
    })?;
    Ok(out)
}

/// Goes from nodes down to those of at most `most` Gaussians, or that cannot be halved, the lower half first. `visit` gets a
/// node and the axis along which it falls apart, and says how many then fall into the lower half.
pub(super) fn walk<E>(
    nodes: &[SplitNode],
    extent: [f64; 3],
    most: u32,
    mut visit: impl FnMut(&SplitNode, Option<usize>) -> Result<u32, E>,
) -> Result<(), E> {
    let mut stack: Vec<SplitNode> = nodes.iter().rev().copied().collect();
    while let Some(node) = stack.pop() {
        let axis = node.cell.axis(extent).filter(|_| node.count > most);
        let low = visit(&node, axis)?;
        let halves = axis.map(|axis| node.halves(axis, low));
        stack.extend(halves.into_iter().flatten().rev().filter(|n| n.count > 0));
    }
    Ok(())
}

pub(crate) fn gaussians(nodes: &[SplitNode]) -> usize {
    nodes.iter().map(|n| n.count as usize).sum()
}

/// Takes a slice apart into pieces of these lengths, as far as it goes.
pub(crate) fn pieces<T>(mut slice: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    lengths.map(|n| slice.split_off_mut(..n.min(slice.len())).unwrap_or_default()).collect()
}

/// The tree of a set of means: what the walk over it will ask for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    /// Gaussians in the order of the leaves.
    pub order: Vec<u32>,
    /// The leaf of each Gaussian, in `order`.
    pub cells: Vec<TreeCell>,
    /// Count of each node's Gaussians that fall into its lower half, of the nodes above the segments.
    pub trunk: Vec<u32>,
    pub segments: Vec<Segment>,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Segment {
    pub nodes: Vec<SplitNode>,
    /// Count of each node's Gaussians that fall into its lower half, nodes in the order of the walk.
    pub splits: Vec<u32>,
}

impl Tree {
    /// Builds it. Means outside the bounds count as on their faces.
    pub(crate) fn build(mean: &[Vec<f64>; 3], bounds: &Bounds) -> Tree {
        let extent = bounds.extent();
        let n = mean[0].len();
        let mut order: Vec<u32> = (0..n as u32).collect();
        let mut cells = vec![TreeCell::default(); n];
        // Whole coordinates of 2^-40 of the extent: comparing them is exact.
        let fine: [Vec<u64>; 3] = each_axis(|k| parallel::map_range(n, |i| grid(mean[k][i], bounds.min[k], extent[k])));
        let part = |order: &mut [u32], node: &SplitNode, axis: usize| {
            // This bit of a coordinate says in which half of the cell it lies.
            let bit = DEEPEST - 1 - node.cell.depth[axis];
            partition(order, |i| (fine[axis][i as usize] >> bit) & 1 == 0) as u32
        };
        let mut trunk = Vec::new();
        let nodes = segments(n as u32, extent, |node, axis, start| {
            let low = part(&mut order[start..start + node.count as usize], node, axis);
            trunk.push(low);
            Ok::<u32, Infallible>(low)
        });
        let Ok(nodes) = nodes;
        let lengths = || nodes.iter().map(|n| gaussians(n));
        let work = nodes.iter().zip(pieces(&mut order, lengths())).zip(pieces(&mut cells, lengths()));
        let segments = parallel::map(work, |((nodes, order), cells)| Segment {
            nodes: nodes.clone(),
            splits: sort(nodes, order, cells, extent, part),
        });
        Tree { order, cells, trunk, segments }
    }

    pub(crate) fn lengths(&self) -> Vec<usize> {
        self.segments.iter().map(|s| gaussians(&s.nodes)).collect()
    }
}

/// Sorts the Gaussians of some nodes into their leaves; returns the splits.
fn sort(
    nodes: &[SplitNode],
    order: &mut [u32],
    cells: &mut [TreeCell],
    extent: [f64; 3],
    part: impl Fn(&mut [u32], &SplitNode, usize) -> u32,
) -> Vec<u32> {
    let (mut splits, mut start) = (Vec::new(), 0);
    let Ok(()) = walk(nodes, extent, 1, |node, axis| {
        let end = start + node.count as usize;
        let Some(axis) = axis else {
            cells[start..end].fill(node.cell);
            start = end;
            return Ok::<u32, Infallible>(0);
        };
        splits.push(part(&mut order[start..end], node, axis));
        Ok(splits[splits.len() - 1])
    });
    splits
}

/// A coordinate in 2^-40 of the extent, within 0 .. 2^40.
fn grid(v: f64, min: f64, extent: f64) -> u64 {
    let cells = (1u64 << DEEPEST) as f64;
    let x = if extent > 0.0 { (v - min) / extent * cells } else { 0.0 };
    (x.max(0.0) as u64).min((1 << DEEPEST) - 1)
}

/// Stable partition; returns how many pass.
fn partition(order: &mut [u32], passes: impl Fn(u32) -> bool) -> usize {
    let mut few = [0; 64];
    let mut many = Vec::new();
    let rest = if order.len() <= few.len() {
        &mut few[..order.len()]
    } else {
        many.resize(order.len(), 0);
        &mut many[..]
    };
    let mut low = 0;
    for i in 0..order.len() {
        // Written to both sides: nobody can predict a branch here.
        let (v, high) = (order[i], i - low);
        (order[low], rest[high]) = (v, v);
        low += usize::from(passes(v));
    }
    let high = order.len() - low;
    order[low..].copy_from_slice(&rest[..high]);
    low
}

/// Models of how nodes fall apart: by count (2 to 15, then powers of two) and share.
pub(super) struct Splits(Vec<[SymbolModel<16>; 3]>);

impl Splits {
    pub(super) fn new() -> Splits {
        let split = |n: u32| {
            // Both ends of a split are likelier than the middle.
            let top = if n < 16 { n as usize } else { 15 };
            let weights = std::array::from_fn(|l| {
                if l > top {
                    0
                } else if l == 0 || l == top {
                    4
                } else {
                    1
                }
            });
            [0, 1, 2].map(|_| SymbolModel::from_weights(weights))
        };
        Splits((2..16).chain([16, 32, 64, 128, 256]).map(split).collect())
    }

    #[inline(always)]
    pub(super) fn code(&mut self, c: &mut impl Coder, node: &SplitNode, low: u32) -> Result<u32, OutOfRange> {
        let n = node.count;
        if n < 16 {
            let low = self.0[n as usize - 2][node.share as usize].code(c, low.min(n) as usize) as u32;
            return if low <= n { Ok(low) } else { Err(OutOfRange) };
        }
        let class = 14 + (n.ilog2() - 4).min(4) as usize;
        let n1 = u64::from(n) + 1;
        let sixteenth = (u64::from(low.min(n)) * 16 / n1) as usize;
        let sixteenth = self.0[class][node.share as usize].code(c, sixteenth) as u64;
        let first = (sixteenth * n1).div_ceil(16);
        let size = ((sixteenth + 1) * n1).div_ceil(16) - first;
        Ok(first as u32 + long_uniform(c, size, u64::from(low).saturating_sub(first)) as u32)
    }
}

/// A value in `0 .. n`, `n` up to 2^60: the upper part as one uniform of at most 2^10, the rest plain.
#[inline(always)]
pub(super) fn long_uniform(c: &mut impl Coder, n: u64, value: u64) -> u64 {
    let low = (64 - n.leading_zeros()).saturating_sub(10);
    let high = c.uniform(((n - 1) >> low) as u32 + 1, (value >> low) as u32);
    // The plain bits below the last upper part may lead beyond the end, which the format cuts off (section 8).
    ((u64::from(high) << low) | c.long_bits(low, value & ((1 << low) - 1))).min(n - 1)
}

/// The splits above the segments, and with them the segments' nodes. The encoder's `lows` say how many Gaussians
/// fall into each node's lower half; the decoder has none.
pub(super) fn trunk(c: &mut impl Coder, header: &BlockHeader, lows: &[u32]) -> Result<Vec<Vec<SplitNode>>, OutOfRange> {
    let (mut splits, mut lows) = (Splits::new(), lows.iter());
    segments(header.gaussians, header.bounds.extent(), |node, _, _| {
        splits.code(c, node, lows.next().copied().unwrap_or(0))
    })
}
