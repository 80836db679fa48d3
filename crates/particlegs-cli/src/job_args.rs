//! Stores the snapshot of a job in its manifest, and opens it again.

use crate::common::CommandContext;
use crate::snapshot_args::ParticleArgs;
use particlegs_compress::job::Job;
use particlegs_core::{Error, Result};
use particlegs_files::input::{is_stream, name_of};
use particlegs_particles::{LayerFields, LayeredParticles, Particles, Storage};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A snapshot in a job's manifest.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct JobSnapshot {
    paths: Vec<PathBuf>,
    #[serde(flatten)]
    particles: ParticleArgs,
    seed: u64,
}

impl JobSnapshot {
    /// Absolute paths, since tasks may run in other folders.
    pub fn new(paths: &[PathBuf], particles: &ParticleArgs, seed: u64) -> Result<Self> {
        let absolute = |p: &PathBuf| {
            if is_stream(p) {
                let what = "a pipe or device, but every task of a job reads it again";
                return Err(Error::input_with(name_of(p), what, "write the data to a file first"));
            }
            let path = std::fs::canonicalize(p).map_err(|e| Error::io(p, e))?;
            if path.to_str().is_none() {
                let what = format!("{}: a job needs a path in UTF-8, because plan.json stores it", p.display());
                return Err(Error::argument(what));
            }
            Ok(path)
        };
        let paths = paths.iter().map(absolute).collect::<Result<_>>()?;
        let mut particles = particles.clone();
        particles.opening.topology = particles.opening.topology.as_ref().map(absolute).transpose()?;
        Ok(JobSnapshot { paths, particles, seed })
    }

    pub fn from_job(job: &Job) -> Result<Self> {
        let place = job.folder.join("plan.json");
        let value = job.snapshot().clone();
        serde_json::from_value(value).map_err(|e| Error::input(&place, format!("names no snapshot: {e}")))
    }

    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    pub fn place(&self) -> String {
        self.paths.first().map_or_else(String::new, |p| p.display().to_string())
    }

    /// Opens the snapshot; also returns whether tasks can reopen it and read any part. Data that cannot be read in
    /// place goes to `storage`. Layers come with their fields if they are wanted.
    pub fn source(
        &self,
        storage: &Storage,
        with_fields: bool,
        context: &CommandContext,
    ) -> Result<(LayeredParticles, bool)> {
        let mut choice = self.particles.choice(self.seed)?;
        if let Some(layered) = choice.read_later(&self.paths, with_fields, context)? {
            return Ok((layered, true));
        }
        let (particles, fields) = match with_fields {
            false => (choice.read(&self.paths, storage, context)?, Vec::new()),
            true => choice.read_fields(&self.paths, storage, context)?,
        };
        Ok((LayeredParticles::from_particles(&particles).with_fields(fields), false))
    }

    /// The snapshot of a job, to be read in parts; `plan` printed its notes.
    pub fn layered(&self, job: &Job, context: &CommandContext) -> Result<LayeredParticles> {
        Ok(context.told_before(|| self.source(&Storage::Memory, job.has_fields(), context))?.0)
    }

    /// The particles of a job, and the fields of their layers where it has any; `plan` printed their notes.
    pub fn particles(&self, job: &Job, context: &CommandContext) -> Result<(Particles, Vec<LayerFields>)> {
        let (mut choice, storage) = (self.particles.choice(self.seed)?, Storage::Memory);
        context.told_before(|| match job.has_fields() {
            true => choice.read_fields(&self.paths, &storage, context),
            false => Ok((choice.read(&self.paths, &storage, context)?, Vec::new())),
        })
    }
}

/// Number of a task, from 0, or `env:NAME` for an environment variable.
pub fn task_number(text: &str) -> Result<u64> {
    let said = match text.strip_prefix("env:") {
        None => text.to_string(),
        Some(name) => {
            std::env::var(name).map_err(|_| Error::argument(format!("{text}: the variable {name} is not set")))?
        }
    };
    said.trim().parse().map_err(|_| Error::argument(format!("{text}: `{said}` is not a number from 0")))
}

/// Adds the task to an error; a stop is not an error, since the engine runs the task again.
pub fn task_error(error: Error, job: &Path, task: &str) -> Error {
    match error {
        Error::Cancelled => Error::Checkpointed { what: format!("{}: {task}", job.display()) },
        other => other,
    }
}
