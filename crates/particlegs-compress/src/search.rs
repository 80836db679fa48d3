//! The smallest file that reaches a goal: the number of Gaussians is searched, and every file is decoded again and
//! measured.

use super::block::CodedBlock;
use super::plan::CompressionPlan;
use super::size::{bytes_a_gaussian, most_gaussians};
use particlegs_core::context::Context;
use particlegs_core::model::{DEFAULT_RATIO, Goal, GoalKind, GoalResult, Target};
use particlegs_core::{Error, Result, codec};
use particlegs_measure::score::GoalMetric;

/// Fits tried at most.
const FITS: usize = 8;
/// Numbers of Gaussians closer than this share need not be told apart.
const CLOSE_NUMBERS: f64 = 0.05;

/// Particles for each Gaussian, at least, where a statistic is to be reached: with fewer to each the correlation of
/// densities falls again (of nbody64 in cells of 0.5 Mpc/h: 0.99903 with 16 to each, 0.99886 with 8).
const PARTICLES_A_GAUSSIAN: u64 = 8;

/// The dependence of a figure on the number of Gaussians. It is searched as a height that rises by about as much with
/// every doubling: decibels, or how often the error is halved.
struct SearchScale {
    /// Gain in height of a doubling of the Gaussians, to begin with.
    a_doubling: f64,
    /// A file this far above what is wanted is small enough.
    close: f64,
    /// Doublings from one number to the next while nothing lies on the other side: at least, and at most. Pictures
    /// follow their number closely; the deviation of a statistic changes its sign now and then, and what it gains
    /// scatters.
    steps: [f64; 2],
    /// The share of the way, in doublings, between two numbers on either side that the next one keeps from both.
    apart: f64,
    most: u64,
}

impl SearchScale {
    fn new(kind: GoalKind, particles: u64) -> SearchScale {
        match kind {
            GoalKind::Psnr => {
                SearchScale { a_doubling: 0.85, close: 0.05, steps: [0.0, 3.0], apart: 0.1, most: particles }
            }
            _ => {
                let most = (particles / PARTICLES_A_GAUSSIAN).max(most_gaussians(particles));
                SearchScale { a_doubling: 0.6, close: 0.1, steps: [1.0, 2.0], apart: 0.3, most }
            }
        }
    }
}

/// The height of `value`: decibels, or the number of halvings of the error (see [`SearchScale`]).
fn height(goal: &Goal, value: f64) -> f64 {
    let halvings = |error: f64| -libm::log2(error.max(1e-12));
    match goal.kind {
        GoalKind::Psnr => value,
        GoalKind::Correlation => halvings(1.0 - value),
        GoalKind::PowerSpectrum | GoalKind::Groups => halvings(value),
    }
}

#[derive(Clone, Copy)]
struct SearchTrial {
    number: f64,
    height: f64,
    reached: GoalResult,
}

/// Finds the number of Gaussians, at the nominal precision, whose decoded file just reaches the goal; `code` gives all
/// blocks at a number. The value that the file reaches comes with it.
pub(super) fn reach(
    metric: &GoalMetric<'_>,
    plan: &CompressionPlan,
    code: &mut dyn FnMut(Target) -> Result<Vec<CodedBlock>>,
    context: &Context<'_>,
) -> Result<(Vec<CodedBlock>, GoalResult)> {
    let goal = metric.goal;
    let scale = SearchScale::new(goal.kind, plan.metadata.count);
    let start = plan.raw_bytes() as f64 / DEFAULT_RATIO / bytes_a_gaussian(plan.recipe().effort);
    // A fit may find room for fewer Gaussians than it is asked for.
    let (mut best_blocks, mut trials) = (None, Vec::new());
    let best = search(&goal, &scale, start, &mut |number| {
        let blocks = code(Target::Gaussians(number as u64))?;
        let model = codec::decode(&plan.file(&blocks, None)?, "the file just coded")?;
        let reached = metric.measure(&model, context)?;
        trials.push((number, model.gaussians()));
        let bytes: usize = blocks.iter().map(CodedBlock::size).sum();
        let figure = goal.describe_value(reached.reached);
        context.message(&format!("{} Gaussians, {bytes} bytes: {figure}", model.gaussians()));
        // Numbers that reach the goal only fall from one to the next.
        if goal.is_met(reached.reached) {
            best_blocks = Some((blocks, reached));
        }
        Ok(reached)
    })?;
    let gaussians = trials.iter().find(|m| m.0 == best.number).map_or(0, |m| m.1);
    best_blocks.ok_or_else(|| unreachable(&scale, best.reached, gaussians, plan))
}

/// Tries numbers of Gaussians, each that reaches the goal smaller than the last that did. Gives the best.
fn search(
    goal: &Goal,
    scale: &SearchScale,
    start: f64,
    attempt: &mut dyn FnMut(f64) -> Result<GoalResult>,
) -> Result<SearchTrial> {
    let (most, wanted_height) = (scale.most as f64, height(goal, goal.asked));
    let mut number = start.clamp(1.0, most).floor();
    let (mut above, mut below, mut best): (Option<SearchTrial>, Option<SearchTrial>, Option<SearchTrial>) =
        (None, None, None);
    for _ in 0..FITS {
        let reached = attempt(number)?;
        let tried = SearchTrial { number, height: height(goal, reached.reached), reached };
        let met = goal.is_met(reached.reached);
        *(if met { &mut above } else { &mut below }) = Some(tried);
        if best.is_none_or(|b| tried.height > b.height) {
            best = Some(tried);
        }
        let close_enough = met && (tried.height - wanted_height <= scale.close || number <= 1.0);
        let bracketed = above.zip(below).is_some_and(|(a, b)| a.number <= b.number * (1.0 + CLOSE_NUMBERS));
        if close_enough || bracketed || !met && number >= most {
            break;
        }
        // Aimed a little above the goal, so that the next number is likely to reach it.
        number = next(above, below, wanted_height + 0.4 * scale.close, scale).clamp(1.0, most).floor();
        // The same number would give the same file.
        if [above, below].into_iter().flatten().any(|t| t.number == number) {
            break;
        }
    }
    best.ok_or(Error::Cancelled)
}

