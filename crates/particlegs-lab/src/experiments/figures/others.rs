//! Pictures of other methods at a model's size.

use crate::lab::{Lab, Style, or_made};
use crate::method::{BoundReport, CompressionMethod, FileContent, MethodOutput};
use crate::snapshot::Snapshot;
use crate::views::{ReferenceViews, Score, cache_key, kept_picture, masked, mean};
use particlegs_core::camera::View;
use particlegs_core::picture::Gray8;
use particlegs_core::{Error, Result};

/// A method at one size, with its pictures.
pub(super) struct MethodPictures {
    pub name: String,
    pub bytes: u64,
    /// Its bound and largest error, if it has a bound.
    pub bound: Option<BoundReport>,
    /// Pictures of the decoded particles, one per view of the truth.
    pub pictures: Vec<Gray8>,
    pub scores: Vec<Score>,
}

impl MethodPictures {
    /// Mean masked PSNR of its pictures, dB; infinite if none differs from the truth.
    pub fn masked(&self) -> Option<f64> {
        mean(&self.scores, masked)
    }
}

/// Every other method at about `bytes`, drawn in the views of `truth`, and notes on those that failed.
pub(super) fn at_size(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    bytes: u64,
    truth: &ReferenceViews,
) -> Result<(Vec<MethodPictures>, Vec<String>)> {
    let (mut others, mut failed) = (Vec::new(), Vec::new());
    for method in CompressionMethod::all(lab).into_iter().filter(|m| *m != CompressionMethod::OpticalDepth) {
        match other(lab, snapshot, method, bytes, truth) {
            Ok(other) => others.push(other),
            Err(e @ (Error::Cancelled | Error::Io { .. })) => return Err(e),
            Err(e) => failed.push(format!("{} was skipped: {e}", method.name(lab))),
        }
    }
    Ok((others, failed))
}

fn other(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    method: CompressionMethod,
    bytes: u64,
    truth: &ReferenceViews,
) -> Result<MethodPictures> {
    let seed = lab.settings.seed;
    let inputs = (method.source(lab), &snapshot.hash, bytes, seed);
    // Made on demand, for the first picture or number that is not cached.
    let mut cached_output: Option<MethodOutput> = None;
    let keep = || -> Result<MethodOutput> { method.keep(lab, &snapshot.particles, &snapshot.hash, bytes, seed) };
    let (size, bound) = lab.store.result("other", &inputs, || {
        let output = cached_output.insert(keep()?);
        Ok((output.bytes, output.bound))
    })?;
    let draw = |view: &View| {
        kept_picture(lab, &("other", &inputs, cache_key(view, truth.size)), || {
            let FileContent::Particles(particles, factor) = &or_made(&mut cached_output, keep)?.content else {
                return Err(Error::input(method.name(lab), "returned no particles"));
            };
            let view = View { radius: view.radius * factor, ..view.clone() };
            lab.draws_particles(particles, truth.bounds, Style::Paraview)?(&view, truth.size)
        })
    };
    let pictures: Vec<Gray8> = truth.views.iter().map(draw).collect::<Result<_>>()?;
    let scores = scores(truth, &pictures)?;
    Ok(MethodPictures { name: method.name(lab), bytes: size, bound, pictures, scores })
}

/// Scores pictures against `truth`, in its order.
pub(super) fn scores(truth: &ReferenceViews, pictures: &[Gray8]) -> Result<Vec<Score>> {
    let mut pictures = pictures.iter().cloned();
    truth.score(|view| pictures.next().ok_or_else(|| Error::argument(format!("there is no picture of {}", view.name))))
}
