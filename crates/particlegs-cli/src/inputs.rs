//! Options that name a frame of a series; inputs are opened by [`particlegs::input`].

use crate::progress::to_stderr;
use crate::snapshot_args::SnapshotArgs;
use clap::Args;
pub use particlegs::input::{FrameChoice, ModelOrSnapshot, decoded_model, is_series, read_file};
use particlegs::input::{frame_beside, read_model_of_snapshot};
use particlegs_core::Result;
use particlegs_core::context::{Context, ProgressSink};
use particlegs_core::text::one_line;
use std::path::Path;

/// Options that name a frame of a series.
#[derive(Args, Clone, Debug, Default)]
pub struct FrameArgs {
    /// Frame of a series, from 0; -1 is the last [default: the last].
    #[arg(long, value_name = "N", hide_short_help = true, allow_negative_numbers = true, conflicts_with = "time")]
    frame: Option<i64>,
    /// Moment of a series: a=0.5, z=1, 5Gyr, step=1000 or 500ps; between frames it is interpolated.
    #[arg(long, value_name = "WHEN", hide_short_help = true)]
    time: Option<String>,
}

impl FrameArgs {
    /// The frame or moment that is named.
    pub fn choice(&self) -> FrameChoice {
        self.time.clone().map_or(self.frame.into(), FrameChoice::Moment)
    }

    /// Whether a frame or a moment is named.
    pub fn is_given(&self) -> bool {
        self.choice() != FrameChoice::Last
    }
}

/// A model's bytes; of a series those of the frame that `opening` names, which then names the snapshot's frame that it
/// was made from.
pub fn model_with_snapshot(path: &Path, opening: &mut SnapshotArgs, context: &Context<'_>) -> Result<Vec<u8>> {
    read_model_of_snapshot(path, &mut opening.frame, context)
}

/// Options of opening `path` beside `other`: a frame is one of `other` where `path` is a single model.
pub fn opening_beside(path: &Path, other: Option<&Path>, opening: &SnapshotArgs) -> SnapshotArgs {
    SnapshotArgs { frame: frame_beside(path, other, opening.frame), ..opening.clone() }
}

/// A model, of a series the frame that is named or else the last, or a snapshot. A pipe is read only once.
pub fn model_or_snapshot(path: &Path, opening: &SnapshotArgs, context: &Context<'_>) -> Result<ModelOrSnapshot> {
    ModelOrSnapshot::open(path, opening.choice()?, context)
}

/// Prints what the command waits for before its progress is shown.
pub struct WaitNotice;

impl ProgressSink for WaitNotice {
    fn message(&self, text: &str) {
        to_stderr(&one_line(text));
    }
}
