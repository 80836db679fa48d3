//! What other compressors make of the particles at a model's size.

use crate::lab::{Lab, Snapshot};
use crate::lcp::Lcp;
use crate::views::{Score, Truth, kept_picture, mean, told};
use crate::{Baseline, Columns, largest_error};
use particlegs::camera::View;
use particlegs::particles::Particles;
use particlegs::picture::{Gray8, Scores};
use particlegs::reference::Reference;
use particlegs::splat::Look;
use particlegs::{Error, Result};
use serde::{Deserialize, Serialize};

/// The compressors that figures show beside models. The one place to add another.
pub(super) fn baselines(_lab: &Lab<'_>) -> Vec<Box<dyn Baseline>> {
    vec![Box::new(Lcp)]
}

/// Bounds that are tried at most.
const TRIALS: usize = 14;
/// A size is met within this share of it.
const CLOSE: f64 = 0.01;

/// A compressor at a size, with its pictures of some views.
pub(super) struct Other {
    /// As tables call it.
    pub name: &'static str,
    /// What it took.
    pub coded: Coded,
    /// Pictures of the decoded particles, a view of the truth each.
    pub pictures: Vec<Gray8>,
    /// Their scores.
    pub scores: Vec<Score>,
}

/// What a compressor took, with its bound verified.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Coded {
    /// The bound, world units.
    pub bound: f64,
    /// Bytes.
    pub bytes: u64,
    /// The largest error of any decoded coordinate, world units.
    pub largest_error: f64,
}

impl Other {
    /// Mean masked PSNR of its pictures, dB.
    pub fn masked(&self) -> Option<f64> {
        mean(&self.scores, |s| s.masked)
    }
}

/// Every compressor at about `bytes`, drawn in the views of `truth` as all particles are; and what failed, in words.
///
/// # Errors
/// [`Error::Cancelled`], [`Error::Io`] and those of drawing; a compressor's own are among the words.
pub(super) fn at_size(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    bytes: u64,
    truth: &Truth,
) -> Result<(Vec<Other>, Vec<String>)> {
    let (mut others, mut failed) = (Vec::new(), Vec::new());
    for baseline in baselines(lab) {
        match other(lab, snapshot, &*baseline, bytes, truth) {
            Ok(other) => others.push(other),
            Err(e @ (Error::Cancelled | Error::Io { .. })) => return Err(e),
            Err(e) => failed.push(format!("{} is left out: {e}", baseline.name())),
        }
    }
    Ok((others, failed))
}

fn other(lab: &Lab<'_>, snapshot: &Snapshot, baseline: &dyn Baseline, bytes: u64, truth: &Truth) -> Result<Other> {
    let inputs = (baseline.name(), &snapshot.hash, bytes);
    let mut decoded = Decoded { lab, snapshot, baseline, bytes, particles: None };
    let coded = lab.store.result("baseline-coded", &inputs, || decoded.coded())?;
    let draw = |view: &View| {
        kept_picture(lab, &("baseline", &inputs, told(view, truth.size)), || {
            let reference = Reference::new(decoded.particles()?);
            reference.draw(view, truth.size, Look::Paraview, lab.progress)
        })
    };
    let pictures: Vec<Gray8> = truth.views.iter().map(draw).collect::<Result<_>>()?;
    let scores = scores(truth, &pictures);
    Ok(Other { name: baseline.name(), coded, pictures, scores })
}

/// The scores of pictures of the views of `truth`, in its order.
pub(super) fn scores(truth: &Truth, pictures: &[Gray8]) -> Vec<Score> {
    let score = |((view, truth), picture): ((&View, &Gray8), &Gray8)| {
        let Scores { psnr, masked_psnr: masked, ssim } = Scores::of(picture, truth);
        Score { view: view.name.clone(), psnr, masked, ssim }
    };
    truth.views.iter().zip(&truth.pictures).zip(pictures).map(score).collect()
}

