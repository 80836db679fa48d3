//! Long runs that write a model: with a time limit, a checkpoint and a log.

use crate::training_log::{curves, logged};
use crate::{CompressOptions, Context, Error, Hint, Model, Particles, Result, Snapshot, Storage};
use particlegs_compress::{Checkpoint, CompressedModel, Compression, FineTuning};
use particlegs_core::checkpoint::{CheckpointStore, NoCheckpoints};
use particlegs_core::codec;
use particlegs_core::model::LawKind;
use particlegs_files::model_file;
use particlegs_files::output::{self, Outputs, kinds};
use particlegs_train::{Accelerator, Limits};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Share of the time limit reserved for coding and measuring ...
const SHARE_AFTER: f64 = 0.1;
/// ... and its limit in seconds.
const MOST_AFTER: f64 = 60.0;

/// Limits of a long run, and the files that it keeps.
#[derive(Clone, Default)]
pub struct RunOptions {
    /// Time limit of the whole run, minutes. Training ends when a tenth of it, at most one minute, is left.
    pub minutes: Option<f64>,
    /// Whether an interrupted run of the same work is continued from `OUTPUT.checkpoint`.
    pub resume: bool,
    /// Whether an existing model and the checkpoint of an interrupted run are replaced.
    pub replace: bool,
    /// A log of the training as JSON lines; its curves are drawn beside it.
    pub log: Option<PathBuf>,
    /// Folder of scratch files; `None` for that of the output.
    pub scratch: Option<PathBuf>,
    /// The GPU that trains; `None` for the CPU.
    pub device: Option<Arc<dyn Accelerator>>,
}

/// A model that was written.
pub struct ModelOutput {
    /// The model, and how it was made.
    pub made: CompressedModel,
    /// Whether the file was there already, made from the same snapshot with the same options.
    pub existing: bool,
    /// The particles that it was made from.
    pub particles: Particles,
}

impl RunOptions {
    fn limits(&self, began: Instant, out: &Path) -> Result<Limits> {
        if self.minutes.is_some_and(|m| !(m > 0.0 && m.is_finite())) {
            return Err(Error::argument("the minutes of a run must be positive"));
        }
        let seconds = self.minutes.map(|m| 60.0 * m - (60.0 * m * SHARE_AFTER).min(MOST_AFTER));
        let (scratch, device) = (Some(self.scratch_folder(out)), self.device.clone());
        Ok(Limits { began, seconds, scratch, device, ..Limits::default() })
    }

    fn scratch_folder(&self, out: &Path) -> PathBuf {
        self.scratch.clone().unwrap_or_else(|| output::scratch_folder(out))
    }

    /// Declares the checkpoint, the log and its curves as outputs beside the model.
    fn plan(&self, out: &Path, outputs: &Outputs, context: &Context<'_>) -> Result<()> {
        match checkpoint_path(out)? {
            Some(path) => {
                outputs.writes(&path, &Checkpoint::KIND, context)?;
                if path.exists() && !self.resume && !self.replace {
                    let hint = Hint::from("continue with ").option("resume", "").words(", or begin again with ");
                    return Err(Error::output(&path, "left by an interrupted run", hint.option("force", "")));
                }
            }
            None if self.resume => return Err(Error::argument("a run is continued beside an output that is a file")),
            None => context.note("the output is not a file, so a stopped run leaves no checkpoint"),
        }
        let Some(log) = &self.log else { return Ok(()) };
        outputs.writes(log, &kinds::LOG, context)?;
        for curve in curves(log)? {
            let is_svg = curve.extension().is_some_and(|e| e == "svg");
            outputs.writes(&curve, if is_svg { &kinds::SVG } else { &kinds::PNG }, context)?;
        }
        Ok(())
    }

