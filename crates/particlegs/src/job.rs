//! A compression as a folder of parts, which any engine runs anywhere and in any order (docs/guide/cluster.md).

use crate::snapshot::SnapshotFiles;
use crate::{CompressOptions, Context, Error, Result, Snapshot, Storage};
use particlegs_compress::job::{self, Task};
use particlegs_core::model::CertificateLevel;
use particlegs_files::output::Outputs;
use particlegs_particles::LayeredParticles;
use serde::Serialize;
use std::path::{Path, PathBuf};

pub use particlegs_compress::job::{BlockReport, JobStatus, State};

/// The folder of a job, and the snapshot that its tasks read.
pub struct Job {
    job: job::JobFolder,
    snapshot: SnapshotFiles,
}

impl Job {
    /// Plans a job: reads the snapshot once, and writes `plan.json` into the folder. The same plan again changes
    /// nothing; another one is replaced where `outputs` replaces. The memory of the options is that of a task.
    ///
    /// # Errors
    /// [`Error::Argument`] for particles in memory, pipes, paths that are not UTF-8, and options that a job does not know;
    /// [`Error::Output`] for a folder with another plan or other files; those of reading.
    pub fn plan(
        snapshot: &Snapshot,
        folder: &Path,
        options: &CompressOptions,
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<Job> {
        let mut options = options.clone();
        // What was read is part of the recipe, by which models are told apart.
        options.read.extend(snapshot.options());
        options.check()?;
        let files = snapshot.files()?.for_tasks()?;
        snapshot.declare(outputs);
        outputs.writes_job(folder)?;
        outputs.make_folder(folder)?;
        let (storage, with_fields) = (Storage::Disk(folder.to_path_buf()), !options.fields.is_empty());
        let later = files.choice.read_later(&files.paths, with_fields, context)?;
        let reopened = later.is_some();
        let source = later.map_or_else(|| in_memory(&files, &storage, with_fields, context), Ok)?;
        let record = serde_json::to_value(&files).map_err(|e| Error::argument(format!("the snapshot's name: {e}")))?;
        let (options, replace, place) = (&options, outputs.replaces(), &*snapshot.place());
        let job = job::JobFolder::plan(
            source,
            &Task { reopened, options, snapshot: record, place, replace },
            folder,
            context,
        )?;
        job.notes().iter().for_each(|note| context.note(note));
        Ok(Job { job, snapshot: files })
    }

    /// Opens the folder of a job.
    ///
    /// # Errors
    /// [`Error::Input`] for a folder without a plan, and a plan that is not valid; [`Error::Compatibility`] for that of
    /// another version.
    pub fn open(folder: &Path) -> Result<Job> {
        let job = job::JobFolder::open(folder)?;
        let invalid = |reason: String| Error::input(&folder.join("plan.json"), format!("names no snapshot: {reason}"));
        let snapshot: SnapshotFiles =
            serde_json::from_value(job.snapshot().clone()).map_err(|e| invalid(e.to_string()))?;
        // serde checks the form of plan.json, but no ranges.
        if let Some(Err(error)) = snapshot.choice.selection.map(particlegs_particles::Selection::check) {
            return Err(invalid(error.to_string()));
        }
        Ok(Job { job, snapshot })
    }

    /// Whether a path is the folder of a job.
    pub fn is_job(path: &Path) -> bool {
        job::JobFolder::is_job(path)
    }

    /// Sorts chunk `chunk` of the snapshot by block; returns whether that was still to be done.
    ///
    /// # Errors
    /// [`Error::Argument`] for a chunk that does not exist; [`Error::Input`] for a snapshot that changed since it was
    /// planned; [`Error::Checkpointed`] where it is stopped.
    pub fn scatter(&self, chunk: u64, context: &Context<'_>) -> Result<bool> {
        let done = context.check().and_then(|()| self.job.scatter(|| self.source(context), chunk, context));
        done.map_err(|e| self.stopped(e, "chunk", chunk))
    }

    /// Fits block `block` into a file in the folder: what is left of it where a checkpoint exists, nothing where it is
    /// done.
    ///
    /// # Errors
    /// As [`Job::scatter`].
    pub fn block(&self, block: u64, context: &Context<'_>) -> Result<BlockReport> {
        let done = self.job.block(block, || self.source(context), context);
        done.map_err(|e| self.stopped(e, "block", block))
    }

    /// A stop is not an error of the task: the engine runs it again.
    fn stopped(&self, error: Error, kind: &str, number: u64) -> Error {
        match error {
            Error::Cancelled => Error::Checkpointed { what: format!("{}: {kind} {number}", self.folder().display()) },
            other => other,
        }
    }

    /// State of the job, by the files in its folder.
    ///
    /// # Errors
    /// [`Error::Input`] for reports that are not valid.
    pub fn status(&self) -> Result<JobStatus> {
        self.job.status()
    }

    /// Reads the snapshot and every file of the folder, and compares them with the plan.
    ///
    /// # Errors
    /// [`Error::Input`] for what differs.
    pub fn verify(&self, context: &Context<'_>) -> Result<JobStatus> {
        self.job.verify(Some(self.source(context)?), context)?;
        self.job.status()
    }

    /// Merges the blocks into a model file with a certificate of this level, or that of the plan: the bytes that
    /// [`crate::compress`] gives. The model of the same job is replaced by itself.
    ///
    /// # Errors
    /// [`Error::Input`] where blocks are missing; [`Error::Output`] for a file that may not be replaced; those of reading.
    pub fn merge_into(
        &self,
        out: &Path,
        level: Option<CertificateLevel>,
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<Vec<u8>> {
        let level = level.unwrap_or(self.job.certificate());
        if outputs.writes_model(out, context)? {
            crate::model::check_recipe(out, &self.job.metadata().recipe, outputs, context)?;
        }
        // Missing blocks are reported before the snapshot is read.
        self.job.check_done()?;
        let particles = match level {
            // Blocks were measured one by one when they were fitted.
            CertificateLevel::None | CertificateLevel::Blocks => None,
            _ => Some(self.snapshot.read(&Storage::Memory, self.job.has_fields(), &context.without_notes())?),
        };
        let bytes = self.job.merge(level, particles.as_ref().map(|(p, fields)| (p, &fields[..])), context)?;
        context.check()?;
        outputs.write_model(out, &bytes, context)?;
        Ok(bytes)
    }

    /// The snapshot, to be read in parts; its notes were reported when the job was planned.
    fn source(&self, context: &Context<'_>) -> Result<LayeredParticles> {
        let (files, with_fields, context) = (&self.snapshot, self.job.has_fields(), context.without_notes());
        match files.choice.read_later(&files.paths, with_fields, &context)? {
            Some(source) => Ok(source),
            None => in_memory(files, &Storage::Memory, with_fields, &context),
        }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.job.folder
    }

    /// The files of the snapshot.
    pub fn snapshot_paths(&self) -> &[PathBuf] {
        &self.snapshot.paths
    }

    /// Its parts, and what they take.
    pub fn parts(&self) -> JobParts {
        JobParts {
            particles: self.job.metadata().count,
            blocks: self.job.blocks(),
            chunks: self.job.chunks(),
            scatter_bytes: self.job.scatter_bytes(),
            memory: self.job.memory(),
            planned_before: self.job.planned_before(),
            task_bytes: self.job.task_bytes(),
            merge_bytes: self.job.merge_bytes(),
        }
    }
}

/// A snapshot that cannot be read in parts, read whole.
fn in_memory(
    files: &SnapshotFiles,
    storage: &Storage,
    with_fields: bool,
    context: &Context<'_>,
) -> Result<LayeredParticles> {
    let (particles, fields) = files.read(storage, with_fields, context)?;
    Ok(LayeredParticles::from_particles(&particles).with_fields(fields))
}

/// The parts of a job, and what they take.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JobParts {
    /// Particles of the snapshot.
    pub particles: u64,
    /// Blocks to be fitted.
    pub blocks: u32,
    /// Chunks to be scattered; 0 where blocks read the snapshot directly.
    pub chunks: u64,
    /// Bytes of the files of all chunks.
    pub scatter_bytes: u64,
    /// Memory that the plan allows a task, bytes.
    pub memory: Option<u64>,
    /// Whether the same plan was in the folder already.
    pub planned_before: bool,
    /// Memory that a task takes, bytes.
    #[serde(skip)]
    pub task_bytes: u64,
    /// Memory that merging takes, bytes.
    #[serde(skip)]
    pub merge_bytes: u64,
}
