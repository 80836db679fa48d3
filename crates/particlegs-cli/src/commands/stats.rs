//! `particlegs stats TRUTH OTHER -o DIR`.

use crate::common::Common;
use crate::snapshot_args::SnapshotArgs;
use crate::{stats_plots, stats_tables};
use clap::{Args, ValueEnum};
use particlegs::model::Model;
use particlegs::particles::Particles;
use particlegs::progress::Progress;
use particlegs::stats::{Assignment, Convention, Measure, Statistics, StatsOptions, Subject, compare};
use particlegs::{Error, Result, codec, output};
use std::path::{Path, PathBuf};

/// Measure what recovered particles, or a model itself, are good for.
#[derive(Args)]
#[command(
    after_help = "Writes stats.json, tables as CSV and plots as SVG and PNG. A model is measured by its mixture itself:
density, P(k), r(k), xi(r) by transform and moments; pairs, groups and neighbours need particles.

Examples:
  particlegs stats snapshot recovered -o stats
  particlegs stats snapshot model.pgs -o stats --only density,spectrum
  particlegs stats snapshot recovered -o stats --grid 50 --spectrum-grid 512"
)]
pub struct Arguments {
    /// The truth: a snapshot's file or folder, or a model file.
    #[arg(value_name = "TRUTH")]
    truth: PathBuf,
    /// What is measured against it: likewise.
    #[arg(value_name = "OTHER")]
    other: PathBuf,
    /// Folder for results; made where it is missing.
    #[arg(long, short, alias = "output", value_name = "DIR")]
    out: PathBuf,
    /// Measure these alone (default: all).
    #[arg(long, value_name = "NAME,...", value_enum, value_delimiter = ',')]
    only: Vec<MeasureName>,
    /// Definitions: correct ones, or the published table's.
    #[arg(long, value_enum, default_value_t = ConventionName::Correct)]
    convention: ConventionName,
    /// Cells along the longest edge for densities.
    #[arg(long, value_name = "N", default_value_t = 256)]
    grid: usize,
    /// Mass assignment for densities.
    #[arg(long, value_enum, default_value_t = AssignmentName::Ngp)]
    assignment: AssignmentName,
    /// Cells along the longest edge for P(k).
    #[arg(long, value_name = "N", default_value_t = 256)]
    spectrum_grid: usize,
    /// Mass assignment for P(k).
    #[arg(long, value_enum, default_value_t = AssignmentName::Tsc)]
    spectrum_assignment: AssignmentName,
    /// One grid for P(k) instead of two half a cell apart.
    #[arg(long)]
    no_interlacing: bool,
    /// Largest wave number (default: the particles' Nyquist frequency, pi / spacing).
    #[arg(long, value_name = "K")]
    k_max: Option<f64>,
    /// Smallest and largest separation for xi(r).
    #[arg(long, value_name = "LO,HI", value_delimiter = ',', num_args = 1)]
    separations: Option<Vec<f64>>,
    /// Distances to take for xi(r), about, a band of separations; above it primaries are sampled.
    #[arg(long, value_name = "N", default_value_t = 300_000_000)]
    pairs: u64,
    /// Linking length of groups, in mean spacings.
    #[arg(long, value_name = "B", default_value_t = 0.2)]
    linking: f64,
    /// Radius of the apertures about group centres, in mean spacings.
    #[arg(long, value_name = "F", default_value_t = 0.128)]
    aperture: f64,
    /// Particles whose nearest neighbour is sought.
    #[arg(long, value_name = "N", default_value_t = 500_000)]
    neighbours: usize,
    /// Take no axis as periodic, whatever the files say.
    #[arg(long)]
    open: bool,
    /// Tables alone, no plots.
    #[arg(long)]
    no_plots: bool,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    common: Common,
}

/// What can be chosen alone.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MeasureName {
    /// Density on a grid.
    Density,
    /// P(k), r(k), xi(r) by transform.
    Spectrum,
    /// xi(r) by pair counts.
    Pairs,
    /// Friends of friends and their cores.
    Groups,
    /// Nearest neighbours.
    Neighbours,
    /// Moments along the axes.
    Moments,
}

/// Whose definitions.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ConventionName {
    /// Cubic cells, windows and shot noise corrected.
    Correct,
    /// As the published table was made.
    Paper,
}

