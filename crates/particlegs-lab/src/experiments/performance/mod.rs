//! Performance: opening, compressing, decoding and drawing, compared with VTK's own Point Gaussian in the same run;
//! memory, and scaling with the number of particles (paper, table tab:perf and figure fig:scale).

mod clock;
mod command;
mod commands;
mod growth;
mod notes;
mod ours;
mod paper;
mod point_gaussian;
mod raw;
mod scale;
mod tables;
mod views;

use super::Experiment;
use crate::lab::{Lab, ModelBuild};
use crate::results::ExperimentResults;
use crate::snapshot::Snapshot;
use clock::Machine;
use notes::PerformanceTimings;
use ours::RenderSource;
use particlegs_core::Result;
use particlegs_core::picture::Size;
use particlegs_fit::Effort;
use raw::RawCopy;
use tables::{SizeTimings, StartupTimes};
use views::TimingViews;

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
    let efforts = [("fast", Effort::Fast), ("default", Effort::Default)];
    let compressions = efforts
        .into_iter()
        .map(|(name, effort)| Ok((name, ours::compression(lab, snapshot, effort, &machine)?)))
        .collect::<Result<Vec<_>>>()?;
    let build = lab.model(snapshot, &ours::recipe(lab, Effort::Default))?;
    let decoding = ours::decoding(lab, snapshot, &build, &machine)?;
    let sizes = views::sizes(lab);
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
