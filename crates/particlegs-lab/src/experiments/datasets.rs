//! One pipeline, one configuration, several data sets (paper, table "Generalization across spatial regions and
//! simulation codes"): nothing is tuned to any of them.

use super::Experiment;
use super::rate_distortion::{Beside, COMPARED, Row, beside, rows};
use crate::found::{Axis, Cell, Found, Plot, Point, Series, Spread, Table};
use crate::lab::{Lab, Recipe, Snapshot};
use crate::method::Method;
use crate::views::{Truth, mean};
use particlegs::Result;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "datasets",
    title: "Several data sets, one configuration",
    paper: "tab:generalization",
    trains: false,
    weight: 60,
    run,
};

/// A data set at the ratio that is compared.
struct Set<'a> {
    snapshot: &'a Snapshot,
    gaussians: usize,
    rows: Vec<Row>,
    beside: Beside,
}

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<Found> {
    lab.progress.begin("data sets", snapshots.len() as u64);
    let mut sets = Vec::new();
    for snapshot in snapshots {
        let first = lab.model(snapshot, &Recipe::ratio(COMPARED, lab.settings.seed))?;
        let truth = Truth::of(lab, snapshot, &first.model.metadata)?;
        let (rows, beside) = (rows(lab, snapshot, &truth, &[COMPARED])?, beside(lab, snapshot, &truth, &first)?);
        sets.push(Set { snapshot, gaussians: first.model.gaussians(), rows, beside });
        lab.progress.advance(1);
    }
    lab.progress.end();
    let mut notes = vec![format!(
        "The first data set is the one that presets were tuned on; the others were not seen while tuning. Default \
         effort, ratio {COMPARED}; {} views, radius and opacity from the published ranges. The table beside each \
         method says how far our models are above it: the sign is what is to carry over.",
        3 * lab.settings.frames
    )];
    if snapshots.len() == 1 {
        notes.push("Only one snapshot was given: name others after it to compare.".into());
    }
    notes.extend(lab.left_out());
    let tables = vec![ours(&sets), margins(lab, &sets)];
    Ok(Found { tables, plots: vec![plot(lab, &sets)], pictures: Vec::new(), notes })
}

impl Set<'_> {
    fn masked(&self, method: Method) -> Vec<f64> {
        self.rows.iter().find(|r| r.method == method).map(Row::masked).unwrap_or_default()
    }

    fn ours(&self) -> &Row {
        self.rows.iter().find(|r| r.method == Method::OpticalDepth).unwrap_or(&self.rows[0])
    }
}

fn ours(sets: &[Set<'_>]) -> Table {
    let mut table = Table::new(
        "datasets",
        format!("Our models at ratio {COMPARED}"),
        &[
            "data set",
            "particles",
            "Gaussians",
            "bytes",
            "masked PSNR, dB",
            "PSNR, dB",
            "SSIM",
            "noise-free, dB",
            "uniform box, dB",
            "all black, dB",
        ],
    );
    for s in sets {
        let row = s.ours();
        table.row([
            Cell::text(&s.snapshot.name),
            Cell::count(s.snapshot.particles.len() as u64),
            Cell::count(s.gaussians as u64),
            Cell::number(row.bytes(), 0),
            Cell::spread(&row.masked(), 2),
            Cell::spread(&row.values(&|s| mean(s, |s| s.psnr)), 2),
            Cell::spread(&row.values(&|s| mean(s, |s| s.ssim)), 4),
            Cell::number(s.beside.noise_free, 2),
            Cell::number(s.beside.uniform_box, 2),
            Cell::number(s.beside.all_black, 2),
        ]);
    }
    table
}

/// How far ours is above each other way, a column a data set.
fn margins(lab: &Lab<'_>, sets: &[Set<'_>]) -> Table {
    let heads: Vec<&str> = ["method"].into_iter().chain(sets.iter().map(|s| s.snapshot.name.as_str())).collect();
    let title = format!("Our models above other ways, masked PSNR, dB, at ratio {COMPARED}");
    let mut table = Table::new("datasets-margins", title, &heads);
    for method in Method::all(lab).into_iter().skip(1) {
        let above = |s: &Set<'_>| {
            let ours = Spread::of(&s.ours().masked()).map_or(f64::NAN, |s| s.median);
            Cell::spread(&s.masked(method).iter().map(|v| ours - v).collect::<Vec<_>>(), 2)
        };
        table.row([Cell::text(method.name(lab))].into_iter().chain(sets.iter().map(above)));
    }
    table
}

fn plot(lab: &Lab<'_>, sets: &[Set<'_>]) -> Plot {
    let curve = |(style, method): (usize, Method)| {
        let point = |(i, s): (usize, &Set<'_>)| Point::spread((i + 1) as f64, &s.masked(method));
        Series {
            name: method.name(lab),
            style,
            dashed: false,
            points: sets.iter().enumerate().filter_map(point).collect(),
        }
    };
    let names: Vec<String> = sets.iter().enumerate().map(|(i, s)| format!("{} {}", i + 1, s.snapshot.name)).collect();
    Plot {
        name: "datasets".into(),
        title: format!("Masked PSNR at ratio {COMPARED} by data set"),
        x: Axis::linear(names.join(", ")),
        y: Axis::linear("masked PSNR, dB"),
        series: Method::all(lab).into_iter().enumerate().map(curve).collect(),
        levels: Vec::new(),
    }
}
