//! `particlegs recover M.pgs -o DIR`.

use crate::common::{CommandContext, Common, named, one_of};
use crate::inputs::{self, FrameArgs};
use crate::outputs::{ForceArgs, PARTICLES};
use clap::{Args, ValueHint};
use particlegs_core::model::Model;
use particlegs_core::{Error, Result, codec};
use particlegs_files::input::name_of;
use particlegs_fit::recover::{Method, Options, drawn_fields, recover};
use particlegs_formats::Writer;
use particlegs_particles::{RawForm, SelectedParticles, Selection, Tiling};
use serde_json::json;
use std::path::{Path, PathBuf};
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
    let writer = match Writer::for_output(&a.output, None) {
        Ok(writer) => writer,
        // First check that the output is not the input.
        Err(error) => return context.writes(&a.output, &PARTICLES).and(Err(error)),
    };
    if !writer.folder && a.form != RawForm::Columns {
        return Err(Error::argument("--form is for folders: a file's extension selects its format"));
    }
    let fields = drawn_fields(&a.output);
    let own: Vec<&str> = RawForm::FOLDER_FILES.into_iter().chain(fields.iter().map(String::as_str)).collect();
    let kept = writer.folder && context.outputs.writes_folder(&a.output, &own)?;
    let start = Instant::now();
    let bytes = inputs::model_of(&a.model, &a.series, &context)?;
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
    let bytes = match writer.folder {
        true => recover(model, hash, &options, &a.output, &context)?,
        false => write_file(&a.output, writer, &options, model, &context)?,
    };
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

/// Draws into memory, and writes a file of another program's format.
fn write_file(out: &Path, writer: &Writer, options: &Options, model: Model, context: &CommandContext) -> Result<u64> {
    context.writes(out, &PARTICLES)?;
    let (particles, fields) = options.draw_with_fields(model, context)?;
    let all = SelectedParticles::new(&particles, Tiling::single(), Selection::all(), context)?.with_fields(fields);
    if let Some(left_out) = writer.left_out(&all) {
        context.message(&format!("note: {left_out}"));
    }
    context.outputs.write_file(out, |out| writer.write(&all, out, context), context)
}
