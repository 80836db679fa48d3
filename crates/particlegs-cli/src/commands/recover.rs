//! `particlegs recover M.pgs -o DIR`.

use crate::common::{Common, named, one_of};
use crate::inputs::FrameArgs;
use crate::outputs::ForceArgs;
use clap::{Args, ValueHint};
use particlegs::{Model, RecoverMethod as Method, RecoverOptions, plan_recovery};
use particlegs_core::Result;
use particlegs_particles::RawForm;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
#[command(after_help = "\
The particles are SYNTHETIC: drawn from the model, not simulated. meta.json in the folder says so, and
lists the analyses that the measurements in the model file support. Fields of the model, such as
velocity, are drawn with the positions.

Examples:
  particlegs recover M.pgs -o particles
  particlegs recover M.pgs -o snap.hdf5              # also .vtp, .dump, .lammpstrj
  particlegs recover M.pgs -o few --particles 1000000 --form npy
  particlegs recover M.pgs -o spaced --method spaced")]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "M.pgs", value_hint = ValueHint::FilePath)]
    model: PathBuf,
    /// Folder for the particles and meta.json, or a file whose extension selects the format.
    ///
    /// Extensions: .hdf5, .h5, .vtp, .dump, .lammpstrj, .npy. A file is drawn in memory; a folder may be larger.
    #[arg(long, short, alias = "out", value_name = "OUT", value_hint = ValueHint::AnyPath)]
    output: PathBuf,
    /// Number of particles [default: as many as the model was made from].
    #[arg(long, value_name = "N")]
    particles: Option<u64>,
    /// How particles are drawn.
    #[arg(long, value_name = "METHOD", default_value = "count", value_parser = named::<Method>())]
    method: Method,
    /// Scale the widths of the Gaussians by this factor.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    scale: f64,
    /// Layers to draw from: species such as gas or dm, or names that `info` lists [default: all].
    #[arg(long, alias = "layers", value_name = "NAME,...", value_delimiter = ',')]
    layer: Vec<String>,
    /// Format of the particles in a folder.
    #[arg(long, value_name = "FORM", default_value = "raw", value_parser = one_of(FORMS))]
    form: RawForm,
    #[command(flatten)]
    series: FrameArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    common: Common,
}

const FORMS: [(RawForm, &str, &str); 2] = [
    (RawForm::Columns, "raw", "Float32 columns xx.f32, yy.f32, zz.f32 (and ww.f32 with weights)"),
    (RawForm::NpyFolder, "npy", "positions.npy, shape (N, 3), float32"),
];

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    context.reads([a.model.as_path()], a.force.force)?;
    let options = RecoverOptions {
        particles: a.particles,
        method: a.method,
        scale: a.scale,
        seed: a.common.seed,
        form: a.form,
        model_name: a.model.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
    };
    plan_recovery(&a.output, &options, &context.outputs, &context)?;
    let start = Instant::now();
    let model = Model::open_frame(&a.model, &a.series.choice(), &context)?;
    let file = model.recover_into(&a.output, (&options, &a.layer), &context.outputs, &context)?;
    let output = a.output.display();
    if file.bytes == 0 {
        let text = format!("{output}: already exists, drawn from this model with the same options");
        return context.finish(&text, &json!({ "output": a.output.to_string_lossy(), "there_already": true }));
    }
    let (particles, bytes, seconds) = (file.particles, file.bytes, start.elapsed().as_secs_f64());
    let text = format!("{output}: {particles} synthetic particles, {:.1} MB, in {seconds:.2} s", bytes as f64 / 1e6);
    let report = json!({
        "output": a.output.to_string_lossy(), "synthetic": true, "method": options.method.name(), "particles": particles,
        "bytes": bytes, "seconds": seconds, "particles_per_second": particles as f64 / seconds,
    });
    context.finish(&text, &report)
}
