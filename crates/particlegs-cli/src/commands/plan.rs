//! `particlegs plan IN... -o JOB --blocks K|auto`.

use crate::common::Common;
use crate::emit::{self, JobEngine};
use crate::fit_args::{FitArgs, number_of_blocks, parse_bytes};
use crate::outputs::ForceArgs;
use crate::snapshot_args::ParticleArgs;
use clap::{Args, ValueHint};
use particlegs::Snapshot;
use particlegs::job::Job;
use particlegs_core::{Error, Result};
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(
    after_help = "\
Example:
  particlegs plan snapshot/ -o job --blocks 64 --emit slurm > job.slurm && bash job.slurm",
    after_long_help = "\
A job is a folder. Its tasks can run on any machine that can access it, and can be repeated:
  particlegs plan snapshot/ -o job --blocks 64
  particlegs scatter job              (all chunks; or one: particlegs scatter job 3)
  particlegs block job 0              (one block; in a Slurm array: env:SLURM_ARRAY_TASK_ID)
  particlegs merge job -o snapshot.pgs
`particlegs status job` shows the progress. The file is the same as that of `compress --blocks 64`.

A script for Slurm or Snakemake can do all of this (docs/guide/cluster.md):
  particlegs plan snapshot/ -o job --blocks 64 --emit slurm > job.slurm && bash job.slurm
  particlegs plan snapshot/ -o job --blocks 64 --emit snakemake > Snakefile && snakemake --cores all"
)]
pub struct Arguments {
    /// Snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// Folder of the job.
    #[arg(long, short, alias = "out", value_name = "JOB", value_hint = ValueHint::DirPath)]
    output: PathBuf,
    /// Number of blocks; `auto` chooses it from --memory.
    ///
    /// Blocks hold about equal numbers of particles.
    #[arg(long, value_name = "K|auto", default_value = "auto")]
    blocks: String,
    /// Memory limit of a task, such as 4GiB [default with `auto`: 4GiB].
    #[arg(long, value_name = "SIZE")]
    memory: Option<String>,
    /// Print a workflow script.
    ///
    /// The summary is then printed on standard error.
    #[arg(long, value_enum, value_name = "ENGINE")]
    emit: Option<JobEngine>,
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    particles: ParticleArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: Arguments) -> Result<()> {
    if let Some(text) = a.fit.train.printed()? {
        return crate::report::line(text.trim_end());
    }
    let mut options = a.fit.options(a.common.seed)?;
    options.memory = a.memory.as_deref().map(parse_bytes).transpose()?;
    options.blocks = match a.blocks.as_str() {
        "auto" => None,
        number => {
            let hint = "--gadget-blocks names the blocks of a Gadget file";
            let wrong = |_| Error::argument(format!("--blocks {number} is neither a number nor `auto` ({hint})"));
            Some(number_of_blocks(number).map_err(wrong)?)
        }
    };
    if let Some(engine) = a.emit {
        // Check the name before reading the snapshot.
        let folder = std::path::absolute(&a.output).map_err(|e| Error::io(&a.output, e))?;
        emit::quoted(engine, &folder)?;
    }
    let context = a.common.clone().start()?;
    let inputs = a.input.iter().chain(&a.particles.opening.topology).map(PathBuf::as_path);
    context.reads(inputs.chain(a.fit.train.tune.config_file()), a.force.force)?;
    if a.emit.is_some() && context.outputs.on_standard_output() {
        return Err(Error::argument("--emit prints its script to standard output: write --json to a file"));
    }
    let snapshot = Snapshot::of_files(&a.input, a.particles.choice(a.common.seed)?);
    let job = Job::plan(&snapshot, &a.output, &options, &context.outputs, &context)?;
    let parts = job.parts();
    let folder = a.output.display();
    let mut text = format!(
        "{folder}: {} particles in {} blocks{}",
        parts.particles,
        parts.blocks,
        if parts.planned_before { " (already planned; nothing changed)" } else { "" }
    );
    text += &match parts.chunks {
        0 => "\nscatter: not needed; blocks read the snapshot directly".to_string(),
        chunks => format!(
            "\nscatter: particlegs scatter {folder}, or its {chunks} chunks one by one; {} bytes in total",
            parts.scatter_bytes
        ),
    };
    text += &format!("\nblocks: particlegs block {folder} 0 to {}", parts.blocks - 1);
    text += &format!("\nthen: particlegs merge {folder} -o MODEL.pgs");
    let mut value = json!(parts);
    value["job"] = a.output.to_string_lossy().into();
    let Some(engine) = a.emit else { return context.finish(&text, &value) };
    text.lines().for_each(|line| context.message(line));
    let script = script(engine, &job, a.common.threads.unwrap_or(THREADS))?;
    if let Some(target) = &a.common.json {
        crate::report::json(target, &value)?;
    }
    crate::report::verbatim(script.trim_end())
}

/// Default of `--threads` for a task in a script, since blocks run side by side.
const THREADS: usize = 4;

/// The script of a workflow engine for a job, with the model file beside the folder.
fn script(engine: JobEngine, job: &Job, threads: usize) -> Result<String> {
    let absolute = |p: &Path| std::fs::canonicalize(p).map_err(|e| Error::io(p, e));
    let folder = absolute(job.folder())?;
    let program = std::env::current_exe().map_err(|e| Error::io("this program", e))?;
    let mut model = folder.clone().into_os_string();
    model.push(".pgs");
    emit::script(engine, &emit::JobScript { program, model: model.into(), folder, parts: job.parts(), threads })
}
