//! `particlegs haloes MODEL|SNAPSHOT -o haloes.csv`.

use crate::common::Common;
use crate::inputs::{self, Input};
use crate::outputs::{CSV, ForceArgs, HDF5, PDF, PNG, SVG};
use crate::snapshot_args::SnapshotArgs;
use clap::{Args, ValueHint};
use particlegs_core::context::Context;
use particlegs_core::model::{Cosmology, Model};
use particlegs_core::text::one_line;
use particlegs_core::{Error, Result, codec};
use particlegs_figure::{FileKind, Plot, PlotAxis, Point, Series, plot_bytes};
use particlegs_files::input::name_of;
use particlegs_files::output::{self, write_atomic};
use particlegs_formats::{is_hdf5, write_haloes};
use particlegs_measure::haloes::{
    HaloCatalogue, HaloMatch, HaloOptions, HaloSource, MassFunctionBin, find_haloes, mass_function, stated_cosmology,
};
use particlegs_measure::stats::ParticleFields;
use particlegs_particles::{Domain, Particles, Storage};
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

enum HaloInput {
    Particles(Box<Particles>, Option<Box<ParticleFields>>),
    Model(Box<Model>),
}

impl HaloInput {
    fn open(path: &Path, other: Option<&Path>, a: &Arguments, context: &Context<'_>) -> Result<HaloInput> {
        let opening = inputs::opening_beside(path, other, &a.snapshot);
        Ok(match inputs::model_or_snapshot(path, &opening, context)? {
            Input::Model(bytes) => {
                let model = a.snapshot.layers_of(codec::decode_with(&bytes, &name_of(path), context)?)?;
                HaloInput::Model(model.into())
            }
            Input::Snapshot(mut choice) => {
                let (particles, fields) = choice.read_fields(&[path.to_path_buf()], &Storage::Memory, context)?;
                let velocities = ParticleFields::moving(&particles, &fields)?;
                HaloInput::Particles(particles.into(), velocities.map(Box::new))
            }
        })
    }

    fn source(&self) -> HaloSource<'_> {
        match self {
            HaloInput::Particles(p, v) => HaloSource::Particles(p, v.as_deref()),
            HaloInput::Model(m) => HaloSource::Model(m),
        }
    }

    fn domain(&self) -> Domain {
        match self {
            HaloInput::Particles(p, _) => Domain::from_particles(p),
            HaloInput::Model(m) => Domain::from_model(m),
        }
    }

    fn length_unit(&self) -> Option<&str> {
        match self {
            HaloInput::Particles(p, _) => p.meta.units.length_text(),
            HaloInput::Model(m) => m.metadata.units.length_text(),
        }
    }
}