/// The number to try next: along the line through both sides, else along the usual slope.
fn next(above: Option<SearchTrial>, below: Option<SearchTrial>, wanted: f64, scale: &SearchScale) -> f64 {
    match (above, below) {
        (Some(a), Some(b)) => {
            let share = ((wanted - b.height) / (a.height - b.height)).clamp(scale.apart, 1.0 - scale.apart);
            libm::exp(libm::log(b.number) * (1.0 - share) + libm::log(a.number) * share)
        }
        (Some(t), None) | (None, Some(t)) => {
            let (doublings, [least, most]) = ((wanted - t.height) / scale.a_doubling, scale.steps);
            // The bounds on a step hold for fewer Gaussians as for more.
            t.number * libm::exp2(doublings.abs().clamp(least, most).copysign(doublings))
        }
        (None, None) => 1.0,
    }
}

fn unreachable(scale: &SearchScale, best: GoalResult, gaussians: usize, plan: &CompressionPlan) -> Error {
    let goal = best.goal;
    let message = format!(
        "the target {} cannot be reached: the best result was {}, with {gaussians} Gaussians",
        goal.describe(plan.metadata.units.length_text()),
        goal.describe_value(best.reached)
    );
    let words = match goal.kind {
        GoalKind::Psnr => "use a lower target, or a size".to_string(),
        _ => format!("use a lower target, or set a number of Gaussians: the search stops at {}", scale.most),
    };
    Error::unreachable(message, words)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Searches a figure that is a function of the number, from 1000 on; numbers tried, and those that met it.
    fn searched(goal: Goal, particles: u64, figure: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>, SearchTrial) {
        let (mut tried, mut met) = (Vec::new(), Vec::new());
        let best = search(&goal, &SearchScale::new(goal.kind, particles), 1000.0, &mut |number| {
            tried.push(number);
            let reached = GoalResult { goal, reached: figure(number) };
            if goal.is_met(reached.reached) {
                met.push(number);
            }
            Ok(reached)
        });
        (tried, met, best.unwrap_or_else(|e| panic!("{e}")))
    }

    #[test]
    fn the_smallest_number_is_found_in_few_fits() {
        let psnr = |asked| Goal { kind: GoalKind::Psnr, asked, at: 0.0 };
        let decibels = |n: f64| 20.0 + 0.7 * n.log2();
        for asked in [24.0, 27.0, 30.0] {
            let right = ((asked - 20.0) / 0.7f64).exp2();
            let (tried, met, _) = searched(psnr(asked), 1 << 24, decibels);
            let smallest = *met.last().unwrap();
            assert!(tried.len() <= 6 && smallest >= right && smallest < 1.06 * right, "{asked}: {tried:?}, {right}");
            assert!(met.is_sorted_by(|a, b| a > b));
        }
        let density = |least| Goal { kind: GoalKind::Correlation, asked: least, at: 1.0 };
        let correlation = |n: f64| 1.0 - 2.0 * n.powf(-0.8);
        for asked in [0.99, 0.999, 0.9995] {
            let right = ((1.0 - asked) / 2.0f64).powf(-1.25);
            let (tried, met, _) = searched(density(asked), 1 << 20, correlation);
            let smallest = *met.last().unwrap();
            assert!(tried.len() <= FITS && smallest >= right && smallest < 1.15 * right, "{asked}: {tried:?}, {right}");
        }
    }

    /// A deviation that changes its sign twice: what is kept has been measured to meet the goal.
    #[test]
    fn figures_that_are_not_monotone_end_in_a_number_that_meets_them() {
        let goal = Goal { kind: GoalKind::PowerSpectrum, asked: 0.01, at: 2.0 };
        let deviation = |n: f64| (0.03 * (n / 1300.0).log2().cos() + 0.001).abs();
        let (tried, met, best) = searched(goal, 1 << 18, deviation);
        assert!(tried.len() <= FITS && deviation(*met.last().unwrap()) <= 0.01, "{tried:?}");
        assert!(best.reached.reached <= 0.01 && met.is_sorted_by(|a, b| a > b), "{met:?}");
    }

    #[test]
    fn what_is_out_of_reach_ends_at_the_most_gaussians() {
        let goal = Goal { kind: GoalKind::Groups, asked: 0.1, at: 20.0 };
        let (tried, met, best) = searched(goal, 1 << 20, |n| if n < 5000.0 { 0.2 } else { 0.3 });
        assert_eq!((tried.last(), met.len(), best.number), (Some(&131_072.0), 0, 1000.0));
        assert!(tried.len() <= 5, "{tried:?}");
        // One Gaussian is the smallest model there is.
        let (tried, met, _) = searched(goal, 1 << 20, |_| 0.05);
        assert_eq!((met.last(), tried.len() < FITS), (Some(&1.0), true));
    }
}
