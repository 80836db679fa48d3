//! The smallest file of a wanted quality: masked PSNR, `expected` look, mean over held-out views.

use super::job::Job;
use crate::codec::{self, Precision};
use crate::picture::{Gray8, Plane, Size, masked_psnr};
use crate::reference::Reference;
use crate::render::{self, Scene};
use crate::score::{EvalView, ViewSeed, held_out_views};
use crate::splat::{Look, tone};
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
    bytes: Vec<u8>,
}

/// Finds the number of Gaussians, at the nominal precision, whose decoded file just reaches
/// `decibels`.
///
/// # Errors
/// [`Error::Unreachable`] where as many Gaussians as particles, or eight fits, do not reach it.
pub(super) fn reach_quality(job: &mut Job, decibels: f64) -> Result<(Vec<u8>, f64)> {
    let truths = truths(job)?;
    let most = job.metadata.count as f64;
    let mut number = (job.raw_bytes as f64 / super::target::DEFAULT_RATIO / codec::NOMINAL_BYTES_A_GAUSSIAN).clamp(1.0, most);
    let (mut above, mut below): (Option<Tried>, Option<Tried>) = (None, None);
    for _ in 0..FITS {
        let (bytes, _) = job.at_number(number as u64)?;
        let reached = quality(job, &bytes, &truths)?;
        job.progress.message(&format!("{} Gaussians, {} bytes: {reached:.2} dB", number as u64, bytes.len()));
        let tried = Tried { number: number.floor(), decibels: reached, bytes };
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
        (Some(t), _) => Ok((t.bytes, 1.0)),
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

/// The held-out views and what all particles show there.
fn truths(job: &Job) -> Result<Vec<(EvalView, Gray8)>> {
    let m = &job.metadata;
    let seed = ViewSeed { bounds: &m.bounds, default_radius: m.default_radius, size: SIZE, seed: job.options.seed };
    let reference = Reference::new(job.particles, m.bounds);
    held_out_views(&seed, FRAMES)
        .into_iter()
        .map(|v| {
            let tau = reference.optical_depth(&v.view, SIZE, job.progress)?;
            let picture = expected(&tau, &v);
            Ok((v, picture))
        })
        .collect()
}

fn expected(tau: &Plane, v: &EvalView) -> Gray8 {
    tone(tau, Look::Expected, v.view.opacity, v.view.radius_pixels(SIZE))
}

fn quality(job: &Job, bytes: &[u8], truths: &[(EvalView, Gray8)]) -> Result<f64> {
    let model = codec::decode(bytes, "the file just coded")?;
    let scene = Scene::of(&model);
    let mut sum = 0.0;
    for (v, truth) in truths {
        let tau = render::optical_depth(&scene, &v.view, SIZE, job.progress)?;
        // Identical pictures have no finite score; 99 dB stands for them in the mean.
        sum += masked_psnr(truth, &expected(&tau, v)).unwrap_or(99.0);
    }
    Ok(sum / truths.len() as f64)
}
