//! `particlegs stats TRUTH OTHER -o DIR`.

use crate::common::{CommandContext, Common, named};
use crate::inputs;
use crate::snapshot_args::SnapshotArgs;
use clap::{Args, ValueHint};
use particlegs::Series;
use particlegs::input::MeasuredInput;
use particlegs_core::{Error, Result};
use particlegs_figure::FileKind;
use particlegs_files::output;
use particlegs_formats::Catalogue;
use particlegs_measure::stats::{Assignment, Convention, Measure, StatsOptions, StatsReport};
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(
    after_help = "\
Examples:
  particlegs stats snapshot recovered -o stats
  particlegs stats snapshot model.pgs -o stats --only density,spectrum
  particlegs stats run.pgs -o stats --only spectrum",
    after_long_help = "\
Writes stats.json, tables as CSV, and plots as SVG and PNG unless --plots says otherwise. A model is
measured from its Gaussians: density, profiles, P(k), r(k), xi(r) by transform, moments and mass
around centres; velocities and other fields are those of particles drawn from it; pairs, groups,
neighbours and g(r) need particles.
A model and particles, in either order, also give the likelihood of the particles under the model.
A whole series alone gives P(k), groups and means of fields over time.
docs/guide/statistics.md defines every measure.

Examples:
  particlegs stats snapshot recovered -o stats
  particlegs stats snapshot model.pgs -o stats --only density,spectrum
  particlegs stats snapshot recovered -o stats --grid 50 --spectrum-grid 512
  particlegs stats melt.dump recovered -o stats --only rdf,profile --profile-axis z
  particlegs stats snapshot model.pgs -o stats --only haloes --centres catalogue.csv
  particlegs stats snapshot model.pgs -o stats --only multipoles,momentum,dispersion
  particlegs stats snapshot model.pgs -o stats --only joint --joint density,temperature
  particlegs stats snapshot model.pgs -o stats --only spectrum --plots pdf
  particlegs stats run.pgs -o stats --only spectrum"
)]
pub struct Arguments {
    /// Truth: a snapshot's file or folder, or a model file; or a whole series alone.
    #[arg(value_name = "TRUTH")]
    truth: PathBuf,
    /// What to compare with it: recovered particles, a snapshot or a model file.
    #[arg(value_name = "OTHER")]
    other: Option<PathBuf>,
    /// Folder for the results.
    #[arg(long = "output", short, alias = "out", value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: PathBuf,
    /// Measure only these [default: all].
    #[arg(long, value_name = "NAME,...", value_parser = named::<Measure>(), value_delimiter = ',')]
    only: Vec<Measure>,
    /// Definitions to use.
    #[arg(long, value_name = "NAME", default_value = "correct", hide_short_help = true, value_parser = named::<Convention>())]
    convention: Convention,
    /// Treat no axis as periodic, whatever the files say.
    #[arg(long)]
    open: bool,
    /// Write tables only, no plots.
    #[arg(long)]
    no_plots: bool,
    /// File formats of the plots.
    #[arg(long, value_name = "KIND,...", default_value = "svg,png", hide_short_help = true)]
    #[arg(value_parser = named::<FileKind>(), value_delimiter = ',', conflicts_with = "no_plots")]
    plots: Vec<FileKind>,
    #[command(flatten)]
    measure: MeasureArgs,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    common: Common,
}