    /// The checkpoint beside `out` of the work with this id; none if the output is a stream.
    fn checkpoint(&self, out: &Path, id: &[u8; 32]) -> Result<Option<Checkpoint>> {
        let Some(path) = checkpoint_path(out)? else { return Ok(None) };
        let place = path.display().to_string();
        if !self.resume {
            return Ok(Some(Checkpoint::fresh(path, id)));
        }
        let hint = || Hint::from("begin again with ").option("force", "").words(" instead of ").option("resume", "");
        if !path.exists() {
            return Err(Error::argument_with(format!("{place}: no checkpoint to continue from"), hint()));
        }
        let checkpoint = Checkpoint::open(path, id)?;
        match checkpoint.fault() {
            None => Ok(Some(checkpoint)),
            Some(fault) => Err(Error::input_with(&place, fault, hint())),
        }
    }

    /// Does the work with its log and checkpoint, and writes the model to `out`. If it is stopped, the checkpoint
    /// stays, and an error says so.
    fn run(
        &self,
        out: &Path,
        mut checkpoint: Option<Checkpoint>,
        context: &Context<'_>,
        work: impl FnOnce(&mut dyn CheckpointStore, &Context<'_>) -> Result<CompressedModel>,
    ) -> Result<CompressedModel> {
        let done = self.work(checkpoint.as_mut(), context, work)?;
        done.notes.iter().for_each(|note| context.note(note));
        // A run that was stopped has given its best model so far, which is written although it was cancelled.
        if !done.stopped {
            context.check()?;
        }
        output::write_bytes(out, &done.bytes)?;
        if done.stopped {
            let message = "is the best model so far; to continue, run the same work with the option `resume`";
            context.message(&format!("stopped: {} {message}", out.display()));
            return Err(Error::Cancelled);
        }
        // Not before the model is written: should that fail, the run can be continued.
        checkpoint.map_or(Ok(()), Checkpoint::remove)?;
        Ok(done)
    }

    fn work(
        &self,
        mut checkpoint: Option<&mut Checkpoint>,
        context: &Context<'_>,
        work: impl FnOnce(&mut dyn CheckpointStore, &Context<'_>) -> Result<CompressedModel>,
    ) -> Result<CompressedModel> {
        let mut none = NoCheckpoints;
        let checkpoints: &mut dyn CheckpointStore = match &mut checkpoint {
            Some(c) => *c,
            None => &mut none,
        };
        let done = match &self.log {
            Some(log) => logged(log, self.resume, context, |context| work(checkpoints, context)),
            None => work(checkpoints, context),
        };
        let Some(checkpoint) = checkpoint else { return done };
        match &done {
            Ok(done) if done.stopped => checkpoint.save()?,
            Ok(_) => {}
            Err(error) => {
                // Report the first error.
                if let Err(e) = checkpoint.save() {
                    context.warn(&format!("the checkpoint was not saved: {e}"));
                } else if matches!(error, Error::Cancelled) && !checkpoint.is_empty() {
                    context.message("stopped: to continue, run the same work with the option `resume`");
                }
            }
        }
        done
    }
}

/// Path of the checkpoint; `None` if the output is a stream.
fn checkpoint_path(out: &Path) -> Result<Option<PathBuf>> {
    if output::is_stream(out)? {
        return Ok(None);
    }
    let mut path = out.to_path_buf().into_os_string();
    path.push(".checkpoint");
    Ok(Some(PathBuf::from(path)))
}

/// Compresses a snapshot into a file. A model that is there already is kept if it was made from the same snapshot with
/// the same options. Training keeps a checkpoint beside the file.
///
/// # Errors
/// As [`crate::compress`]; [`Error::Output`] for a file that may not be replaced; [`Error::Cancelled`], after which the run
/// can be continued if it trains.
pub fn compress_into(
    snapshot: &Snapshot,
    out: &Path,
    (options, run): (&CompressOptions, &RunOptions),
    outputs: &Outputs,
    context: &Context<'_>,
) -> Result<ModelOutput> {
    let began = Instant::now();
    options.check()?;
    let mut options = options.clone();
    options.limits = run.limits(began, out)?;
    options.read.extend(snapshot.options());
    snapshot.declare(outputs);
    let is_kept = outputs.writes_model(out, context)? && !run.resume;
    if options.training.is_some() {
        run.plan(out, outputs, context)?;
    } else if run.device.is_some() {
        let message = "without training a GPU has no use here: it only trains";
        return Err(Error::argument(message));
    }
    if let Some(folder) = &run.scratch {
        output::check_writable(&folder.join("scratch"))?;
    }
    // The recipe is compared before the particles are read, which may take long; their hash is compared below.
    if is_kept && !options.ask_for(&codec::read_metadata(&existing(out, context)?, &out.display().to_string())?) {
        return Err(outputs.refused(out));
    }
    if options.memory.is_some() {
        options.storage = Storage::Disk(run.scratch_folder(out));
    }
    let (particles, fields) = snapshot.read(!options.fields.is_empty(), &options.storage, context)?;
    let blocks = options.blocks_of(&particles)?;
    if options.memory.is_some() && blocks > 1 {
        options.storage.announce(&format!("{blocks} blocks"), particles.raw_bytes(), context);
    }
    if is_kept {
        let bytes = existing(out, context)?;
        let model = codec::decode_with(&bytes, &out.display().to_string(), context)?;
        if !options.made(&model.metadata, model.certificate.is_some(), &particles)? {
            return Err(outputs.refused(out));
        }
        return Ok(ModelOutput { made: CompressedModel::existing(bytes, model), existing: true, particles });
    }
    let planned = Compression::plan(&particles, &fields, &options, context)?;
    planned.notes().iter().for_each(|note| context.note(note));
    let checkpoint = match options.training {
        Some(_) => run.checkpoint(out, &planned.id())?,
        None => None,
    };
    let compressed_model =
        run.run(out, checkpoint, context, |checkpoints, context| planned.run(checkpoints, context))?;
    Ok(ModelOutput { made: compressed_model, existing: false, particles })
}

fn existing(out: &Path, context: &Context<'_>) -> Result<Vec<u8>> {
    crate::input::read_model(out, &Default::default(), context)
}

impl Model {
    /// Trains the splats of an alpha-blend model further on its snapshot, into a file, with a checkpoint beside it.
    ///
    /// # Errors
    /// [`Error::Argument`] for optical-depth models; [`Error::Input`] for another snapshot; [`Error::Output`] for a file
    /// that may not be replaced; [`Error::Memory`]; [`Error::Cancelled`], after which the run can be continued.
    pub fn finetune_into(
        &self,
        snapshot: &Snapshot,
        out: &Path,
        (options, run): (&FineTuning, &RunOptions),
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<CompressedModel> {
        let options = FineTuning { limits: run.limits(Instant::now(), out)?, ..options.clone() };
        snapshot.declare(outputs);
        // A run with a time limit cannot be compared with another.
        if outputs.writes_model(out, context)? && !run.resume {
            return Err(outputs.refused(out));
        }
        run.plan(out, outputs, context)?;
        self.info()?.left_out().iter().for_each(|note| context.note(note));
        if self.metadata().law != LawKind::AlphaBlend {
            let message = format!(
                "{}: a model of the {} law; only alpha-blend models can be fine-tuned",
                self.name(),
                self.metadata().law.name()
            );
            let hint =
                Hint::from("optical-depth blocks need no fine-tuning after a merge; compress the snapshot with ");
            return Err(Error::argument_with(message, hint.option("train", "best")));
        }
        let storage = options.memory.map_or(Storage::Memory, |_| Storage::Disk(run.scratch_folder(out)));
        let (particles, _) = snapshot.read(false, &storage, context)?;
        let of_several = model_file::is_of_several(self.bytes(), self.metadata(), self.name())?;
        let named = &particles.meta.name;
        particlegs_compress::verify::check_source(self.decoded(), of_several, &particles, named, self.name())?;
        let checkpoint = run.checkpoint(out, &options.id(self.bytes()))?;
        let (model, size) = (self.decoded(), self.bytes().len() as u64);
        run.run(out, checkpoint, context, |checkpoints, context| {
            particlegs_compress::finetune(model, size, &particles, &options, checkpoints, context)
        })
    }
}