/// Mass assignment.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AssignmentName {
    /// Nearest grid point.
    Ngp,
    /// Cloud in cell.
    Cic,
    /// Triangular-shaped cloud.
    Tsc,
}

impl From<AssignmentName> for Assignment {
    fn from(name: AssignmentName) -> Self {
        match name {
            AssignmentName::Ngp => Assignment::Ngp,
            AssignmentName::Cic => Assignment::Cic,
            AssignmentName::Tsc => Assignment::Tsc,
        }
    }
}

impl From<MeasureName> for Measure {
    fn from(name: MeasureName) -> Self {
        match name {
            MeasureName::Density => Measure::Density,
            MeasureName::Spectrum => Measure::Spectrum,
            MeasureName::Pairs => Measure::Pairs,
            MeasureName::Groups => Measure::Groups,
            MeasureName::Neighbours => Measure::Neighbours,
            MeasureName::Moments => Measure::Moments,
        }
    }
}

/// Particles or a model, as they were read.
enum Source {
    Particles(Box<Particles>),
    Model(Box<Model>),
}

impl Source {
    fn open(path: &Path, args: &SnapshotArgs, progress: &dyn Progress) -> Result<Self> {
        if super::info::is_model(path)? {
            let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
            return Ok(Source::Model(Box::new(codec::decode(&bytes, &path.display().to_string())?)));
        }
        Ok(Source::Particles(Box::new(args.open(&[path.to_path_buf()], progress)?)))
    }

    fn subject(&self) -> Subject<'_> {
        match self {
            Source::Particles(p) => Subject::Particles(p),
            Source::Model(m) => Subject::Model(m),
        }
    }

    /// Unit of length and whether it is comoving.
    fn length_unit(&self) -> Option<String> {
        match self {
            Source::Particles(p) => p.meta.length_unit.clone(),
            Source::Model(m) => m.metadata.length_unit.clone(),
        }
    }
}

/// What stats.json holds.
#[derive(serde::Serialize)]
struct Report<'a> {
    truth: String,
    other: String,
    length_unit: Option<String>,
    tool_version: &'static str,
    #[serde(flatten)]
    statistics: &'a Statistics,
}

/// Measures and writes.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let options = options(&a)?;
    std::fs::create_dir_all(&a.out).map_err(|e| Error::io(&a.out, e))?;
    output::check_writable(&a.out.join("stats.json"))?;
    let truth = Source::open(&a.truth, &a.snapshot, &context)?;
    let other = Source::open(&a.other, &a.snapshot, &context)?;
    let statistics = compare(truth.subject(), other.subject(), &options, &context)?;
    statistics.notes.iter().for_each(|n| context.message(&format!("note: {n}")));
    let unit = a.snapshot.length_unit.clone().or_else(|| truth.length_unit());
    stats_tables::write(&a.out, &statistics)?;
    if !a.no_plots {
        stats_plots::write_all(&a.out, &statistics, unit.as_deref())?;
    }
    let report = Report {
        truth: a.truth.display().to_string(),
        other: a.other.display().to_string(),
        length_unit: unit.clone(),
        tool_version: env!("CARGO_PKG_VERSION"),
        statistics: &statistics,
    };
    crate::report::json(&a.out.join("stats.json"), &report)?;
    context.finish(&stats_tables::summary(&statistics, unit.as_deref()), &report)
}

fn options(a: &Arguments) -> Result<StatsOptions> {
    let separations = match a.separations.as_deref() {
        None => None,
        Some([low, high]) => Some([*low, *high]),
        Some(_) => return Err(Error::argument("--separations takes two lengths LO,HI")),
    };
    let measures = if a.only.is_empty() { Measure::ALL.to_vec() } else { a.only.iter().map(|m| (*m).into()).collect() };
    Ok(StatsOptions {
        measures,
        convention: match a.convention {
            ConventionName::Correct => Convention::Correct,
            ConventionName::Paper => Convention::Paper,
        },
        cells: a.grid,
        assignment: a.assignment.into(),
        spectrum_cells: a.spectrum_grid,
        spectrum_assignment: a.spectrum_assignment.into(),
        open: a.open,
        interlaced: !a.no_interlacing,
        k_max: a.k_max,
        separations,
        pair_budget: a.pairs,
        linking: a.linking,
        aperture: a.aperture,
        neighbour_sample: a.neighbours,
        seed: a.common.seed,
        ..StatsOptions::default()
    })
}
