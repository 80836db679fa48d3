//! Several data sets with one configuration (paper, table "Generalization across spatial regions and simulation
//! codes").

use super::Experiment;
use super::rates::{COMPARED, NOT_OF_THIS_SIZE, RatePoint, ReferenceScores, beside, rows, series};
use crate::lab::{Lab, ModelSettings};
use crate::method::CompressionMethod;
use crate::results::{ExperimentResults, Plot, PlotAxis, ResultTable, Spread, TableCell, decibels};
use crate::snapshot::Snapshot;
use crate::views::{ReferenceViews, identical_note, mean, psnr, ssim};
use particlegs_core::model::Model;
use particlegs_core::{Error, Result};
use particlegs_measure::stats::{HaloProfiles, Measure, StatsOptions, Subject, compare};

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "datasets",
    title: "Several data sets, one configuration",
    paper: "tab:generalization",
    trains: false,
    weight: 60,
    run,
};

/// Radii about centres of haloes.
const RADII: [f64; 3] = [1.0, 0.31, 0.1];
const RADII_UNIT: &str = "Mpc/h";

/// A data set at the compared ratio.
struct DatasetComparison<'a> {
    snapshot: &'a Snapshot,
    gaussians: usize,
    rows: Vec<RatePoint>,
    beside: ReferenceScores,
    enclosed: Vec<EnclosedMassRatio>,
}

/// Mass within one of [`RADII`] about centres of haloes, model / truth.
struct EnclosedMassRatio {
    /// Centres about which the truth has mass.
    centres: u64,
    median: Option<f64>,
    quartiles: Option<[f64; 2]>,
}

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    lab.context.begin("data sets", snapshots.len() as u64);
    let (mut sets, mut failed) = (Vec::new(), Vec::new());
    for snapshot in snapshots {
        match measured(lab, snapshot) {
            Ok(set) => sets.push(set),
            // A data set with too few particles must not stop the others.
            Err(e @ (Error::Input { .. } | Error::Argument { .. } | Error::Unreachable { .. })) => {
                failed.push((snapshot, e));
            }
            Err(e) => return Err(e),
        }
        lab.context.advance(1);
    }
    lab.context.end();
    if sets.is_empty()
        && let Some((snapshot, e)) = failed.first()
    {
        return Err(Error::input(&snapshot.name, e.to_string()));
    }
    let mut notes = vec![format!(
        "Presets were tuned only on nbody128 and nbody64. Settings: default effort, ratio {COMPARED}, {} views, \
         radius and opacity from the published ranges. The second table shows the lead of our models over each \
         method; its sign should hold for other data sets. The figure omits methods without a file near that size.",
        3 * lab.settings.frames
    )];
    if snapshots.len() == 1 {
        notes.push("There was only one snapshot: name more snapshots to compare data sets.".into());
    }
    let pictures = sets.iter().flat_map(|s| s.rows.iter().map(move |r| (s, r))).flat_map(|(s, r)| {
        r.pictures(lab).map(|(name, scores)| (format!("{}, {name}", s.snapshot.name), scores)).collect::<Vec<_>>()
    });
    notes.extend(identical_note(pictures));
    notes.extend(sets.iter().filter_map(|s| s.snapshot.weights_note()));
    notes.extend(lab.left_out());
    notes.extend(failed.iter().map(|(snapshot, e)| format!("{} was not measured: {e}.", snapshot.name)));
    let enclosed = sets.iter().any(|s| !s.enclosed.is_empty()).then(|| enclosed(&sets));
    let tables = [ours(&sets), margins(lab, &sets)].into_iter().chain(enclosed).collect();
    Ok(ExperimentResults { tables, plots: vec![plot(lab, &sets)], pictures: Vec::new(), notes })
}

fn measured<'a>(lab: &Lab<'_>, snapshot: &'a Snapshot) -> Result<DatasetComparison<'a>> {
    let first = lab.model(snapshot, &ModelSettings::ratio(COMPARED, lab.settings.seed))?;
    let truth = ReferenceViews::new(lab, snapshot, &first.model.metadata)?;
    let (rows, beside) = (rows(lab, snapshot, &truth, &[COMPARED])?, beside(lab, snapshot, &truth, &first)?);
    let enclosed = enclosed_masses(lab, snapshot, &first.model)?;
    Ok(DatasetComparison { snapshot, gaussians: first.model.gaussians(), rows, beside, enclosed })
}

