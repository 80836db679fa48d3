//! `particlegs finetune M.pgs SNAPSHOT... -o M2.pgs`.

use crate::common::{CommandContext, Common, named};
use crate::device::DeviceArgs;
use crate::fit_args::{TargetArgs, parse_bytes, with_default};
use crate::info_model;
use crate::inputs::FrameChoice;
use crate::outputs::ForceArgs;
use crate::snapshot_args::ParticleArgs;
use crate::train_args::{self, RunArgs, TuneArgs};
use clap::{Args, ValueHint};
use particlegs::{Model, RunOptions, Snapshot};
use particlegs_compress::{CompressedModel, FineTuning};
use particlegs_core::Result;
use particlegs_core::model::{CertificateLevel, LawKind};
use particlegs_train::{Config, Limits};
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(
    mut_arg("ratio", |a| with_default(a, "that of the model")),
    mut_arg("gaussians", |a| a.help("Largest number of Gaussians; the file size follows from it")),
    after_help = "\
Follows the published recipe: 60 000 steps at 1080p on pictures of the whole snapshot, with wider
VizMapper ranges, and densification in the first half; --scale shortens it. The result has one
block, and without a target the size of the model.

Examples:
  particlegs merge job -o merged.pgs && particlegs finetune merged.pgs snapshot/ -o tuned.pgs
  particlegs finetune merged.pgs snapshot/ -o tuned.pgs --scale 0.1 --minutes 30 --log tuning.jsonl
  particlegs finetune --print-config > finetune.toml"
)]
pub struct Arguments {
    /// Model file with the alpha-blend law.
    #[arg(required_unless_present = "print_config", value_name = "M.pgs", value_hint = ValueHint::FilePath)]
    model: Option<PathBuf>,
    /// The whole snapshot that the model was made from.
    #[arg(required_unless_present = "print_config", value_name = "SNAPSHOT")]
    snapshot: Vec<PathBuf>,
    /// Model file to write.
    #[arg(long, short, alias = "out", value_name = "M2.pgs", value_hint = ValueHint::FilePath, required_unless_present = "print_config")]
    output: Option<PathBuf>,
    #[command(flatten)]
    target: TargetArgs,
    /// How much to measure on the decoded model and store in the file.
    #[arg(long, value_name = "LEVEL", default_value = "quick", value_parser = named::<CertificateLevel>())]
    certificate: CertificateLevel,
    /// Memory limit, such as 1GiB: the particles are kept on disk.
    #[arg(long, value_name = "SIZE")]
    memory: Option<String>,
    #[command(flatten)]
    tune: TuneArgs,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    particles: ParticleArgs,
    #[command(flatten)]
    common: Common,
}

const LAW: Option<LawKind> = Some(LawKind::AlphaBlend);

pub fn run(a: Arguments) -> Result<()> {
    if let Some(text) = a.tune.printed(Config::fine_tuning(), LAW)? {
        return crate::report::line(text.trim_end());
    }
    // clap requires both unless the configuration is printed, which has returned by now.
    let none = Path::new("");
    let (path, out) = (a.model.as_deref().unwrap_or(none), a.output.as_deref().unwrap_or(none));
    let start = Instant::now();
    let options = FineTuning {
        target: a.target.target()?,
        training: a.tune.config(Config::fine_tuning(), LAW)?,
        limits: Limits::default(),
        memory: a.memory.as_deref().map(parse_bytes).transpose()?,
        seed: a.common.seed,
        certificate: a.certificate,
    };
    let run = RunOptions { device: a.device.trainer(true)?, ..a.run.options(a.force.force) };
    let context = a.common.clone().start()?;
    let inputs = a.snapshot.iter().map(PathBuf::as_path).chain([path]).chain(a.tune.config_file());
    context.reads(inputs, a.force.force)?;
    context.finishes_its_steps();
    let model = Model::open_frame(path, &FrameChoice::Last, &context)?;
    let snapshot = Snapshot::of_files(&a.snapshot, a.particles.choice(a.common.seed)?);
    let new_model = model.finetune_into(&snapshot, out, (&options, &run), &context.outputs, &context)?;
    let (gaussians, size) = (model.decoded().gaussians(), model.bytes().len() as u64);
    report(out, &context, gaussians, size, &new_model, start.elapsed().as_secs_f64())
}

fn report(
    out: &Path,
    context: &CommandContext,
    gaussians_in: usize,
    bytes_in: u64,
    new_model: &CompressedModel,
    seconds: f64,
) -> Result<()> {
    let (bytes, gaussians) = (new_model.bytes.len(), new_model.model.gaussians());
    let ratio = new_model.model.raw_bytes() as f64 / bytes as f64;
    let mut text = format!(
        "{}: {gaussians_in} -> {gaussians} Gaussians, {bytes_in} -> {bytes} bytes, ratio {ratio:.1}, in {seconds:.2} s",
        out.display()
    );
    text += &train_args::trained(new_model);
    let certificate = new_model.model.certificate.as_ref();
    let (words, verdict) =
        info_model::describe_new_model(certificate, &new_model.model.metadata, &new_model.model.layers, out, context);
    text += &words;
    let mut report = train_args::report(out, new_model, &verdict, seconds);
    report["gaussians_in"] = gaussians_in.into();
    report["model_bytes_in"] = bytes_in.into();
    context.finish(&text, &report)
}
