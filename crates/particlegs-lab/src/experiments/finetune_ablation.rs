//! The published fine-tuning of a merged model of eight blocks, also with another loss or without density control
//! (paper, table of fine-tuning).

use super::ablation::{self, StageEvaluator};
use super::models::{fine_tuning, merged, whole};
use super::{Experiment, groups, published as paper};
use crate::lab::Lab;
use crate::results::ExperimentResults;
use crate::snapshot::Snapshot;
use crate::training::{TrainingResult, scale, tuned};
use particlegs_core::Result;
use particlegs_train::Config;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "finetune-ablation",
    title: "Fine-tuning of a merged model with another loss, and without density control",
    paper: "tab:ablation_ft",
    trains: true,
    weight: 700,
    run,
};

/// Number of merged blocks.
const BLOCKS: u32 = 8;

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let (snapshot, seed) = (&snapshots[0], lab.settings.seed);
    let of_blocks = merged(lab, snapshot, BLOCKS, seed)?;
    let tune = |config: &Config, seed| tuned(lab, snapshot, &of_blocks.made, config, seed);
    let config = fine_tuning(lab)?;
    let seeds: Result<Vec<TrainingResult>> = lab.settings.seeds().map(|seed| tune(&config, seed)).collect();
    // Sizes of the recipe that made the blocks: fine-tuning has only the first.
    let recipe = whole(lab)?;
    let judge = StageEvaluator::new(lab, snapshot, &recipe, &of_blocks.made.model.metadata, &groups::in_range())?;
    let mut rows = vec![judge.row("published: L1, density control", &seeds?, Some(paper::EIGHT))?];
    for (label, config, theirs) in variants(&config) {
        rows.push(judge.row(label, &[tune(&config, seed)?], Some(theirs))?);
    }
    rows.push(judge.row("merged, before fine-tuning", &[of_blocks], None)?);
    rows.push(judge.noise_free()?);
    let sizes = judge.sizes();
    let title = "Fine-tuning of a merged model of eight blocks";
    let tables = vec![ablation::table("finetune-ablation", title, &rows, &sizes)];
    let mut notes = ablation::notes(lab, scale(lab), &recipe, &sizes);
    notes.push(format!(
        "Each of the {BLOCKS} blocks was trained for all those steps, and the merged model was fine-tuned for {} \
         steps at {} (published: 60 000 at 1920 x 1080), so fine-tuning never saw the larger size.",
        config.iterations(),
        sizes[0]
    ));
    notes.push(ablation::noise_note(&rows[0], &sizes));
    notes.extend(ablation::held_note(&rows));
    if let [first, .., noise_free] = &rows[..] {
        notes.extend(ablation::room_note("the first row", first, noise_free, &sizes));
    }
    notes.push("The first row has several seeds of fine-tuning of one merged model; other rows have one seed.".into());
    Ok(ExperimentResults { tables, notes, ..ExperimentResults::default() })
}

/// The variants of the paper's table, with its results.
fn variants(production: &Config) -> [(&'static str, Config, paper::PublishedRow); 3] {
    let dssim = |share| {
        let mut config = production.clone();
        config.loss.dssim = share;
        config
    };
    let mut fixed = production.clone();
    for stage in &mut fixed.stages {
        (stage.densify.every, stage.densify.until) = (0, 0);
    }
    [
        ("without density control", fixed, paper::NO_DENSIFICATION),
        ("DSSIM alone", dssim(1.0), paper::PURE_DSSIM),
        ("0.9 L1 + 0.1 DSSIM", dssim(0.1), paper::DSSIM_BLEND),
    ]
}