/// The result as JSON.
#[derive(serde::Serialize)]
struct HaloReport {
    input: String,
    haloes: usize,
    /// With masses: 100 particles and more.
    with_masses: usize,
    largest_mass: Option<f64>,
    mass_unit: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    agreement: Option<HaloMatch>,
    mass_function: Vec<MassFunctionBin>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    mass_function_of_truth: Vec<MassFunctionBin>,
    notes: Vec<String>,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let files = [&a.truth, &a.snapshot.topology].into_iter().flatten().map(PathBuf::as_path);
    context.reads([a.input.as_path()].into_iter().chain(files), a.force.force)?;
    context.writes(&a.output, if is_hdf5(&a.output)? { &HDF5 } else { &CSV })?;
    for path in &a.mass_function {
        output::ending(path, &["csv", "png", "svg", "pdf"])?;
        let kind = match FileKind::from_path(path) {
            Some(FileKind::Png) => &PNG,
            Some(FileKind::Svg) => &SVG,
            Some(FileKind::Pdf) => &PDF,
            None => &CSV,
        };
        context.writes(path, kind)?;
    }
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
    let input = HaloInput::open(&a.input, a.truth.as_deref(), &a, &context)?;
    let found = find_haloes(input.source(), &options, &context)?;
    context.notes(&found.notes);
    if found.column("m200c").is_none() {
        context.message("note: state what the file does not: --particle-mass, --mass-unit, --cosmology, --redshift");
    }
    let truth = a.truth.as_ref().map(|path| {
        let truth = HaloInput::open(path, Some(&a.input), &a, &context)?;
        check_units(&input, &truth, path)?;
        find_haloes(truth.source(), &options, &context)
    });
    let truth = truth.transpose()?;
    let domain = input.domain();
    let ends = ends([Some(&found), truth.as_ref()]);
    let bins = |c: &HaloCatalogue| ends.map_or(Vec::new(), |ends| mass_function(c, &domain, ends));
    let agreement = truth.as_ref().map(|truth| HaloMatch::new([truth, &found], &domain)).transpose()?.flatten();
    let (masses, unit) = found.masses().unwrap_or_default();
    let masses: Vec<f64> = masses.into_iter().filter(|m| m.is_finite()).collect();
    let report = HaloReport {
        input: a.input.display().to_string(),
        haloes: found.len(),
        with_masses: masses.len(),
        largest_mass: masses.iter().copied().reduce(f64::max),
        mass_unit: unit.to_string(),
        agreement,
        mass_function: bins(&found),
        mass_function_of_truth: truth.as_ref().map_or(Vec::new(), bins),
        notes: found.notes.clone(),
    };
    context.check()?;
    if found.is_empty() {
        let what = format!("there are no haloes of {} linked particles and more", a.min_particles);
        return Err(Error::argument(what));
    }
    write_haloes(&found, &a.output)?;
    for path in &a.mass_function {
        write_mass_function(path, &report, input.length_unit())?;
    }
    context.finish(&summary(&report, truth.as_ref()), &report)
}

/// Catalogues of other units are not compared.
fn check_units(input: &HaloInput, truth: &HaloInput, path: &Path) -> Result<()> {
    let units = [input, truth].map(|input| match input {
        HaloInput::Particles(p, _) => &p.meta.units,
        HaloInput::Model(m) => &m.metadata.units,
    });
    let text = |k: usize| units[k].length_text().unwrap_or("none").to_string();
    if text(0) != text(1) {
        let what = format!("its unit of length is {}, that of the input {}", text(1), text(0));
        return Err(Error::input_with(name_of(path), what, "convert one of them first"));
    }
    let [own, other] = [input, truth].map(HaloInput::domain);
    let same = (0..3).all(|k| (own.length[k] / other.length[k] - 1.0).abs() < 0.01);
    if own.periodic != other.periodic || own.periodic.contains(&true) && !same {
        let what = format!("its box is {:?}, that of the input {:?}", other.length, own.length);
        return Err(Error::input_with(name_of(path), what, "compare haloes of the same box"));
    }
    Ok(())
}

/// Masses from those of 100 particles to the heaviest.
fn ends(catalogues: [Option<&HaloCatalogue>; 2]) -> Option<[f64; 2]> {
    let mut ends: Option<[f64; 2]> = None;
    for c in catalogues.into_iter().flatten() {
        for m in c.masses()?.0.into_iter().filter(|m| m.is_finite()) {
            ends = Some(ends.map_or([m; 2], |[low, high]| [low.min(m), high.max(m)]));
        }
    }
    ends
}

