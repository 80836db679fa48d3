//! `particlegs extract RUN.pgs --frame N -o M.pgs`.

use crate::common::Common;
use crate::inputs::FrameArgs;
use crate::outputs::ForceArgs;
use clap::{Args, ValueHint};
use particlegs::input::ModelOrSeries;
use particlegs_core::{Error, Result};
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
    let ModelOrSeries::Series(series) = ModelOrSeries::open(&a.series, &context)? else {
        let message = "it is one model, not a series: there is nothing to extract";
        return Err(Error::input_with(name_of(&a.series), message, "use the file as it is"));
    };
    let model = series.model(&a.frame.choice(), &context)?;
    let (bytes, gaussians) = (model.bytes(), model.info()?.gaussians());
    context.outputs.write_model(&a.output, bytes, &context)?;
    let text = format!("{}: {} Gaussians, {} bytes", a.output.display(), gaussians, bytes.len());
    let report = json!({
        "output": a.output.to_string_lossy(), "gaussians": gaussians, "model_bytes": bytes.len(),
    });
    context.finish(&text, &report)
}
