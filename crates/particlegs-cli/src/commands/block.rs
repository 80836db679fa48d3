//! `particlegs block JOB I`.

use crate::common::Common;
use clap::{Args, ValueHint};
use particlegs::job::Job;
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
    let block = task_number(&a.block)?;
    context.reads_job(&a.job, job.snapshot_paths(), false)?;
    context.finishes_its_steps();
    let report = job.block(block, &context)?;
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

/// Number of a task, from 0, or `env:NAME` for an environment variable.
pub fn task_number(text: &str) -> Result<u64> {
    let number_text = match text.strip_prefix("env:") {
        None => text.to_string(),
        Some(name) => {
            std::env::var(name).map_err(|_| Error::argument(format!("{text}: the variable {name} is not set")))?
        }
    };
    number_text.trim().parse().map_err(|_| Error::argument(format!("{text}: `{number_text}` is not a number from 0")))
}
