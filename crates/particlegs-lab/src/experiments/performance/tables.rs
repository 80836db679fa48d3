//! Tables of what was timed in one process, with the paper's own figures beside them.

use super::clock::{Frames, Times, seconds};
use super::growth::not;
use super::ours::{BothFrames, Phases};
use super::paper;
use super::point_gaussian::PointGaussian;
use crate::found::{Cell, Table};
use particlegs::picture::Size;

/// All that was timed at one size of pictures.
pub(super) struct AtSize {
    pub size: Size,
    pub model: BothFrames,
    pub paraview: BothFrames,
    pub expected: BothFrames,
    pub vtk: Result<PointGaussian, String>,
}

/// A picture of which kind.
type Pick = fn(&BothFrames) -> &Frames;

/// Frames by renderer.
pub(super) fn frames(all: &[AtSize]) -> Table {
    let mut table = Table::new(
        "performance-frames",
        "A frame, in milliseconds: median, smallest and largest",
        &[
            "frame under a new",
            "pixels",
            "model",
            "all particles, `expected`",
            "all particles, `paraview`",
            "all particles, VTK",
            "model faster than `paraview`, times",
            "model faster than VTK, times",
            "paper: ParaView",
            "paper: its model",
            "paper: faster, times",
        ],
    );
    let kinds: [(&str, bool, Pick); 2] =
        [("camera", false, |f| &f.cameras), ("radius and opacity", true, |f| &f.settings)];
    for at in all {
        for (name, settings, pick) in kinds {
            let (model, paraview) = (pick(&at.model), pick(&at.paraview));
            let vtk = at.vtk.as_ref().map(|v| if settings { &v.settings } else { &v.cameras });
            let published = paper::frame(at.size.height, settings);
            let of = |value: fn(&paper::Frame) -> f64, digits| Cell::number(published.as_ref().map(value), digits);
            table.row([
                Cell::text(name),
                Cell::text(format!("{}x{}", at.size.width, at.size.height)),
                model.cell(),
                pick(&at.expected).cell(),
                paraview.cell(),
                vtk.map_or_else(|_| Cell::text("not measured"), Frames::cell),
                Cell::spread(&model.faster_than(paraview), 1),
                vtk.map_or(Cell::Empty, |v| Cell::spread(&model.faster_than(v), 0)),
                of(|f| f.paraview, 0),
                of(|f| f.published, 2),
                of(|f| f.ratio, 0),
            ]);
        }
    }
    table
}

/// Times before there is a frame.
pub(super) struct Steps<'a> {
    pub opening: &'a Option<Times>,
    pub decoding: &'a Times,
    pub compressions: &'a [(&'static str, Phases)],
}

/// Steps of the way, in seconds.
pub(super) fn steps(steps: &Steps<'_>, all: &[AtSize]) -> Table {
    let mut table = Table::new(
        "performance-steps",
        "Steps, in seconds: median, smallest and largest",
        &["step", "ours", "VTK", "load", "paper: ParaView", "paper: its model"],
    );
    let number = |v: f64, digits| Cell::number(v, digits);
    let vtk: Vec<&PointGaussian> = all.iter().filter_map(|a| a.vtk.as_ref().ok()).collect();
    let loads: Vec<f64> = vtk.iter().map(|v| v.load).collect();
    let of_vtk = if loads.is_empty() { Cell::text("not measured") } else { seconds(&loads) };
    let not_opened = || Cell::text(not("read with options of the command"));
    let load = |l: Option<f64>| Cell::number(l, 1);
    table.row([
        Cell::text("particles opened, read and checked"),
        steps.opening.as_ref().map_or_else(not_opened, Times::cell),
        of_vtk,
        load(steps.opening.as_ref().and_then(|t| t.load)),
        number(paper::PARAVIEW_LOAD, 1),
        Cell::Empty,
    ]);
    table.row([
        Cell::text("model's file decoded"),
        steps.decoding.cell(),
        Cell::Empty,
        load(steps.decoding.load),
        Cell::Empty,
        number(paper::MODEL_LOAD, 3),
    ]);
    for at in all {
        let first = at.vtk.as_ref().map_or(Cell::Empty, |v| seconds(&[v.first]));
        let [width, height] = [at.size.width, at.size.height];
        let name = Cell::text(format!("first frame of {width}x{height}, buffers built"));
        let loads = at.vtk.as_ref().ok().and_then(|v| v.cameras.load);
        table.row([name, Cell::Empty, first, load(loads), Cell::Empty, Cell::Empty]);
    }
    for (name, c) in steps.compressions {
        let name = Cell::text(format!("compression, effort {name}, whole"));
        table.row([name, seconds(&[c.seconds]), Cell::Empty, load(c.load), Cell::Empty, Cell::Empty]);
    }
    for (name, value) in [
        ("preparation: raw to VTP", paper::PREPARATION),
        ("training, one block", paper::TRAINING),
        ("merging 8 blocks", paper::MERGE),
        ("fine-tuning", paper::FINE_TUNING),
    ] {
        let name = Cell::text(format!("paper's {name}"));
        table.row([name, Cell::Empty, Cell::Empty, Cell::Empty, Cell::Empty, seconds(&[value])]);
    }
    table
}

/// Compressions by phase.
pub(super) fn phases(compressions: &[(&'static str, Phases)]) -> Table {
    let mut table = Table::new(
        "performance-phases",
        "A compression by phase, in seconds, without certificate",
        &["effort", "phase", "seconds", "share, %", "bytes", "Gaussians", "load"],
    );
    for (effort, c) in compressions {
        let rows = c.phases.iter().map(|(name, s)| (name.as_str(), *s)).chain([("all", c.seconds)]);
        for (phase, s) in rows {
            let of_all = |v: u64| if phase == "all" { Cell::count(v) } else { Cell::Empty };
            table.row([
                Cell::text(*effort),
                Cell::text(phase),
                Cell::number(s, 3),
                Cell::number(100.0 * s / c.seconds, 1),
                of_all(c.bytes),
                of_all(c.gaussians),
                if phase == "all" { Cell::number(c.load, 1) } else { Cell::Empty },
            ]);
        }
    }
    table
}

/// How VTK's picture agrees with ours.
pub(super) fn agreement(all: &[AtSize]) -> Option<Table> {
    let mut table = Table::new(
        "performance-agreement",
        "The same picture by VTK and by our renderer of all particles",
        &["look", "pixels", "PSNR, dB", "masked PSNR, dB", "pixels that differ", "largest difference, levels of 255"],
    );
    for at in all {
        let Some(agrees) = at.vtk.as_ref().ok().and_then(|v| v.agrees) else { continue };
        for (look, a) in ["`paraview` without FXAA", "`paraview`"].iter().zip(agrees) {
            let decibels = |v: Option<f64>| v.map_or(Cell::text("identical"), |v| Cell::number(v, 1));
            table.row([
                Cell::text(*look),
                Cell::text(format!("{}x{}", at.size.width, at.size.height)),
                decibels(a.psnr),
                decibels(a.masked),
                Cell::number(a.differ * at.size.pixels() as f64, 0),
                Cell::count(u64::from(a.largest)),
            ]);
        }
    }
    (!table.rows.is_empty()).then_some(table)
}
