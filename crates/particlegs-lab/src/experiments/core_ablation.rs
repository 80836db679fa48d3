//! The published recipe with one component removed at a time, and our law at the same bytes (paper, table of
//! components).

use super::ablation::{self, AblationRow, StageEvaluator};
use super::groups::{self, ViewGroup, masked, mean_over};
use super::models::{of_seeds, whole};
use super::{Experiment, published as paper};
use crate::lab::Lab;
use crate::results::{ExperimentResults, ResultTable, TableCell};
use crate::snapshot::Snapshot;
use crate::training::{TrainingResult, TrainingTask, ours_at, recipe, scale, scaled, single_resolution, trained};
use particlegs_core::Result;
use particlegs_core::model::LawKind;
use particlegs_core::splat::ToneStyle;
use particlegs_train::{Config, Norm, Start};

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "core-ablation",
    title: "The published recipe with one component removed at a time",
    paper: "tab:ablation_core",
    trains: true,
    weight: 900,
    run,
};

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let (snapshot, config) = (&snapshots[0], whole(lab)?);
    let train = |config: &Config| of_seeds(lab, snapshot, |seed| TrainingTask::published(config.clone(), 1, seed));
    let full = train(&config)?;
    let judge = StageEvaluator::new(lab, snapshot, &config, &full[0].made.model.metadata, &all_groups())?;
    let mut rows = vec![judge.row("published recipe, whole", &full, Some(paper::SINGLE))?];
    for (label, config, theirs) in ablations(scale(lab))? {
        rows.push(judge.row(label, &train(&config)?, Some(theirs))?);
    }
    let (bytes, ours) = (full[0].made.bytes.len() as u64, ours_at(scale(lab))?);
    for (label, training) in
        [("ours: optical depth, untrained", None), ("ours: optical depth, trained (preset fast)", Some(ours))]
    {
        let models = of_seeds(lab, snapshot, |seed| TrainingTask::ours(bytes, training.clone(), seed))?;
        rows.push(judge.row(label, &models, None)?);
    }
    rows.push(judge.noise_free()?);
    let sizes = judge.sizes();
    let title = "Components of the published recipe, and our law at the same bytes";
    let more = more(lab, snapshot, &judge, &full)?;
    let tables = vec![
        ablation::table("core-ablation", title, &rows, &sizes),
        by_factor(&rows[0], &rows[1], &sizes[1]),
        ablation::table("core-ablation-more", "Other choices, which the paper does not compare", &more, &sizes),
    ];
    let mut notes = ablation::notes(lab, scale(lab), &config, &sizes);
    notes.push(ablation::noise_note(&rows[0], &sizes));
    notes.extend(ablation::held_note(rows.iter().chain(&more)));
    notes.push(format!(
        "Our rows have the {bytes} bytes of the first run of the whole recipe: a fit to the particles without \
         pictures, and the same fit trained on pictures with the preset `fast` and a last stage of the same size. A \
         Gaussian takes 68 bytes as PLY, as published. Time is wall-clock time on a machine that may have been \
         busy."
    ));
    Ok(ExperimentResults { tables, notes, ..ExperimentResults::default() })
}

/// Rows that the paper does not have, one seed each, below the whole recipe.
fn more(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    judge: &StageEvaluator<'_>,
    full: &[TrainingResult],
) -> Result<Vec<AblationRow>> {
    let mut rows = vec![judge.row("published recipe, whole", full, None)?];
    for (label, task) in choices(scale(lab), lab.settings.seed)? {
        rows.push(judge.row(label, &[trained(lab, snapshot, &task)?], None)?);
    }
    Ok(rows)
}

/// Choices that the paper does not compare, and the task of each.
fn choices(scale: f64, seed: u64) -> Result<Vec<(&'static str, TrainingTask)>> {
    let with = |change: fn(&mut Config)| {
        let mut config = recipe();
        change(&mut config);
        scaled(config, scale)
    };
    let published = |change| -> Result<TrainingTask> { Ok(TrainingTask::published(with(change)?, 1, seed)) };
    let from = |change| -> Result<TrainingTask> { Ok(TrainingTask::published_from_fit(with(change)?, seed)) };
    Ok(vec![
        ("without density control", published(|c| c.stages.iter_mut().for_each(|s| s.densify.every = 0))?),
        ("without opacity resets", published(|c| c.alpha_blend.reset_every = 0)?),
        ("0.8 L1 + 0.2 DSSIM", published(|c| c.loss.dssim = 0.2)?),
        ("L2", published(|c| c.loss.norm = Norm::L2)?),
        ("noise-free targets (expected)", published(|c| c.target = ToneStyle::Expected)?),
        ("start from our partition", from(|c| c.start = Start::Partition)?),
        ("start from our fit", from(|c| c.start = Start::Fit)?),
        ("law optical-depth, otherwise as published", published(|c| c.law = LawKind::OpticalDepth)?),
    ])
}

/// The removed part, the recipe without it, and the paper's result.
fn ablations(scale: f64) -> Result<[(&'static str, Config, paper::PublishedRow); 3]> {
    let (mut no_vizmapper, mut far) = (recipe(), recipe());
    no_vizmapper.alpha_blend.vizmapper = false;
    far.cameras.orbits.truncate(1);
    Ok([
        ("without VizMapper", scaled(no_vizmapper, scale)?, paper::NO_VIZMAPPER),
        ("single resolution: that of the first stage", scaled(single_resolution(), scale)?, paper::SINGLE_RESOLUTION),
        ("far orbit only", scaled(far, scale)?, paper::FAR_ORBIT),
    ])
}

/// Factors at which the network is tested: radius and opacity within the trained range.
fn factors() -> [(&'static str, ViewGroup); 5] {
    [
        ("radius 0.5", ViewGroup::radius(0.5)),
        ("radius and opacity 1", ViewGroup::radius(1.0)),
        ("radius 1.5", ViewGroup::radius(1.5)),
        ("opacity 0.5", ViewGroup::opacity(0.5)),
        ("opacity 1.5", ViewGroup::opacity(1.5)),
    ]
}

fn all_groups() -> Vec<ViewGroup> {
    groups::in_range().into_iter().chain(factors().map(|(_, g)| g)).collect()
}

/// Gain from the network by radius and opacity.
fn by_factor(full: &AblationRow, without: &AblationRow, large: &str) -> ResultTable {
    let heads = ["factor of the default", "whole, dB", "without VizMapper, dB", "gain by the VizMapper, dB"];
    let title = format!("Effect of the VizMapper: masked PSNR at the mid orbit, {large}");
    let mut table = ResultTable::new("core-ablation-factors", title, &heads);
    for (label, group) in factors() {
        let means_of = |row: &AblationRow| -> Vec<Option<f64>> {
            row.scores[1].iter().map(|s| mean_over(s, std::slice::from_ref(&group), masked)).collect()
        };
        let (with, without) = (means_of(full), means_of(without));
        let part: Vec<f64> = with.iter().zip(&without).filter_map(|(a, b)| Some((*a)? - (*b)?)).collect();
        let cell = |v: Vec<Option<f64>>| TableCell::spread(&v.into_iter().flatten().collect::<Vec<_>>(), 2);
        table.row([TableCell::text(label), cell(with), cell(without), TableCell::spread(&part, 2)]);
    }
    table
}
