//! The one pass over the snapshot that a job begins with, and the memory that the tasks of the job take.

use super::manifest::{FORM, JobFolder, Manifest, VERSION};
use super::runs;
use super::scatter::Buckets;
use crate::{CompressionPlan, FieldPlan, MemoryLoad, Options};
use particlegs_core::context::Context;
use particlegs_core::model::CertificateLevel;
use particlegs_core::{Error, Hint, Result};
use particlegs_files::input::read_own;
use particlegs_files::output;
use particlegs_particles::blocks::{KdTree, SnapshotScan};
use particlegs_particles::{LayeredParticles, RUN};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The request of a caller.
pub struct Task<'a> {
    /// Whether blocks can open the snapshot again, and read any part of it. If not, its particles are sorted into
    /// blocks now.
    pub reopened: bool,
    /// As for [`crate::compress`]; the memory is that of a task.
    pub options: &'a Options,
    /// Description of the snapshot by which it is opened again: the caller's own.
    pub snapshot: serde_json::Value,
    /// Its name in errors.
    pub place: &'a str,
    /// Whether another plan in the folder is given up, with all that was done for it.
    pub replace: bool,
}

/// Runs a chunk has at most: 33 million particles.
const MOST_RUNS: u64 = 512;
/// A snapshot is cut into this many chunks before they grow.
const CHUNKS: u64 = 32;
/// Memory of a task where none is given.
const MEMORY: u64 = 4 << 30;
/// Blocks read a snapshot where it lies if together they read it no more than this often.
const READ_AGAIN: f64 = 2.0;

impl JobFolder {
    /// Plans a job in `folder`: reads the snapshot once, then writes the manifest, whole or not at all.
    /// The same plan again changes nothing.
    pub fn plan(
        mut source: LayeredParticles,
        task: &Task<'_>,
        folder: &Path,
        context: &Context<'_>,
    ) -> Result<JobFolder> {
        task.options.check()?;
        if task.options.target.goal().is_some() {
            let hint = Hint::from("use a size, a ratio or a number of Gaussians; ").command("compress", "");
            let message = "a job cannot search for a quality, which depends on all blocks together";
            return Err(Error::argument_with(message, hint.words(" accepts a quality target")));
        }
        check_folder(folder)?;
        let mut fields = FieldPlan::default();
        let Options { fields: names, star_forming, .. } = task.options;
        if !names.is_empty() {
            let counts: Vec<u64> = source.layers.iter().map(|l| l.layer.content).collect();
            let (names, layers) = ((&names[..], *star_forming), (&source.fields[..], &counts[..]));
            fields = FieldPlan::new(names, layers, &source.meta.fields, false, task.options.law())?;
            // The plan notes the snapshot's fields as omitted: those that the model gets are none of them.
            source.meta.fields.clone_from(&fields.omitted);
        }
        let load = MemoryLoad {
            fields: fields.bytes(source.layers.iter().map(|l| l.layer.content)),
            ..task.options.load(source.count(), source.raw_bytes(), COPIES)
        };
        let blocks = task.options.tasks_of(&load, MEMORY)?;
        let mut scan = SnapshotScan::new(&source, task.place, blocks != 1, context)?;
        scan.settle(&mut source);
        // Weights that are all the same have just been dropped: then particles count alike.
        fields.quantities.iter_mut().for_each(|q| q.by_mass = source.has_weights());
        let mut plan = CompressionPlan::new(task.options, &source, &scan, blocks, context)?;
        plan.notes.splice(0..0, std::mem::take(&mut fields.notes));
        let (runs, memory) = (scan.runs.len() as u64, task.options.memory);
        let within = memory.map_or(MOST_RUNS, |m| (m / bucketed_run(&fields)).max(1));
        let chunk_runs = runs.div_ceil(CHUNKS).clamp(1, MOST_RUNS.min(within));
        let scattered = !task.reopened || reads(&plan.tree, &scan) > READ_AGAIN;
        let manifest = Manifest {
            particlegs_job: VERSION,
            snapshot: task.snapshot.clone(),
            plan,
            fields,
            origin: source.origin,
            chunk_runs,
            chunks: if scattered { runs.div_ceil(chunk_runs) } else { 0 },
            memory,
        };
        let text = manifest.text();
        let before = is_there(folder, &text, task.replace)?;
        let id = *blake3::hash(text.as_bytes()).as_bytes();
        let starts = manifest.layer_runs();
        let job = JobFolder { folder: folder.to_path_buf(), manifest, id, starts, runs: scan.runs, before };
        let written = write(&job, (!task.reopened).then_some(&source), &text, context);
        // The files of a plan that was there before are kept, whatever failed now.
        if written.is_err() && !before {
            clear(folder)?;
        }
        written.map(|()| job)
    }
}

/// Writes the files of a plan, the manifest last; chunks too where `source` is only here.
fn write(job: &JobFolder, source: Option<&LayeredParticles>, text: &str, context: &Context<'_>) -> Result<()> {
    let folder = &job.folder;
    make_folder(&folder.join("blocks"))?;
    make_folder(&folder.join("scatter"))?;
    runs::write(&folder.join("runs.bin"), &job.id, &job.runs)?;
    if let Some(source) = source {
        output::check_space_in(folder, job.scatter_bytes())?;
        // Chunks that an interrupted run has sorted for the same plan stay.
        (0..job.manifest.chunks).try_for_each(|c| match Buckets::open(job, c) {
            Ok(_) => Ok(()),
            Err(_) => job.bucket(source, c, context),
        })?;
    }
    output::write_bytes(&folder.join("plan.json"), text.as_bytes())
}

