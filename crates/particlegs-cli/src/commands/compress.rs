//! `particlegs compress IN... -o M.pgs`.

use crate::common::{Common, Context};
use crate::fit_args::FitArgs;
use crate::info_model;
use crate::run_args::{self, RunArgs};
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use clap::Args;
use particlegs::compress::{Compressed, Load, Options, compress, parse_bytes};
use particlegs::fit::Pieces;
use particlegs::particles::{Particles, Room};
use particlegs::progress::Progress;
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
  particlegs compress snapshot/ -o snapshot.pgs --pictures pictures/
  particlegs compress snapshot/ -o snapshot.pgs --train best --log training.jsonl
  particlegs compress snapshot/ -o snapshot.pgs --train best --log training.jsonl --resume
  particlegs compress --train paper --law alpha-blend --print-config > paper.toml")]
pub struct Arguments {
    /// A snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required_unless_present = "print_config", value_name = "IN")]
    input: Vec<PathBuf>,
    /// The model file to write.
    #[arg(long, short, alias = "out", value_name = "M.pgs", required_unless_present = "print_config")]
    output: Option<PathBuf>,
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
    #[command(flatten)]
    run: RunArgs,
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
    options.limits = a.run.limits(start, a.scratch_folder())?;
    if let Some(folder) = &a.pictures {
        // The model may go there as well.
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    output::check_writable(a.output())?;
    options.memory = memory;
    if memory.is_some() {
        options.room = Room::Disk(a.scratch_folder());
    }
    let particles = a.snapshot.open_selected_in(&options.room, &a.input, selection, a.common.seed, &context)?;
    options.blocks = blocks(&a, &options, memory, &particles, &context)?;
    if particles.meta.cell.is_none() {
        context.message("note: no periodic box is known (--box Lx,Ly,Lz): nothing wraps around");
    }
    let mut checkpoint = match options.training {
        Some(_) => Some(a.run.checkpoint(a.output(), &options.name_of_work(&particles), &context)?),
        None => None,
    };
    let work = |pieces: &mut dyn Pieces, progress: &dyn Progress| compress(&particles, &options, pieces, progress);
    let done = a.run.run(&context, checkpoint.as_mut(), work)?;
    if !done.stopped {
        context.check()?;
    }
    output::write_bytes(a.output(), &done.bytes)?;
    if done.stopped {
        return Err(run_args::stopped(a.output(), &context));
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
    /// The model file; empty where nothing but the configuration is printed.
    fn output(&self) -> &Path {
        self.output.as_deref().unwrap_or(Path::new(""))
    }

    /// Where scratch files go.
    fn scratch_folder(&self) -> PathBuf {
        let beside = self.output().parent().filter(|p| !p.as_os_str().is_empty());
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
        a.output().display(),
        done.model.metadata.count,
        bytes as f64 / gaussians as f64,
    );
    let phases: Vec<String> = done.seconds.iter().map(|(p, s)| format!("{p} {s:.2} s")).collect();
    text += &format!("\n{:.2} s: {}", seconds, phases.join(", "));
    text += &run_args::trained(done);
    if a.fit.is_fast() {
        text += "\n--effort fast: fewer small groups than default from ratio 300 on (docs/results/recovery.md)";
    }
    let unit = done.model.metadata.length_unit.as_deref();
    let (told, verdict) = info_model::told(done.model.certificate.as_ref(), unit, context);
    text += &told;
    let value = json!({
        "output": a.output, "particles": done.model.metadata.count, "gaussians": gaussians,
        "model_bytes": bytes, "raw_bytes": done.raw_bytes, "compression_ratio": ratio,
        "bytes_a_gaussian": bytes as f64 / gaussians as f64, "step_factor": done.step_factor, "trained": done.trained,
        "seconds": seconds, "seconds_by_phase": done.seconds.iter().copied().collect::<std::collections::BTreeMap<_, _>>(),
        "certificate": done.model.certificate, "verdict": verdict,
    });
    context.finish(&text, &value)
}
