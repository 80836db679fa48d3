//! `particlegs merge A.pgs B.pgs ... -o M.pgs`, `particlegs merge JOB -o M.pgs`.

use crate::common::{CommandContext, Common, named};
use crate::info_model;
use crate::outputs::ForceArgs;
use crate::report::counted;
use clap::{Args, ValueHint};
use particlegs::job::Job;
use particlegs::merge_files;
use particlegs_core::model::CertificateLevel;
use particlegs_core::{Error, Result, codec};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args)]
#[command(after_help = "\
Coded blocks are copied, so nothing is lost, and the order of the parts does not matter. The default
particle radius, the bounds and the counts are those of the whole; scores in the parts are dropped.
For alpha-blend models the VizMapper comes from the part with the first block (by layer, then by
position), as published; `finetune` trains the merged model on the whole snapshot.

A job folder gives the same file as `compress`, measured against the snapshot.

Examples:
  particlegs merge west.pgs east.pgs -o whole.pgs
  particlegs merge west.pgs east.pgs --fields velocity -o whole.pgs    # if they have different fields
  particlegs merge job -o whole.pgs
  particlegs merge blocks/*.pgs -o whole.pgs && particlegs verify whole.pgs snapshot/")]
pub struct Arguments {
    /// Model files, or one job folder.
    #[arg(required = true, value_name = "A.pgs|JOB")]
    parts: Vec<PathBuf>,
    /// Model file to write.
    #[arg(long, short, alias = "out", value_name = "M.pgs", value_hint = ValueHint::FilePath)]
    output: PathBuf,
    /// How much to measure of a job's file against its snapshot [default: as planned].
    #[arg(long, value_name = "LEVEL", value_parser = named::<CertificateLevel>())]
    certificate: Option<CertificateLevel>,
    /// Fields to keep, which all parts must have; `none` keeps none [default: all, if the parts have the same].
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    fields: Vec<String>,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let start = Instant::now();
    let (bytes, parts) = match &a.parts[..] {
        [folder] if Job::is_job(folder) => merge_job(&a, folder, &context)?,
        parts => {
            context.reads(parts.iter().map(PathBuf::as_path), a.force.force)?;
            context.outputs.writes_model(&a.output, &context)?;
            let fields = match &a.fields[..] {
                [] => None,
                [none] if none == "none" => Some(Vec::new()),
                names => Some(names.to_vec()),
            };
            let bytes = merge_files(parts, fields, &context)?;
            // The last moment to stop, before anything is written.
            context.check()?;
            context.outputs.write_model(&a.output, &bytes, &context)?;
            (bytes, parts.len())
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    let info = codec::read_info(&bytes, &a.output.display().to_string())?;
    let blocks: Vec<_> = info.layers.iter().flat_map(|l| &l.content).collect();
    let gaussians: u64 = blocks.iter().map(|b| u64::from(b.gaussians)).sum();
    let (layers, blocks, particles) = (info.layers.len(), blocks.len(), info.metadata.count);
    let mut text = format!(
        "{}: {}, {} in {}, {gaussians} Gaussians for {particles} particles, {} bytes, in {seconds:.2} s",
        a.output.display(),
        counted(parts, "part"),
        counted(blocks, "block"),
        counted(layers, "layer"),
        bytes.len()
    );
    // Only a job's file is measured; a file merged from files has no certificate.
    if info.certificate.is_some() {
        text += &info_model::describe_new_model(
            info.certificate.as_ref(),
            &info.metadata,
            &info.layers,
            &a.output,
            &context,
        )
        .0;
    }
    let report = json!({
        "output": a.output.to_string_lossy(), "parts": parts, "layers": layers, "blocks": blocks, "gaussians": gaussians,
        "particles": particles, "model_bytes": bytes.len(), "seconds": seconds,
    });
    context.finish(&text, &report)
}

/// The file of a job, and the number of its blocks.
fn merge_job(a: &Arguments, folder: &Path, context: &CommandContext) -> Result<(Vec<u8>, usize)> {
    if !a.fields.is_empty() {
        let hint = "`plan --fields` chooses the fields of a job";
        return Err(Error::argument_with("--fields has no effect on a job folder", hint));
    }
    let job = Job::open(folder)?;
    context.reads_job(folder, job.snapshot_paths(), a.force.force)?;
    let bytes = job.merge_into(&a.output, a.certificate, &context.outputs, context)?;
    Ok((bytes, job.parts().blocks as usize))
}
