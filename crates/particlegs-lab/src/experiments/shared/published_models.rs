//! Models by the published recipe at the laboratory's scale: whole, in blocks or fine-tuned.

use crate::experiments::seeds::each_seed;
use crate::lab::Lab;
use crate::snapshot::Snapshot;
use crate::training::{TrainingResult, TrainingTask, recipe, scale, scaled, trained};
use particlegs_core::Result;
use particlegs_train::Config;

/// The published recipe at the laboratory's scale.
pub(crate) fn whole(lab: &Lab<'_>) -> Result<Config> {
    scaled(recipe(), scale(lab))
}

/// The published fine-tuning at the laboratory's scale.
pub(crate) fn fine_tuning(lab: &Lab<'_>) -> Result<Config> {
    scaled(Config { evaluate_views: 4, ..Config::fine_tuning() }, scale(lab))
}

/// A model of `blocks` blocks, each trained in its own frame by the whole recipe, merged with the network of the first.
pub(crate) fn merged(lab: &Lab<'_>, snapshot: &Snapshot, blocks: u32, seed: u64) -> Result<TrainingResult> {
    trained(lab, snapshot, &TrainingTask::published(whole(lab)?, blocks, seed))
}

/// The task's model for every seed.
pub(crate) fn of_seeds(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    task: impl Fn(u64) -> TrainingTask,
) -> Result<Vec<TrainingResult>> {
    each_seed(lab, |t: &TrainingResult| &t.made.model, |seed| trained(lab, snapshot, &task(seed)))
}
