//! `particlegs recover M.pgs -o DIR`.

use crate::common::Common;
use crate::info_model;
use clap::{Args, ValueEnum};
use particlegs::codec;
use particlegs::particles::RawForm;
use particlegs::progress::Progress;
use particlegs::recover::{Method, Options, recover};
use particlegs::{Error, Result};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
The particles are SYNTHETIC: drawn from the model, never simulated; meta.json beside them says so,
and which analyses the measurements in the model file support.

Examples:
  particlegs recover M.pgs -o particles                     as many as the model was made of
  particlegs recover M.pgs -o few --particles 1000000 --form npy
  particlegs recover M.pgs -o spaced --method spaced        nearest neighbours mended")]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "M.pgs")]
    model: PathBuf,
    /// Folder to write.
    #[arg(long, short, alias = "out", value_name = "DIR")]
    output: PathBuf,
    /// Number of particles (default: as many as the model was made of).
    #[arg(long, value_name = "N")]
    particles: Option<u64>,
    /// How particles are placed.
    #[arg(long, value_enum, default_value_t = MethodArg::Count)]
    method: MethodArg,
    /// Factor on the Gaussians' widths.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    scale: f64,
    /// Only these layers of the model.
    #[arg(long, value_name = "NAME")]
    layer: Vec<String>,
    /// What to write into the folder beside meta.json.
    #[arg(long, value_enum, default_value_t = FormArg::Raw)]
    form: FormArg,
    #[command(flatten)]
    common: Common,
}

/// Methods on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum MethodArg {
    /// Normal draws, each Gaussian's own number (the published V0).
    Count,
    /// Normal draws in proportion to count (alpha-blend models: opacity) times volume (V1).
    Volume,
    /// Uniform in ellipsoids of three standard deviations (V4).
    Ellipsoid,
    /// Uniform in cells of a grid of 512^3 that hold the Gaussians' centres (V6; alpha-blend models: in
    /// proportion to opacity times volume).
    Grid,
    /// As count, evenly: less shot noise in cells, spacings too regular.
    Stratified,
    /// As count, clumped within Gaussians: nearest neighbours come near the truth.
    Spaced,
}

/// Forms on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum FormArg {
    /// Float32 columns xx.f32, yy.f32, zz.f32 (and ww.f32 with weights).
    Raw,
    /// positions.npy, shape (N, 3), float32.
    Npy,
}

#[derive(Serialize)]
struct Report {
    output: PathBuf,
    synthetic: bool,
    method: &'static str,
    particles: u64,
    bytes: u64,
    seconds: f64,
    particles_per_second: f64,
}

/// Draws.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    if a.output.is_file() {
        let exists = std::io::Error::new(std::io::ErrorKind::NotADirectory, "is a file, not a folder");
        return Err(Error::io(&a.output, exists));
    }
    let start = Instant::now();
    let bytes = info_model::read(&a.model)?;
    let mut model = codec::decode(&bytes, &a.model.display().to_string())?;
    if !a.layer.is_empty() {
        let certificate = model.certificate.take();
        model = model.only(&a.layer)?;
        // What was measured on the whole says little about a part of it.
        if certificate.is_some() {
            context.message("note: the scores in the file are of all layers together");
        }
    }
    let options = Options {
        particles: a.particles,
        method: a.method(),
        scale: a.scale,
        seed: a.common.seed,
        form: match a.form {
            FormArg::Raw => RawForm::Columns,
            FormArg::Npy => RawForm::NpyFolder,
        },
        model_name: a.model.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
    };
    let hash = codec::file_hash(&bytes);
    drop(bytes);
    let done = recover(model, hash, &options, &a.output, &context)?;
    let seconds = start.elapsed().as_secs_f64();
    let report = Report {
        synthetic: true,
        method: options.method.name(),
        particles: done.particles,
        bytes: done.bytes,
        particles_per_second: done.particles as f64 / seconds,
        seconds,
        output: a.output,
    };
    let text = format!(
        "{}: {} synthetic particles, {:.1} MB, in {seconds:.2} s",
        report.output.display(),
        report.particles,
        report.bytes as f64 / 1e6
    );
    context.finish(&text, &report)
}

impl Arguments {
    fn method(&self) -> Method {
        match self.method {
            MethodArg::Count => Method::Count,
            MethodArg::Volume => Method::Volume,
            MethodArg::Ellipsoid => Method::Ellipsoid,
            MethodArg::Grid => Method::Grid,
            MethodArg::Stratified => Method::Stratified,
            MethodArg::Spaced => Method::Spaced,
        }
    }
}
