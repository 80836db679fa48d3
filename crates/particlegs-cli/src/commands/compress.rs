//! `particlegs compress IN... -o M.pgs`.

use crate::common::{CommandContext, Common};
use crate::device::DeviceArgs;
use crate::fit_args::{FitArgs, HEADING, LATER, number_of_blocks, parse_bytes};
use crate::info_model;
use crate::outputs::ForceArgs;
use crate::snapshot_args::ParticleArgs;
use crate::train_args::{self, RunArgs};
use clap::{Args, ValueHint};
use particlegs::{RunOptions, Snapshot, compress_into};
use particlegs_compress::{CompressedModel, SharingPolicy, Target};
use particlegs_core::model::Model;
use particlegs_core::{Result, codec};
use particlegs_particles::Particles;
use particlegs_pictures::certificate;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(
    after_help = "\
Examples:
  particlegs compress snapshot/ -o snapshot.pgs --ratio 65 --pictures pictures/
  particlegs compress huge.hdf5 -o huge.pgs --memory 2GiB",
    after_long_help = "\
Examples:
  particlegs compress snapshot/ -o snapshot.pgs
  particlegs compress snapshot/ -o snapshot.pgs --ratio 65 --effort fast
  particlegs compress x.f32 y.f32 z.f32 -o snapshot.pgs --size 11MB
  particlegs compress snapshot/ -o snapshot.pgs --size-total 11MB --fields velocity
  particlegs compress points.npy -o points.pgs --psnr 32 --box 100,100,100
  particlegs compress snapshot/ -o snapshot.pgs --max-pk-error 1% --k-max 2
  particlegs compress snapshot/ -o snapshot.pgs --min-correlation 0.999 --cell 1
  particlegs compress snapshot/ -o snapshot.pgs --groups-within 10% --from 100
  particlegs compress huge.hdf5 -o huge.pgs --memory 2GiB --scratch /local/tmp
  particlegs compress snapshot/ -o snapshot.pgs --pictures pictures/
  particlegs compress snapshot/ -o snapshot.pgs --train best --log training.jsonl
  particlegs compress snapshot/ -o snapshot.pgs --train best --log training.jsonl --resume
  particlegs compress --train paper --law alpha-blend --print-config > paper.toml

docs/guide/choosing.md helps to choose a ratio and an effort."
)]
pub struct Arguments {
    /// Snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required_unless_present = "print_config", value_name = "IN")]
    input: Vec<PathBuf>,
    /// Model file to write.
    #[arg(long, short, alias = "out", value_name = "M.pgs", value_hint = ValueHint::FilePath, required_unless_present = "print_config")]
    output: Option<PathBuf>,
    /// Whether particle types share Gaussians, each with a share of every Gaussian.
    ///
    /// This describes types better that lie in the same places, such as gas and dark matter.
    #[arg(long, display_order = LATER, value_name = "auto|yes|no", hide_short_help = true, default_value = "auto", hide_default_value = true)]
    share_gaussians: SharingPolicy,
    /// File size to reach with fields, such as 11MB.
    ///
    /// --size speaks of positions and masses alone. Up to six fits are made, until the file with its
    /// fields has 98 % of SIZE, but no more than SIZE.
    #[arg(long, help_heading = HEADING, value_name = "SIZE", group = "TargetArgs", requires = "fields", hide_short_help = true)]
    size_total: Option<String>,
    /// Folder for pictures of snapshot, model, error and surface density.
    #[arg(long, display_order = LATER, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pictures: Option<PathBuf>,
    /// Memory limit, such as 2GiB: larger snapshots are fitted block by block.
    #[arg(long, display_order = LATER, value_name = "SIZE")]
    memory: Option<String>,
    /// Number of blocks, fitted one by one [default: 1, or as many as --memory needs].
    ///
    /// Blocks hold about equal numbers of particles.
    #[arg(long, display_order = LATER, value_name = "K", hide_short_help = true, value_parser = number_of_blocks)]
    blocks: Option<u32>,
    /// Folder for the scratch files of --memory [default: the folder of the model file].
    ///
    /// They are removed when the run ends, even if it fails.
    #[arg(
        long,
        display_order = LATER,
        value_name = "DIR",
        hide_short_help = true,
        value_hint = ValueHint::DirPath,
        requires = "memory"
    )]
    scratch: Option<PathBuf>,
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    particles: ParticleArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    if let Some(text) = a.fit.train.printed()? {
        return crate::report::line(text.trim_end());
    }
    let mut options = a.fit.options(a.common.seed)?;
    options.sharing = a.share_gaussians;
    options.memory = a.memory.as_deref().map(parse_bytes).transpose()?;
    options.blocks = a.blocks;
    if let Some(total) = a.size_total.as_deref().map(parse_bytes).transpose()? {
        options.target = Target::Size(total);
        options.size_with_fields = true;
    }
    let context = a.common.clone().start()?;
    let inputs = a.input.iter().chain(&a.particles.opening.topology).map(PathBuf::as_path);
    context.reads(inputs.chain(a.fit.train.tune.config_file()), a.force.force)?;
    if let Some(folder) = &a.pictures {
        // The model may go into the same folder.
        context.outputs.make_folder(folder)?;
        certificate::declare(folder, &context.outputs, &context)?;
    }
    let start = Instant::now();
    let device = a.device.trainer(options.training.is_some())?;
    let run = RunOptions { scratch: a.scratch.clone(), device, ..a.run.options(a.force.force) };
    // Only training has a checkpoint to write.
    if options.training.is_some() {
        context.finishes_its_steps();
    }
    let snapshot = Snapshot::of_files(&a.input, a.particles.choice(a.common.seed)?);
    let model_output = compress_into(&snapshot, a.output(), (&options, &run), &context.outputs, &context)?;
    a.write_pictures(&model_output.made.model, &model_output.particles, &context)?;
    match model_output.existing {
        true => report_existing(&a, &model_output.made, &context),
        false => report(&a, &context, &model_output.made, start.elapsed().as_secs_f64()),
    }
}

