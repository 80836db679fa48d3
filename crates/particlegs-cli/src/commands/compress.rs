//! `particlegs compress IN... -o M.pgs`.

use crate::common::{CommandContext, Common};
use crate::device::DeviceArgs;
use crate::fit_args::{FitArgs, LATER, number_of_blocks};
use crate::info_model;
use crate::outputs::ForceArgs;
use crate::run_args::{self, RunArgs};
use crate::snapshot_args::ParticleArgs;
use crate::target_args::{HEADING, parse_bytes};
use clap::{Args, ValueHint};
use particlegs_compress::{CompressedModel, Compression, Options, SharingPolicy, Target};
use particlegs_core::checkpoint::CheckpointStore;
use particlegs_core::context::Context;
use particlegs_core::model::Model;
use particlegs_core::{Result, codec};
use particlegs_files::output;
use particlegs_particles::{Particles, Storage};
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
    /// Should particle types share Gaussians, each with a share of every Gaussian?
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
    let mut options = a.fit.options(&a.particles, a.common.seed)?;
    options.sharing = a.share_gaussians;
    options.memory = a.memory.as_deref().map(parse_bytes).transpose()?;
    options.blocks = a.blocks;
    if let Some(total) = a.size_total.as_deref().map(parse_bytes).transpose()? {
        options.target = Target::Size(total);
        options.size_with_fields = true;
    }
    options.check()?;
    let context = a.common.clone().start()?;
    let start = Instant::now();
    options.limits = a.run.limits(start, a.scratch_folder())?;
    options.limits.device = a.device.trainer(options.training.is_some())?;
    let kept = a.plan(&options, &context)?;
    if options.memory.is_some() {
        options.storage = Storage::Disk(a.scratch_folder());
    }
    let mut choice = a.particles.choice(a.common.seed)?;
    let (particles, sources) = match options.fields.is_empty() {
        true => (choice.read(&a.input, &options.storage, &context)?, Vec::new()),
        false => choice.read_fields(&a.input, &options.storage, &context)?,
    };
    let blocks = options.blocks_of(&particles)?;
    if options.memory.is_some() && blocks > 1 {
        options.storage.announce(&format!("{blocks} blocks"), particles.raw_bytes(), &context);
    }
    if kept {
        return there_already(&a, &options, &particles, &context);
    }
    let planned = Compression::plan(&particles, &sources, &options, &context)?;
    context.notes(planned.notes());
    let checkpoint = match options.training {
        Some(_) => a.run.checkpoint(a.output(), &planned.id())?,
        None => None,
    };
    let work = |checkpoints: &mut dyn CheckpointStore, context: &Context<'_>| planned.run(checkpoints, context);
    let done = a.run.run(a.output(), &context, checkpoint, work)?;
    let seconds = start.elapsed().as_secs_f64();
    a.write_pictures(&done.model, &particles, &context)?;
    report(&a, &context, &done, seconds)
}

impl Arguments {
    /// The model file; empty if only the configuration is printed.
    fn output(&self) -> &Path {
        self.output.as_deref().unwrap_or(Path::new(""))
    }

    fn scratch_folder(&self) -> PathBuf {
        self.scratch.clone().unwrap_or_else(|| output::scratch_folder(self.output()))
    }

    /// Declares inputs and outputs. Returns whether there is a model already that this command may have made.
    fn plan(&self, options: &Options, context: &CommandContext) -> Result<bool> {
        let inputs = self.input.iter().chain(&self.particles.opening.topology).map(PathBuf::as_path);
        let inputs = inputs.chain(self.fit.train.tune.config_file());
        context.reads(inputs, self.force.force)?;
        if let Some(folder) = &self.pictures {
            // The model may go into the same folder.
            certificate::declare(folder, &context.outputs, context)?;
        }
        let there = context.outputs.writes_model(self.output(), context)?;
        if options.training.is_some() {
            self.run.plan(self.output(), self.force.force, context)?;
        }
        if let Some(folder) = &self.scratch {
            output::check_writable(&folder.join("scratch"))?;
        }
        let kept = there && !self.run.goes_on();
        if kept {
            let bytes = crate::inputs::model(self.output(), context)?;
            let told = codec::read_metadata(&bytes, &self.output().display().to_string())?;
            if !options.ask_for(&told) {
                return Err(context.refused(self.output()));
            }
        }
        Ok(kept)
    }

    fn write_pictures(&self, model: &Model, particles: &Particles, context: &CommandContext) -> Result<()> {
        let Some(folder) = &self.pictures else { return Ok(()) };
        certificate::write(folder, model, particles, context).map(drop).inspect_err(|_| {
            context.message(&format!("note: wrote the model ({}), but not its pictures", self.output().display()));
        })
    }
}

/// For an existing model: accepts it if this command makes the same one, else refuses to replace it. Draws its pictures
/// in any case.
fn there_already(a: &Arguments, options: &Options, particles: &Particles, context: &CommandContext) -> Result<()> {
    let (bytes, place) = (crate::inputs::model(a.output(), context)?, a.output().display().to_string());
    let model = codec::decode_with(&bytes, &place, context)?;
    let certificate = model.certificate.as_ref();
    if !options.made(&model.metadata, certificate.is_some(), particles)? {
        return Err(context.refused(a.output()));
    }
    let info = codec::read_info(&bytes, &place)?;
    let gaussians = info.gaussians();
    let (told, _) = info_model::describe_new_model(certificate, &model.metadata, &model.layers, a.output(), context);
    let text = format!(
        "{place}: already exists, made from this snapshot with the same options: {} particles -> {gaussians} Gaussians, \
         {} bytes, {}{told}",
        model.metadata.count,
        bytes.len(),
        info.describe_ratio(),
    );
    let value = json!({
        "output": a.output().to_string_lossy(), "there_already": true, "particles": model.metadata.count, "gaussians": gaussians,
        "model_bytes": bytes.len(), "raw_bytes": info.raw_bytes(), "compression_ratio": info.compression_ratio(), "certificate": certificate,
    });
    a.write_pictures(&model, particles, context)?;
    context.finish(&text, &value)
}

fn report(a: &Arguments, context: &CommandContext, done: &CompressedModel, seconds: f64) -> Result<()> {
    let info = codec::read_info(&done.bytes, "the file just coded")?;
    // Species may share Gaussians.
    let (bytes, gaussians) = (done.bytes.len(), info.gaussians());
    let mut text = format!(
        "{}: {} particles -> {gaussians} Gaussians, {bytes} bytes, {}, {seconds:.1} s",
        a.output().display(),
        done.model.metadata.count,
        info.describe_ratio(),
    );
    text += &run_args::trained(done);
    if !a.fit.fields.is_empty() {
        text += &info.describe_fields().iter().map(|line| format!("\n  {line}")).collect::<String>();
    }
    if let Some(goal) = &done.reached {
        text += &format!("\n{}", info_model::describe_goal(goal, done.model.metadata.units.length_text()));
    }
    if a.fit.is_fast() {
        text += "\n--effort fast keeps fewer small groups than default from ratio 300 on (docs/results/recovery.md)";
    }
    let Model { certificate, metadata, layers } = &done.model;
    let (told, verdict) = info_model::describe_new_model(certificate.as_ref(), metadata, layers, a.output(), context);
    text += &told;
    let mut report = run_args::report(a.output(), done, &verdict, seconds);
    report["particles"] = metadata.count.into();
    report["bytes_per_gaussian"] = (bytes as f64 / gaussians as f64).into();
    report["goal"] = json!(done.reached);
    context.finish(&text, &report)
}
