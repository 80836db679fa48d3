//! `particlegs compress IN... -o M.pgs`.

use crate::common::{Common, Context};
use crate::fit_args::FitArgs;
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use clap::Args;
use particlegs::compress::{Checkpoint, Compressed, Load, Options, compress, parse_bytes};
use particlegs::fit::{NoPieces, Pieces};
use particlegs::particles::{Particles, Room};
use particlegs::progress::Progress;
use particlegs::train::Limits;
use particlegs::{Error, Result, output};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
Examples:
  particlegs compress snapshot/ -o snapshot.pgs                     ratio 300, default effort
  particlegs compress snapshot/ -o snapshot.pgs --ratio 65 --effort high
  particlegs compress x.f32 y.f32 z.f32 -o snapshot.pgs --size 11MB
  particlegs compress points.npy -o points.pgs --psnr 32 --box 100,100,100
  particlegs compress huge.hdf5 -o huge.pgs --memory 2GiB --scratch /local/tmp
  particlegs compress snapshot/ -o snapshot.pgs --pictures pictures/")]
pub struct Arguments {
    /// A snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// The model file to write.
    #[arg(long, short, value_name = "M.pgs")]
    output: PathBuf,
    #[command(flatten)]
    fit: FitArgs,
    /// Divide the particles into K blocks of balanced counts, each fitted on its own (default: 1, or
    /// as many as --memory asks for).
    #[arg(long, value_name = "K")]
    blocks: Option<u32>,
    /// Memory to stay within, e.g. 1GiB: particles wait on disk, block by block.
    #[arg(long, value_name = "M")]
    memory: Option<String>,
    /// Folder of the scratch files that --memory needs (default: the output's); they have no names
    /// and vanish by themselves.
    #[arg(long, value_name = "DIR", requires = "memory")]
    scratch: Option<PathBuf>,
    /// Stop training after so many minutes; its rates fall so that they are at their end by then.
    #[arg(long, value_name = "M", help_heading = "Training")]
    minutes: Option<f64>,
    /// Go on from M.pgs.checkpoint, which an interrupted run of the same command left.
    #[arg(long, help_heading = "Training")]
    resume: bool,
    /// Log of the training, JSON lines, and its curves beside it as SVG (default: none).
    #[arg(long, value_name = "FILE.jsonl", help_heading = "Training")]
    log: Option<PathBuf>,
    /// Write side-by-side pictures (truth | model | error) and the surface density to a folder.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    window: WindowArgs,
    #[command(flatten)]
    common: Common,
}