impl Arguments {
    /// The model file; empty if only the configuration is printed.
    fn output(&self) -> &Path {
        self.output.as_deref().unwrap_or(Path::new(""))
    }

    fn write_pictures(&self, model: &Model, particles: &Particles, context: &CommandContext) -> Result<()> {
        let Some(folder) = &self.pictures else { return Ok(()) };
        certificate::write(folder, model, particles, context).map(drop).inspect_err(|_| {
            context.message(&format!("note: wrote the model ({}), but not its pictures", self.output().display()));
        })
    }
}

fn report_existing(a: &Arguments, compressed_model: &CompressedModel, context: &CommandContext) -> Result<()> {
    let (model, bytes, place) = (&compressed_model.model, &compressed_model.bytes, a.output().display().to_string());
    let certificate = model.certificate.as_ref();
    let info = codec::read_info(bytes, &place)?;
    let gaussians = info.gaussians();
    let (words, _) = info_model::describe_new_model(certificate, &model.metadata, &model.layers, a.output(), context);
    let text = format!(
        "{place}: already exists, made from this snapshot with the same options: {} particles -> {gaussians} Gaussians, \
         {} bytes, {}{words}",
        model.metadata.count,
        bytes.len(),
        info.describe_ratio(),
    );
    let value = json!({
        "output": a.output().to_string_lossy(), "there_already": true, "particles": model.metadata.count, "gaussians": gaussians,
        "model_bytes": bytes.len(), "raw_bytes": info.raw_bytes(), "compression_ratio": info.compression_ratio(), "certificate": certificate,
    });
    context.finish(&text, &value)
}

fn report(a: &Arguments, context: &CommandContext, compressed_model: &CompressedModel, seconds: f64) -> Result<()> {
    let info = codec::read_info(&compressed_model.bytes, "the file just coded")?;
    // Species may share Gaussians.
    let (bytes, gaussians) = (compressed_model.bytes.len(), info.gaussians());
    let mut text = format!(
        "{}: {} particles -> {gaussians} Gaussians, {bytes} bytes, {}, {seconds:.1} s",
        a.output().display(),
        compressed_model.model.metadata.count,
        info.describe_ratio(),
    );
    text += &train_args::trained(compressed_model);
    if !a.fit.fields.is_empty() {
        text += &info.describe_fields().iter().map(|line| format!("\n  {line}")).collect::<String>();
    }
    if let Some(goal) = &compressed_model.reached {
        text += &format!("\n{}", info_model::describe_goal(goal, compressed_model.model.metadata.units.length_text()));
    }
    if a.fit.is_fast() {
        text += "\n--effort fast keeps fewer small groups than default from ratio 300 on (docs/results/recovery.md)";
    }
    let Model { certificate, metadata, layers } = &compressed_model.model;
    let (words, verdict) = info_model::describe_new_model(certificate.as_ref(), metadata, layers, a.output(), context);
    text += &words;
    let mut report = train_args::report(a.output(), compressed_model, &verdict, seconds);
    report["particles"] = metadata.count.into();
    report["bytes_per_gaussian"] = (bytes as f64 / gaussians as f64).into();
    report["goal"] = json!(compressed_model.reached);
    context.finish(&text, &report)
}
