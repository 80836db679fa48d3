//! Tables of times within one process, with the paper's numbers.

use super::clock::{FrameTimes, Times, seconds};
use super::growth::not;
use super::ours::{FrameTimings, Phases};
use super::point_gaussian::PointGaussian;
use crate::experiments::published::performance as paper;
use crate::results::{ResultTable, TableCell};
use particlegs_core::picture::Size;

/// All times at one picture size.
pub(super) struct SizeTimings {
    pub size: Size,
    pub model: FrameTimings,
    pub paraview: FrameTimings,
    pub expected: FrameTimings,
    pub vtk: Result<PointGaussian, String>,
}

/// Kind of picture.
type FrameSelector = fn(&FrameTimings) -> &FrameTimes;

pub(super) fn frames(all: &[SizeTimings]) -> ResultTable {
    let mut table = ResultTable::new(
        "performance-frames",
        "Milliseconds per frame: median, smallest and largest",
        &[
            "frame with a new",
            "pixels",
            "model",
            "all particles, `expected`",
            "all particles, `paraview`",
            "all particles, VTK",
            "model's speed-up over `paraview`",
            "model's speed-up over VTK",
            "paper: ParaView",
            "paper: its model",
            "paper: speed-up",
        ],
    );
    let kinds: [(&str, bool, FrameSelector); 2] =
        [("camera", false, |f| &f.cameras), ("radius and opacity", true, |f| &f.settings)];
    for at in all {
        for (name, settings, pick) in kinds {
            let (model, paraview) = (pick(&at.model), pick(&at.paraview));
            let vtk = at.vtk.as_ref().map(|v| if settings { &v.settings } else { &v.cameras });
            let published = paper::frame(at.size.height, settings);
            let published_cell = |value: fn(&paper::PublishedFrame) -> f64, digits| {
                TableCell::number(published.as_ref().map(value), digits)
            };
            table.row([
                TableCell::text(name),
                TableCell::text(format!("{}x{}", at.size.width, at.size.height)),
                model.cell(),
                pick(&at.expected).cell(),
                paraview.cell(),
                vtk.map_or_else(|_| TableCell::text("not measured"), FrameTimes::cell),
                TableCell::spread(&model.faster_than(paraview), 1),
                vtk.map_or(TableCell::Empty, |v| TableCell::spread(&model.faster_than(v), 0)),
                published_cell(|f| f.paraview, 0),
                published_cell(|f| f.published, 2),
                published_cell(|f| f.ratio, 0),
            ]);
        }
    }
    table
}

/// Times before the first frame.
pub(super) struct StartupTimes<'a> {
    pub opening: &'a Option<Times>,
    pub decoding: &'a Times,
    pub compressions: &'a [(&'static str, Phases)],
}

pub(super) fn steps(steps: &StartupTimes<'_>, all: &[SizeTimings]) -> ResultTable {
    let mut table = ResultTable::new(
        "performance-steps",
        "Seconds per step: median, smallest and largest",
        &["step", "ours", "VTK", "load", "paper: ParaView", "paper: its model"],
    );
    let number = |v: f64, digits| TableCell::number(v, digits);
    let vtk: Vec<&PointGaussian> = all.iter().filter_map(|a| a.vtk.as_ref().ok()).collect();
    let loads: Vec<f64> = vtk.iter().map(|v| v.load).collect();
    let of_vtk = if loads.is_empty() { TableCell::text("not measured") } else { seconds(&loads) };
    let not_opened = || TableCell::text(not("read with options"));
    let load = |l: Option<f64>| TableCell::number(l, 1);
    table.row([
        TableCell::text("open, read and check particles"),
        steps.opening.as_ref().map_or_else(not_opened, Times::cell),
        of_vtk,
        load(steps.opening.as_ref().and_then(|t| t.load)),
        number(paper::PARAVIEW_LOAD, 1),
        TableCell::Empty,
    ]);
    table.row([
        TableCell::text("decode the model file"),
        steps.decoding.cell(),
        TableCell::Empty,
        load(steps.decoding.load),
        TableCell::Empty,
        number(paper::MODEL_LOAD, 3),
    ]);
    for at in all {
        let first = at.vtk.as_ref().map_or(TableCell::Empty, |v| seconds(&[v.first]));
        let [width, height] = [at.size.width, at.size.height];
        let name = TableCell::text(format!("first frame of {width}x{height}, with new buffers"));
        let loads = at.vtk.as_ref().ok().and_then(|v| v.cameras.load);
        table.row([name, TableCell::Empty, first, load(loads), TableCell::Empty, TableCell::Empty]);
    }
    for (name, c) in steps.compressions {
        let name = TableCell::text(format!("whole compression, effort {name}"));
        table.row([name, seconds(&[c.seconds]), TableCell::Empty, load(c.load), TableCell::Empty, TableCell::Empty]);
    }
    for (name, value) in [
        ("preparation: raw to VTP", paper::PREPARATION),
        ("training, one block", paper::TRAINING),
        ("merging 8 blocks", paper::MERGE),
        ("fine-tuning", paper::FINE_TUNING),
    ] {
        let name = TableCell::text(format!("paper's {name}"));
        table.row([name, TableCell::Empty, TableCell::Empty, TableCell::Empty, TableCell::Empty, seconds(&[value])]);
    }
    table
}

pub(super) fn phases(compressions: &[(&'static str, Phases)]) -> ResultTable {
    let mut table = ResultTable::new(
        "performance-phases",
        "Seconds of a compression by phase, without certificate",
        &["effort", "phase", "seconds", "share, %", "bytes", "Gaussians", "load"],
    );
    for (effort, c) in compressions {
        let rows = c.phases.iter().map(|(name, s)| (name.as_str(), *s)).chain([("all", c.seconds)]);
        for (phase, s) in rows {
            let of_all = |v: u64| if phase == "all" { TableCell::count(v) } else { TableCell::Empty };
            table.row([
                TableCell::text(*effort),
                TableCell::text(phase),
                TableCell::number(s, 3),
                TableCell::number(100.0 * s / c.seconds, 1),
                of_all(c.bytes),
                of_all(c.gaussians),
                if phase == "all" { TableCell::number(c.load, 1) } else { TableCell::Empty },
            ]);
        }
    }
    table
}

pub(super) fn agreement(all: &[SizeTimings]) -> Option<ResultTable> {
    let mut table = ResultTable::new(
        "performance-agreement",
        "The same picture from VTK and from our renderer of all particles",
        &["look", "pixels", "PSNR, dB", "masked PSNR, dB", "different pixels", "largest difference, levels of 255"],
    );
    for at in all {
        let Some(agrees) = at.vtk.as_ref().ok().and_then(|v| v.agrees) else { continue };
        for (look, a) in ["`paraview` without FXAA", "`paraview`"].iter().zip(agrees) {
            let decibels = |v: Option<f64>| v.map_or(TableCell::text("identical"), |v| TableCell::number(v, 1));
            table.row([
                TableCell::text(*look),
                TableCell::text(format!("{}x{}", at.size.width, at.size.height)),
                decibels(a.psnr),
                decibels(a.masked),
                TableCell::number(a.differ * at.size.pixels() as f64, 0),
                TableCell::count(u64::from(a.largest)),
            ]);
        }
    }
    (!table.rows.is_empty()).then_some(table)
}
