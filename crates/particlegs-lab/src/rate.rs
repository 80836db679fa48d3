//! Finds the bound at which a baseline has a given size, and verifies bounds.

use crate::subset::mean_spacing;
use crate::{Baseline, PositionColumns, errors, finite_ends};
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use std::time::Instant;

/// Largest number of trials; six are usual.
const TRIALS: u64 = 12;
/// A size within this share counts as reached.
const CLOSE_ENOUGH: f64 = 0.01;
/// Bounds closer than this share count as equal.
const NARROW: f64 = 1e-4;
/// Largest factor of the first step from a bound that misses the size.
const LARGEST_STEP: f64 = 8.0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeBound {
    /// The bound, in the particles' unit of length.
    pub bound: f64,
    /// File size at this bound.
    pub bytes: u64,
    /// Relative deviation from the requested size; positive if larger.
    pub off: f64,
    pub trials: u64,
}

impl SizeBound {
    /// Whether the size is within 1 % of the requested one. Otherwise the baseline cannot reach it: its steps, or its
    /// smallest file, are too large.
    pub fn met(&self) -> bool {
        self.off.abs() <= CLOSE_ENOUGH
    }
}

/// The bound at which the size of a baseline is closest to `bytes`, found by the secant method on log size over log
/// bound.
pub fn at_size(
    baseline: &dyn Baseline,
    particles: &PositionColumns,
    bytes: u64,
    context: &Context<'_>,
) -> Result<SizeBound> {
    if bytes == 0 || particles[0].is_empty() {
        return Err(Error::argument(format!(
            "at least one byte and one particle are needed, not {bytes} bytes for {} particles",
            particles[0].len()
        )));
    }
    context.begin(&format!("{} at {bytes} bytes", baseline.name()), TRIALS);
    let mut search = Search::new(particles, bytes);
    let mut best: Option<SizeBound> = None;
    let mut trials = 0;
    while trials < TRIALS {
        context.check()?;
        trials += 1;
        let bound = search.next.exp();
        let got = baseline.compress(particles, bound)?.bytes.len() as u64;
        context.advance(1);
        let off = got as f64 / bytes as f64 - 1.0;
        let miss = (got.max(1) as f64 / bytes as f64).ln();
        if best.is_none_or(|b| miss.abs() < b.off.ln_1p().abs()) {
            best = Some(SizeBound { bound, bytes: got, off, trials });
        }
        if off.abs() <= CLOSE_ENOUGH || !search.learn(miss) {
            break;
        }
    }
    context.end();
    Ok(SizeBound { trials, ..best.expect("at least one trial") })
}

/// Search for the zero of log size over log bound; bounds are logarithms.
struct Search {
    next: f64,
    /// Largest known bound with too many bytes, and the logarithm of the excess.
    more: Option<(f64, f64)>,
    /// Smallest known bound with too few bytes, likewise.
    less: Option<(f64, f64)>,
    /// Limits of the bound.
    ends: [f64; 2],
    /// Number of moves of the same end of the bracket in a row; negative for `more`.
    same: i32,
}

impl Search {
    /// Starts at the bound at which uniform particles, coded as a set, take these bytes.
    fn new(particles: &PositionColumns, bytes: u64) -> Search {
        let ends = particles.iter().map(|c| finite_ends(c));
        let longest = ends.map(|e| e[1] - e[0]).fold(0.0, f64::max);
        let longest = if longest > 0.0 { longest } else { 1.0 };
        // From the precision of float32 to far more than one bin: ZFP's sizes fall until then.
        let ends = [longest * 2f64.powi(-30), longest * 1024.0].map(f64::ln);
        let bits = 8.0 * bytes as f64 / particles[0].len() as f64;
        let finite = particles.iter().flatten().all(|v| v.is_finite());
        let spacing = if finite { mean_spacing(particles) } else { longest };
        let guess = (0.5 * spacing).ln() + (std::f64::consts::LOG2_E - bits) / 3.0 * std::f64::consts::LN_2;
        Search { next: guess.clamp(ends[0], ends[1]), more: None, less: None, ends, same: 0 }
    }

