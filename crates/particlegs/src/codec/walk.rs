//! The one walk over a block's content: the encoder writes with it, the decoder reads with it
//! (docs/format.md, section 5 to 8).

use super::header::{BlockHeader, Predictor};
use super::rans::Coder;
use super::symbols::{Model, RESIDUALS, Residual};
use super::tree::{Cell, Node};
use super::trellis::State;

/// Whole numbers of one Gaussian. `t`, `m` and `shape` are on half steps (2 k + lattice).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Leaf {
    pub cell: Cell,
    /// Log size.
    pub t: i32,
    /// Log count.
    pub m: i32,
    /// Log mass a particle, relative; 0 where particles have no weights.
    pub w: i32,
    pub shape: [i32; 5],
    /// Levels of the cell's axes.
    pub levels: [u64; 3],
    /// Position in quarter levels.
    pub place: [u64; 3],
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

/// Classes of the step factor that shape models distinguish.
const STEP_CLASSES: usize = 12;
/// Classes of the shape numbers already coded.
const REACH_CLASSES: usize = 3;

struct Models {
    /// By count (2 to 15, then powers of two) and share.
    split: Vec<[Model<16>; 3]>,
    t: Vec<Residual>,
    m: Vec<Residual>,
    w: Residual,
    shape: Vec<Residual>,
}

impl Models {
    fn new() -> Self {
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
            [0, 1, 2].map(|_| Model::from_weights(weights))
        };
        Models {
            split: (2..16).chain([16, 32, 64, 128, 256]).map(split).collect(),
            t: vec![Residual::new(); 3],
            m: vec![Residual::new(); 3],
            w: Residual::new(),
            shape: vec![Residual::new(); 2 * STEP_CLASSES * REACH_CLASSES],
        }
    }

    /// The number of the lower half's Gaussians.
    fn split(&mut self, c: &mut impl Coder, node: &Node, low: u32) -> u32 {
        let n = node.count;
        if n < 16 {
            return self.split[n as usize - 2][node.share as usize].code(c, low.min(n) as usize) as u32;
        }
        let class = 14 + (n.ilog2() - 4).min(4) as usize;
        let n1 = u64::from(n) + 1;
        let sixteenth = (u64::from(low.min(n)) * 16 / n1) as usize;
        let sixteenth = self.split[class][node.share as usize].code(c, sixteenth) as u64;
        let first = (sixteenth * n1).div_ceil(16);
        let size = ((sixteenth + 1) * n1).div_ceil(16) - first;
        first as u32 + long_uniform(c, size, u64::from(low).saturating_sub(first)).min(size - 1) as u32
    }
}

/// A value in `0 .. n`, `n` up to 2^60: the upper part as one uniform of at most 2^10, the rest plain.
fn long_uniform(c: &mut impl Coder, n: u64, value: u64) -> u64 {
    let low = (64 - n.leading_zeros()).saturating_sub(10);
    let high = c.uniform(((n - 1) >> low) as u32 + 1, (value >> low) as u32);
    (u64::from(high) << low) | c.long_bits(low, value & ((1 << low) - 1))
}

/// Walks `header.gaussians` Gaussians; `sink` gets each as coded.
pub(crate) fn walk(
    c: &mut impl Coder,
    header: &BlockHeader,
    script: &mut impl Script,
    mut sink: impl FnMut(&Leaf) -> Result<(), OutOfRange>,
) -> Result<(), OutOfRange> {
    let extent = header.bounds.extent();
    let mut models = Models::new();
    let mut leaves = Leaves::new(header, extent);
    let mut stack = vec![Node { cell: Cell::default(), count: header.gaussians, share: 0 }];
    while let Some(node) = stack.pop() {
        match node.cell.axis(extent).filter(|_| node.count > 1) {
            None => {
                for _ in 0..node.count {
                    let mut leaf = script.leaf(leaves.done);
                    leaf.cell = node.cell;
                    leaves.code(c, &mut models, &mut leaf)?;
                    sink(&leaf)?;
                }
            }
            Some(axis) => {
                let low = script.split();
                let low = models.split(c, &node, low);
                let [a, b] = node.halves(axis, low);
                stack.extend([b, a].into_iter().filter(|n| n.count > 0));
            }
        }
    }
    Ok(())
}

