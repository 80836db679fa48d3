//! Baselines at a size, and with their bounds verified.

use crate::subset::mean_spacing;
use crate::{Baseline, PositionColumns, errors, finite_ends};
use particlegs_pipeline::context::Context;
use particlegs_pipeline::{Error, Result};
use std::time::Instant;

/// Trials of a bound at most; six are usual.
const TRIALS: u64 = 12;
/// A size is met where it is off by less than this share of it.
const CLOSE_ENOUGH: f64 = 0.01;
/// Bounds nearer than this share of each other are not told apart.
const NARROW: f64 = 1e-4;
/// The first bound beside one that misses is this many times larger or smaller at most.
const LARGEST_STEP: f64 = 8.0;

/// The bound of a size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeBound {
    /// The bound, in the particles' unit of length.
    pub bound: f64,
    /// Bytes at this bound.
    pub bytes: u64,
    /// How far they are from those asked for, as a share of them: above 0 is more.
    pub off: f64,
    pub trials: u64,
}

impl SizeBound {
    /// Is it within 1 % of what was asked for? Where not, the baseline has no such size: its steps are larger, or its
    /// smallest file is.
    pub fn met(&self) -> bool {
        self.off.abs() <= CLOSE_ENOUGH
    }
}

/// The bound at which a baseline takes as close to `bytes` as it can, on a logarithmic scale of sizes: sought between
/// bounds of too many and too few bytes by the secant of log size over log bound.
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
    Ok(SizeBound { trials, ..best.expect("one trial at least") })
}

/// Where log sizes over log bounds fall through 0: logarithms of bounds.
struct Search {
    next: f64,
    /// The largest bound known that gives too many bytes, and by what logarithm.
    more: Option<(f64, f64)>,
    /// The smallest known that gives too few.
    less: Option<(f64, f64)>,
    /// Bounds that are not passed.
    ends: [f64; 2],
    /// How often in a row the same side of the bracket moved: below 0 `more`.
    same: i32,
}

impl Search {
    /// From the bound at which evenly spread particles take the bytes, coded as a set.
    fn new(particles: &PositionColumns, bytes: u64) -> Search {
        let ends = particles.iter().map(|c| finite_ends(c));
        let longest = ends.map(|e| e[1] - e[0]).fold(0.0, f64::max);
        let longest = if longest > 0.0 { longest } else { 1.0 };
        // From float32's own precision to far more than one bin: ZFP's sizes fall until then.
        let ends = [longest * 2f64.powi(-30), longest * 1024.0].map(f64::ln);
        let bits = 8.0 * bytes as f64 / particles[0].len() as f64;
        let finite = particles.iter().flatten().all(|v| v.is_finite());
        let spacing = if finite { mean_spacing(particles) } else { longest };
        let guess = (0.5 * spacing).ln() + (std::f64::consts::LOG2_E - bits) / 3.0 * std::f64::consts::LN_2;
        Search { next: guess.clamp(ends[0], ends[1]), more: None, less: None, ends, same: 0 }
    }

    /// Notes by what logarithm the size at the last bound is too large, and finds the next; `false` where there is none.
    fn learn(&mut self, miss: f64) -> bool {
        let here = (self.next, miss);
        if miss > 0.0 {
            self.more = Some(here);
            self.same = self.same.min(0) - 1;
        } else {
            self.less = Some(here);
            self.same = self.same.max(0) + 1;
        }
        let step = LARGEST_STEP.ln();
        let grown = f64::from(1 << (self.same.abs() - 1).min(8));
        let wanted = match (self.more, self.less) {
            (Some(more), Some(less)) => {
                if less.0 - more.0 < NARROW {
                    return false;
                }
                // What stays at its end is counted half as far off each time (Illinois): sizes are curves, and steps.
                let half = 0.5f64.powi((self.same.abs() - 1).min(8));
                let (above, below) = if self.same < 0 { (more.1, half * less.1) } else { (half * more.1, less.1) };
                let share = (above / (above - below)).clamp(0.02, 0.98);
                more.0 + (less.0 - more.0) * share
            }
            // Sizes fall about as bounds grow; where they hardly do, steps grow.
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

/// One run of a baseline: what it took, and what came back.
pub struct BaselineRun {
    pub bound: f64,
    pub bytes: u64,
    pub compress_seconds: f64,
    pub decompress_seconds: f64,
    pub largest_error: f64,
    /// By how much the worst coordinate passes the bound and half a float32 ulp of its own; 0 where none does.
    pub excess: f64,
    pub decoded: PositionColumns,
    /// Which particle comes where in them; `None` = in their own order.
    pub order: Option<Vec<u32>>,
}

/// What became of a run.
pub enum BoundCheck {
    /// The bound holds, to half a float32 ulp of each coordinate.
    Held(BaselineRun),
    /// It does not: `excess` says by how much.
    Exceeded(BaselineRun),
    /// The baseline failed, or did not give back as many particles.
    Failed(Error),
}

impl BoundCheck {
    /// What a report says where the bound does not hold or the baseline failed: one line; `None` where all is well.
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

    /// The run, whether its bound holds or not.
    pub fn run(&self) -> Option<&BaselineRun> {
        match self {
            BoundCheck::Held(run) | BoundCheck::Exceeded(run) => Some(run),
            BoundCheck::Failed(_) => None,
        }
    }
}

/// Compresses, decompresses and holds every coordinate to its bound. Nothing beyond it is allowed but half a float32 ulp
/// of the coordinate, the rounding of a decoder that computes in more digits than it gives.
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
    for (own, error) in errors(particles, &decoded, coded.order.as_deref()) {
        largest_error = largest_error.max(error);
        excess = excess.max(error - bound - half_ulp(own));
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
