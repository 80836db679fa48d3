//! Numbers in whole steps, with models by the class of what is expected: of changes from one frame of a series to the
//! next (docs/format.md, section 16), and of fields, whose guess comes from the nearest Gaussians that are decoded already
//! (section 14).

use super::rans::Coder;
use super::symbols::{Residual, SymbolModel};
use crate::math::each_axis;
use crate::model::Mixture;

/// Numbers in steps, and logarithms, at most.
const MOST_STEPS: i32 = 1 << 20;
pub(super) const LARGEST_LOG: f64 = 16.0;
/// Edges of the classes of models: sums of steps, a number's own steps in earlier frames, width of a
/// Gaussian's steps over the usual.
const UNREST_EDGES: [u32; 5] = [2, 5, 10, 20, 40];
const HISTORY_EDGES: [u32; 3] = [1, 2, 4];
const COARSENESS_EDGES: [f64; 3] = [0.7, 1.0, 1.5];
const CLASSES: usize = (UNREST_EDGES.len() + 1) * (HISTORY_EDGES.len() + 1) * (COARSENESS_EDGES.len() + 1);
/// Kinds of numbers that have models of their own.
const KINDS: usize = 6;
/// A place whose guess is the Gaussian's own velocity, and one that only neighbours guess.
pub(super) const PLACE: usize = 0;
pub(super) const FIRST_PLACE: usize = 1;
pub(super) const SIZE: usize = 2;
pub(super) const SHAPE: usize = 3;
pub(super) const COUNT: usize = 4;
pub(super) const WEIGHT: usize = 5;

/// Models of numbers, by kind and class.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChangeModels {
    pub(super) stays: SymbolModel<2>,
    numbers: Vec<Residual<16>>,
}

/// Context that a number's model follows from.
#[derive(Clone, Copy)]
pub(super) struct NumberContext {
    /// Steps of other numbers.
    pub(super) unrest: u32,
    /// Steps of the number in earlier frames.
    pub(super) history: i32,
    /// Width of the Gaussian's steps over the usual.
    pub(super) coarseness: f64,
}

impl ChangeModels {
    pub(super) fn new() -> Self {
        let unrests = UNREST_EDGES.len() + 1;
        let model = |i: usize| Residual::bell(0.25 * f64::from(1u32 << (i % unrests)));
        ChangeModels { stays: SymbolModel::from_weights([60, 1]), numbers: (0..KINDS * CLASSES).map(model).collect() }
    }

    /// A number in steps.
    pub(super) fn code(
        &mut self,
        c: &mut impl Coder,
        kind: usize,
        context: &NumberContext,
        steps: i32,
    ) -> std::result::Result<i32, String> {
        let unrest = UNREST_EDGES.iter().filter(|edge| context.unrest >= **edge).count();
        let history = HISTORY_EDGES.iter().filter(|edge| context.history.unsigned_abs() >= **edge).count();
        let coarseness = COARSENESS_EDGES.iter().filter(|edge| context.coarseness >= **edge).count();
        let class = (coarseness * (HISTORY_EDGES.len() + 1) + history) * (UNREST_EDGES.len() + 1) + unrest;
        let model = &mut self.numbers[kind * CLASSES + class];
        // A number tends to go on in its direction: mirrored, one model serves both signs (section 16).
        let sign = if context.history < 0 { -1 } else { 1 };
        let steps = sign * model.code(c, 0, sign * steps);
        if steps.abs() > MOST_STEPS { Err("a number of a change is out of range".into()) } else { Ok(steps) }
    }
}

/// A value in whole steps that lead no further than `most`: values next to none are none, as they cost more than they
/// gain.
pub(super) fn in_steps(value: f64, step: f64, most: f64) -> i32 {
    const DEAD: f64 = 0.2;
    let v = value / step;
    let k = (v.abs() + 0.5 - DEAD).floor().min((most / step).floor()).min(f64::from(MOST_STEPS));
    (if v < 0.0 { -k } else { k }) as i32
}

/// Earlier Gaussians among which the nearest are looked for, and how many of these predict.
const WINDOW: usize = 1024;
const NEIGHBOURS: usize = 8;
/// Classes of what is expected of a residual; the least, in steps squared, and the factor from one to the next.
const FIELD_CLASSES: usize = 24;
const LEAST_CLASS: f64 = 1.0 / 16.0;

