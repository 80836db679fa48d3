//! `particlegs recover M.pgs -o DIR`.

use crate::common::{Common, named, one_of};
use crate::inputs;
use crate::outputs::ForceArgs;
use clap::{Args, ValueHint};
use particlegs_files::input::name_of;
use particlegs_pipeline::Result;
use particlegs_pipeline::codec;
use particlegs_pipeline::particles::RawForm;
use particlegs_pipeline::recover::{Method, Options, recover};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
#[command(after_help = "\
The particles are SYNTHETIC: drawn from the model, not simulated. meta.json beside them says so, and
lists the analyses that the measurements in the model file support.

Examples:
  particlegs recover M.pgs -o particles
  particlegs recover M.pgs -o few --particles 1000000 --form npy
  particlegs recover M.pgs -o spaced --method spaced")]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "M.pgs", value_hint = ValueHint::FilePath)]
    model: PathBuf,
    /// Folder for the particles and meta.json.
    #[arg(long, short, alias = "out", value_name = "DIR", value_hint = ValueHint::DirPath)]
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
    /// Format of the particles.
    #[arg(long, value_name = "FORM", default_value = "raw", value_parser = one_of(FORMS))]
    form: RawForm,
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
    let kept = context.outputs().writes_folder(&a.output, &RawForm::FOLDER_FILES)?;
    let start = Instant::now();
    let bytes = inputs::model(&a.model, &context)?;
    let mut model = codec::decode_with(&bytes, &name_of(&a.model), &context)?;
    if !a.layer.is_empty() {
        let certificate = model.certificate.take();
        model = model.only(&a.layer)?;
        // Scores of the whole model say little about some layers.
        if certificate.is_some() {
            context.message("note: the scores in the model file are for all layers together, not for these");
        }
    }
    let options = Options {
        particles: a.particles,
        method: a.method,
        scale: a.scale,
        seed: a.common.seed,
        form: a.form,
        model_name: a.model.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
    };
    let hash = codec::file_hash(&bytes);
    drop(bytes);
    if kept {
        if !options.is_there(&a.output, &model, hash)? {
            return Err(context.refused(&a.output));
        }
        let text = format!("{}: already exists, drawn from this model with the same options", a.output.display());
        return context.finish(&text, &json!({ "output": a.output.to_string_lossy(), "there_already": true }));
    }
    let particles = options.total(&model);
    let bytes = recover(model, hash, &options, &a.output, &context)?;
    let seconds = start.elapsed().as_secs_f64();
    let text = format!(
        "{}: {particles} synthetic particles, {:.1} MB, in {seconds:.2} s",
        a.output.display(),
        bytes as f64 / 1e6
    );
    let report = json!({
        "output": a.output.to_string_lossy(), "synthetic": true, "method": options.method.name(), "particles": particles,
        "bytes": bytes, "seconds": seconds, "particles_per_second": particles as f64 / seconds,
    });
    context.finish(&text, &report)
}
