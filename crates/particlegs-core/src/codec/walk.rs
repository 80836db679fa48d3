//! The one walk over a block's content: the encoder writes with it, the decoder reads with it
//! (docs/format.md, section 5 to 8).

use super::exact::exp;
use super::header::{BlockHeader, Predictor, cholesky, limited};
use super::rans::{Coder, Part};
use super::symbols::{Model, Residual};
use super::tree::{Cell, Node, segments};
use super::trellis::State;
use crate::math::Sym3;

/// Whole numbers of one Gaussian. `t`, `m` and `shape` are on half steps (2 k + lattice).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Leaf {
    pub cell: Cell,
    /// Log size.
    pub t: i32,
    /// Log count; in shaded blocks log depth.
    pub m: i32,
    /// Log mass a particle, relative, or in shaded blocks log grey level; 0 where neither is coded.
    pub w: i32,
    pub shape: [i32; 5],
    /// Levels of the cell's axes.
    pub levels: [u64; 3],
    /// Position in quarter levels.
    pub place: [u64; 3],
    /// Covariance of radius 1, as decoded.
    pub unit: Sym3,
    /// Geometric mean radius, world units, as decoded.
    pub radius: f64,
    /// Factor on the steps of shape and place.
    pub factor: f64,
    /// Particles, as decoded, before they are made whole; in shaded blocks the depth.
    pub count: f64,
}

/// What a Gaussian's numbers are predicted from: an earlier one's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Past {
    /// Of its cell.
    pub level: i32,
    pub t: i32,
    pub m: i32,
    pub w: i32,
}

impl Leaf {
    /// What is remembered of it.
    #[inline(always)]
    pub(crate) fn past(&self) -> Past {
        Past { level: self.cell.level(), t: self.t, m: self.m, w: self.w }
    }
}

/// What the encoder has to say; the decoder says nothing.
pub(crate) trait Script {
    /// Gaussians in the lower half of the next node.
    fn split(&mut self) -> u32;
    /// Gaussian `i`; the walk overwrites what it knows itself.
    fn leaf(&mut self, i: usize) -> Leaf;
}

/// The decoder's script.
pub(crate) struct Nothing;

impl Script for Nothing {
    fn split(&mut self) -> u32 {
        0
    }

    fn leaf(&mut self, _: usize) -> Leaf {
        Leaf::default()
    }
}

/// Numbers that the walk cannot go on with.
pub(crate) struct OutOfRange;

/// The slowest adaptation of models, 1 / 2^SLOWEST of the way a symbol, and in the first coding.
pub(super) const SLOWEST: u32 = 9;
const SLOWEST_FIRST: u32 = 7;
/// Classes of the step factor that shape models of the first coding distinguish.
const STEP_CLASSES: usize = 12;
/// And of the shape numbers already coded.
const REACH_CLASSES: usize = 3;
/// In the second coding: spreads in steps that shape models start from, by half octaves of what is expected.
const SPREADS: [f64; 12] = [0.1875, 0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0];
/// Shape numbers that the block's mean spread counts as, beside those of the Gaussian itself.
const MEAN_WEIGHT: f64 = 5.0;

/// The slowest adaptation of a block's models.
fn slowest(h: &BlockHeader) -> u32 {
    if h.spreads.is_some() { SLOWEST } else { SLOWEST_FIRST }
}

struct Models {
    splits: Splits,
    t: Vec<Residual<32>>,
    m: Vec<Residual<32>>,
    w: Residual<32>,
    shape: Vec<Residual<16>>,
}

impl Models {
    fn new(h: &BlockHeader) -> Self {
        let slowest = slowest(h);
        let splits = Splits::new(slowest);
        let geometric = |n: usize| vec![Residual::geometric(slowest); n];
        let w = Residual::geometric(slowest);
        match h.spreads {
            None => {
                let shape = vec![Residual::geometric(slowest); 2 * STEP_CLASSES * REACH_CLASSES];
                Models { splits, t: geometric(3), m: geometric(3), w, shape }
            }
            Some([t, m, _]) => {
                let bell = |spread: f32| vec![Residual::bell(f64::from(spread), slowest)];
                let shape = |class| Residual::bell(SPREADS[class / 2], slowest);
                Models { splits, t: bell(t), m: bell(m), w, shape: (0..2 * SPREADS.len()).map(shape).collect() }
            }
        }
    }
}

/// Models of how nodes fall apart: by count (2 to 15, then powers of two) and share.
pub(super) struct Splits(Vec<[Model<16>; 3]>);

impl Splits {
    /// They settle at 1 / 2^slowest of the way a symbol.
    pub(super) fn new(slowest: u32) -> Splits {
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
            [0, 1, 2].map(|_| Model::from_weights(weights, slowest))
        };
        Splits((2..16).chain([16, 32, 64, 128, 256]).map(split).collect())
    }

    /// The number of the lower half's Gaussians.
    #[inline(always)]
    pub(super) fn code(&mut self, c: &mut impl Coder, node: &Node, low: u32) -> Result<u32, OutOfRange> {
        let n = node.count;
        c.part(Part::Tree);
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
    ((u64::from(high) << low) | c.long_bits(low, value & ((1 << low) - 1))).min(n - 1)
}