/// The nearest earlier Gaussians, nearest first: their squared distances and numbers.
type Near = Vec<(f64, u32)>;

/// The Gaussians of a block that are decoded, in order.
pub(super) struct FieldPredictor<'a> {
    gaussians: &'a Mixture,
    done: Vec<u32>,
}

impl<'a> FieldPredictor<'a> {
    pub fn new(gaussians: &'a Mixture) -> Self {
        FieldPredictor { gaussians, done: Vec::with_capacity(gaussians.len()) }
    }

    pub fn push(&mut self, i: usize) {
        self.done.push(i as u32);
    }

    /// The nearest of the Gaussians decoded last.
    pub fn near(&self, i: usize) -> Near {
        let mean = self.gaussians.mean_of(i);
        let from = self.done.len().saturating_sub(WINDOW);
        let mut neighbours: Near = Vec::with_capacity(NEIGHBOURS + 1);
        // Backwards: of equal distances the later one comes first (section 14).
        for &j in self.done[from..].iter().rev() {
            let other = self.gaussians.mean_of(j as usize);
            let [x, y, z] = each_axis(|k| other[k] - mean[k]);
            let d2 = x * x + y * y + z * z;
            if neighbours.len() < NEIGHBOURS || d2 < neighbours[NEIGHBOURS - 1].0 {
                let at = neighbours.partition_point(|n| n.0 <= d2);
                neighbours.insert(at, (d2, j));
                neighbours.truncate(NEIGHBOURS);
            }
        }
        neighbours
    }

    /// One over what the value of each neighbour is expected to miss this one's by, squared.
    pub fn weights(&self, neighbours: &Near, change: f64, error2: impl Fn(usize, f64) -> f64) -> Vec<f64> {
        let weight = |&(d2, j): &(f64, u32)| {
            let j = j as usize;
            // A neighbour without error in the same place would have an infinite weight.
            1.0 / (error2(j, self.gaussians.count[j]) + change * d2.sqrt() + 1e-300)
        };
        neighbours.iter().map(weight).collect()
    }
}

/// The weighted mean of what neighbours have, and how far it is expected to be off, squared.
pub(super) fn expected(neighbours: &Near, weights: &[f64], start: f64, value: impl Fn(usize) -> f64) -> (f64, f64) {
    let (mut sum, mut total) = (0.0, 0.0);
    for (&(_, j), &w) in neighbours.iter().zip(weights) {
        sum += w * value(j as usize);
        total += w;
    }
    match neighbours.len() {
        0 => (start, 1e30),
        n => (sum / total, n as f64 / total),
    }
}

/// Models of one kind of numbers, by the class of what is expected.
pub(super) struct FieldNumberCoder(Vec<Residual<32>>);

impl Default for FieldNumberCoder {
    fn default() -> Self {
        // Spreads in steps, by the class.
        let model = |class: usize| Residual::bell((LEAST_CLASS * (1u64 << class) as f64).sqrt());
        FieldNumberCoder((0..FIELD_CLASSES).map(model).collect())
    }
}

impl FieldNumberCoder {
    /// A number in whole steps from a guess that is expected to be off by `variance`.
    #[inline(always)]
    pub fn code(
        &mut self,
        c: &mut impl Coder,
        [guess, variance]: [f64; 2],
        [error, step]: [f64; 2],
        target: Option<f64>,
    ) -> Result<f64, String> {
        let most = f64::from(MOST_STEPS);
        let wanted = target.map_or(0.0, |t| ((t - guess) / step).round()).clamp(-most, most);
        let class = class((variance + error * error) / (step * step));
        let steps = self.0[class].code(c, 0, wanted as i32);
        if steps.abs() > MOST_STEPS {
            return Err("a number of a field is out of range".into());
        }
        Ok(guess + step * f64::from(steps))
    }
}

/// The class of an expected square, in steps squared.
#[inline(always)]
fn class(square: f64) -> usize {
    let mut edge = 2.0 * LEAST_CLASS;
    let mut class = 0;
    // Comparisons and no logarithm, so that every machine takes the same class.
    while class + 1 < FIELD_CLASSES && square >= edge {
        edge *= 2.0;
        class += 1;
    }
    class
}
