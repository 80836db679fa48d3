//! Methods at several file sizes, with reference scores: rows for several experiments.

use crate::lab::{Lab, ModelBuild};
use crate::method::{CompressionMethod, MethodMeasurement};
use crate::results::{PlotSeries, Point, Spread};
use crate::snapshot::Snapshot;
use crate::views::{ReferenceViews, Score, masked, mean};
use particlegs_core::Result;
use particlegs_measure::score;
use serde::{Deserialize, Serialize};

/// Ratio at which methods are compared: that of the published single-block model (paper, table "Rate-distortion").
pub(super) const COMPARED: f64 = 263.0;

/// The axis of file sizes; small files are on the right.
pub(super) const BY_SIZE: &str = "ratio: bytes of positions / file size";
/// Replaces a margin if there is no file of that size.
pub(super) const NOT_OF_THIS_SIZE: &str = "no file of this size";
/// Largest factor between the requested size and a file that counts as having it.
const OFF: f64 = 1.1;

/// A method at one ratio, once per seed.
pub(super) struct RatePoint {
    pub method: CompressionMethod,
    pub ratio: f64,
    /// Measurements by seed.
    pub runs: Vec<MethodMeasurement>,
}

impl RatePoint {
    /// A number from every seed's scores; seeds without one are left out.
    pub fn values(&self, measure: &dyn Fn(&[Score]) -> Option<f64>) -> Vec<f64> {
        self.runs.iter().filter(|r| r.failure.is_none()).filter_map(|r| measure(&r.scores)).collect()
    }

    /// The scores of every seed, with their label.
    pub fn pictures<'a>(&'a self, lab: &Lab<'_>) -> impl Iterator<Item = (String, &'a [Score])> {
        let name = format!("{} at ratio {}", self.method.name(lab), self.ratio);
        self.runs.iter().map(move |run| (name.clone(), &run.scores[..]))
    }

    /// Masked PSNR, averaged over views.
    pub fn masked(&self) -> Vec<f64> {
        self.values(&|s| mean(s, masked))
    }

    /// Whether the file is within a tenth of the requested share of `raw` bytes. If not, the method cannot reach it,
    /// and its scores do not compare.
    pub fn met(&self, raw: f64) -> bool {
        self.bytes().is_some_and(|b| (1.0 / OFF..OFF).contains(&(b * self.ratio / raw)))
    }

    /// File size, the median over seeds.
    pub fn bytes(&self) -> Option<f64> {
        let all: Vec<f64> = self.runs.iter().filter(|r| r.failure.is_none()).map(|r| r.bytes as f64).collect();
        Spread::new(&all).map(|s| s.median)
    }
}

/// Reference scores: masked PSNR in dB, averaged over the same views.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct ReferenceScores {
    /// The picture of all particles without shot noise.
    pub noise_free: Option<f64>,
    /// The same number of particles, uniform over the box.
    pub uniform_box: Option<f64>,
    pub all_black: Option<f64>,
}

/// The trivial scores, and the one that no model is expected to exceed, from any model's scores.
pub(super) fn beside(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    truth: &ReferenceViews,
    any: &ModelBuild,
) -> Result<ReferenceScores> {
    lab.store.result("beside", &(&snapshot.hash, truth.key()), || {
        let scored = score::evaluate(&any.model, &snapshot.particles, &truth.views, truth.size, None, lab.context)?
            .mean
            .paraview;
        Ok(ReferenceScores {
            noise_free: scored.noise_free.masked_psnr,
            uniform_box: scored.uniform_box.masked_psnr,
            all_black: scored.all_black.masked_psnr,
        })
    })
}

/// Every method at every ratio; random ones with every seed. Models, which are slow and hardly depend on the seed, have
/// several seeds only at the compared ratio.
pub(super) fn rows(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    truth: &ReferenceViews,
    ratios: &[f64],
) -> Result<Vec<RatePoint>> {
    let (raw, methods) = (snapshot.position_bytes() as f64, CompressionMethod::all_and_trained(lab));
    lab.context.begin("methods and sizes", (ratios.len() * methods.len()) as u64);
    let mut rows = Vec::new();
    for &ratio in ratios {
        for &method in &methods {
            let several = method.is_random() && (!method.is_model() || ratio == COMPARED);
            let seeds: Vec<u64> = lab.settings.seeds().take(if several { usize::MAX } else { 1 }).collect();
            let run = |seed| method.measure(lab, snapshot, truth, (raw / ratio) as u64, seed);
            rows.push(RatePoint { method, ratio, runs: seeds.into_iter().map(run).collect::<Result<_>>()? });
            lab.context.advance(1);
        }
    }
    lab.context.end();
    // Sort the ratios of a method together.
    rows.sort_by_key(|r: &RatePoint| methods.iter().position(|m| *m == r.method));
    Ok(rows)
}

/// One curve per method. Colours are by compressor; dashed lines are its other order, its moved particles, or the
/// published law.
pub(super) fn series(lab: &Lab<'_>, method: CompressionMethod, points: Vec<Point>) -> PlotSeries {
    let (style, dashed) = match method {
        CompressionMethod::OpticalDepth => (0, false),
        CompressionMethod::AlphaBlend => (0, true),
        CompressionMethod::Subset => (1, false),
        CompressionMethod::Baseline { at, jitter } => {
            let family = |name: &str| name.split([' ', ',']).next().unwrap_or_default().to_string();
            let own_family = family(lab.baselines[at].name());
            let mut families: Vec<String> = lab.baselines.iter().map(|b| family(b.name())).collect();
            // The orders of one compressor follow each other in the list.
            families.dedup();
            let first = lab.baselines.iter().position(|b| family(b.name()) == own_family);
            (2 + families.iter().position(|f| *f == own_family).unwrap_or(0), jitter || first != Some(at))
        }
    };
    PlotSeries { name: method.name(lab), style, dashed, points }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_without_a_file_of_that_size_are_not_compared() {
        let measurement_of = |bytes| MethodMeasurement { bytes, bound: None, scores: Vec::new(), failure: None };
        let row = |bytes: &[u64]| RatePoint {
            method: CompressionMethod::Subset,
            ratio: 10.0,
            runs: bytes.iter().map(|b| measurement_of(*b)).collect(),
        };
        // 10,000 raw bytes at ratio 10: 1000, give or take a tenth.
        let met = [&[1000][..], &[911, 900, 915], &[1101], &[9000], &[]].map(|b| row(b).met(10_000.0));
        assert_eq!(met, [true, true, false, false, false]);
    }
}
