//! Models of the numbers that change from one frame of a series to the next (docs/format.md, section 16).

use super::rans::Coder;
use super::symbols::{Residual, SymbolModel};

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
