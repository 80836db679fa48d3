//! Scaling with the number of particles: seconds, memory and bytes of `compress` as a whole command.

use super::clock::Machine;
use super::command::{CommandRun, RawCopy, run};
use crate::experiments::rates::COMPARED;
use crate::lab::Lab;
use crate::results::{Plot, PlotAxis, PlotSeries, Point, ResultTable, TableCell};
use crate::snapshot::Snapshot;
use particlegs_core::Result;
use particlegs_particles::{Selection, Tiling};
use serde::{Deserialize, Serialize};
use std::process::Command;

/// One number of particles.
#[derive(Serialize, Deserialize)]
pub(super) struct GrowthPoint {
    pub particles: u64,
    /// Their origin in the snapshot, in words.
    pub what: String,
    /// Bytes of the file; `None` if the command failed.
    pub bytes: Option<u64>,
    pub ran: CommandRun,
}

/// Random subsets, all particles, and, with full settings and a periodic box, four copies.
pub(super) fn measure(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    raw: &RawCopy<'_>,
    machine: &Machine,
) -> Result<Vec<GrowthPoint>> {
    let parts: &[u64] = if lab.settings.quick { &[8, 2, 1] } else { &[64, 16, 4, 1] };
    let mut all = Vec::new();
    for part in parts {
        let n = snapshot.particles.len() as u64 / part;
        if n > 0 {
            let sample = (*part > 1).then_some(n);
            let selection = Selection { sample, seed: lab.settings.seed, ..Selection::all() };
            let label = if *part > 1 { format!("a random 1/{part}") } else { "all".into() };
            all.push(one(lab, snapshot, label, n, machine, |name| raw.written(name, Tiling::single(), selection))?);
        }
    }
    if let (false, Ok(tiling)) = (lab.settings.quick, Tiling::new([2, 2, 1], &snapshot.particles)) {
        let (label, n) = ("2 x 2 x 1 copies of the box".to_string(), 4 * snapshot.particles.len() as u64);
        all.push(one(lab, snapshot, label, n, machine, |name| raw.written(name, tiling, Selection::all()))?);
    }
    Ok(all)
}

fn one(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    label: String,
    particles: u64,
    machine: &Machine,
    write: impl FnOnce(&str) -> Result<std::path::PathBuf>,
) -> Result<GrowthPoint> {
    let inputs = (&snapshot.hash, particles, COMPARED, lab.settings.seed, machine);
    let compressed = || {
        let path = write(&format!("n{particles}"))?;
        let parent = path.parent().unwrap_or(&path).to_path_buf();
        let out = parent.join(format!("n{particles}.pgs"));
        let mut command = compress(lab, &path, &out);
        let ran = run(&mut command, "", &parent, lab.context)?;
        let bytes = ran.cost.is_some().then(|| std::fs::metadata(&out).map(|m| m.len()).ok()).flatten();
        Ok(GrowthPoint { particles, what: label, bytes, ran })
    };
    lab.store.result_if("timed-growth", &inputs, compressed, |g: &GrowthPoint| !g.ran.failed())
}

/// `compress` at the compared ratio.
pub(super) fn compress(lab: &Lab<'_>, snapshot: &std::path::Path, out: &std::path::Path) -> Command {
    let mut command = Command::new(&lab.settings.program);
    let (ratio, seed) = (COMPARED.to_string(), lab.settings.seed.to_string());
    command.arg("compress").arg(snapshot).arg("-o").arg(out).args(["--ratio", &ratio, "--seed", &seed]);
    command
}

pub(super) fn table(all: &[GrowthPoint]) -> ResultTable {
    let mut table = ResultTable::new(
        "performance-growth",
        format!("Growth with the number of particles: the whole command `compress --ratio {COMPARED}`"),
        &[
            "particles",
            "part of the snapshot",
            "file size, bytes",
            "seconds",
            "CPU seconds",
            "peak memory, MiB",
            "load",
            "microseconds per particle",
            "peak bytes per particle",
        ],
    );
    for g in all {
        let n = g.particles as f64;
        let Some(cost) = &g.ran.cost else {
            let mut row =
                vec![TableCell::count(g.particles), TableCell::text(&g.what), TableCell::text(not(&g.ran.said))];
            row.resize(table.columns.len(), TableCell::Empty);
            table.row(row);
            continue;
        };
        let [seconds, processor, peak, load] = cost.cells();
        table.row([
            TableCell::count(g.particles),
            TableCell::text(&g.what),
            TableCell::number(g.bytes.map(|b| b as f64), 0),
            seconds,
            processor,
            peak,
            load,
            TableCell::number(1e6 * cost.seconds / n, 2),
            TableCell::number(cost.peak.map(|b| b as f64 / n), 1),
        ]);
    }
    table
}

pub(super) fn not(why: &str) -> String {
    format!("not measured: {why}")
}

/// Seconds and memory by the number of particles.
pub(super) fn plots(all: &[GrowthPoint]) -> Vec<Plot> {
    let plot = |name: &str, title: &str, y: &str, measure: fn(&GrowthPoint) -> Option<f64>| {
        let points: Vec<Point> = all.iter().filter_map(|g| Some(Point::new(g.particles as f64, measure(g)?))).collect();
        let mut series = vec![PlotSeries { name: "compress".into(), style: 0, dashed: false, points }];
        series.extend(proportional(&series[0].points));
        let (x, y) = (PlotAxis::logarithmic("particles"), PlotAxis::logarithmic(y));
        Plot { name: format!("performance-growth-{name}"), title: title.into(), x, y, series, levels: vec![] }
    };
    vec![
        plot("seconds", "Time of a compression", "time of the whole command, s", |g| {
            Some(g.ran.cost.as_ref()?.seconds)
        }),
        plot("memory", "Memory of a compression", "peak memory, MiB", |g| {
            g.ran.cost.as_ref()?.peak.map(|b| b as f64 / 1048576.0)
        }),
    ]
}

/// The line through the last point that is proportional to the particles; empty for fewer than two points.
pub(super) fn proportional(points: &[Point]) -> Option<PlotSeries> {
    let ([first, .., last], style) = (points, 7) else { return None };
    let at = |x: f64| Point::new(x, last.y * x / last.x);
    Some(PlotSeries { name: "proportional".into(), style, dashed: true, points: vec![at(first.x), at(last.x)] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_proportional_line_ends_at_the_last_point() {
        let points = [Point::new(10.0, 5.0), Point::new(20.0, 6.0), Point::new(40.0, 8.0)];
        let line = proportional(&points).unwrap().points;
        assert_eq!((line[0].y, line[1].y, line[0].x), (2.0, 8.0, 10.0));
        assert!(proportional(&points[..1]).is_none());
    }

    #[test]
    fn failures_are_shown_in_their_row() {
        let ran = CommandRun { cost: None, said: "too small".into() };
        let table = table(&[GrowthPoint { particles: 7, what: "all".into(), bytes: None, ran }]);
        assert_eq!(table.rows[0].len(), table.columns.len());
        assert_eq!(table.rows[0][2], TableCell::text("not measured: too small"));
    }
}
