//! A segment's Gaussians from coarse to fine: the tree of cells, the heaviest and densest nodes first, with the count of
//! every node; the size of each Gaussian and where in its cell it lies, roughly (docs/format.md, section 6). A walk may
//! stop after any level: what is known by then is a mixture of fewer, larger Gaussians.

use super::OutOfRange;
use super::header::{BlockHeader, limited};
use super::rans::Coder;
use super::symbols::{Residual, SymbolModel};
use super::tree::{SplitNode, TreeCell};
use crate::math::exp;

/// Levels of a walk: the last takes all that is left.
pub(crate) const LEVELS: usize = 256;
/// Levels to a factor of e in a node's weight.
const LEVELS_TO_E: f64 = 6.0;
/// Gain of the logarithm of a node's weight by a halving of its cell: of equal counts the smaller cell comes first.
const HALVING: f64 = 0.16;
/// Magnitude of whole steps of a Gaussian's numbers at most, and of a node's.
pub(crate) const MOST_STEPS: i32 = 1 << 20;
const MOST_NODE_STEPS: i32 = 1 << 22;
/// Bits of the plain numbers of a root.
const ROOT_BITS: u32 = 24;
/// Classes of how many Gaussians a node's count stands for, by octaves.
const CLASSES: usize = 12;
/// First weights of the models of halves, by class, for the symbols of [`NodeHalves`]: heavy nodes hold several
/// Gaussians in either half, light ones single ones (frequencies of an N-body box of 2 M particles at ratio 300).
const HALVES: [[u32; 4]; 9] = [
    [18, 12, 1, 1],
    [18, 12, 1, 1],
    [20, 8, 2, 1],
    [20, 6, 4, 1],
    [17, 4, 7, 4],
    [12, 2, 8, 9],
    [7, 1, 7, 17],
    [3, 1, 5, 25],
    [2, 1, 2, 60],
];
/// Bits at most that say where a Gaussian lies along an axis of its cell, before its shape is known.
const MOST_PLACE_BITS: u32 = 6;

/// Division of a node's Gaussians among its halves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum NodeHalves {
    /// All into one; whether it is the upper.
    One(bool),
    /// One Gaussian into each.
    #[default]
    Singles,
    /// One Gaussian into one half and several into the other; whether these are in the upper.
    Single(bool),
    /// Several into each.
    Several,
}

/// The encoder's numbers of a node; where two halves hold Gaussians, the lower one's log count and mean log mass minus
/// the upper one's, whole steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Division {
    pub halves: NodeHalves,
    pub count: i32,
    pub mass: i32,
}

/// A Gaussian as the encoder has it: log size in whole steps, and its place along the axes of its cell in quarter levels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafGaussian {
    pub size: i32,
    pub place: [u64; 3],
    pub levels: [u64; 3],
}

impl LeafGaussian {
    /// Placeholder of the decoder.
    pub const NONE: LeafGaussian = LeafGaussian { size: 0, place: [0; 3], levels: [1; 3] };
}

/// The encoder's knowledge of the nodes, numbered as the walk numbers them; the decoder has none.
pub(crate) trait NodeSource {
    /// Log count and mean log mass of a root, whole steps.
    fn root(&mut self, _node: usize) -> [i32; 2] {
        [0; 2]
    }

    /// Division of a node of several Gaussians. Where both halves hold some, they are numbered next, the lower one
    /// first; a half that holds all keeps the node's number.
    fn division(&mut self, _node: usize) -> Division {
        Division::default()
    }

    fn single(&mut self, _node: usize) -> LeafGaussian {
        LeafGaussian::NONE
    }
}

pub(crate) struct NoSource;