/// Nothing where a snapshot has no centres, or other units.
fn enclosed_masses(lab: &Lab<'_>, snapshot: &Snapshot, model: &Model) -> Result<Vec<EnclosedMassRatio>> {
    let centres = snapshot.centres(lab.context)?;
    if centres.is_empty() || snapshot.unit() != RADII_UNIT {
        return Ok(Vec::new());
    }
    let mut options = StatsOptions {
        measures: vec![Measure::Haloes],
        centers: Some(centres.into_iter().map(|at| (at, None)).collect()),
        halo_bins: 1,
        ..StatsOptions::default()
    };
    let within = |r: f64| {
        options.halo_radius = Some(r);
        let (truth, model) = (Subject::Particles(&snapshot.particles), Subject::Model(model));
        let haloes = compare(truth, model, &options, lab.context)?.haloes;
        let last = |h: HaloProfiles| Some((*h.compared.last()?, *h.median.last()?, *h.quartiles.last()?));
        let (centres, median, quartiles) = haloes.and_then(last).unwrap_or_default();
        Ok(EnclosedMassRatio { centres, median, quartiles })
    };
    RADII.into_iter().map(within).collect()
}

impl DatasetComparison<'_> {
    fn masked(&self, method: CompressionMethod) -> Vec<f64> {
        self.rows.iter().find(|r| r.method == method).map(RatePoint::masked).unwrap_or_default()
    }

    /// Whether there is a file, but none near the compared size.
    fn missed(&self, method: CompressionMethod) -> bool {
        let raw = self.snapshot.position_bytes() as f64;
        self.rows.iter().any(|r| r.method == method && r.bytes().is_some() && !r.met(raw))
    }

    fn ours(&self) -> &RatePoint {
        self.rows.iter().find(|r| r.method == CompressionMethod::OpticalDepth).unwrap_or(&self.rows[0])
    }
}

fn ours(sets: &[DatasetComparison<'_>]) -> ResultTable {
    ResultTable::new(
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
    )
    .with(sets.iter().enumerate().map(|(i, s)| {
        let row = s.ours();
        [
            TableCell::text(format!("{} {}", i + 1, s.snapshot.name)),
            TableCell::count(s.snapshot.particles.len() as u64),
            TableCell::count(s.gaussians as u64),
            TableCell::number(row.bytes(), 0),
            TableCell::decibels(&row.masked()),
            TableCell::decibels(&row.values(&|s| mean(s, psnr))),
            TableCell::spread(&row.values(&|s| mean(s, ssim)), 4),
            TableCell::number(s.beside.noise_free, 2),
            TableCell::number(s.beside.uniform_box, 2),
            TableCell::number(s.beside.all_black, 2),
        ]
    }))
}

fn enclosed(sets: &[DatasetComparison<'_>]) -> ResultTable {
    let within = |r: &f64| format!("within {r} {RADII_UNIT}: median (quartiles)");
    let heads: Vec<String> =
        ["data set", "haloes"].map(String::from).into_iter().chain(RADII.iter().map(within)).collect();
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let cell = |m: &EnclosedMassRatio| match (m.median, m.quartiles) {
        (Some(value), Some(range)) => TableCell::Spread { value, range, digits: 3 },
        _ => TableCell::Empty,
    };
    let row = |s: &DatasetComparison<'_>| {
        let name = [TableCell::text(&s.snapshot.name), TableCell::count(s.enclosed.first()?.centres)];
        Some(name.into_iter().chain(s.enclosed.iter().map(cell)).collect::<Vec<_>>())
    };
    let title = format!("Mass about haloes of another finder, model / particles, at ratio {COMPARED}");
    ResultTable::new("datasets-enclosed", title, &heads).with(sets.iter().filter_map(row))
}

/// Lead of our models over each other method, one column per data set.
fn margins(lab: &Lab<'_>, sets: &[DatasetComparison<'_>]) -> ResultTable {
    let heads: Vec<&str> = ["method"].into_iter().chain(sets.iter().map(|s| s.snapshot.name.as_str())).collect();
    let title = format!("Our models above other methods, masked PSNR, dB, at ratio {COMPARED}");
    let row = |method: CompressionMethod| {
        let above = |s: &DatasetComparison<'_>| {
            if s.missed(method) {
                return TableCell::text(NOT_OF_THIS_SIZE);
            }
            let ours = Spread::new(&s.ours().masked()).map_or(f64::NAN, |s| s.median);
            TableCell::spread(&s.masked(method).iter().map(|v| ours - v).collect::<Vec<_>>(), 2)
        };
        let above: Vec<TableCell> = sets.iter().map(above).collect();
        [vec![TableCell::text(method.name(lab))], above].concat()
    };
    ResultTable::new("datasets-margins", title, &heads).with(CompressionMethod::all(lab).into_iter().skip(1).map(row))
}

