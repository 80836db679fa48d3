//! `particlegs info FILE`: a model file, or a snapshot in any format.

use crate::common::Common;
use crate::inputs::{self, ModelOrSnapshot};
use crate::snapshot_args::SnapshotArgs;
use crate::{info_model, info_series, info_snapshot};
use clap::Args;
use particlegs::Series;
use particlegs_core::Result;
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
            if a.csv { context.line(&series.table(&context)?.text()) } else { info_series::print(&context, &series) }
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
