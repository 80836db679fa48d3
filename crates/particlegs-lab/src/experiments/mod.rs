//! The experiments, one per file.

mod ablation;
mod blocks;
mod core_ablation;
mod datasets;
mod figures;
mod finetune_ablation;
mod generalisation;
#[cfg(feature = "gpu")]
mod gpu;
mod groups;
mod models;
mod performance;
mod published;
mod published_blocks;
mod published_run;
mod rate_distortion;
mod rates;
mod recovery;
mod sweep;

use crate::lab::Lab;
use crate::results::ExperimentResults;
use crate::snapshot::Snapshot;
use particlegs_core::{Error, Result};

pub struct Experiment {
    /// Name on the command line.
    pub name: &'static str,
    /// Its subject, in one line.
    pub title: &'static str,
    /// Labels of the paper's tables and figures that it reproduces.
    pub paper: &'static str,
    /// Whether it trains models.
    pub trains: bool,
    /// Approximate share of the time of `all`, for the progress. 0 = it needs no snapshot and is not part of `all`.
    pub weight: u64,
    /// Runs it. The first snapshot is measured; the others are compared with it.
    pub run: fn(&Lab<'_>, &[Snapshot]) -> Result<ExperimentResults>,
}

/// All experiments, in the order of a report.
pub const EXPERIMENTS: &[Experiment] = &[
    rate_distortion::EXPERIMENT,
    datasets::EXPERIMENT,
    blocks::EXPERIMENT,
    generalisation::EXPERIMENT,
    performance::EXPERIMENT,
    recovery::EXPERIMENT,
    figures::EXPERIMENT,
    core_ablation::EXPERIMENT,
    finetune_ablation::EXPERIMENT,
    published_blocks::EXPERIMENT,
    published_run::EXPERIMENT,
    #[cfg(feature = "gpu")]
    gpu::EXPERIMENT,
];

/// The experiments of a name: one, or `all` that the settings allow.
pub fn named(name: &str, training: bool) -> Result<Vec<&'static Experiment>> {
    if name == "all" {
        return Ok(EXPERIMENTS.iter().filter(|e| e.weight > 0 && (training || !e.trains)).collect());
    }
    let experiments = EXPERIMENTS.iter().find(|e| e.name == name).map(|e| vec![e]);
    experiments.ok_or_else(|| {
        let names: Vec<&str> = EXPERIMENTS.iter().map(|e| e.name).collect();
        Error::argument(format!("there is no experiment {name:?}: use `all` or one of {}", names.join(", ")))
    })
}