/// The splits above the segments, and with them the segments' nodes.
pub(crate) fn trunk(
    c: &mut impl Coder,
    header: &BlockHeader,
    script: &mut impl Script,
) -> Result<Vec<Vec<Node>>, OutOfRange> {
    let mut splits = Splits::new(slowest(header));
    segments(header.gaussians, header.bounds.extent(), |node, _, _| {
        let low = script.split();
        splits.code(c, node, low)
    })
}

/// Walks a segment's nodes; `sink` gets each Gaussian as coded, with its number in the segment.
pub(crate) fn walk(
    c: &mut impl Coder,
    header: &BlockHeader,
    nodes: &[Node],
    script: &mut impl Script,
    sink: impl FnMut(usize, &Leaf),
) -> Result<(), OutOfRange> {
    kernel(c, header, nodes, script, sink)
}

#[inline(always)]
fn kernel(
    c: &mut impl Coder,
    header: &BlockHeader,
    nodes: &[Node],
    script: &mut impl Script,
    mut sink: impl FnMut(usize, &Leaf),
) -> Result<(), OutOfRange> {
    let extent = header.bounds.extent();
    let mut models = Models::new(header);
    let mut leaves = Leaves::new(header, extent);
    let mut stack: Vec<Node> = nodes.iter().rev().copied().collect();
    let mut done = 0;
    while let Some(node) = stack.pop() {
        match node.cell.axis(extent).filter(|_| node.count > 1) {
            None => {
                for _ in 0..node.count {
                    let mut leaf = script.leaf(done);
                    leaf.cell = node.cell;
                    leaves.code(c, &mut models, &mut leaf)?;
                    sink(done, &leaf);
                    done += 1;
                }
            }
            Some(axis) => {
                let low = script.split();
                let low = models.splits.code(c, &node, low)?;
                let [a, b] = node.halves(axis, low);
                if b.count > 0 {
                    stack.push(b);
                }
                if a.count > 0 {
                    stack.push(a);
                }
            }
        }
    }
    Ok(())
}

/// What is remembered from Gaussian to Gaussian.
struct Leaves<'a> {
    header: &'a BlockHeader,
    extent: [f64; 3],
    before: [Past; 2],
    powers: Powers,
    trellis_t: State,
    trellis_m: State,
    trellis_w: State,
    trellis_shape: State,
    trellis_place: State,
}

impl<'a> Leaves<'a> {
    fn new(header: &'a BlockHeader, extent: [f64; 3]) -> Self {
        let start = State::default();
        Leaves {
            header,
            extent,
            before: [Past::default(); 2],
            powers: Powers::new(),
            trellis_t: start,
            trellis_m: start,
            trellis_w: start,
            trellis_shape: start,
            trellis_place: start,
        }
    }

    #[inline(always)]
    fn code(&mut self, c: &mut impl Coder, models: &mut Models, leaf: &mut Leaf) -> Result<(), OutOfRange> {
        let h = self.header;
        let level = leaf.cell.level();
        let surprise = if h.spreads.is_some() { 0 } else { surprise_class(level, self.before[0].level) };
        c.part(Part::Size);
        let predicted = h.predict_t(level, &self.before);
        let model = &mut models.t[surprise];
        leaf.t = scalar(c, model, h.low[0], &mut self.trellis_t, predicted, leaf.t)?;
        c.part(Part::Count);
        let predicted = h.predict_m(level, leaf.t, &self.before);
        let model = &mut models.m[surprise];
        leaf.m = scalar(c, model, h.low[1], &mut self.trellis_m, predicted, leaf.m)?;
        if h.has_w() {
            c.part(Part::Mass);
            leaf.w = scalar(c, &mut models.w, h.low[2], &mut self.trellis_w, self.before[0].w, leaf.w)?;
        }
        self.powers.fill(h, leaf);
        self.shape(c, models, leaf)?;
        self.place(c, leaf);
        self.before = [leaf.past(), self.before[0]];
        Ok(())
    }

    #[inline(always)]
    fn shape(&mut self, c: &mut impl Coder, models: &mut Models, leaf: &mut Leaf) -> Result<(), OutOfRange> {
        c.part(Part::Shape);
        let h = self.header;
        let mut reach = 0i64;
        for k in 0..5 {
            let model = match h.spreads {
                Some([.., mean]) => {
                    // Numbers of this Gaussian, and with less and less weight the block's.
                    let mean = f64::from(mean) / leaf.factor;
                    let expected = (MEAN_WEIGHT * mean + reach as f64) / (MEAN_WEIGHT + k as f64);
                    2 * spread_class(expected, h.low[3]) + self.trellis_shape.lattice() as usize
                }
                None => {
                    let class = usize::from(k >= 2) * STEP_CLASSES + step_class(leaf.factor);
                    class * REACH_CLASSES + reach_class(reach, k as i64)
                }
            };
            let model = &mut models.shape[model];
            leaf.shape[k] = scalar(c, model, h.low[3], &mut self.trellis_shape, 0, leaf.shape[k])?;
            reach += i64::from(leaf.shape[k].abs());
        }
        leaf.unit = h.unit_covariance(leaf.shape, leaf.factor).ok_or(OutOfRange)?;
        Ok(())
    }

