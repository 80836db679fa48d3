//! `particlegs info FILE`: a model file, or a snapshot in any format.

use crate::common::Common;
use crate::snapshot_args::SnapshotArgs;
use crate::{info_model, info_snapshot};
use clap::Args;
use particlegs::{Error, Result};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Args)]
#[command(after_help = "Examples:
  particlegs info M.pgs
  particlegs info snap_099.0.hdf5
  particlegs info dump.lammpstrj.gz --frame 0
  particlegs info M.pgs --json - | jq .metadata")]
pub struct Arguments {
    /// Model file, or a snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "FILE")]
    input: Vec<PathBuf>,
    /// Do not read the particles of a snapshot: their bounds are left out.
    #[arg(long)]
    no_bounds: bool,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    common: Common,
}

/// Prints what the file says.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    match &a.input[..] {
        [one] if is_model(one)? => info_model::print(&context, one),
        paths => info_snapshot::print(&context, paths, &a.snapshot.choice()?, !a.no_bounds),
    }
}

/// Does the file begin as a model file does?
pub(super) fn is_model(path: &Path) -> Result<bool> {
    if path.is_dir() {
        return Ok(false);
    }
    let mut head = [0u8; 8];
    let mut file = File::open(path).map_err(|e| Error::io(path, e))?;
    Ok(file.read_exact(&mut head).is_ok() && particlegs::codec::is_model(&head))
}