fn plot(lab: &Lab<'_>, sets: &[DatasetComparison<'_>]) -> Plot {
    let curve = |method: CompressionMethod| {
        let comparisons = sets.iter().enumerate().filter(|(_, s)| !s.missed(method));
        let point = |(i, s): (usize, &DatasetComparison<'_>)| decibels((i + 1) as f64, &s.masked(method));
        series(lab, method, comparisons.filter_map(point).collect())
    };
    Plot {
        name: "datasets".into(),
        title: format!("Masked PSNR at ratio {COMPARED} by data set"),
        x: PlotAxis {
            range: Some([0.5, sets.len() as f64 + 0.5]),
            names: sets.iter().map(|s| s.snapshot.name.clone()).collect(),
            ..PlotAxis::linear("data set")
        },
        y: PlotAxis::linear("masked PSNR, dB"),
        series: CompressionMethod::all(lab).into_iter().map(curve).collect(),
        levels: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;
    use particlegs_core::context::Context;
    use particlegs_core::model::Units;
    use particlegs_core::picture::Size;

    #[test]
    fn a_data_set_that_is_too_small_does_not_stop_the_others() {
        let snapshot_of = |name: &str, n: u32| {
            Snapshot::new(name.into(), name.into(), crate::testing::lattice(n, |v| (v / 31.0).powi(2)), None)
        };
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings { size: Size { width: 64, height: 36 }, ..Settings::new(true, "".into()) };
        let lab = Lab::new(settings, folder.path(), &Context::SILENT).unwrap();
        let results = run(&lab, &[snapshot_of("large", 20_000), snapshot_of("small", 300)]).unwrap();
        assert!(results.notes.last().unwrap().starts_with("small was not measured: "), "{:?}", results.notes);
        let (ours, margins) = (&results.tables[0], &results.tables[1]);
        assert_eq!((ours.rows.len(), &ours.rows[0][0], margins.columns.len()), (1, &TableCell::text("1 large"), 2));
        assert!(run(&lab, &[snapshot_of("small", 300)]).is_err());
    }

    #[test]
    fn masses_are_compared_about_the_centres_beside_a_snapshot() {
        let folder = tempfile::tempdir().unwrap();
        let mut particles = crate::testing::lattice(20_000, |v| (v / 31.0).powi(2));
        particles.meta.units = Units::new(Some("Mpc/h"), None, Some(true));
        let snapshot = Snapshot::new("s".into(), folder.path().into(), particles, None);
        let settings = Settings { size: Size { width: 64, height: 36 }, ..Settings::new(true, "".into()) };
        let lab = Lab::new(settings, folder.path(), &Context::SILENT).unwrap();
        let model = lab.model(&snapshot, &ModelSettings::ratio(COMPARED, 42)).unwrap().model;
        assert!(enclosed_masses(&lab, &snapshot, &model).unwrap().is_empty());
        std::fs::write(folder.path().join("centres.csv"), "x,y,z\n1,1,1\n30,30,30\n").unwrap();
        let masses = enclosed_masses(&lab, &snapshot, &model).unwrap();
        assert_eq!(masses.len(), RADII.len());
        assert!(masses[0].centres >= 1 && masses[0].median.is_some_and(|m| m > 0.0 && m < 2.0));
        std::fs::write(folder.path().join("centres.csv"), "nothing\n").unwrap();
        assert!(enclosed_masses(&lab, &snapshot, &model).is_err());
    }
}
