//! `particlegs plan IN... -o JOB --blocks K|auto`.

use crate::common::Common;
use crate::fit_args::FitArgs;
use crate::job_args::JobSnapshot;
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use clap::Args;
use particlegs::compress::parse_bytes;
use particlegs::job::{self, Task};
use particlegs::particles::Room;
use particlegs::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
The job is a folder; its parts run anywhere, in any order, as often as you like:
  particlegs plan snapshot/ -o job --blocks 64
  particlegs scatter job              (all chunks; or one: particlegs scatter job 3)
  particlegs block job 0              (one block; in a Slurm array: env:SLURM_ARRAY_TASK_ID)
  particlegs merge job -o snapshot.pgs
`particlegs status job` tells how far it is. The file is that of `compress --blocks 64`.")]
pub struct Arguments {
    /// A snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// The job's folder.
    #[arg(long, short, value_name = "JOB")]
    output: PathBuf,
    /// Number of blocks of balanced counts; `auto`: as many as --memory asks for.
    #[arg(long, value_name = "K|auto", default_value = "auto")]
    blocks: String,
    /// Memory that a task may take, e.g. 4GiB [default for auto: 4GiB].
    #[arg(long, value_name = "M")]
    memory: Option<String>,
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    window: WindowArgs,
    #[command(flatten)]
    common: Common,
}

/// Plans.
pub fn run(a: Arguments) -> Result<()> {
    let selection = (&a.selection, &a.window);
    let options = a.fit.options(&a.snapshot, selection, a.common.seed)?;
    let memory = a.memory.as_deref().map(parse_bytes).transpose()?;
    let blocks = match a.blocks.as_str() {
        "auto" => None,
        number => {
            let wrong = |_| Error::argument(format!("--blocks {number} is neither a number nor `auto`"));
            Some(number.parse::<u32>().map_err(wrong)?)
        }
    };
    let context = a.common.clone().start()?;
    let snapshot = JobSnapshot::new(&a.input, &a.snapshot, selection, a.common.seed)?;
    let named = serde_json::to_value(&snapshot).map_err(|e| Error::argument(format!("the snapshot's name: {e}")))?;
    std::fs::create_dir_all(&a.output).map_err(|e| Error::io(&a.output, e))?;
    let source = snapshot.source(&Room::Disk(a.output.clone()), &context)?;
    let task = Task { options: &options, blocks, memory, snapshot: named, place: &snapshot.place() };
    let planned = job::plan(source, &task, &a.output, &context)?;
    let (m, plan) = (&planned.job.manifest, &planned.job.manifest.plan);
    let folder = a.output.display();
    let mut text = format!(
        "{folder}: {} particles in {} blocks{}",
        plan.metadata.count,
        plan.blocks,
        if planned.before { " (planned before; nothing changed)" } else { "" }
    );
    text += &match m.chunks {
        0 => "\nno scatter is needed: blocks read the snapshot where it lies".to_string(),
        chunks => format!(
            "\nscatter: {chunks} chunks, {} bytes in all: particlegs scatter {folder} [0 to {}]",
            plan.raw_bytes(),
            chunks - 1
        ),
    };
    text += &format!("\nblocks: particlegs block {folder} 0 to {}", plan.blocks - 1);
    text += &format!("\nthen: particlegs merge {folder} -o MODEL.pgs");
    let value = json!({
        "job": a.output, "particles": plan.metadata.count, "blocks": plan.blocks, "chunks": m.chunks,
        "scatter_bytes": if m.chunks > 0 { plan.raw_bytes() } else { 0 }, "memory": m.memory, "planned_before": planned.before,
    });
    context.finish(&text, &value)
}