/// Particles as a compressor gives them back, made where they are first needed.
struct Decoded<'a> {
    lab: &'a Lab<'a>,
    snapshot: &'a Snapshot,
    baseline: &'a dyn Baseline,
    bytes: u64,
    particles: Option<Particles>,
}

impl Decoded<'_> {
    /// The bound of the size, kept.
    fn bound(&self, columns: &Columns) -> Result<f64> {
        let inputs = (self.baseline.name(), &self.snapshot.hash, self.bytes);
        self.lab.store.result("baseline-bound", &inputs, || {
            let size = |bound: f64| {
                self.lab.progress.check()?;
                Ok(self.baseline.compress(columns, bound)?.bytes.len() as u64)
            };
            bound_of(self.bytes, self.snapshot.spacing(), size)
        })
    }

    /// Compresses, decompresses, holds every coordinate to the bound and keeps the particles.
    fn coded(&mut self) -> Result<Coded> {
        let columns = self.snapshot.columns();
        let bound = self.bound(&columns)?;
        let coded = self.baseline.compress(&columns, bound)?;
        let decoded = self.baseline.decompress(&coded.bytes)?;
        let n = columns[0].len();
        if decoded.iter().any(|c| c.len() != n) {
            let got = decoded[0].len();
            return Err(Error::input(self.baseline.name(), format!("{got} particles came back of {n}")));
        }
        let largest_error = largest_error(&columns, &decoded, coded.order.as_deref());
        let largest = columns.iter().flatten().fold(0f32, |a, v| a.max(v.abs()));
        // Decoders compute in more digits than float32 holds: half its step at the largest coordinate is theirs.
        let step = f64::from(largest.next_up() - largest);
        if largest_error.is_nan() || largest_error > bound + 0.5 * step {
            let what = format!("an error of {largest_error:e} breaks its bound of {bound:e}");
            return Err(Error::input(self.baseline.name(), what));
        }
        let [x, y, z] = decoded;
        self.particles = Some(Particles::from_columns(x, y, z));
        Ok(Coded { bound, bytes: coded.bytes.len() as u64, largest_error })
    }

    fn particles(&mut self) -> Result<&Particles> {
        if self.particles.is_none() {
            self.coded()?;
        }
        self.particles.as_ref().ok_or_else(|| Error::input(self.baseline.name(), "gave no particles"))
    }
}

/// The bound whose size is nearest to `bytes`: halving between bounds of too many and too few bytes, from `first` on, on a
/// logarithmic scale.
fn bound_of(bytes: u64, first: f64, mut size: impl FnMut(f64) -> Result<u64>) -> Result<f64> {
    let (mut bound, mut more, mut less) = (first, None::<f64>, None::<f64>);
    let mut best = (f64::INFINITY, first);
    for _ in 0..TRIALS {
        let off = size(bound)? as f64 / bytes as f64;
        if off.ln().abs() < best.0 {
            best = (off.ln().abs(), bound);
        }
        if (off - 1.0).abs() <= CLOSE {
            break;
        }
        if off > 1.0 {
            more = Some(bound)
        } else {
            less = Some(bound)
        }
        bound = match (more, less) {
            (Some(a), Some(b)) => (a * b).sqrt(),
            (Some(a), None) => 2.0 * a,
            (None, Some(b)) => 0.5 * b,
            (None, None) => bound,
        };
    }
    Ok(best.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_of_a_size_is_found() {
        // Bytes fall with the bound as they do for coordinates.
        let size = |bound: f64| Ok((1000.0 * (8.0 - bound.log2())) as u64);
        for first in [1e-4, 1.0, 100.0] {
            let bound = bound_of(9_000, first, size).unwrap();
            let got = size(bound).unwrap() as f64;
            assert!((got / 9_000.0 - 1.0).abs() <= CLOSE, "{first}: {bound} {got}");
        }
        // Sizes that cannot be met: the nearest one tried.
        assert!(bound_of(10, 1.0, |_| Ok(5_000)).unwrap() > 0.0);
        assert!(bound_of(10, 1.0, |_| Err(Error::Cancelled)).is_err());
    }
}
