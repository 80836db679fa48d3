//! `particlegs merge A.pgs B.pgs ... -o M.pgs`.

use crate::common::Common;
use crate::info_model;
use clap::Args;
use particlegs::codec::{self, Merge};
use particlegs::progress::Progress;
use particlegs::{Result, output};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
Blocks are copied as they are coded: nothing is lost, and the order of the parts does not matter.
Particle radius, bounds and counts are those of the whole; the scores in the parts are dropped.

Examples:
  particlegs merge west.pgs east.pgs -o whole.pgs
  particlegs merge blocks/*.pgs -o whole.pgs && particlegs verify whole.pgs snapshot/")]
pub struct Arguments {
    /// Model files.
    #[arg(required = true, value_name = "A.pgs")]
    parts: Vec<PathBuf>,
    /// The model file to write.
    #[arg(long, short, value_name = "M.pgs")]
    output: PathBuf,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct Report {
    output: PathBuf,
    parts: usize,
    layers: usize,
    blocks: usize,
    gaussians: u64,
    particles: u64,
    model_bytes: usize,
    seconds: f64,
}

/// Merges.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.start()?;
    let start = Instant::now();
    output::check_writable(&a.output)?;
    let mut merge = Merge::default();
    context.begin("merging", a.parts.len() as u64);
    for part in &a.parts {
        context.check()?;
        merge.add(&info_model::read(part)?, &part.display().to_string())?;
        context.advance(1);
    }
    context.end();
    let bytes = merge.finish()?;
    context.check()?;
    output::write_bytes(&a.output, &bytes)?;
    let seconds = start.elapsed().as_secs_f64();
    let info = codec::read_info(&bytes, &a.output.display().to_string())?;
    let blocks = || info.layers.iter().flat_map(|l| &l.blocks);
    let report = Report {
        parts: a.parts.len(),
        layers: info.layers.len(),
        blocks: blocks().count(),
        gaussians: blocks().map(|b| u64::from(b.gaussians)).sum(),
        particles: info.metadata.count,
        model_bytes: bytes.len(),
        output: a.output,
        seconds,
    };
    let text = format!(
        "{}: {} model files, {} blocks in {} layers, {} Gaussians for {} particles, {} bytes, in {:.2} s",
        report.output.display(),
        report.parts,
        report.blocks,
        report.layers,
        report.gaussians,
        report.particles,
        report.model_bytes,
        report.seconds
    );
    context.finish(&text, &report)
}