/// What is remembered from Gaussian to Gaussian.
struct Leaves<'a> {
    header: &'a BlockHeader,
    extent: [f64; 3],
    done: usize,
    before: [Leaf; 2],
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
            done: 0,
            before: [Leaf::default(); 2],
            trellis_t: start,
            trellis_m: start,
            trellis_w: start,
            trellis_shape: start,
            trellis_place: start,
        }
    }

    fn code(&mut self, c: &mut impl Coder, models: &mut Models, leaf: &mut Leaf) -> Result<(), OutOfRange> {
        let h = self.header;
        let surprise = surprise_class(leaf, &self.before[0]);
        leaf.t =
            scalar(c, &mut models.t[surprise], h.low[0], &mut self.trellis_t, h.predict_t(leaf, &self.before), leaf.t)?;
        leaf.m =
            scalar(c, &mut models.m[surprise], h.low[1], &mut self.trellis_m, h.predict_m(leaf, &self.before), leaf.m)?;
        if h.weighted {
            leaf.w = scalar(c, &mut models.w, h.low[2], &mut self.trellis_w, self.before[0].w, leaf.w)?;
        }
        let step = h.step_factor(leaf.t, leaf.m);
        self.shape(c, models, leaf, step)?;
        self.place(c, leaf, step);
        self.before = [*leaf, self.before[0]];
        self.done += 1;
        Ok(())
    }

    fn shape(&mut self, c: &mut impl Coder, models: &mut Models, leaf: &mut Leaf, step: f64) -> Result<(), OutOfRange> {
        let class = step_class(step);
        let mut reach = 0i64;
        for k in 0..5 {
            // The mean magnitude so far, in half steps.
            let reach_class = if k == 0 { 0 } else { reach_class(reach / k as i64) };
            let model = (usize::from(k >= 2) * STEP_CLASSES + class) * REACH_CLASSES + reach_class;
            leaf.shape[k] =
                scalar(c, &mut models.shape[model], self.header.low[3], &mut self.trellis_shape, 0, leaf.shape[k])?;
            reach += i64::from(leaf.shape[k].abs());
        }
        Ok(())
    }

    fn place(&mut self, c: &mut impl Coder, leaf: &mut Leaf, step: f64) {
        leaf.levels = self.header.levels(&leaf.cell, self.extent, leaf.t, step);
        for k in 0..3 {
            let n = leaf.levels[k];
            if n == 1 {
                // One level: the middle of the cell, and the trellis rests.
                leaf.place[k] = 2;
                continue;
            }
            let lattice = self.trellis_place.lattice() as u64;
            let j = long_uniform(c, n, leaf.place[k] / 4).min(n - 1);
            self.trellis_place.step(j as i64);
            leaf.place[k] = 4 * j + 1 + 2 * lattice;
        }
    }
}

/// How far the leaf's level is from the last one's: the further, the less is known.
fn surprise_class(leaf: &Leaf, before: &Leaf) -> usize {
    match (leaf.cell.level() - before.cell.level()).abs() {
        0..=1 => 0,
        2..=4 => 1,
        _ => 2,
    }
}

/// Half octaves of the step factor, from 1/8 to 8.
fn step_class(step: f64) -> usize {
    // Comparing squares keeps to exact operations.
    let mut class = 0;
    let mut edge = 1.0 / 32.0;
    while class + 1 < STEP_CLASSES && step * step >= edge {
        edge *= 2.0;
        class += 1;
    }
    class
}

/// Classes of the mean magnitude in half steps.
fn reach_class(mean: i64) -> usize {
    usize::from(mean >= 2) + usize::from(mean >= 5)
}

/// Codes a number on half steps against its prediction on half steps.
#[inline]
fn scalar(
    c: &mut impl Coder,
    model: &mut Residual,
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
    pub(crate) fn apply(&self, features: &[i32]) -> i32 {
        let sum: i64 = self.slopes.iter().zip(features).map(|(&a, &f)| i64::from(a) * i64::from(f)).sum();
        let sum = (sum + 128) >> 8;
        (sum + i64::from(self.constant)).clamp(-(1 << 21), 1 << 21) as i32
    }
}

const _: () = assert!(RESIDUALS == 32);
