//! `particlegs info FILE`: a model file, a series, or a snapshot in any format.

use crate::common::{CommandContext, Common};
use crate::inputs::{self, ModelOrSnapshot};
use crate::snapshot_args::SnapshotArgs;
use crate::{info_model, info_snapshot};
use clap::Args;
use particlegs::{FrameDescription, Series};
use particlegs_core::Result;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(after_help = "Examples:
  particlegs info M.pgs
  particlegs info snap_099.0.hdf5
  particlegs info dump.lammpstrj.gz --frame 0
  particlegs info run.pgs --frame 12
  particlegs info run.pgs --csv > frames.csv
  particlegs info M.pgs --json - | jq .metadata")]
pub struct Arguments {
    /// Model file, or a snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "FILE")]
    input: Vec<PathBuf>,
    /// Do not read the particles of a snapshot, and leave out their bounds.
    #[arg(long)]
    no_bounds: bool,
    /// Print a table of the frames of a series as CSV: times, particles, Gaussians, bytes and scores.
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    context.reads(a.input.iter().chain(&a.snapshot.topology).map(PathBuf::as_path), false)?;
    match &a.input[..] {
        [one] if a.snapshot.frame.is_none() && inputs::is_series(one) => {
            let series = Series::open(one)?;
            if a.csv { context.line(&series.table(&context)?.text()) } else { print(&context, &series) }
        }
        [one] if inputs::is_series(one) => {
            let info = Series::open(one)?.frame_info(&a.snapshot.frame.into(), &context)?;
            info_model::print_info(&context, &info)
        }
        [one] => match inputs::model_or_snapshot(one, &a.snapshot, &context)? {
            ModelOrSnapshot::Model(bytes) => info_model::print(&context, one, &bytes),
            ModelOrSnapshot::Snapshot(choice) => info_snapshot::print(&context, &a.input, &choice, !a.no_bounds),
        },
        paths => info_snapshot::print(&context, paths, &a.snapshot.choice()?, !a.no_bounds),
    }
}

/// A line for each frame: its number, what the clock shows, what it is, its bytes and its score.
fn print(context: &CommandContext, series: &Series) -> Result<()> {
    let description = series.describe()?;
    let keyframes =
        description.frames.iter().filter(|f| matches!(f, FrameDescription::There { kind: "keyframe", .. })).count();
    let (frames, bytes, clock) = (description.frames.len(), description.series_bytes, description.clock);
    let mut text = format!("series of {frames} frames, {keyframes} of them keyframes, {bytes} bytes");
    let _ = write!(text, "\n{:>6} {clock:>13} {:>9} {:>9} {:>9}", "frame", "kind", "bytes", "PSNR, dB");
    for frame in &description.frames {
        let _ = match frame {
            FrameDescription::Missing { frame, kind } => write!(text, "\n{frame:>6} {:>13} {kind:>9}", ""),
            FrameDescription::There { frame, kind, time, bytes, masked_psnr } => {
                let psnr = masked_psnr.map_or(String::new(), |v| format!("{v:.2}"));
                write!(text, "\n{frame:>6} {time:>13.6} {kind:>9} {bytes:>9} {psnr:>9}")
            }
        };
    }
    context.finish(&text, &description)
}