    /// Records the log excess at the last bound and finds the next bound; `false` at the end.
    fn learn(&mut self, miss: f64) -> bool {
        let trial = (self.next, miss);
        if miss > 0.0 {
            self.more = Some(trial);
            self.same = self.same.min(0) - 1;
        } else {
            self.less = Some(trial);
            self.same = self.same.max(0) + 1;
        }
        let step = LARGEST_STEP.ln();
        let grown = f64::from(1 << (self.same.abs() - 1).min(8));
        let wanted = match (self.more, self.less) {
            (Some(more), Some(less)) => {
                if less.0 - more.0 < NARROW {
                    return false;
                }
                // Illinois method: the value of the end that stays is halved, since sizes are curved and stepped.
                let half = 0.5f64.powi((self.same.abs() - 1).min(8));
                let (above, below) = if self.same < 0 { (more.1, half * less.1) } else { (half * more.1, less.1) };
                let share = (above / (above - below)).clamp(0.02, 0.98);
                more.0 + (less.0 - more.0) * share
            }
            // Sizes fall roughly as bounds grow; where they hardly do, the steps grow.
            (Some(more), None) => more.0 + grown * more.1.clamp(0.1, step),
            (None, Some(less)) => less.0 + grown * less.1.clamp(-step, -0.1),
            (None, None) => return false,
        };
        let next = wanted.clamp(self.ends[0], self.ends[1]);
        let moved = next != self.next;
        self.next = next;
        moved
    }
}

/// One run of a baseline.
pub struct BaselineRun {
    pub bound: f64,
    pub bytes: u64,
    pub compress_seconds: f64,
    pub decompress_seconds: f64,
    pub largest_error: f64,
    /// By how much the worst coordinate exceeds the bound plus half a float32 ulp; 0 if none does.
    pub excess: f64,
    pub decoded: PositionColumns,
    /// Input index of each decoded particle; `None` = the input order.
    pub order: Option<Vec<u32>>,
}

/// Outcome of a run.
pub enum BoundCheck {
    /// The bound holds, within half a float32 ulp of each coordinate.
    Held(BaselineRun),
    /// The bound is exceeded by `excess`.
    Exceeded(BaselineRun),
    /// The baseline failed, or returned another number of particles.
    Failed(Error),
}

impl BoundCheck {
    /// One line for the report if the bound is broken or the baseline failed.
    pub fn failure(&self) -> Option<String> {
        match self {
            BoundCheck::Held(_) => None,
            BoundCheck::Exceeded(run) => Some(format!(
                "the bound of {} is broken: the error {} exceeds it and half a float32 ulp by {:e}",
                run.bound, run.largest_error, run.excess
            )),
            BoundCheck::Failed(error) => Some(error.to_string()),
        }
    }

    /// The run, even if its bound is broken.
    pub fn run(&self) -> Option<&BaselineRun> {
        match self {
            BoundCheck::Held(run) | BoundCheck::Exceeded(run) => Some(run),
            BoundCheck::Failed(_) => None,
        }
    }
}

/// Compresses, decompresses and checks every coordinate. Half a float32 ulp above the bound is allowed: the rounding of
/// a decoder that computes in more digits.
pub fn verified(baseline: &dyn Baseline, particles: &PositionColumns, bound: f64) -> BoundCheck {
    match run(baseline, particles, bound) {
        Ok(run) if run.excess > 0.0 => BoundCheck::Exceeded(run),
        Ok(run) => BoundCheck::Held(run),
        Err(error) => BoundCheck::Failed(error),
    }
}

fn run(baseline: &dyn Baseline, particles: &PositionColumns, bound: f64) -> Result<BaselineRun> {
    let started = Instant::now();
    let coded = baseline.compress(particles, bound)?;
    let compress_seconds = started.elapsed().as_secs_f64();
    let started = Instant::now();
    let decoded = baseline.decompress(&coded.bytes)?;
    let decompress_seconds = started.elapsed().as_secs_f64();
    let n = particles[0].len();
    if decoded.iter().any(|c| c.len() != n) {
        let got = decoded[0].len();
        return Err(Error::input(baseline.name(), format!("{got} particles were decoded instead of {n}")));
    }
    if !coded.order.as_deref().is_none_or(|order| is_order(order, n)) {
        return Err(Error::input(baseline.name(), "its order is not a permutation of the particles"));
    }
    let (mut largest_error, mut excess) = (0f64, 0f64);
    for (coordinate, error) in errors(particles, &decoded, coded.order.as_deref()) {
        largest_error = largest_error.max(error);
        excess = excess.max(error - bound - half_ulp(coordinate));
    }
    let (bytes, order) = (coded.bytes.len() as u64, coded.order);
    Ok(BaselineRun { bound, bytes, compress_seconds, decompress_seconds, largest_error, excess, decoded, order })
}

fn is_order(order: &[u32], n: usize) -> bool {
    let mut seen = vec![false; n];
    let new = |i: &u32| seen.get_mut(*i as usize).is_some_and(|s| !std::mem::replace(s, true));
    order.len() == n && order.iter().all(new)
}

/// Half the distance from a float32 to the next.
fn half_ulp(v: f32) -> f64 {
    let next = v.abs().next_up();
    if next.is_finite() { 0.5 * (f64::from(next) - f64::from(v.abs())) } else { 0.0 }
}

#[cfg(test)]
mod tests;
