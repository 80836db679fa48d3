//! Performance: opening, compressing, decoding and drawing, compared with VTK's own Point Gaussian in the same run;
//! memory, and scaling with the number of particles (paper, table tab:perf and figure fig:scale).

mod clock;
mod command;
mod commands;
mod growth;
mod notes;
mod ours;
mod point_gaussian;
mod scale;
mod tables;

use super::Experiment;
use crate::lab::{Lab, ModelBuild};
use crate::results::ExperimentResults;
use crate::snapshot::Snapshot;
use crate::views::cache_key;
use clock::Machine;
use command::RawCopy;
use notes::PerformanceTimings;
use ours::RenderSource;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::model::Metadata;
use particlegs_core::picture::Size;
use particlegs_fit::Effort;
use particlegs_measure::score::evaluation_views;
use tables::{SizeTimings, StartupTimes};

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "performance",
    title: "Performance: time and memory, compared with VTK's Point Gaussian",
    paper: "tab:perf, fig:scale",
    trains: false,
    weight: 40,
    run,
};

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let (snapshot, machine) = (&snapshots[0], Machine::here());
    let raw = RawCopy::new(lab, snapshot);
    let opening = ours::opening(lab, snapshot, &machine)?;
    let efforts = [("fast", Effort::Fast), ("default", Effort::Default), ("best", Effort::Best)];
    let compressions = efforts
        .into_iter()
        .map(|(name, effort)| Ok((name, ours::compression(lab, snapshot, effort, &machine)?)))
        .collect::<Result<Vec<_>>>()?;
    let build = lab.model(snapshot, &ours::recipe(lab, Effort::Default))?;
    let decoding = ours::decoding(lab, snapshot, &build, &machine)?;
    let sizes = sizes(lab);
    let timed = commands::measure(lab, snapshot, &build, &sizes, &raw, &machine)?;
    let grown = growth::measure(lab, snapshot, &raw, &machine)?;
    let all = frames(lab, snapshot, &build, &sizes, &raw, &machine)?;
    let scale = scale::measure(lab, snapshot)?;

    let steps = StartupTimes { opening: &opening, decoding: &decoding, compressions: &compressions };
    let timings = PerformanceTimings { steps: &steps, frames: &all, grown: &grown, commands: &timed, scale: &scale };
    let notes = notes::notes(snapshot, &timings, &machine);
    let mut tables = vec![tables::frames(&all), tables::steps(&steps, &all), tables::phases(&compressions)];
    tables.extend(tables::agreement(&all));
    let vtk: Vec<_> = all.into_iter().map(|a| (a.size, a.vtk)).collect();
    tables.extend([commands::table(&grown, &timed, &vtk), growth::table(&grown), scale.table()]);
    let plots = growth::plots(&grown).into_iter().chain([scale.plot()]).collect();
    Ok(ExperimentResults { tables, plots, pictures: Vec::new(), notes })
}

/// All renderers at every size; pictures are compared at the first.
fn frames(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    build: &ModelBuild,
    sizes: &[Size],
    raw: &RawCopy<'_>,
    machine: &Machine,
) -> Result<Vec<SizeTimings>> {
    lab.context.begin("frames", 4 * sizes.len() as u64);
    let mut all = Vec::new();
    for size in sizes {
        let shots = TimingViews::new(lab, &build.model.metadata, *size);
        let ours = |source: RenderSource| {
            let frames = ours::frames(lab, snapshot, source, build, &shots, machine);
            lab.context.advance(1);
            frames
        };
        let (model, paraview, expected) =
            (ours(RenderSource::Model)?, ours(RenderSource::Paraview)?, ours(RenderSource::Expected)?);
        let vtk = point_gaussian::measure(lab, snapshot, &shots, all.is_empty(), raw, machine)?;
        lab.context.advance(1);
        all.push(SizeTimings { size: *size, model, paraview, expected, vtk });
    }
    lab.context.end();
    Ok(all)
}

struct TimingViews {
    size: Size,
    /// The first view, at the default radius and opacity.
    first: View,
    /// Cameras of the three orbits, at the default radius and opacity.
    cameras: Vec<View>,
    /// The first view's camera, with radii and opacities from the published ranges.
    settings: Vec<View>,
}

impl TimingViews {
    /// Views of a model: one camera per orbit (far, mid, near), and as many radii and opacities.
    fn new(lab: &Lab<'_>, m: &Metadata, size: Size) -> TimingViews {
        let views = evaluation_views(m, size, lab.settings.seed, 1);
        let plain = |v: &View| View { radius: m.default_radius, opacity: m.default_opacity, ..v.clone() };
        // A camera of the middle orbit from another seed, so that no timed frame repeats it.
        let other = evaluation_views(m, size, lab.settings.seed + 1, 1);
        let first = plain(other.get(1).unwrap_or(&views[0]));
        let settings = views.iter().map(|v| View { camera: first.camera, ..v.clone() }).collect();
        TimingViews { size, cameras: views.iter().map(plain).collect(), settings, first }
    }

    /// Cache key of times in these views.
    fn key(&self) -> String {
        let all = std::iter::once(&self.first).chain(&self.cameras).chain(&self.settings);
        let text: String = all.map(|v| cache_key(v, self.size)).collect();
        blake3::hash(text.as_bytes()).to_hex()[..16].to_string()
    }
}

/// Timed picture sizes: that of the settings, and twice its width and height.
fn sizes(lab: &Lab<'_>) -> [Size; 2] {
    let s = lab.settings.size;
    [s, Size { width: 2 * s.width, height: 2 * s.height }]
}
