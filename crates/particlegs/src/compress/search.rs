//! The smallest file that reaches a goal: the number of Gaussians is searched, and every file is decoded again and
//! measured.

use super::block::CodedBlock;
use super::plan::Plan;
use super::size::{bytes_a_gaussian, most_gaussians};
use super::target::{DEFAULT_RATIO, Target};
use crate::codec;
use crate::model::{Goal, GoalKind, Reached};
use crate::progress::Progress;
use crate::score::Gauge;
use crate::{Error, Result};

/// Fits tried at most.
const FITS: usize = 8;
/// Numbers of Gaussians closer than this share need not be told apart.
const CLOSE_NUMBERS: f64 = 0.02;

/// How a figure follows the number of Gaussians. It is searched as a height that rises by about as much with every
/// doubling: decibels, or how often the error is halved.
struct Scale {
    /// What a doubling of the Gaussians buys, to begin with.
    a_doubling: f64,
    /// A file this far above what is wanted is small enough.
    close: f64,
    /// Gaussians at most.
    most: u64,
}

impl Scale {
    fn of(kind: GoalKind, particles: u64) -> Scale {
        match kind {
            GoalKind::Psnr => Scale { a_doubling: 0.85, close: 0.05, most: particles },
            // More would follow the noise of the particles, which these figures take for signal.
            _ => Scale { a_doubling: 0.8, close: 0.1, most: most_gaussians(particles) },
        }
    }
}

/// See [`Scale`].
fn height(goal: &Goal, value: f64) -> f64 {
    let halvings = |error: f64| -error.max(1e-12).log2();
    match goal.kind {
        GoalKind::Psnr => value,
        GoalKind::Correlation => halvings(1.0 - value),
        GoalKind::PowerSpectrum | GoalKind::Groups => halvings(value),
    }
}

/// One fit of the search.
#[derive(Clone, Copy)]
struct Tried {
    number: f64,
    height: f64,
    reached: Reached,
}

/// Finds the number of Gaussians, at the nominal precision, whose decoded file just reaches the goal; `code` gives all
/// blocks at a number. What the file reaches comes with it.
///
/// # Errors
/// [`Error::Unreachable`] where the most Gaussians, or eight fits, do not reach it; those of `code`.
pub(super) fn reach(
    gauge: &Gauge<'_>,
    plan: &Plan,
    code: &mut dyn FnMut(Target) -> Result<Vec<CodedBlock>>,
    progress: &dyn Progress,
) -> Result<(Vec<CodedBlock>, Reached)> {
    let goal = gauge.goal;
    let scale = Scale::of(goal.kind, plan.metadata.count);
    let start = plan.raw_bytes() as f64 / DEFAULT_RATIO / bytes_a_gaussian(plan.effort);
    let mut kept = None;
    let best = search(&goal, &scale, start, &mut |number| {
        let blocks = code(Target::Gaussians(number as u64))?;
        let model = codec::decode(&plan.file(&blocks, None)?, "the file just coded")?;
        let reached = gauge.measure(&model, progress)?;
        let bytes: usize = blocks.iter().map(CodedBlock::size).sum();
        progress.message(&format!("{number} Gaussians, {bytes} bytes: {}", goal.value_in_words(reached.reached)));
        // Numbers that reach the goal only fall from one to the next.
        if goal.is_met(reached.reached) {
            kept = Some((blocks, reached));
        }
        Ok(reached)
    })?;
    kept.ok_or_else(|| unreachable(&scale, &best, plan))
}

/// Tries numbers of Gaussians, each that reaches the goal smaller than the last that did. Gives the best.
fn search(goal: &Goal, scale: &Scale, start: f64, attempt: &mut dyn FnMut(f64) -> Result<Reached>) -> Result<Tried> {
    let (most, wanted) = (scale.most as f64, height(goal, goal.asked));
    let mut number = start.clamp(1.0, most).floor();
    let (mut above, mut below, mut best): (Option<Tried>, Option<Tried>, Option<Tried>) = (None, None, None);
    for _ in 0..FITS {
        let reached = attempt(number)?;
        let tried = Tried { number, height: height(goal, reached.reached), reached };
        let met = goal.is_met(reached.reached);
        *(if met { &mut above } else { &mut below }) = Some(tried);
        if best.is_none_or(|b| tried.height > b.height) {
            best = Some(tried);
        }
        let close_enough = met && (tried.height - wanted <= scale.close || number <= 1.0);
        let bracketed = above.zip(below).is_some_and(|(a, b)| a.number <= b.number * (1.0 + CLOSE_NUMBERS));
        if close_enough || bracketed || !met && number >= most {
            break;
        }
        number = next(above, below, wanted + 0.4 * scale.close, scale.a_doubling).clamp(1.0, most).floor();
        if [above, below].into_iter().flatten().any(|t| t.number == number) {
            break;
        }
    }
    best.ok_or(Error::Cancelled)
}

/// The number to try next: along the line through both sides, else along the usual slope.
fn next(above: Option<Tried>, below: Option<Tried>, wanted: f64, a_doubling: f64) -> f64 {
    match (above, below) {
        (Some(a), Some(b)) => {
            let share = ((wanted - b.height) / (a.height - b.height)).clamp(0.05, 0.95);
            (b.number.ln() * (1.0 - share) + a.number.ln() * share).exp()
        }
        (Some(t), None) | (None, Some(t)) => {
            let doublings = ((wanted - t.height) / a_doubling).clamp(-3.0, 3.0);
            t.number * doublings.exp2()
        }
        (None, None) => 1.0,
    }
}

/// Why the goal is not reached, and what would help.
fn unreachable(scale: &Scale, best: &Tried, plan: &Plan) -> Error {
    let goal = best.reached.goal;
    let what = format!(
        "{} was asked for; at best {} was reached, with {} Gaussians",
        goal.in_words(plan.metadata.length_unit.as_deref()),
        goal.value_in_words(best.reached.reached),
        best.number
    );
    let words = match goal.kind {
        GoalKind::Psnr => "ask for less, or for a size".to_string(),
        _ => format!(
            "ask for less; more than {} Gaussians, one for 16 particles, would follow the particles' noise",
            scale.most
        ),
    };
    Error::Unreachable { what, remedy: words.into() }
}