#[derive(Args)]
#[command(next_help_heading = "Options of single measures")]
struct MeasureArgs {
    /// Density: cells along the longest edge [default: of 8 particles].
    #[arg(long, value_name = "N")]
    grid: Option<usize>,
    /// Density: mass assignment.
    #[arg(long, value_name = "NAME", default_value = "ngp", hide_short_help = true, value_parser = named::<Assignment>())]
    assignment: Assignment,
    /// P(k): cells along the longest edge.
    #[arg(long, value_name = "N", default_value_t = 256)]
    spectrum_grid: usize,
    /// P(k): mass assignment.
    #[arg(long, value_name = "NAME", default_value = "tsc", hide_short_help = true, value_parser = named::<Assignment>())]
    spectrum_assignment: Assignment,
    /// P(k): use one grid instead of two interlaced ones.
    #[arg(long, hide_short_help = true)]
    no_interlacing: bool,
    /// P(k): largest wave number [default: the particles' Nyquist frequency, pi / mean spacing].
    #[arg(long, value_name = "K", hide_short_help = true)]
    k_max: Option<f64>,
    /// xi(r): smallest and largest separation.
    #[arg(long, value_name = "LO,HI", value_delimiter = ',', num_args = 1, hide_short_help = true)]
    separations: Option<Vec<f64>>,
    /// xi(r): approximate number of distances to compute per band of separations.
    ///
    /// If there are more, a sample of the particles is used as primaries.
    #[arg(long, value_name = "N", default_value_t = 300_000_000, hide_short_help = true)]
    pairs: u64,
    /// g(r): largest distance [default: 4 mean spacings, at most half the box].
    #[arg(long, value_name = "R", hide_short_help = true)]
    rdf_max: Option<f64>,
    /// Profile: axis whose results are printed.
    #[arg(long, value_name = "AXIS", default_value = "z", hide_short_help = true, value_parser = ["x", "y", "z"])]
    profile_axis: String,
    /// Profile: number of slabs.
    #[arg(long, value_name = "N", default_value_t = 200, hide_short_help = true)]
    profile_bins: usize,
    /// Haloes: text file with x, y, z and optionally a radius per line.
    ///
    /// The header, with or without #, names the columns and their units; halo catalogues from Rockstar,
    /// consistent-trees and AHF are read as they are. Without a file, the centres are those of the truth's 1000 largest
    /// groups with 100 particles or more.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    centres: Option<PathBuf>,
    /// Haloes: largest radius, that of dispersions [default: the file's, else 2 mean spacings].
    #[arg(long, value_name = "R", hide_short_help = true)]
    halo_radius: Option<f64>,
    /// Haloes: number of shells, from a 50th of the largest radius to that radius.
    #[arg(long, value_name = "N", default_value_t = 20, hide_short_help = true)]
    halo_bins: usize,
    /// Groups: linking length in mean spacings.
    #[arg(long, value_name = "B", default_value_t = 0.2)]
    linking: f64,
    /// Groups: the linking length itself, such as 0.02Mpc; a plain number is in the truth's unit.
    ///
    /// In a zoom simulation (light particles in a box of heavier ones) only the light ones are linked, by default at 0.2
    /// of their own mean spacing.
    #[arg(long, value_name = "LENGTH", conflicts_with = "linking")]
    linking_length: Option<String>,
    /// Groups: radius of the apertures around their centres, in mean spacings.
    #[arg(long, value_name = "F", default_value_t = 0.128, hide_short_help = true)]
    aperture: f64,
    /// Neighbours: number of particles to find the nearest neighbour of.
    #[arg(long, value_name = "N", default_value_t = 500_000, hide_short_help = true)]
    neighbours: usize,
    /// Joint histogram: the two scalar fields [default: the first two that both sides have].
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1, hide_short_help = true)]
    joint: Option<Vec<String>>,
    /// Joint histogram: number of bins along either axis.
    #[arg(long, value_name = "N", default_value_t = 50, hide_short_help = true)]
    joint_bins: usize,
}

