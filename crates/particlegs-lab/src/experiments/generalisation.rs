//! One model at distances, radii and opacities that it was not made for (paper, table of generalisation).

use super::ablation::frames as trained_frames;
use super::groups::{self, ViewGroup, in_pixels};
use super::models::{describe_seeds, each_seed, of_seeds, whole};
use super::rates::COMPARED as RATIO;
use super::sweep::{Sweep, SweepModel, SweepStep};
use super::{Experiment, published as paper};
use crate::lab::{Lab, ModelBuild, ModelSettings};
use crate::results::ExperimentResults;
use crate::snapshot::Snapshot;
use crate::training::{self, TrainingResult, TrainingTask};
use crate::views::{ReferenceViews, Score};
use particlegs_core::Result;
use particlegs_core::model::Metadata;
use particlegs_core::picture::Size;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "generalisation",
    title: "One model at other distances, radii and opacities",
    paper: "tab:gen_view, section IV-F",
    trains: false,
    weight: 80,
    run,
};

/// Factors of the default radius: the published range, and beyond it.
const RADII: [f64; 6] = [0.25, 0.5, 1.0, 1.5, 2.0, 2.5];
/// Factors of the default opacity.
const OPACITIES: [f64; 6] = [0.25, 0.5, 1.0, 1.5, 2.0, 2.4];

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let snapshot = &snapshots[0];
    let builds = each_seed(
        lab,
        |build: &ModelBuild| &build.model,
        |seed| lab.model(snapshot, &ModelSettings::ratio(RATIO, seed)),
    )?;
    let (metadata, frames) = (&builds[0].model.metadata, 2 * lab.settings.frames);
    let truth = truth(lab, snapshot, metadata, frames, lab.settings.size)?;
    let models = vec![model(lab, snapshot, &truth, "optical depth", 0, &builds)?];
    let noise_free = groups::noise_free(lab, snapshot, &truth)?;
    let mut results = ExperimentResults::default();
    results.notes.push(format!(
        "An optical-depth model at ratio {RATIO}, {}, compared with ParaView's pictures of all particles at {}: \
         {frames} views per group, in the same directions in all groups. For distances, radius and opacity are \
         drawn from the published range, with the same draws at each distance; for factors, the distance is 0.7. \
         Noise-free is the score of the mean picture of all particles, which models can hardly exceed. The fit uses \
         no pictures: \"trained\" and \"beyond\" refer to the published method.",
        describe_seeds(lab, &[builds.len()]),
        in_pixels(truth.size)
    ));
    results.notes.extend(falls(&models, &noise_free));
    add(&mut results, "generalisation", &models, &noise_free, "");
    match lab.settings.training {
        true => beside_published(lab, snapshot, &mut results)?,
        false => results.notes.push(
            "The published law was not trained in this run. If training is requested, its model is compared with \
             ours of the same size. Separate columns show the paper's numbers."
                .into(),
        ),
    }
    Ok(results)
}

fn sweeps() -> [Sweep; 3] {
    let orbits = paper::ORBITS.map(|o| SweepStep {
        at: o.orbit,
        group: ViewGroup::orbit(o.orbit),
        kind: o.kind,
        paper: [Some(o.masked), Some(o.ssim)],
    });
    let range = groups::RANGE[0]..=groups::RANGE[1];
    let inside = |f: f64| if range.contains(&f) { "trained" } else { "beyond" };
    let factors = |all: [f64; 6], theirs: [(f64, f64); 2], group: fn(f64) -> ViewGroup| {
        all.map(|f| {
            let published = theirs.into_iter().find(|t| t.0 == f).map(|t| t.1);
            let at_defaults = (f == 1.0).then_some(paper::AT_DEFAULTS);
            SweepStep { at: f, group: group(f), kind: inside(f), paper: [published.or(at_defaults), None] }
        })
    };
    [
        Sweep { name: "orbits", what: "distance, base distances", base: None, steps: orbits.to_vec() },
        Sweep {
            name: "radius",
            what: "radius, default radii",
            base: Some(1.0),
            steps: factors(RADII, paper::RADII, ViewGroup::radius).to_vec(),
        },
        Sweep {
            name: "opacity",
            what: "opacity, default opacities",
            base: Some(1.0),
            steps: factors(OPACITIES, paper::OPACITIES, ViewGroup::opacity).to_vec(),
        },
    ]
}

fn truth(lab: &Lab<'_>, snapshot: &Snapshot, metadata: &Metadata, frames: usize, size: Size) -> Result<ReferenceViews> {
    let all: Vec<ViewGroup> = sweeps().into_iter().flat_map(|s| s.steps).map(|s| s.group).collect();
    ReferenceViews::at_size(lab, snapshot, groups::views(&all, metadata, lab.settings.seed, frames), size)
}

