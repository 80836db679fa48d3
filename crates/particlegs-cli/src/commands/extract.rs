//! `particlegs extract RUN.pgs --frame N -o M.pgs`.

use crate::common::Common;
use crate::inputs::{self, FrameArgs};
use crate::outputs::{self, ForceArgs};
use clap::{Args, ValueHint};
use particlegs_files::input::name_of;
use particlegs_pipeline::{Result, codec};
use serde_json::json;
use std::path::PathBuf;

#[derive(Args)]
#[command(mut_arg("frame", |a| a.hide_short_help(false)), mut_arg("time", |a| a.hide_short_help(false)))]
#[command(after_help = "\
A keyframe is copied as it is. A frame between is coded anew in finer steps, and loses next to nothing.

Examples:
  particlegs extract run.pgs --frame 12 -o frame12.pgs
  particlegs extract run.pgs --time z=1 -o z1.pgs")]
pub struct Arguments {
    /// Series file.
    #[arg(value_name = "RUN.pgs", value_hint = ValueHint::FilePath)]
    series: PathBuf,
    /// Model file to write.
    #[arg(long, short, alias = "out", value_name = "M.pgs", value_hint = ValueHint::FilePath)]
    output: PathBuf,
    #[command(flatten)]
    frame: FrameArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.start()?;
    context.reads([a.series.as_path()], a.force.force)?;
    let kept = context.writes(&a.output, &outputs::MODEL)?;
    let bytes = inputs::model_of(&a.series, &a.frame, &context)?;
    let info = codec::read_info(&bytes, &name_of(&a.output))?;
    context.write_model(&a.output, &bytes, kept)?;
    let text = format!("{}: {} Gaussians, {} bytes", a.output.display(), info.gaussians(), bytes.len());
    let report = json!({
        "output": a.output.to_string_lossy(), "gaussians": info.gaussians(), "model_bytes": bytes.len(),
    });
    context.finish(&text, &report)
}
