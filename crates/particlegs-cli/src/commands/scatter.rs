//! `particlegs scatter JOB [I]`.

use crate::common::Common;
use crate::job_args::{JobSnapshot, of_task, task_number};
use clap::Args;
use particlegs::Result;
use particlegs::job::Job;
use particlegs::progress::Progress;
use serde_json::json;
use std::path::PathBuf;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
Copies the particles of a chunk of the snapshot into buckets, one for each block. What is done is
skipped; SIGTERM, SIGUSR1 and Ctrl-C stop it with exit code 75: run it again to go on.")]
pub struct Arguments {
    /// The job's folder.
    job: PathBuf,
    /// The chunk, from 0, or `env:NAME` [default: all].
    #[arg(value_name = "I")]
    chunk: Option<String>,
    #[command(flatten)]
    common: Common,
}

/// Buckets one chunk or all.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let job = Job::open(&a.job)?;
    let chunks = match &a.chunk {
        None => 0..job.manifest.chunks,
        Some(text) => {
            let number = task_number(text)?;
            number..number.saturating_add(1)
        }
    };
    let snapshot = JobSnapshot::of(&job)?;
    context.reads_job(&a.job, snapshot.paths(), false)?;
    context.finishes_its_steps();
    let mut done = 0;
    for chunk in chunks.clone() {
        let scattered = context.check().and_then(|()| job.scatter(|| snapshot.layered(&context), chunk, &context));
        done += u64::from(scattered.map_err(|e| of_task(e, &a.job, &format!("chunk {chunk}")))?);
    }
    let all = chunks.end - chunks.start;
    let text = format!("{}: {done} of {all} chunks bucketed, {} were there", a.job.display(), all - done);
    context.finish(&text, &json!({ "job": a.job.to_string_lossy(), "bucketed": done, "before": all - done }))
}
