//! `particlegs series SNAPSHOT... -o RUN.pgs`.

use crate::common::Common;
use crate::fit_args::{FitArgs, number_of_blocks, parse_bytes};
use crate::outputs::ForceArgs;
use crate::snapshot_args::ParticleArgs;
use clap::{Args, ValueHint};
use particlegs::{CompressOptions, FrameRange, SeriesOptions, make_series};
use particlegs_compress::series::{KEYFRAME_INTERVAL, SERIES_FILE};
use particlegs_core::Result;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
#[command(mut_arg("train", |a| a.hide_short_help(true)), mut_arg("psnr", |a| a.hide_short_help(true)))]
#[command(mut_arg("size", |a| a.hide_short_help(true)))]
#[command(mut_arg("certificate", |a| a.help("How much to measure of every frame [default: quick, of keyframes alone]")))]
#[command(after_help = "\
Run the command again to go on after an interruption, or with more snapshots.

Examples:
  particlegs series snap_*.hdf5 -o run.pgs --ratio 300
  particlegs series traj.xtc --topology conf.gro --frames 0:1000:10 -o run.pgs")]
pub struct Arguments {
    /// Snapshots in order of time, or their folder; or a trajectory, with --frames.
    #[arg(required = true, value_name = "SNAPSHOT")]
    input: Vec<PathBuf>,
    /// Series file to write.
    #[arg(long, short, alias = "out", value_name = "RUN.pgs", value_hint = ValueHint::FilePath)]
    output: PathBuf,
    /// Frames of a trajectory: from FIRST to before END, every STEP.
    #[arg(long, value_name = "FIRST:END:STEP")]
    frames: Option<FrameRange>,
    /// Frames from one keyframe to the next.
    #[arg(long, value_name = "N", default_value_t = KEYFRAME_INTERVAL)]
    keyframe_interval: usize,
    /// Turn and move each frame so that these atoms, such as "name CA", lie best on those of the first frame.
    ///
    /// The words are those of --select. Aligned frames have no periodic box.
    #[arg(long, value_name = "TEXT", hide_short_help = true)]
    align: Option<String>,
    /// Memory limit, such as 2GiB: particles are then read from scratch files beside the output.
    ///
    /// Frames that need more are fitted in blocks.
    #[arg(long, value_name = "SIZE", hide_short_help = true)]
    memory: Option<String>,
    /// Number of blocks of each frame [default: 1, or as many as --memory needs].
    #[arg(long, value_name = "K", hide_short_help = true, value_parser = number_of_blocks)]
    blocks: Option<u32>,
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    particles: ParticleArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let choice = a.particles.choice(a.common.seed)?;
    let compress = CompressOptions {
        memory: a.memory.as_deref().map(parse_bytes).transpose()?,
        blocks: a.blocks,
        ..a.fit.options(a.common.seed)?
    };
    let (keyframe_interval, certify_changes) = (a.keyframe_interval, a.fit.certificate.is_some());
    let (frames, align, replace) = (a.frames, a.align, a.force.force);
    let options = SeriesOptions { compress, keyframe_interval, certify_changes, frames, align, replace };
    let context = a.common.start()?;
    let start = Instant::now();
    context.reads(a.input.iter().chain(&choice.topology).map(PathBuf::as_path), replace)?;
    context.writes(&a.output, &SERIES_FILE)?;
    let series = make_series(&a.input, &choice, &a.output, &options, &context)?;
    let (output, seconds) = (a.output.display(), start.elapsed().as_secs_f64());
    let (frames, keyframes) = (series.frames.len(), series.frames.iter().filter(|f| f.keyframe).count());
    let gaps = if series.missing.is_empty() { String::new() } else { format!(", {} missing", series.missing.len()) };
    let text = format!(
        "{output}: {frames} frames, {keyframes} of them keyframes{gaps}, {} bytes, ratio {:.1}, {seconds:.1} s",
        series.series_bytes, series.compression_ratio,
    );
    let mut report = json!(series);
    report["output"] = a.output.to_string_lossy().into();
    report["seconds"] = seconds.into();
    context.finish(&text, &report)
}
