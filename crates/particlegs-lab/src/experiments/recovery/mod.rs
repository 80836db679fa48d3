//! Particles recovered from models, and what they are good for (paper, section "Approximate Particle Recovery", tables
//! tab:recovery_methods and tab:recovery_blocks, figures fig:recovery:slices and fig:recovery:stats).

mod analyses;
mod facts;
pub(super) mod measure;
mod notes;
mod plots;
mod slices;
mod tables;

use super::Experiment;
use super::rates::COMPARED as RATIO;
use crate::lab::{Lab, ModelSettings};
use crate::results::ExperimentResults;
use crate::snapshot::Snapshot;
use facts::Facts;
use measure::{METHODS, MeasurementScope, RecoverySource};
use particlegs_core::Result;
use particlegs_fit::Effort;
use particlegs_fit::recover::Method;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "recovery",
    title: "Particles recovered from models, by method, file size and number of blocks",
    paper: "tab:recovery_methods, tab:recovery_blocks, fig:recovery:slices, fig:recovery:stats",
    trains: false,
    weight: 120,
    run,
};

/// A recovery method, measured once per seed.
struct MethodRecovery {
    method: Method,
    /// In the correct convention.
    all: Vec<Facts>,
    paper: Vec<Facts>,
}

/// A model with some ratio and effort, measured with the first seed.
struct SizeRecovery {
    name: String,
    /// Gaussians, bytes, ratio.
    size: (u64, u64, f64),
    /// Particles by `count`, `stratified` and `spaced`, the latter two without spectra and xi.
    count: Facts,
    stratified: Facts,
    spaced: Facts,
    model: Facts,
}

/// A model of some blocks, measured once per seed.
struct BlocksRecovery {
    blocks: u32,
    size: (u64, u64, f64),
    all: Vec<Facts>,
    paper: Vec<Facts>,
}

struct RecoveryMeasurements {
    methods: Vec<MethodRecovery>,
    sizes: Vec<SizeRecovery>,
    blocks: Vec<BlocksRecovery>,
    /// Mean spacing of the particles, world units.
    spacing: f64,
    unit: String,
}

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let snapshot = &snapshots[0];
    let base = ModelSettings::ratio(RATIO, lab.settings.seed);
    let (recipes, blocks) = (sizes(lab), if lab.settings.quick { &[1, 8][..] } else { &[1, 2, 4, 8, 16] });
    lab.context.begin("recovered particles", (METHODS.len() + recipes.len() + blocks.len()) as u64);
    let drawn = |recipe: ModelSettings| RecoverySource { lab, snapshot, recipe };
    let methods = METHODS.iter().map(|m| of_method(&drawn(base.clone()), *m)).collect::<Result<_>>()?;
    let sizes = recipes.into_iter().map(|recipe| of_size(&drawn(recipe))).collect::<Result<_>>()?;
    let of_blocks = |n: &u32| of_blocks(&drawn(ModelSettings { blocks: *n, ..base.clone() }));
    let blocks = blocks.iter().map(of_blocks).collect::<Result<_>>()?;
    lab.context.end();
    let unit = snapshot.particles.meta.units.length_text().unwrap_or("length units").to_string();
    let measured = RecoveryMeasurements { methods, sizes, blocks, spacing: snapshot.spacing(), unit };
    Ok(ExperimentResults {
        tables: tables::all(&measured).into_iter().chain([analyses::table(&measured)]).collect(),
        plots: plots::all(&measured),
        pictures: vec![slices::pictures(&drawn(base))?],
        notes: notes::all(&measured, lab, snapshot),
    })
}

/// Ratios and efforts of the table by size.
fn sizes(lab: &Lab<'_>) -> Vec<ModelSettings> {
    let (slow, fast): (&[f64], &[f64]) = match lab.settings.quick {
        true => (&[65.0, RATIO], &[RATIO]),
        false => (&[30.0, 65.0, 100.0, RATIO, 1000.0, 3000.0], &[65.0, RATIO]),
    };
    let recipe = |ratio: &f64| ModelSettings::ratio(*ratio, lab.settings.seed);
    let fast = fast.iter().map(|r| ModelSettings { effort: Effort::Fast, ..recipe(r) });
    slow.iter().map(recipe).chain(fast).collect()
}

fn of_method(drawn: &RecoverySource<'_>, method: Method) -> Result<MethodRecovery> {
    let (all, paper) =
        (drawn.facts_of_seeds(method, MeasurementScope::All)?, drawn.facts_of_seeds(method, MeasurementScope::Paper)?);
    drawn.lab.context.advance(1);
    Ok(MethodRecovery { method, all, paper })
}

fn of_size(drawn: &RecoverySource<'_>) -> Result<SizeRecovery> {
    let seed = drawn.lab.settings.seed;
    let size = drawn.size()?;
    let effort = if drawn.recipe.effort == Effort::Fast { ", fast" } else { "" };
    let measured = SizeRecovery {
        name: format!("{:.0}{effort}", size.2),
        size,
        count: drawn.facts(Method::Count, seed, MeasurementScope::All)?,
        stratified: drawn.facts(Method::Stratified, seed, MeasurementScope::Local)?,
        spaced: drawn.facts(Method::Spaced, seed, MeasurementScope::Local)?,
        model: drawn.facts_of_model()?,
    };
    drawn.lab.context.advance(1);
    Ok(measured)
}

fn of_blocks(drawn: &RecoverySource<'_>) -> Result<BlocksRecovery> {
    let facts_of = |depth| drawn.facts_of_seeds(Method::Count, depth);
    let (all, paper) = (facts_of(MeasurementScope::All)?, facts_of(MeasurementScope::Paper)?);
    drawn.lab.context.advance(1);
    Ok(BlocksRecovery { blocks: drawn.recipe.blocks, size: drawn.size()?, all, paper })
}