impl NodeSource for NoSource {}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum NodeContent {
    /// It holds several Gaussians.
    Several,
    /// It holds one.
    Single,
    /// Its halves, as numbers of nodes.
    Halves([u32; 2]),
    /// It holds one, of this log size in whole steps, in part `place` of `2^bits` along each axis of its cell.
    Gaussian { size: i32, bits: [u8; 3], place: [u8; 3] },
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct TreeNode {
    pub cell: TreeCell,
    /// Log count, whole steps; in shaded blocks log depth.
    pub count: i32,
    /// Mean log mass a particle, relative, whole steps; in shaded blocks log grey level.
    pub mass: i32,
    pub below: NodeContent,
    /// Log count of the node that it is a half of.
    parent: i32,
    root: u32,
    /// Whether it holds all Gaussians of the cell that its own is a half of.
    whole: bool,
}

/// A walk over the nodes of a segment, level by level.
pub(crate) struct LevelWalk<'a> {
    header: &'a BlockHeader,
    extent: [f64; 3],
    /// Count of Gaussians of each root, and its log count.
    roots: Vec<(f64, i32)>,
    pub nodes: Vec<TreeNode>,
    /// Nodes that wait for their level.
    waiting: Vec<Vec<u32>>,
    /// The level, and how many of its nodes are done.
    level: usize,
    done: usize,
    /// Logarithm of the greatest weight of a root.
    top: f64,
    /// Gaussians that the nodes so far hold at least, that there are, and that there may be.
    least: usize,
    total: usize,
    most: usize,
    sums: CountSums,
    models: LevelModels,
}

struct LevelModels {
    halves: Vec<SymbolModel<4>>,
    count: [Residual<64>; 3],
    mass: Residual<32>,
    size: Residual<32>,
}

impl<'a> LevelWalk<'a> {
    /// A walk that begins at the nodes of a segment: their numbers come first.
    pub(crate) fn new(
        c: &mut impl Coder,
        header: &'a BlockHeader,
        nodes: &[SplitNode],
        source: &mut impl NodeSource,
    ) -> Result<Self, OutOfRange> {
        let mut walk = LevelWalk {
            header,
            extent: header.bounds.extent(),
            roots: Vec::with_capacity(nodes.len()),
            nodes: Vec::with_capacity(nodes.len()),
            waiting: vec![Vec::new(); LEVELS],
            level: 0,
            done: 0,
            top: f64::NEG_INFINITY,
            least: 0,
            total: 0,
            most: 0,
            sums: CountSums::new(f64::from(header.steps[2])),
            models: LevelModels::new(header),
        };
        for (number, node) in nodes.iter().enumerate() {
            let [count, mass] = source.root(number);
            let count = plain(c, count)?;
            let mass = if header.has_w() { plain(c, mass)? } else { 0 };
            walk.roots.push((f64::from(node.count), count));
            walk.total += node.count as usize;
            let below = if node.count > 1 { NodeContent::Several } else { NodeContent::Single };
            let root = number as u32;
            walk.least += least(&below);
            walk.nodes.push(TreeNode { cell: node.cell, count, mass, below, parent: count, root, whole: false });
            walk.top = walk.top.max(walk.log_weight(number));
        }
        walk.most = walk.total;
        (0..nodes.len()).for_each(|node| walk.wait(node));
        Ok(walk)
    }

    /// Refuses to find more Gaussians than this: what the bytes have earned.
    pub(crate) fn limit(&mut self, most: usize) {
        self.most = self.most.min(most);
    }

