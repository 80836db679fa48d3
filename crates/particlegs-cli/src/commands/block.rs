//! `particlegs block JOB I`.

use crate::common::Common;
use crate::job_args::{JobSnapshot, task_error, task_number};
use clap::{Args, ValueHint};
use particlegs_compress::job::Job;
use particlegs_core::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "\
Fits one block and writes its model file; a block that is done is skipped. On SIGTERM, SIGUSR1 or
Ctrl-C it writes a checkpoint and exits with code 75; run it again to continue.

Examples:
  particlegs block job 0
  particlegs block job env:SLURM_ARRAY_TASK_ID")]
pub struct Arguments {
    /// Folder of the job.
    #[arg(value_name = "JOB", value_hint = ValueHint::DirPath)]
    job: PathBuf,
    /// Block number, from 0, or `env:NAME` to read it from an environment variable.
    #[arg(value_name = "I")]
    block: String,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let job = Job::open(&a.job)?;
    let number = task_number(&a.block)?;
    let block = u32::try_from(number).map_err(|_| {
        Error::argument(format!("block {number} is outside the {} of this job, counted from 0", job.blocks()))
    })?;
    let snapshot = JobSnapshot::from_job(&job)?;
    context.reads_job(&a.job, snapshot.paths(), false)?;
    context.finishes_its_steps();
    let report = job.block(block, || snapshot.layered(&job, &context), &context);
    let report = report.map_err(|e| task_error(e, &a.job, &format!("block {block}")))?;
    let how = match report.continued {
        None => "was already done".to_string(),
        Some(0) => "done".to_string(),
        Some(pieces) => format!("done, continued from a checkpoint with {pieces} finished parts"),
    };
    let seconds: f64 = report.seconds.iter().map(|s| s.1).sum();
    let text = format!(
        "{}: block {block} {how}: {} particles -> {} Gaussians, {} bytes, {seconds:.2} s",
        a.job.display(),
        report.particles,
        report.gaussians,
        report.bytes
    );
    context.finish(&text, &json!({ "before": report.continued.is_none(), "report": report }))
}
