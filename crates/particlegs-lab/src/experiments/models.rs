//! Models that experiments share: one for each seed, if the seed makes a difference; and those of the published recipe
//! at the laboratory's scale: whole, in blocks or fine-tuned.

use crate::lab::Lab;
use crate::snapshot::Snapshot;
use crate::training::{TrainingResult, TrainingTask, recipe, scale, scaled, trained};
use particlegs_core::Result;
use particlegs_core::model::Model;
use particlegs_train::Config;

/// Makes one for each seed, but only one if the second gives the same Gaussians: fits of small snapshots are not
/// random, since no cell has more particles than its sample.
pub(super) fn each_seed<T>(
    lab: &Lab<'_>,
    model: fn(&T) -> &Model,
    mut make: impl FnMut(u64) -> Result<T>,
) -> Result<Vec<T>> {
    let mut all: Vec<T> = Vec::new();
    for seed in lab.settings.seeds() {
        let one = make(seed)?;
        if let [first] = &all[..]
            && model(first).blocks().map(|b| &b.gaussians).eq(model(&one).blocks().map(|b| &b.gaussians))
        {
            break;
        }
        all.push(one);
    }
    Ok(all)
}

/// Describes numbers of fits per kind of model, and whether the seed mattered.
pub(super) fn describe_seeds(lab: &Lab<'_>, counts: &[usize]) -> String {
    let (least, most) = (counts.iter().min().unwrap_or(&0), counts.iter().max().unwrap_or(&0));
    match (lab.settings.seeds, least, most) {
        (1, ..) => "one fit with one seed".into(),
        (_, 1, 1) => "one fit, because its seed changes nothing here".into(),
        (_, 1, n) => format!("one fit where its seed changes nothing, else {n} with different seeds"),
        (_, _, n) => format!("{n} fits with different seeds"),
    }
}

/// The published recipe at the laboratory's scale.
pub(super) fn whole(lab: &Lab<'_>) -> Result<Config> {
    scaled(recipe(), scale(lab))
}

/// The published fine-tuning at the laboratory's scale.
pub(super) fn fine_tuning(lab: &Lab<'_>) -> Result<Config> {
    scaled(Config { evaluate_views: 4, ..Config::fine_tuning() }, scale(lab))
}

/// A model of `blocks` blocks, each trained in its own frame by the whole recipe, merged with the network of the first.
pub(super) fn merged(lab: &Lab<'_>, snapshot: &Snapshot, blocks: u32, seed: u64) -> Result<TrainingResult> {
    trained(lab, snapshot, &TrainingTask::published(whole(lab)?, blocks, seed))
}

/// The task's model for every seed.
pub(super) fn of_seeds(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    task: impl Fn(u64) -> TrainingTask,
) -> Result<Vec<TrainingResult>> {
    each_seed(lab, |t: &TrainingResult| &t.made.model, |seed| trained(lab, snapshot, &task(seed)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::{ModelBuild, ModelSettings};
    use crate::settings::Settings;
    use particlegs_core::context::Context;

    #[test]
    fn seeds_that_change_nothing_count_once() {
        let (snapshot, folder) = (crate::testing::snapshot(), tempfile::tempdir().unwrap());
        let settings = Settings { seeds: 3, ..Settings::new(true, "".into()) };
        let lab = Lab::new(settings, folder.path(), &Context::SILENT).unwrap();
        let model_count = |ratio: fn(u64) -> f64| {
            each_seed(
                &lab,
                |m: &ModelBuild| &m.model,
                |seed| lab.model(&snapshot, &ModelSettings::ratio(ratio(seed), seed)),
            )
            .unwrap()
            .len()
        };
        assert_eq!((model_count(|_| 10.0), model_count(|seed| 5.0 + seed as f64 / 10.0)), (1, 3));
        // One seed alone says nothing of what seeds change.
        let mut one = Lab::new(lab.settings.clone(), folder.path(), &Context::SILENT).unwrap();
        one.settings.seeds = 1;
        assert!(
            !describe_seeds(&one, &[1, 1]).contains("nothing") && describe_seeds(&lab, &[1, 1]).contains("nothing")
        );
        assert!(
            describe_seeds(&lab, &[1, 3]).contains("else 3") && describe_seeds(&lab, &[3, 3]).starts_with("3 fits")
        );
    }
}
