//! `particlegs simplify M.pgs -o M2.pgs --ratio R | --gaussians K`.

use crate::common::Common;
use crate::fit_args::TargetArgs;
use crate::inputs::FrameArgs;
use crate::outputs::ForceArgs;
use clap::{Args, ValueHint};
use particlegs::Model;
use particlegs_core::Result;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
#[command(mut_group("TargetArgs", |g| g.required(true)), after_help = "\
Merges Gaussians in pairs, the least visible merges first; counts, mass and moments are kept. This
needs no particles, but a model compressed from them to the same size is better.

Examples:
  particlegs simplify M.pgs -o small.pgs --ratio 1000
  particlegs simplify M.pgs -o preview.pgs --gaussians 2000")]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "M.pgs", value_hint = ValueHint::FilePath)]
    model: PathBuf,
    /// Model file to write.
    #[arg(long, short, alias = "out", value_name = "M2.pgs", value_hint = ValueHint::FilePath)]
    output: PathBuf,
    #[command(flatten)]
    target: TargetArgs,
    #[command(flatten)]
    series: FrameArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let target = a.target.target()?;
    let context = a.common.start()?;
    let start = Instant::now();
    context.reads([a.model.as_path()], a.force.force)?;
    // Before the model is read, which may take long: a file that appears meanwhile is not replaced.
    context.outputs.writes_model(&a.output, &context)?;
    let model = Model::open_frame(&a.model, &a.series.choice(), &context)?;
    let small = model.simplify_into(&a.output, target, &context.outputs, &context)?;
    let (bytes, info) = (small.bytes(), small.info()?);
    let [gaussians_in, gaussians] = [&model, &small].map(|m| m.decoded().gaussians());
    let seconds = start.elapsed().as_secs_f64();
    let text = format!(
        "{}: {gaussians_in} -> {gaussians} Gaussians, {} bytes, {}, in {seconds:.2} s",
        a.output.display(),
        bytes.len(),
        info.describe_ratio(),
    );
    let report = json!({
        "output": a.output.to_string_lossy(), "gaussians_in": gaussians_in, "gaussians": gaussians,
        "model_bytes": bytes.len(), "raw_bytes": info.raw_bytes(), "compression_ratio": info.compression_ratio(), "seconds": seconds,
    });
    context.finish(&text, &report)
}