    /// Goes on to the end of `level`; false where the bytes end before.
    pub(crate) fn run(
        &mut self,
        c: &mut impl Coder,
        source: &mut impl NodeSource,
        level: usize,
    ) -> Result<bool, OutOfRange> {
        while self.level <= level {
            let Some(&node) = self.waiting[self.level].get(self.done) else {
                // The list of a level that is over gives its memory back.
                self.waiting[self.level] = Vec::new();
                (self.level, self.done) = (self.level + 1, 0);
                c.end_of_level();
                continue;
            };
            self.done += 1;
            let node = node as usize;
            let is_coded = match self.nodes[node].below {
                NodeContent::Several => self.divide(c, source, node)?,
                _ => self.resolve(c, source, node)?,
            };
            if !is_coded {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// All Gaussians in the order of the tree, after the last level.
    pub(crate) fn leaves(&self) -> Result<Vec<u32>, OutOfRange> {
        let leaves = self.in_order();
        match leaves.len() == self.total {
            true => Ok(leaves),
            false => Err(OutOfRange),
        }
    }

    /// The nodes without halves, in the order of the tree.
    pub(crate) fn in_order(&self) -> Vec<u32> {
        let mut out = Vec::with_capacity(self.least);
        let mut stack: Vec<u32> = (0..self.roots.len() as u32).rev().collect();
        while let Some(node) = stack.pop() {
            match self.nodes[node as usize].below {
                // The lower half comes to lie on top, and so is taken first.
                NodeContent::Halves([a, b]) => stack.extend([b, a]),
                _ => out.push(node),
            }
        }
        out
    }

    /// Codes how a node's Gaussians fall into its halves.
    #[inline(always)]
    fn divide(&mut self, c: &mut impl Coder, source: &mut impl NodeSource, number: usize) -> Result<bool, OutOfRange> {
        let node = self.nodes[number];
        let axis = node.cell.axis(self.extent);
        let division = source.division(number);
        let class = self.class(&node);
        let halves = self.models.halves[class].code(c, division.halves.symbol());
        let halves = NodeHalves::from_symbol(halves, |upper| c.bits(1, u32::from(upper)) == 1, division.halves);
        let halves_of = |side: u64| axis.map_or(node.cell, |axis| node.cell.half(axis, side));
        if let NodeHalves::One(upper) = halves {
            if c.exhausted() {
                return Ok(false);
            }
            // Without an axis the node would come back as it is, which the format forbids (docs/format.md, section 6).
            if axis.is_none() {
                return Err(OutOfRange);
            }
            let cell = halves_of(u64::from(upper));
            self.nodes[number] = TreeNode { cell, whole: true, ..node };
            self.wait(number);
            return Ok(true);
        }
        // One number for two counts: their sum is the node's, which is known.
        let [count_a, count_b] = {
            let difference = self.count(c, halves, division.count);
            self.sums.parts(node.count, difference)
        };
        let [mass_a, mass_b] = if self.header.has_w() {
            let difference = self.models.mass.code(c, u32::from(self.header.low[2]), division.mass);
            // The node's is the mean of the two, rounded down: what the halving loses the difference gives back.
            let mass = node.mass.saturating_sub(difference >> 1);
            [mass.saturating_add(difference), mass]
        } else {
            [0; 2]
        };
        // Values read beyond the end are discarded: the node stays whole.
        if c.exhausted() {
            return Ok(false);
        }
        let (below_a, below_b) = match halves {
            NodeHalves::Single(true) => (NodeContent::Single, NodeContent::Several),
            NodeHalves::Single(false) => (NodeContent::Several, NodeContent::Single),
            NodeHalves::Several => (NodeContent::Several, NodeContent::Several),
            _ => (NodeContent::Single, NodeContent::Single),
        };
        let numbers = [count_a, count_b, mass_a, mass_b];
        self.least += least(&below_a) + least(&below_b) - least(&NodeContent::Several);
        // Checked before nodes are added: a stream must not claim more Gaussians than its bytes earn.
        if numbers.iter().any(|v| v.unsigned_abs() > MOST_NODE_STEPS as u32) || self.least > self.most {
            return Err(OutOfRange);
        }
        let first = self.nodes.len() as u32;
        self.nodes[number].below = NodeContent::Halves([first, first + 1]);
        // The lower half first, as the nodes of a level are coded in the order in which they joined it (section 6).
        for (side, count, mass, below) in [(0, count_a, mass_a, below_a), (1, count_b, mass_b, below_b)] {
            let cell = halves_of(side);
            let next = self.nodes.len();
            self.nodes.push(TreeNode { cell, count, mass, below, parent: node.count, root: node.root, whole: false });
            self.wait(next);
        }
        Ok(true)
    }

    /// Codes the difference of the log counts of two halves.
    #[inline(always)]
    fn count(&mut self, c: &mut impl Coder, halves: NodeHalves, difference: i32) -> i32 {
        let low = u32::from(self.header.low[1]);
        // Several Gaussians hold more than one, whichever half they are in.
        let shift = i32::from(self.header.surplus);
        match halves {
            NodeHalves::Single(false) => self.models.count[1].code(c, low, difference - shift).saturating_add(shift),
            // Mirrored: the side of several comes first in both cases, so that one model serves them.
            NodeHalves::Single(true) => {
                (self.models.count[1].code(c, low, -difference - shift).saturating_add(shift)).saturating_neg()
            }
            NodeHalves::Several => self.models.count[2].code(c, low, difference),
            _ => self.models.count[0].code(c, low, difference),
        }
    }

    /// Codes the size of a node's only Gaussian, and where it lies.
    #[inline(always)]
    fn resolve(&mut self, c: &mut impl Coder, source: &mut impl NodeSource, number: usize) -> Result<bool, OutOfRange> {
        let node = self.nodes[number];
        let leaf = source.single(number);
        let h = self.header;
        let predicted = h.predict_size(node.cell.level(), node.count, node.parent);
        let size = self.models.size.code(c, u32::from(h.low[0]), leaf.size.saturating_sub(predicted));
        let size = size.saturating_add(predicted);
        let bits = self.place_bits(&node, size);
        let mut place = [0; 3];
        for k in 0..3 {
            let part = (leaf.place[k] << bits[k]) / (4 * leaf.levels[k]);
            place[k] = c.bits(u32::from(bits[k]), part as u32) as u8;
        }
        if c.exhausted() {
            return Ok(false);
        }
        if [size, node.count, node.mass].iter().any(|v| v.unsigned_abs() > MOST_STEPS as u32) {
            return Err(OutOfRange);
        }
        self.nodes[number].below = NodeContent::Gaussian { size, bits, place };
        Ok(true)
    }

    /// Bits that say where a Gaussian lies along each axis of its cell: one less than its places take if it is round.
    fn place_bits(&self, node: &TreeNode, size: i32) -> [u8; 3] {
        let h = self.header;
        let (t, m) = (size.saturating_mul(2), node.count.saturating_mul(2));
        let step = h.place_step(h.radius(t), limited(h.size_power(t) * h.count_power(m)));
        let widths = node.cell.widths(self.extent);
        widths.map(|w| {
            let levels = w / step;
            // Octaves of the number of places, by the exponent.
            let octaves = ((levels.to_bits() >> 52) as i32 - 1023).clamp(0, MOST_PLACE_BITS as i32 + 1);
            (octaves - 1).max(0) as u8
        })
    }

    /// The class of a node by the number of Gaussians that its share of its root's count stands for.
    fn class(&self, node: &TreeNode) -> usize {
        let (gaussians, count) = self.roots[node.root as usize];
        let share = exp(f64::from(self.header.steps[2]) * f64::from(node.count.saturating_sub(count)));
        // The exponent of a float is its octave; no logarithm, whose bits would be the platform's.
        let octave = ((gaussians * share).to_bits() >> 52) as i32 - 1023;
        2 * (octave + 3).clamp(0, CLASSES as i32 - 1) as usize + usize::from(node.whole)
    }

    /// Logarithm of a node's weight: its count, and how small its cell is.
    fn log_weight(&self, node: usize) -> f64 {
        let node = &self.nodes[node];
        f64::from(self.header.steps[2]) * f64::from(node.count) + HALVING * f64::from(node.cell.level())
    }

    /// Puts a node off to its level, this one at the earliest.
    fn wait(&mut self, node: usize) {
        let level_distance = (self.top - self.log_weight(node)) * LEVELS_TO_E;
        // A half may weigh more than what is being done now: it is not put back to a level that is over.
        let level = (level_distance as usize).clamp(self.level, LEVELS - 1);
        self.waiting[level].push(node as u32);
    }
}

impl LevelModels {
    fn new(h: &BlockHeader) -> Self {
        let [size, count, _] = h.spreads.map(f64::from);
        let halves = |class: usize| SymbolModel::from_weights(HALVES[(class / 2).min(HALVES.len() - 1)]);
        LevelModels {
            halves: (0..2 * CLASSES).map(halves).collect(),
            count: [0, 1, 2].map(|_| Residual::bell(count)),
            mass: Residual::geometric(),
            size: Residual::bell(size),
        }
    }
}

impl NodeHalves {
    fn symbol(self) -> usize {
        match self {
            NodeHalves::One(_) => 0,
            NodeHalves::Singles => 1,
            NodeHalves::Single(_) => 2,
            NodeHalves::Several => 3,
        }
    }

    /// From its symbol; `upper` codes which half, if it must be said.
    fn from_symbol(symbol: usize, mut upper: impl FnMut(bool) -> bool, encoded: NodeHalves) -> NodeHalves {
        let mut side = || upper(matches!(encoded, NodeHalves::One(true) | NodeHalves::Single(true)));
        match symbol {
            0 => NodeHalves::One(side()),
            1 => NodeHalves::Singles,
            2 => NodeHalves::Single(side()),
            _ => NodeHalves::Several,
        }
    }
}

/// Gaussians that a node holds at least.
fn least(below: &NodeContent) -> usize {
    if *below == NodeContent::Several { 2 } else { 1 }
}

/// A plain whole number.
fn plain(c: &mut impl Coder, value: i32) -> Result<i32, OutOfRange> {
    let value = c.long_bits(ROOT_BITS, (i64::from(value) + i64::from(MOST_NODE_STEPS)) as u64) as i64;
    let value = (value - i64::from(MOST_NODE_STEPS)) as i32;
    if value.abs() <= MOST_NODE_STEPS { Ok(value) } else { Err(OutOfRange) }
}

/// Log counts of nodes from those of their halves, whole steps.
pub(crate) struct CountSums {
    step: f64,
    /// Excess of two halves over the larger one, by the difference of their log counts.
    excess: [i32; TABLED],
}

/// Differences whose excess is kept.
const TABLED: usize = 64;

impl CountSums {
    pub(crate) fn new(step: f64) -> Self {
        CountSums { step, excess: std::array::from_fn(|d| excess(step, d as u32)) }
    }

    fn excess(&self, difference: u32) -> i32 {
        self.excess.get(difference as usize).copied().unwrap_or_else(|| excess(self.step, difference))
    }

    /// The log count of a node whose halves have these.
    pub(crate) fn whole(&self, [a, b]: [i32; 2]) -> i32 {
        a.max(b) + self.excess(a.abs_diff(b))
    }

    /// The log counts of the halves of a node, from their difference.
    fn parts(&self, whole: i32, difference: i32) -> [i32; 2] {
        let size = difference.unsigned_abs();
        let larger = whole.saturating_sub(self.excess(size));
        let smaller = larger.saturating_sub_unsigned(size);
        if difference >= 0 { [larger, smaller] } else { [smaller, larger] }
    }
}

/// ln(1 + exp(-step difference)) in whole steps, rounded: the least g with exp(step (g + 0.5)) >= 1 + exp(-step difference).
fn excess(step: f64, difference: u32) -> i32 {
    let sum = 1.0 + exp(-step * f64::from(difference));
    let enough = |g: i32| exp(step * (f64::from(g) + 0.5)) >= sum;
    // A guess that any logarithm is near enough for: the comparisons decide.
    let mut g = (libm::log(sum) / step).round().max(0.0) as i32;
    while g > 0 && enough(g - 1) {
        g -= 1;
    }
    while !enough(g) {
        g += 1;
    }
    g
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn halves_come_back_from_their_sum_and_difference(
            a in -5000i32..5000, b in -5000i32..5000, step in prop_oneof![1e-4f64..1e-2, 0.01f64..16.0],
        ) {
            let sums = CountSums::new(step);
            let whole = sums.whole([a, b]);
            prop_assert_eq!(sums.parts(whole, a - b), [a, b]);
            let truth = (f64::from(a.max(b)) * step) + libm::log1p(libm::exp(-step * f64::from(a.abs_diff(b))));
            prop_assert!((f64::from(whole) * step - truth).abs() <= 0.5000001 * step);
        }
    }
}