    #[inline(always)]
    fn place(&mut self, c: &mut impl Coder, leaf: &mut Leaf) {
        c.part(Part::Place);
        let h = self.header;
        let widths = if h.spreads.is_some() { cholesky(&leaf.unit).0 } else { [1.0; 3] };
        leaf.levels = h.levels(&leaf.cell, self.extent, h.place_step(leaf.radius, leaf.factor), widths);
        for k in 0..3 {
            let n = leaf.levels[k];
            if n == 1 {
                // One level: the middle of the cell, and the trellis rests.
                leaf.place[k] = 2;
                continue;
            }
            let lattice = self.trellis_place.lattice() as u64;
            let j = long_uniform(c, n, leaf.place[k] / 4);
            self.trellis_place.step(j as i64);
            leaf.place[k] = 4 * j + 1 + 2 * lattice;
        }
    }
}

/// Powers of sizes and counts that were met lately: few distinct ones follow each other.
struct Powers {
    /// Size, radius, share of the step factor.
    sizes: [(i32, f64, f64); POWERS],
    /// Count in half steps, count, share of the step factor.
    counts: [(i32, f64, f64); POWERS],
}

/// Powers that are remembered.
const POWERS: usize = 128;

impl Powers {
    fn new() -> Self {
        // No number on half steps is that low.
        let none = [(i32::MIN, 0.0, 0.0); POWERS];
        Powers { sizes: none, counts: none }
    }

    /// Radius, count and step factor of a Gaussian whose numbers are known.
    #[inline(always)]
    fn fill(&mut self, h: &BlockHeader, leaf: &mut Leaf) {
        let size = &mut self.sizes[leaf.t as usize % POWERS];
        if size.0 != leaf.t {
            *size = (leaf.t, h.radius(leaf.t), h.size_power(leaf.t));
        }
        let count = &mut self.counts[leaf.m as usize % POWERS];
        if count.0 != leaf.m {
            *count = (leaf.m, exp(h.log_count(leaf.m)), h.count_power(leaf.m));
        }
        (leaf.radius, leaf.count, leaf.factor) = (size.1, count.1, limited(size.2 * count.2));
    }
}

/// How far the leaf's level is from the last one's: the further, the less is known.
#[inline(always)]
fn surprise_class(level: i32, before: i32) -> usize {
    let far = (level - before).abs();
    usize::from(far >= 2) + usize::from(far >= 5)
}

/// Half octaves of the step factor, from 1/8 to 8: how many of 2^-5 to 2^5 are at most its square.
#[inline(always)]
fn step_class(step: f64) -> usize {
    let exponent = ((step * step).to_bits() >> 52) as i32 - 1023;
    (exponent + 6).clamp(0, STEP_CLASSES as i32 - 1) as usize
}

/// Half octaves of what is expected of a shape number in half steps, its plain low bits apart.
#[inline(always)]
fn spread_class(expected: f64, low: u8) -> usize {
    let e = expected / f64::from(1u32 << low);
    let octaves = ((e * e).to_bits() >> 52) as i32 - 1023;
    (octaves + 4).clamp(0, SPREADS.len() as i32 - 1) as usize
}

/// Classes of the mean magnitude, in half steps, of `k` numbers that sum to `reach`.
#[inline(always)]
fn reach_class(reach: i64, k: i64) -> usize {
    // floor(reach / k) >= 2 and >= 5; 0 without numbers.
    let k = k.max(1);
    usize::from(reach >= 2 * k) + usize::from(reach >= 5 * k)
}

/// Codes a number on half steps against its prediction on half steps.
#[inline(always)]
fn scalar<const N: usize>(
    c: &mut impl Coder,
    model: &mut Residual<N>,
    low: u8,
    state: &mut State,
    predicted: i32,
    half: i32,
) -> Result<i32, OutOfRange> {
    let lattice = state.lattice();
    let guess = (predicted - lattice + 1) >> 1;
    let k = model.code(c, u32::from(low), ((half - lattice) >> 1) - guess).saturating_add(guess);
    if k.abs() > 1 << 20 {
        return Err(OutOfRange);
    }
    state.step(i64::from(k));
    Ok(2 * k + lattice)
}

impl Predictor {
    /// Sum of coefficient times feature, rounded.
    #[inline(always)]
    pub(crate) fn apply(&self, features: &[i32]) -> i32 {
        let sum: i64 = self.slopes.iter().zip(features).map(|(&a, &f)| i64::from(a) * i64::from(f)).sum();
        let sum = (sum + 128) >> 8;
        (sum + i64::from(self.constant)).clamp(-(1 << 21), 1 << 21) as i32
    }
}