/// Removes a plan and the files of its tasks; the plan first, so that no half of it is taken for one. Files of other
/// names stay.
fn clear(folder: &Path) -> Result<()> {
    let removed = |path: &Path, done: std::io::Result<()>| match done {
        Err(e) if !matches!(e.kind(), ErrorKind::NotFound | ErrorKind::DirectoryNotEmpty) => Err(Error::io(path, e)),
        _ => Ok(()),
    };
    let remove = |path: PathBuf| removed(&path, std::fs::remove_file(&path));
    ["plan.json", "runs.bin"].iter().try_for_each(|name| remove(folder.join(name)))?;
    for name in ["blocks", "scatter"] {
        let within = folder.join(name);
        let entries = std::fs::read_dir(&within).into_iter().flatten().flatten();
        entries.map(|e| e.path()).filter(|path| is_piece(path)).try_for_each(remove)?;
        removed(&within, std::fs::remove_dir(&within))?;
    }
    Ok(())
}

/// Whether a file has the name of something that a task makes, or of one on its way there.
fn is_piece(path: &Path) -> bool {
    let numbered = path.file_stem().is_some_and(|s| s.as_encoded_bytes().iter().all(u8::is_ascii_digit));
    let ending = path.extension().and_then(|e| e.to_str());
    numbered && matches!(ending, Some("pgs" | "json" | "sums" | "checkpoint" | "bin"))
        || path.file_name().is_some_and(output::is_temporary)
}

/// Whether this very plan is in the folder. Another one goes if it may.
fn is_there(folder: &Path, text: &str, replace: bool) -> Result<bool> {
    match read_own(&folder.join("plan.json"), FORM) {
        Ok(None) => Ok(false),
        Ok(Some(existing_text)) if existing_text == text.as_bytes() => Ok(true),
        Ok(Some(existing_text)) if replace && is_plan(&existing_text) => clear(folder).map(|()| false),
        _ => Err(Error::output(
            folder,
            "the folder already contains another plan",
            "use another folder, or replace the plan",
        )),
    }
}

/// Whether this is a plan, of whatever version.
fn is_plan(text: &[u8]) -> bool {
    serde_json::from_slice::<serde_json::Value>(text).is_ok_and(|v| v.get("particlegs_job").is_some())
}

/// Number of times that the snapshot is read if every block reads the runs that reach into it.
fn reads(tree: &KdTree, scan: &SnapshotScan) -> f64 {
    let touched: usize = scan.runs.iter().map(|r| tree.blocks_in(r.min, r.max).len()).sum();
    touched as f64 / scan.runs.len().max(1) as f64
}

/// Checks that the folder is a job's or empty, and makes it if it is not there.
fn check_folder(folder: &Path) -> Result<()> {
    // What engines say of their tasks goes to `logs`.
    const OURS: [&str; 5] = ["plan.json", "runs.bin", "blocks", "scatter", "logs"];
    make_folder(folder)?;
    let ours = |name: std::ffi::OsString| {
        OURS.iter().any(|o| name == *o) || name.to_string_lossy().starts_with(".particlegs-")
    };
    let mut entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?.filter_map(|e| e.ok());
    match entries.find(|e| !ours(e.file_name())) {
        None => output::check_writable(&folder.join("plan.json")),
        Some(other) => {
            let message = format!("the folder contains `{}`", other.file_name().to_string_lossy());
            Err(Error::output(folder, message, "use a new or empty folder"))
        }
    }
}

fn make_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))
}

/// Copies of a block's particles that a task holds: as gathered, and the fit's.
const COPIES: u64 = 2;
/// Bytes of a particle in a chunk while it is bucketed: as read, sorted, and its order.
const BUCKETED: u64 = 40;

/// Fields of 256 x 256 x 256 cells, two and as f64, while the blocks' sums are added up.
const ADDED_UP: u64 = 500 << 20;

/// Bytes that a run takes while it is bucketed, with its fields.
fn bucketed_run(fields: &FieldPlan) -> u64 {
    let widest = (0..fields.layers.len()).map(|l| fields.particle_bytes(l)).max().unwrap_or(0);
    (BUCKETED + widest) * RUN as u64
}

impl JobFolder {
    fn load(&self) -> MemoryLoad {
        let plan = &self.manifest.plan;
        MemoryLoad {
            count: plan.metadata.count,
            raw_bytes: plan.raw_bytes(),
            target: plan.recipe().target,
            effort: plan.recipe().effort,
            copies: COPIES,
            measuring: plan.certificate == CertificateLevel::Blocks,
            fields: self.manifest.fields.bytes(plan.layers.iter().map(|l| l.content)),
        }
    }

    /// Bytes of memory that a block or a chunk takes, whichever is larger: an estimate from above.
    pub fn task_bytes(&self) -> u64 {
        let m = &self.manifest;
        let chunk = if m.chunks > 0 { m.chunk_runs.saturating_mul(bucketed_run(&m.fields)) } else { 0 };
        self.load().task_bytes(u64::from(m.plan.recipe().blocks)).max(chunk)
    }

    /// Bytes of memory that the merge takes; where the model is measured, with all particles in memory.
    pub fn merge_bytes(&self) -> u64 {
        let plan = &self.manifest.plan;
        if plan.certificate == CertificateLevel::Blocks {
            return self.load().merge_bytes(false).saturating_add(ADDED_UP);
        }
        let measured = plan.certificate.measures();
        let particles = if measured { plan.column_bytes() } else { 0 };
        self.load().merge_bytes(measured).saturating_add(particles)
    }
}