fn model<'m>(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    truth: &ReferenceViews,
    label: &str,
    style: usize,
    builds: impl IntoIterator<Item = &'m ModelBuild>,
) -> Result<SweepModel> {
    let scores = builds.into_iter().map(|m| groups::scores(lab, snapshot, truth, m)).collect::<Result<_>>()?;
    Ok(SweepModel { label: label.into(), style, scores })
}

fn add(results: &mut ExperimentResults, stem: &str, models: &[SweepModel], noise_free: &[Score], suffix: &str) {
    for sweep in sweeps() {
        results.tables.push(sweep.table(stem, models, noise_free, suffix));
        results.plots.push(sweep.plot(stem, models, noise_free, suffix));
    }
}

/// Note on the loss of quality beyond the published range, and how much of it is due to the model.
fn falls(models: &[SweepModel], noise_free: &[Score]) -> Vec<String> {
    let cases = [("radius", 2.0), ("radius", 2.5), ("opacity", 2.0), ("opacity", 2.4)];
    let sweeps = sweeps();
    let said = cases.iter().filter_map(|(name, factor)| {
        let sweep = sweeps.iter().find(|s| s.name == *name)?;
        let [ours, noise] = [&models[0].scores[..], &[noise_free.to_vec()]].map(|all| sweep.fall(all, *factor));
        let paper = sweep.paper_fall(*factor)?;
        let (ours, noise) = (ours?, noise?);
        let excess = ours - noise;
        Some(format!("{name} {factor}: {ours:+.2} dB ({excess:+.2} relative to noise-free; paper {paper:+.2})"))
    });
    let said: Vec<String> = said.collect();
    vec![format!(
        "Masked PSNR relative to factor 1: {}. The peak of PSNR is fixed while pictures become brighter, so the \
         same relative error costs more decibels. The noise-free picture changes for the same reason; only a \
         model's change beyond that is due to the model.",
        said.join("; ")
    )]
}

/// The trained published law, and ours at the same bytes, at the sizes of its training.
fn beside_published(lab: &Lab<'_>, snapshot: &Snapshot, results: &mut ExperimentResults) -> Result<()> {
    let config = whole(lab)?;
    let published = of_seeds(lab, snapshot, |seed| TrainingTask::published(config.clone(), 1, seed))?;
    let mut plain = training::recipe();
    plain.alpha_blend.vizmapper = false;
    let plain = training::scaled(plain, training::scale(lab))?;
    let plain = of_seeds(lab, snapshot, |seed| TrainingTask::published(plain.clone(), 1, seed))?;
    let bytes = published[0].made.bytes.len() as u64;
    let ours = of_seeds(lab, snapshot, |seed| TrainingTask::ours(bytes, None, seed))?;
    let [_, size] = training::sizes(&config);
    let truth = truth(lab, snapshot, &published[0].made.model.metadata, trained_frames(lab), size)?;
    let sweep_model = |label: &str, style, all: &[TrainingResult]| {
        model(lab, snapshot, &truth, label, style, all.iter().map(|t| &t.made))
    };
    let models = vec![
        sweep_model("optical depth, untrained", 0, &ours)?,
        sweep_model("published law, trained", 1, &published)?,
        sweep_model("published law, no VizMapper", 2, &plain)?,
    ];
    let noise_free = groups::noise_free(lab, snapshot, &truth)?;
    let (scale, size) = (training::scale(lab), in_pixels(size));
    results.notes.push(format!(
        "The published law: its recipe scaled by {scale}, as in `core-ablation`, and our untrained fit of the same \
         {bytes} bytes, scored at {size}, the size of its last stages."
    ));
    results.notes.extend(edge(&models));
    add(results, "generalisation-published", &models, &noise_free, &format!(", {size}"));
    Ok(())
}

/// Note on the loss of the published law beyond its range, compared with ours.
fn edge(models: &[SweepModel]) -> Option<String> {
    let sweeps = sweeps();
    let radius = sweeps.iter().find(|s| s.name == "radius")?;
    let [ours, theirs] = [0, 1].map(|k| radius.fall(&models[k].scores, 2.5));
    let (ours, theirs) = (ours?, theirs?);
    Some(format!(
        "From factor 1 to 2.5 default radii, the published law changes by {theirs:+.2} dB and ours by {ours:+.2} \
         dB: {:+.2} dB of the change are due to the law.",
        theirs - ours
    ))
}
