//! `particlegs haloes MODEL|SNAPSHOT -o haloes.csv`.

use crate::common::Common;
use crate::inputs;
use crate::outputs::ForceArgs;
use crate::snapshot_args::SnapshotArgs;
use clap::{Args, ValueHint};
use particlegs::haloes::HaloFiles;
use particlegs::input::MeasuredInput;
use particlegs_core::Result;
use particlegs_core::model::Cosmology;
use particlegs_files::input::name_of;
use particlegs_measure::haloes::{HaloOptions, HaloReport, stated_cosmology};
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(
    after_help = "\
Examples:
  particlegs haloes snapshot.hdf5 -o haloes.csv
  particlegs haloes model.pgs -o haloes.hdf5
  particlegs haloes model.pgs -o haloes.csv --truth snapshot.hdf5 --mass-function masses.png",
    after_long_help = "\
Dark matter is linked by friends of friends, and other particle types are attached to it. Around the
density peak of each group, masses and radii are those of spheres with 200 times the mean density of
matter (200m), 200 and 500 times the critical density (200c, 500c), and the virial density of Bryan
and Norman 1998 (vir). There is no unbinding, and there are no subhaloes. The file says what its
columns are, and in which units. docs/guide/haloes.md defines them.

From a model, the haloes are those of particles drawn from it, and their masses are integrated over
its Gaussians. Masses, radii and what is measured inside them have standard errors.

Examples:
  particlegs haloes snapshot.hdf5 -o haloes.csv
  particlegs haloes model.pgs -o haloes.hdf5
  particlegs haloes model.pgs -o haloes.csv --truth snapshot.hdf5 --mass-function masses.png
  particlegs haloes raw-folder -o haloes.csv --particle-mass 1.088e10 --mass-unit Msun/h --cosmology h=0.6736,Om=0.3152
  particlegs stats snapshot.hdf5 model.pgs -o stats --only haloes --centres haloes.csv"
)]
pub struct Arguments {
    /// A snapshot's file or folder, or a model file.
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    /// Catalogue to write: NAME.csv, or NAME.hdf5.
    #[arg(long, short, alias = "out", value_name = "FILE", value_hint = ValueHint::FilePath)]
    output: PathBuf,
    /// Also find haloes in this snapshot or model, and say how well those of the input agree with them.
    #[arg(long, value_name = "SNAPSHOT", value_hint = ValueHint::AnyPath)]
    truth: Option<PathBuf>,
    /// Write the mass function: a table NAME.csv, or a plot NAME.png, .svg or .pdf; with --truth, both.
    #[arg(long, value_name = "FILE,...", value_delimiter = ',', value_hint = ValueHint::FilePath)]
    mass_function: Vec<PathBuf>,
    /// Linking length in mean spacings of the linked particles.
    #[arg(long, value_name = "B", default_value_t = 0.2)]
    linking: f64,
    /// Particle types to link [default: dark matter if there is any, else all].
    #[arg(long, value_name = "TYPE,...", value_delimiter = ',', hide_short_help = true)]
    link: Vec<String>,
    /// Linked particles of the smallest halo.
    #[arg(long, value_name = "N", default_value_t = 20, hide_short_help = true)]
    min_particles: usize,
    /// Softening length, in the input's unit; vmax and concentration begin at three of these [default: a 25th of the mean
    /// spacing].
    #[arg(long, value_name = "LENGTH", hide_short_help = true)]
    softening: Option<f64>,
    /// Fraction of the simulation's particles that the snapshot contains, such as 0.1; masses are divided by it.
    #[arg(long, value_name = "F", default_value_t = 1.0, hide_short_help = true)]
    sample_fraction: f64,
    /// Mass of a particle, in the unit of mass, if the file states none.
    #[arg(long, value_name = "MASS")]
    particle_mass: Option<f64>,
    /// Cosmology, if the file states none, or to override it: h=0.68,Om=0.31,OL=0.69 (flat if OL is not given).
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = stated_cosmology)]
    cosmology: Option<Cosmology>,
    /// Redshift, if the file states none, or to override it.
    #[arg(long, value_name = "Z", allow_hyphen_values = true)]
    redshift: Option<f64>,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let input_paths = [&a.input].into_iter().chain(&a.truth).chain(&a.snapshot.topology);
    context.reads(input_paths.map(PathBuf::as_path), a.force.force)?;
    let files = HaloFiles { catalogue: &a.output, mass_functions: &a.mass_function };
    files.declare(&context.outputs, &context)?;
    let options = HaloOptions {
        linking: a.linking,
        smallest: a.min_particles,
        linked: a.link.clone(),
        softening: a.softening,
        sample_fraction: a.sample_fraction,
        particle_mass: a.particle_mass,
        mass_unit: a.snapshot.mass_unit.clone(),
        cosmology: a.cosmology.unwrap_or_default(),
        redshift: a.redshift,
        seed: a.common.seed,
    };
    let open = |path: &Path, other: Option<&Path>| {
        MeasuredInput::open(path, inputs::opening_beside(path, other, &a.snapshot).choice()?, true, &context)
    };
    let input = open(&a.input, a.truth.as_deref())?;
    let truth = a.truth.as_ref().map(|path| Ok((open(path, Some(&a.input))?, name_of(path)))).transpose()?;
    let name = a.input.display().to_string();
    let side = truth.as_ref().map(|(truth, name)| (truth.side(), &name[..]));
    let report = HaloReport::new((input.side(), &name), side, &options, &context)?;
    if report.catalogue.column("m200c").is_none() {
        context.message("note: state what the file does not: --particle-mass, --mass-unit, --cosmology, --redshift");
    }
    files.write(&report)?;
    context.finish(&report.text(), &report)
}
