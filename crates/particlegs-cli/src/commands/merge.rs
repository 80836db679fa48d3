//! `particlegs merge A.pgs B.pgs ... -o M.pgs`, `particlegs merge JOB -o M.pgs`.

use crate::common::{Common, Context};
use crate::info_model;
use crate::job_args::JobSnapshot;
use clap::Args;
use particlegs::codec::{self, Merge};
use particlegs::job::Job;
use particlegs::model::Law;
use particlegs::particles::Room;
use particlegs::progress::Progress;
use particlegs::{Result, output};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
Blocks are copied as they are coded: nothing is lost, and the order of the parts does not matter.
Particle radius, bounds and counts are those of the whole; the scores in the parts are dropped.
Of alpha-blend models the VizMapper of the part with the first block (by layer, then by place) is
taken, as published: fine-tune the merged model on the whole snapshot.

A job's folder gives the file that `compress` gives, measured on its snapshot.

Examples:
  particlegs merge west.pgs east.pgs -o whole.pgs
  particlegs merge job -o whole.pgs
  particlegs merge blocks/*.pgs -o whole.pgs && particlegs verify whole.pgs snapshot/")]
pub struct Arguments {
    /// Model files, or one job's folder.
    #[arg(required = true, value_name = "A.pgs|JOB")]
    parts: Vec<PathBuf>,
    /// The model file to write.
    #[arg(long, short, alias = "out", value_name = "M.pgs")]
    output: PathBuf,
    /// Do not measure a job's file on its snapshot: no scores in the file.
    #[arg(long)]
    no_certificate: bool,
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
    let context = a.common.clone().start()?;
    let start = Instant::now();
    output::check_writable(&a.output)?;
    let (bytes, parts) = match &a.parts[..] {
        [folder] if Job::is_job(folder) => of_job(&a, folder, &context)?,
        parts => (of_files(parts, &context)?, parts.len()),
    };
    context.check()?;
    output::write_bytes(&a.output, &bytes)?;
    let seconds = start.elapsed().as_secs_f64();
    let info = codec::read_info(&bytes, &a.output.display().to_string())?;
    if info.metadata.law == Law::AlphaBlend && parts > 1 {
        let network = match info.vizmapper {
            Some(_) => "the VizMapper is that of the part with the first block",
            None => "the part with the first block has no VizMapper, and so the file has none",
        };
        context.message(&format!("note: {network}, as published; it was trained on that part alone"));
    }
    let blocks = || info.layers.iter().flat_map(|l| &l.blocks);
    let report = Report {
        parts,
        layers: info.layers.len(),
        blocks: blocks().count(),
        gaussians: blocks().map(|b| u64::from(b.gaussians)).sum(),
        particles: info.metadata.count,
        model_bytes: bytes.len(),
        output: a.output,
        seconds,
    };
    let mut text = format!(
        "{}: {} parts, {} blocks in {} layers, {} Gaussians for {} particles, {} bytes, in {:.2} s",
        report.output.display(),
        report.parts,
        report.blocks,
        report.layers,
        report.gaussians,
        report.particles,
        report.model_bytes,
        report.seconds
    );
    // A job's file is measured; one of files has no certificate, and nothing is said of it.
    if info.certificate.is_some() {
        text += &info_model::told(info.certificate.as_ref(), info.metadata.length_unit.as_deref(), &context).0;
    }
    context.finish(&text, &report)
}

/// The file of model files.
fn of_files(parts: &[PathBuf], context: &Context) -> Result<Vec<u8>> {
    let mut merge = Merge::default();
    context.begin("merging", parts.len() as u64);
    for part in parts {
        context.check()?;
        merge.add(&info_model::read(part)?, &part.display().to_string())?;
        context.advance(1);
    }
    context.end();
    merge.finish()
}

/// The file of a job, and the number of its blocks.
fn of_job(a: &Arguments, folder: &Path, context: &Context) -> Result<(Vec<u8>, usize)> {
    let job = Job::open(folder)?;
    let measured = job.manifest.plan.certificate && !a.no_certificate;
    // Blocks that are missing are named before the snapshot is read.
    job.check_done()?;
    let particles = match measured {
        true => Some(JobSnapshot::of(&job)?.particles(&Room::Memory, context)?),
        false => None,
    };
    let bytes = job.merge(particles.as_ref(), context)?;
    Ok((bytes, job.manifest.plan.blocks as usize))
}
