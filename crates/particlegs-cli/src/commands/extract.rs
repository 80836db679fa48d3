//! `particlegs extract RUN.pgs --frame N -o M.pgs`.

use crate::common::Common;
use crate::inputs::{self, FrameArgs};
use crate::outputs::ForceArgs;
use clap::{Args, ValueHint};
use particlegs_core::{Error, Result, codec};
use particlegs_files::input::name_of;
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
    context.outputs.writes_model(&a.output, &context)?;
    let (series, place) = (inputs::read_file(&a.series, &context)?, name_of(&a.series));
    if !codec::is_series(&series) {
        let what = "it is one model, not a series: there is nothing to extract";
        return Err(Error::input_with(place, what, "use the file as it is"));
    }
    let bytes = inputs::frame_of(series, &a.frame.choice(), &place, &context)?;
    let info = codec::read_info(&bytes, &name_of(&a.output))?;
    context.outputs.write_model(&a.output, &bytes, &context)?;
    let text = format!("{}: {} Gaussians, {} bytes", a.output.display(), info.gaussians(), bytes.len());
    let report = json!({
        "output": a.output.to_string_lossy(), "gaussians": info.gaussians(), "model_bytes": bytes.len(),
    });
    context.finish(&text, &report)
}