/// Options of single measures, and these.
pub const OPTIONS_OF_MEASURES: &[(&str, &[&str])] = &[
    ("grid assignment", &["density"]),
    ("spectrum_grid spectrum_assignment no_interlacing k_max", &["spectrum", "multipoles", "momentum"]),
    ("separations", &["pairs", "spectrum"]),
    ("pairs", &["pairs", "rdf"]),
    ("aperture", &["groups"]),
    ("linking linking_length", &["groups", "haloes", "dispersion"]),
    ("rdf_max", &["rdf"]),
    ("profile_axis profile_bins", &["profile"]),
    ("centres halo_radius", &["haloes", "dispersion"]),
    ("halo_bins", &["haloes"]),
    ("neighbours", &["neighbours"]),
    ("joint joint_bins", &["joint"]),
];

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let mut options = options(&a)?;
    let Some(other) = &a.other else { return run_series(&a, options, &context) };
    let lists = a.measure.centres.iter().chain(&a.snapshot.topology);
    a.declare([&a.truth, other].into_iter().chain(lists), &context)?;
    // The list is read before the particles, which may take long, so that a bad one is refused at once.
    let list = a.measure.centres.as_ref().map(|path| Ok((path, Catalogue::read(path, &context)?))).transpose()?;
    // A frame of a series stands beside the frame that it was made from.
    let mut beside = a.snapshot.clone();
    if let Some(series) = [&a.truth, other].into_iter().find(|p| inputs::is_series(p)) {
        inputs::model_with_snapshot(series, &mut beside, &context)?;
    }
    let open = |path: &Path, other: &Path| {
        let opening = if inputs::is_series(path) { &a.snapshot } else { &beside };
        let opening = inputs::opening_beside(path, Some(other), opening);
        MeasuredInput::open(path, opening.choice()?, options.needs_fields(), &context)
    };
    let truth = open(&a.truth, other)?;
    let place = (truth.side().subject.unit_system(), truth.side().subject.cell());
    let centers = list.map(|(path, list)| list.placed(path, place, &context)).transpose()?;
    let other_input = open(other, &a.truth)?;
    options.centers = centers;
    let [of_truth, of_other] = [&a.truth, other].map(|path| path.display().to_string());
    let mut report = StatsReport::new((truth.side(), &of_truth), (other_input.side(), &of_other), &options, &context)?;
    report.length_unit = a.snapshot.length_unit.clone().or(report.length_unit);
    report.write(&a.out, a.plots(), &context.outputs, &context)?;
    context.finish(&report.text(), &report)
}

impl Arguments {
    fn declare<'a>(&'a self, inputs: impl IntoIterator<Item = &'a PathBuf>, context: &CommandContext) -> Result<()> {
        context.reads(inputs.into_iter().map(PathBuf::as_path), false)?;
        context.outputs.make_folder(&self.out)?;
        output::check_writable(&self.out.join("stats.json"))
    }

    fn plots(&self) -> &[FileKind] {
        if self.no_plots { &[] } else { &self.plots }
    }
}

/// Measures each frame of a series.
fn run_series(a: &Arguments, options: StatsOptions, context: &CommandContext) -> Result<()> {
    if a.snapshot.frame.is_some() || !inputs::is_series(&a.truth) {
        let message = "stats compares two inputs, and only one is given";
        return Err(Error::argument_with(message, "name the other; alone stands a series, without --frame"));
    }
    a.declare([&a.truth], context)?;
    let statistics = Series::open(&a.truth)?.statistics(options, &a.snapshot.particle_type, context)?;
    statistics.write(&a.out, a.plots(), &context.outputs, context)?;
    context.finish(&statistics.text(), &statistics)
}

fn options(a: &Arguments) -> Result<StatsOptions> {
    let separations = match a.measure.separations.as_deref() {
        None => None,
        Some([low, high]) => Some([*low, *high]),
        Some(_) => return Err(Error::argument("--separations takes two lengths LO,HI")),
    };
    let joint = match a.measure.joint.as_deref() {
        None => None,
        Some([x, y]) => Some([x, y].map(|name| name.trim().to_string())),
        Some(_) => return Err(Error::argument("--joint takes two fields X,Y")),
    };
    let measures = if a.only.is_empty() { Measure::ALL.to_vec() } else { a.only.clone() };
    Ok(StatsOptions {
        measures,
        convention: a.convention,
        cells: a.measure.grid,
        assignment: a.measure.assignment,
        spectrum_cells: a.measure.spectrum_grid,
        spectrum_assignment: a.measure.spectrum_assignment,
        open: a.open,
        interlaced: !a.measure.no_interlacing,
        k_max: a.measure.k_max,
        separations,
        pair_budget: a.measure.pairs,
        rdf_max: a.measure.rdf_max,
        // clap has refused all other names.
        profile_axis: "xyz".find(&a.measure.profile_axis).unwrap_or(2),
        profile_bins: a.measure.profile_bins,
        halo_radius: a.measure.halo_radius,
        halo_bins: a.measure.halo_bins,
        linking: a.measure.linking,
        linking_length: a.measure.linking_length.clone(),
        aperture: a.measure.aperture,
        neighbour_sample: a.measure.neighbours,
        joint,
        joint_bins: a.measure.joint_bins,
        seed: a.common.seed,
        ..StatsOptions::default()
    })
}