/// Compresses, writes the file and the pictures, reports.
pub fn run(a: Arguments) -> Result<()> {
    let selection = (&a.selection, &a.window);
    if let Some(text) = a.fit.train.printed()? {
        return crate::report::line(text.trim_end());
    }
    let mut options = a.fit.options(&a.snapshot, selection, a.common.seed)?;
    let memory = a.memory.as_deref().map(parse_bytes).transpose()?;
    let context = a.common.clone().start()?;
    let start = Instant::now();
    if let Some(folder) = &a.pictures {
        // The model may go there as well.
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    output::check_writable(&a.output)?;
    options.memory = memory;
    if memory.is_some() {
        options.room = Room::Disk(a.scratch_folder());
    }
    let particles = a.snapshot.open_selected_in(&options.room, &a.input, selection, a.common.seed, &context)?;
    options.blocks = blocks(&a, &options, memory, &particles, &context)?;
    if particles.meta.cell.is_none() {
        context.message("note: no periodic box is known (--box Lx,Ly,Lz): nothing wraps around");
    }
    options.limits = a.limits()?;
    let mut checkpoint = a.checkpoint(&options, &particles)?;
    let work = |pieces: &mut dyn Pieces| match &a.log {
        Some(log) => {
            crate::train_log::logged(log, &context, |progress| compress(&particles, &options, pieces, progress))
        }
        None => compress(&particles, &options, pieces, &context),
    };
    let done = match &mut checkpoint {
        None => work(&mut NoPieces)?,
        Some(checkpoint) => {
            let done = work(checkpoint);
            if done.as_ref().map_or(true, |d| d.stopped) {
                checkpoint.save()?;
            }
            done?
        }
    };
    if !done.stopped {
        context.check()?;
    }
    output::write_bytes(&a.output, &done.bytes)?;
    if done.stopped {
        context.message(&format!(
            "stopped: {} holds the best so far; the same command with --resume goes on",
            a.output.display()
        ));
        return Err(Error::Cancelled);
    }
    if let Some(checkpoint) = checkpoint {
        checkpoint.remove()?;
    }
    let seconds = start.elapsed().as_secs_f64();
    report(&a, &context, &done, seconds)?;
    if let Some(folder) = &a.pictures {
        for path in crate::pictures::write(folder, &done.model, &particles, &context)? {
            context.message(&format!("wrote {}", path.display()));
        }
    }
    Ok(())
}

impl Arguments {
    /// How far training goes.
    fn limits(&self) -> Result<Limits> {
        if self.minutes.is_some_and(|m| !(m > 0.0 && m.is_finite())) {
            return Err(Error::argument("--minutes must be positive"));
        }
        Ok(Limits { seconds: self.minutes.map(|m| 60.0 * m), scratch: Some(self.scratch_folder()) })
    }

    /// Where a training run keeps what it can go on from; `None` where nothing is trained.
    fn checkpoint(&self, options: &Options, particles: &Particles) -> Result<Option<Checkpoint>> {
        if options.training.is_none() {
            let stray =
                [("--resume", self.resume), ("--minutes", self.minutes.is_some()), ("--log", self.log.is_some())];
            return match stray.iter().find(|s| s.1) {
                Some((option, _)) => Err(Error::argument(format!("{option} needs --train fast|best|paper"))),
                None => Ok(None),
            };
        }
        let mut path = self.output.clone().into_os_string();
        path.push(".checkpoint");
        let whose = options.name_of_work(particles);
        let checkpoint =
            if self.resume { Checkpoint::open(path.into(), &whose)? } else { Checkpoint::fresh(path.into(), &whose) };
        if self.resume && checkpoint.is_empty() {
            return Err(Error::argument(
                "there is no checkpoint of this command beside the output: leave --resume out",
            ));
        }
        Ok(Some(checkpoint))
    }

    /// Where scratch files go.
    fn scratch_folder(&self) -> PathBuf {
        let beside = self.output.parent().filter(|p| !p.as_os_str().is_empty());
        self.scratch.clone().unwrap_or_else(|| beside.unwrap_or(Path::new(".")).to_path_buf())
    }
}

/// The number of blocks: as asked for, or as the memory asks for; says what scratch space that takes.
fn blocks(
    a: &Arguments,
    options: &Options,
    memory: Option<u64>,
    particles: &Particles,
    context: &Context,
) -> Result<u32> {
    let Some(bound) = memory else { return Ok(a.blocks.unwrap_or(1)) };
    let raw_bytes = particles.raw_bytes();
    let (target, effort) = (options.target, options.effort);
    let load = Load { count: particles.len() as u64, raw_bytes, target, effort, copies: 1 };
    let blocks = match a.blocks {
        None => load.blocks_within(bound)?,
        Some(blocks) if load.block_bytes(u64::from(blocks)) <= bound => blocks,
        Some(blocks) => {
            let (what, need_bytes) = (format!("a fit in {blocks} blocks"), load.block_bytes(u64::from(blocks)));
            return Err(Error::Memory { what, need_bytes, have_bytes: bound });
        }
    };
    if blocks > 1 {
        options.room.announce(&format!("{blocks} blocks"), raw_bytes, context);
    }
    Ok(blocks)
}

fn report(a: &Arguments, context: &Context, done: &Compressed, seconds: f64) -> Result<()> {
    let (bytes, gaussians) = (done.bytes.len(), done.model.gaussians());
    let ratio = done.raw_bytes as f64 / bytes as f64;
    let mut text = format!(
        "{}: {} particles -> {gaussians} Gaussians, {bytes} bytes, ratio {ratio:.1}, {:.2} bytes a Gaussian",
        a.output.display(),
        done.model.metadata.count,
        bytes as f64 / gaussians as f64,
    );
    let phases: Vec<String> = done.seconds.iter().map(|(p, s)| format!("{p} {s:.2} s")).collect();
    text += &format!("\n{:.2} s: {}", seconds, phases.join(", "));
    for [before, after] in &done.trained {
        if let (Some(before), Some(after)) = (before, after) {
            text += &format!("\ntrained: {before:.2} to {after:.2} dB masked PSNR on held-out views, before coding");
        }
    }
    if a.fit.is_fast() {
        text += "\nfor pictures: the partition alone loses most small groups; use --effort default for statistics";
    }
    if done.model.certificate.is_some() {
        text += &format!(
            "\n{}",
            crate::info_model::certificate(done.model.certificate.as_ref(), done.model.metadata.length_unit.as_deref())
                .trim_end()
        );
    }
    let value = json!({
        "output": a.output, "particles": done.model.metadata.count, "gaussians": gaussians,
        "model_bytes": bytes, "raw_bytes": done.raw_bytes, "compression_ratio": ratio,
        "bytes_a_gaussian": bytes as f64 / gaussians as f64, "step_factor": done.step_factor, "trained": done.trained,
        "seconds": seconds, "seconds_by_phase": done.seconds.iter().copied().collect::<std::collections::BTreeMap<_, _>>(),
        "certificate": done.model.certificate,
    });
    context.finish(&text, &value)
}
