//! The smallest file of a wanted quality: masked PSNR, `expected` look, mean over held-out views.

use super::block::bytes_a_gaussian;
use super::job::{Coded, Job};
use super::target::DEFAULT_RATIO;
use crate::codec;
use crate::picture::Size;
use crate::render::Scene;
use crate::score::{HeldOut, ViewSeed, held_out_views};
use crate::{Error, Result};

/// Pictures that quality is measured on.
const SIZE: Size = Size { width: 1920, height: 1080 };
/// Held-out views an orbit.
const FRAMES: usize = 2;
/// Decibels that a doubling of the Gaussians buys, to begin the search with.
const DECIBELS_A_DOUBLING: f64 = 0.85;
/// A file this far above the wanted quality is small enough.
const CLOSE_DECIBELS: f64 = 0.05;
/// Fits tried at most.
const FITS: usize = 8;

/// One fit of the search.
struct Tried {
    number: f64,
    decibels: f64,
    coded: Coded,
}

/// Finds the number of Gaussians, at the nominal precision, whose decoded file just reaches
/// `decibels`.
///
/// # Errors
/// [`Error::Unreachable`] where as many Gaussians as particles, or eight fits, do not reach it.
pub(super) fn reach_quality(job: &mut Job, decibels: f64) -> Result<Coded> {
    let m = &job.plan.metadata;
    let seed = ViewSeed { bounds: &m.bounds, default_radius: m.default_radius, size: SIZE, seed: job.plan.seed };
    let held_out = HeldOut::draw(job.particles, &held_out_views(&seed, FRAMES), SIZE, job.progress)?;
    let most = m.count as f64;
    let mut number =
        (job.plan.raw_bytes() as f64 / DEFAULT_RATIO / bytes_a_gaussian(job.plan.effort)).clamp(1.0, most).floor();
    let (mut above, mut below): (Option<Tried>, Option<Tried>) = (None, None);
    for _ in 0..FITS {
        let coded = job.at_number(number as u64)?;
        let model = codec::decode(&job.file(&coded, None)?, "the file just coded")?;
        // Pictures that are identical in every view have no finite score.
        let reached = held_out.expected_masked_psnr(&Scene::of(&model), job.progress)?.unwrap_or(f64::INFINITY);
        job.progress.message(&format!("{number} Gaussians, {} bytes: {reached:.2} dB", coded.len()));
        let tried = Tried { number, decibels: reached, coded };
        let done = reached >= decibels && (reached - decibels <= CLOSE_DECIBELS || number <= 1.0)
            || reached < decibels && number >= most;
        *(if reached >= decibels { &mut above } else { &mut below }) = Some(tried);
        if done {
            break;
        }
        number = next(above.as_ref(), below.as_ref(), decibels + 0.4 * CLOSE_DECIBELS).clamp(1.0, most).floor();
        if [&above, &below].into_iter().flatten().any(|t| t.number == number) {
            break;
        }
    }
    match (above, below) {
        (Some(t), _) => Ok(t.coded),
        (None, below) => Err(Error::Unreachable {
            what: format!(
                "{decibels} dB was asked for; {:.2} dB was reached with {} Gaussians",
                below.as_ref().map_or(0.0, |t| t.decibels),
                below.as_ref().map_or(0.0, |t| t.number)
            ),
            hint: "ask for less, or for a size".into(),
        }),
    }
}

/// The number to try next: along the line through both sides, else along the usual slope.
fn next(above: Option<&Tried>, below: Option<&Tried>, decibels: f64) -> f64 {
    match (above, below) {
        (Some(a), Some(b)) => {
            let share = ((decibels - b.decibels) / (a.decibels - b.decibels)).clamp(0.05, 0.95);
            (b.number.ln() * (1.0 - share) + a.number.ln() * share).exp()
        }
        (Some(t), None) | (None, Some(t)) => {
            let doublings = ((decibels - t.decibels) / DECIBELS_A_DOUBLING).clamp(-3.0, 3.0);
            t.number * doublings.exp2()
        }
        (None, None) => 1.0,
    }
}
