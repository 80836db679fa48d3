//! `particlegs simplify M.pgs -o M2.pgs --ratio R | --gaussians K`.

use crate::common::Common;
use crate::info_model;
use clap::Args;
use particlegs::compress::{Target, simplify};
use particlegs::progress::Progress;
use particlegs::{Result, codec, output};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
Gaussians are merged in pairs, those that show least first: counts, mass and moments are kept. A
model compressed from the particles to the same size is better; this one needs no particles.

Examples:
  particlegs simplify M.pgs -o small.pgs --ratio 1000
  particlegs simplify M.pgs -o preview.pgs --gaussians 2000")]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "M.pgs")]
    model: PathBuf,
    /// The model file to write.
    #[arg(long, short, alias = "out", value_name = "M2.pgs")]
    output: PathBuf,
    #[command(flatten)]
    target: TargetArgs,
    #[command(flatten)]
    common: Common,
}

/// One target.
#[derive(Args)]
#[group(required = true, multiple = false)]
struct TargetArgs {
    /// Compression ratio: 12 bytes a particle (16 with weights) over the file's bytes.
    #[arg(long)]
    ratio: Option<f64>,
    /// File size, e.g. 11MB, 900kB, 1.5GiB.
    #[arg(long)]
    size: Option<String>,
    /// Number of Gaussians, at the nominal precision.
    #[arg(long, value_name = "K")]
    gaussians: Option<u64>,
}

impl TargetArgs {
    /// The target, and how the file's command says it.
    fn target(&self) -> Result<(Target, String)> {
        match (self.ratio, &self.size, self.gaussians) {
            (Some(r), ..) => Ok((Target::Ratio(r).check()?, format!("simplify --ratio {r}"))),
            (_, Some(s), _) => Ok((Target::parse_size(s)?, format!("simplify --size {s}"))),
            (.., k) => {
                let k = k.unwrap_or(0);
                Ok((Target::Gaussians(k).check()?, format!("simplify --gaussians {k}")))
            }
        }
    }
}

#[derive(Serialize)]
struct Report {
    output: PathBuf,
    gaussians_in: usize,
    gaussians: usize,
    model_bytes: usize,
    compression_ratio: f64,
    seconds: f64,
}

/// Simplifies.
pub fn run(a: Arguments) -> Result<()> {
    let (target, command) = a.target.target()?;
    let context = a.common.start()?;
    let start = Instant::now();
    output::check_writable(&a.output)?;
    let bytes = info_model::read(&a.model)?;
    let model = codec::decode(&bytes, &a.model.display().to_string())?;
    let gaussians_in = model.gaussians();
    let done = simplify(model, bytes.len() as u64, target, &command, &context)?;
    context.check()?;
    output::write_bytes(&a.output, &done.bytes)?;
    let report = Report {
        gaussians_in,
        gaussians: done.gaussians,
        model_bytes: done.bytes.len(),
        compression_ratio: done.raw_bytes as f64 / done.bytes.len() as f64,
        seconds: start.elapsed().as_secs_f64(),
        output: a.output,
    };
    let text = format!(
        "{}: {gaussians_in} -> {} Gaussians, {} bytes, ratio {:.1}, in {:.2} s",
        report.output.display(),
        report.gaussians,
        report.model_bytes,
        report.compression_ratio,
        report.seconds
    );
    context.finish(&text, &report)
}