fn write_mass_function(path: &Path, report: &HaloReport, length: Option<&str>) -> Result<()> {
    let mass = &report.mass_unit[..];
    let Some(kind) = FileKind::from_path(path) else {
        let truth = |i: usize| report.mass_function_of_truth.get(i);
        return write_atomic(path, |to| {
            let columns = "mass_low,mass_high,haloes,density,error";
            let of_truth = if truth(0).is_some() { ",haloes_truth,density_truth,error_truth" } else { "" };
            writeln!(to, "{columns}{of_truth}")?;
            let length = length.unwrap_or("unit of length");
            let words = format!("masses in {mass}; haloes per volume ({length}^3) and decade of mass");
            writeln!(to, "# {}", one_line(&words))?;
            for (i, b) in report.mass_function.iter().enumerate() {
                write!(to, "{:.6e},{:.6e},{},{:.6e},{:.6e}", b.masses[0], b.masses[1], b.haloes, b.density, b.error)?;
                if let Some(b) = truth(i) {
                    write!(to, ",{},{:.6e},{:.6e}", b.haloes, b.density, b.error)?;
                }
                writeln!(to)?;
            }
            Ok(())
        });
    };
    let series = |name: &str, style: usize, bins: &[MassFunctionBin]| {
        let point = |b: &MassFunctionBin| Point {
            x: (b.masses[0] * b.masses[1]).sqrt(),
            y: b.density,
            range: Some([(b.density - b.error).max(0.1 * b.density), b.density + b.error]),
        };
        let points = bins.iter().filter(|b| b.haloes > 0).map(point).collect();
        Series { name: name.into(), style, dashed: false, points }
    };
    let volume = length.map_or("volume".into(), |l| format!("({l})³"));
    let mass_label = if mass == "particles" { "particles within R200m".into() } else { format!("M200m [{mass}]") };
    let truth = &report.mass_function_of_truth;
    let mut plots = vec![Plot {
        name: "mass_function".into(),
        title: "Mass function of haloes".into(),
        x: PlotAxis::logarithmic(&mass_label),
        y: PlotAxis::logarithmic(format!("haloes per decade and {volume}")),
        series: Vec::new(),
        levels: Vec::new(),
    }];
    if !truth.is_empty() {
        plots[0].series.push(series("truth", 8, truth));
    }
    plots[0].series.push(series(if truth.is_empty() { "haloes" } else { "input" }, 1, &report.mass_function));
    let both = report.mass_function.iter().zip(truth).filter(|(b, t)| b.haloes > 0 && t.haloes > 0);
    let ratio = |(b, t): (&MassFunctionBin, &MassFunctionBin)| {
        Point::new((b.masses[0] * b.masses[1]).sqrt(), b.density / t.density)
    };
    let points: Vec<Point> = both.map(ratio).collect();
    if !points.is_empty() {
        let series = Series { name: String::new(), style: 1, dashed: false, points };
        plots.push(Plot {
            name: "ratio".into(),
            title: String::new(),
            x: PlotAxis::logarithmic(&mass_label),
            y: PlotAxis::ratios("input / truth", [0.5, 1.5]),
            series: vec![series],
            levels: Vec::new(),
        });
    }
    let bytes = plot_bytes(&plots, kind)?;
    let bytes =
        bytes.ok_or_else(|| Error::argument("there is no halo with a mass to plot: 100 particles are needed"))?;
    write_atomic(path, |to| to.write_all(&bytes))
}

fn summary(report: &HaloReport, truth: Option<&HaloCatalogue>) -> String {
    let unit = one_line(&report.mass_unit);
    let mut text = format!("{} haloes, {} of them with masses", report.haloes, report.with_masses);
    if let Some(mass) = report.largest_mass {
        text += &format!("; the heaviest has {mass:.4e} {unit}");
    }
    if let (Some(m), Some(truth)) = (&report.agreement, truth) {
        let percent = |v: Option<f64>| v.map_or("-".into(), |v| format!("{:.1} %", 100.0 * v));
        text += &format!(
            "\ntruth: {} haloes; with 300 particles and more: {} in the truth, {} in the input",
            truth.len(),
            m.truth,
            m.other
        );
        text += &format!("\ncompleteness {}, purity {}", percent(m.completeness), percent(m.purity));
        text += &format!(
            "\nM200m over the truth's: median {}, scatter {}",
            m.mass_median.map_or("-".into(), |v| format!("{v:.4}")),
            percent(m.mass_scatter)
        );
    }
    text
}
