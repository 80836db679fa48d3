//! `particlegs status JOB`.

use crate::common::Common;
use clap::{Args, ValueHint};
use particlegs::job::{Job, State};
use particlegs_core::Result;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  particlegs status job --json -")]
pub struct Arguments {
    /// Folder of the job.
    #[arg(value_name = "JOB", value_hint = ValueHint::DirPath)]
    job: PathBuf,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let job = Job::open(&a.job)?;
    context.reads_job(&a.job, &[], false)?;
    let status = job.status()?;
    let parts = |states: &[State]| {
        let numbers_in = |state| {
            let numbers = states.iter().enumerate().filter(|s| *s.1 == state).map(|s| s.0.to_string());
            numbers.collect::<Vec<_>>()
        };
        let mut text = format!("{} of {} done", numbers_in(State::Done).len(), states.len());
        for (state, name) in [(State::Checkpointed, "interrupted, with a checkpoint"), (State::Missing, "to do")] {
            let numbers = numbers_in(state);
            if !numbers.is_empty() {
                let more = if numbers.len() > 12 { ", ..." } else { "" };
                let first = numbers.iter().take(12).cloned().collect::<Vec<_>>().join(", ");
                text += &format!("; {} {name} ({first}{more})", numbers.len());
            }
        }
        text
    };
    let chunks = match status.chunks.len() {
        0 => "not needed".to_string(),
        _ => parts(&status.chunks),
    };
    let text = format!(
        "{}\nchunks: {chunks}\nblocks: {}\nparticles: {} of {} fitted; {} Gaussians, {} bytes, {:.1} s of work",
        a.job.display(),
        parts(&status.blocks),
        status.particles[0],
        status.particles[1],
        status.gaussians,
        status.model_bytes,
        status.seconds
    );
    context.finish(&text, &status)
}
