//! `particlegs scatter JOB [I]`.

use crate::commands::block::task_number;
use crate::common::Common;
use clap::{Args, ValueHint};
use particlegs::job::Job;
use particlegs_core::Result;
use serde_json::json;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "\
Copies the particles of the snapshot, chunk by chunk, into one bucket per block. Chunks that are
done are skipped. On SIGTERM, SIGUSR1 or Ctrl-C it exits with code 75; run it again to continue.")]
pub struct Arguments {
    /// Folder of the job.
    #[arg(value_name = "JOB", value_hint = ValueHint::DirPath)]
    job: PathBuf,
    /// Chunk number, from 0, or `env:NAME` to read it from an environment variable [default: all].
    #[arg(value_name = "I")]
    chunk: Option<String>,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let job = Job::open(&a.job)?;
    let all = job.parts().chunks;
    let chunks = match &a.chunk {
        None => 0..all,
        Some(text) => {
            let number = task_number(text)?;
            // The library refuses a chunk that there is not, also the largest number.
            number..number.saturating_add(1)
        }
    };
    context.reads_job(&a.job, job.snapshot_paths(), false)?;
    context.finishes_its_steps();
    let (mut done, all) = (0, chunks.end - chunks.start);
    for chunk in chunks {
        done += u64::from(job.scatter(chunk, &context)?);
    }
    let text = match all {
        0 => "scatter is not needed; blocks read the snapshot directly".to_string(),
        _ => format!("{done} of {all} chunks sorted, {} were already done", all - done),
    };
    let text = format!("{}: {text}", a.job.display());
    context.finish(&text, &json!({ "job": a.job.to_string_lossy(), "bucketed": done, "before": all - done }))
}
