//! The smallest file of a wanted quality: masked PSNR, `expected` look, mean over held-out views.

use super::block::CodedBlock;
use super::plan::Plan;
use super::size::bytes_a_gaussian;
use super::target::{DEFAULT_RATIO, Target};
use crate::codec;
use crate::particles::Particles;
use crate::picture::Size;
use crate::progress::Progress;
use crate::render::Scene;
use crate::score::{HeldOut, held_out_views};
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
    blocks: Vec<CodedBlock>,
}

/// Finds the number of Gaussians, at the nominal precision, whose decoded file just reaches
/// `decibels`; `code` gives all blocks at a number.
///
/// # Errors
/// [`Error::Unreachable`] where as many Gaussians as particles, or eight fits, do not reach it; those of
/// `code`.
pub(super) fn reach_quality(
    decibels: f64,
    particles: &Particles,
    plan: &Plan,
    code: &mut dyn FnMut(Target) -> Result<Vec<CodedBlock>>,
    progress: &dyn Progress,
) -> Result<Vec<CodedBlock>> {
    let m = &plan.metadata;
    let held_out = HeldOut::draw(particles, &held_out_views(m, SIZE, plan.seed, FRAMES), SIZE, progress)?;
    let most = m.count as f64;
    let mut number = (plan.raw_bytes() as f64 / DEFAULT_RATIO / bytes_a_gaussian(plan.effort)).clamp(1.0, most).floor();
    let (mut above, mut below): (Option<Tried>, Option<Tried>) = (None, None);
    for _ in 0..FITS {
        let blocks = code(Target::Gaussians(number as u64))?;
        let model = codec::decode(&plan.file(&blocks, None)?, "the file just coded")?;
        // Pictures that are identical in every view have no finite score.
        let reached = held_out.expected_masked_psnr(&Scene::of(&model), progress)?.unwrap_or(f64::INFINITY);
        let bytes: usize = blocks.iter().map(CodedBlock::size).sum();
        progress.message(&format!("{number} Gaussians, {bytes} bytes: {reached:.2} dB"));
        let tried = Tried { number, decibels: reached, blocks };
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
        (Some(t), _) => Ok(t.blocks),
        (None, below) => Err(Error::Unreachable {
            what: format!(
                "{decibels} dB was asked for; {:.2} dB was reached with {} Gaussians",
                below.as_ref().map_or(0.0, |t| t.decibels),
                below.as_ref().map_or(0.0, |t| t.number)
            ),
            remedy: "ask for less, or for a size".into(),
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
