//! Numbers of a field as whole steps from a guess, which comes from the nearest Gaussians that are decoded already
//! (docs/format.md, section 14).

use super::rans::Coder;
use super::symbols::Residual;
use crate::math::each_axis;
use crate::model::Mixture;

/// Earlier Gaussians among which the nearest are looked for, and how many of these predict.
const WINDOW: usize = 1024;
const NEIGHBOURS: usize = 8;
/// Classes of what is expected of a residual; the least, in steps squared, and the factor from one to the next.
const CLASSES: usize = 24;
const LEAST_CLASS: f64 = 1.0 / 16.0;
/// Whole numbers of steps at most.
const MOST_STEPS: i32 = 1 << 20;

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
        FieldNumberCoder((0..CLASSES).map(model).collect())
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
    while class + 1 < CLASSES && square >= edge {
        edge *= 2.0;
        class += 1;
    }
    class
}
