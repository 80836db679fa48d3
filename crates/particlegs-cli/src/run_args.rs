//! Options of long runs: time limit, checkpoint and log. Shared by `compress` and `finetune`.

use crate::common::CommandContext;
use crate::outputs::{LOG, PNG, SVG};
use crate::train_log::{curves, logged};
use clap::{Args, ValueHint};
use particlegs_compress::{Checkpoint, CompressedModel};
use particlegs_core::checkpoint::{CheckpointStore, NoCheckpoints};
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_files::output;
use particlegs_measure::score::Assessment;
use particlegs_train::Limits;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Share of --minutes reserved for coding and measuring ...
const SHARE_AFTER: f64 = 0.1;
/// ... and its limit in seconds.
const MOST_AFTER: f64 = 60.0;

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Training")]
pub struct RunArgs {
    /// Time limit for the whole run, in minutes.
    ///
    /// Training ends when a tenth of the time, at most one minute, is left for coding and measuring. The
    /// learning rates decrease so that they reach their final values by then.
    #[arg(long, value_name = "M", hide_short_help = true)]
    minutes: Option<f64>,
    /// Continue an interrupted run of the same command from OUTPUT.checkpoint.
    #[arg(long, hide_short_help = true)]
    resume: bool,
    /// Write a training log as JSON lines, and its curves beside it as SVG and PNG.
    #[arg(long, value_name = "FILE.jsonl", hide_short_help = true, value_hint = ValueHint::FilePath)]
    log: Option<PathBuf>,
}

impl RunArgs {
    /// Limits of training in a command that started at `began`; scratch files go to `scratch`.
    pub fn limits(&self, began: Instant, scratch: PathBuf) -> Result<Limits> {
        if self.minutes.is_some_and(|m| !(m > 0.0 && m.is_finite())) {
            return Err(Error::argument("--minutes must be positive"));
        }
        let seconds = self.minutes.map(|m| 60.0 * m - (60.0 * m * SHARE_AFTER).min(MOST_AFTER));
        Ok(Limits { began, seconds, scratch: Some(scratch), ..Limits::default() })
    }

    /// Does it continue from a checkpoint?
    pub fn goes_on(&self) -> bool {
        self.resume
    }

    /// Declares the checkpoint, the log and its curves as outputs beside the model. Only `force` discards files of an
    /// interrupted run.
    pub fn plan(&self, output: &Path, force: bool, context: &CommandContext) -> Result<()> {
        match checkpoint_path(output)? {
            Some(path) => {
                context.finishes_its_steps();
                context.writes(&path, &Checkpoint::KIND)?;
                if path.exists() && !self.resume && !force {
                    let hint = "continue with --resume, or begin again with --force";
                    return Err(Error::output(&path, "left by an interrupted run", hint));
                }
            }
            None if self.resume => return Err(Error::argument("--resume needs an output that is a file")),
            None => context.message("note: the output is not a file, so a stopped run leaves no checkpoint"),
        }
        let Some(log) = &self.log else { return Ok(()) };
        context.writes(log, &LOG)?;
        for curve in curves(log)? {
            context.writes(&curve, if curve.extension().is_some_and(|e| e == "svg") { &SVG } else { &PNG })?;
        }
        Ok(())
    }

    /// The checkpoint beside `output` of the work with this id; none if the output is a stream.
    pub fn checkpoint(&self, output: &Path, whose: &[u8; 32]) -> Result<Option<Checkpoint>> {
        let Some(path) = checkpoint_path(output)? else { return Ok(None) };
        let place = path.display().to_string();
        if !self.resume {
            return Ok(Some(Checkpoint::fresh(path, whose)));
        }
        let hint = "begin again with --force instead of --resume".into();
        if !path.exists() {
            return Err(Error::Argument { what: format!("{place}: no checkpoint to continue from"), hint });
        }
        let checkpoint = Checkpoint::open(path, whose)?;
        match checkpoint.fault() {
            None => Ok(Some(checkpoint)),
            Some(fault) => Err(Error::input_with(&place, fault, hint)),
        }
    }

    /// Does the work with its log and checkpoint, and writes the model to `output`. If it is stopped, the checkpoint
    /// stays, and an error says so.
    pub fn run(
        &self,
        output: &Path,
        context: &CommandContext,
        mut checkpoint: Option<Checkpoint>,
        work: impl FnOnce(&mut dyn CheckpointStore, &Context<'_>) -> Result<CompressedModel>,
    ) -> Result<CompressedModel> {
        let done = self.work(context, checkpoint.as_mut(), work)?;
        context.notes(&done.notes);
        if !done.stopped {
            context.check()?;
        }
        output::write_bytes(output, &done.bytes)?;
        if done.stopped {
            let output = output.display();
            let what = format!("{output} is the best model so far; to continue, run the same command with --resume");
            context.message(&format!("stopped: {what}"));
            return Err(Error::Cancelled);
        }
        checkpoint.map_or(Ok(()), Checkpoint::remove)?;
        Ok(done)
    }

    fn work(
        &self,
        context: &CommandContext,
        mut checkpoint: Option<&mut Checkpoint>,
        work: impl FnOnce(&mut dyn CheckpointStore, &Context<'_>) -> Result<CompressedModel>,
    ) -> Result<CompressedModel> {
        let mut none = NoCheckpoints;
        let pieces: &mut dyn CheckpointStore = match &mut checkpoint {
            Some(c) => *c,
            None => &mut none,
        };
        let done = match &self.log {
            Some(log) => logged(log, self.resume, context, |context| work(pieces, context)),
            None => work(pieces, context),
        };
        let Some(checkpoint) = checkpoint else { return done };
        match &done {
            Ok(done) if done.stopped => checkpoint.save()?,
            Ok(_) => {}
            Err(error) => {
                // Report the first error.
                if let Err(e) = checkpoint.save() {
                    context.message(&format!("warning: the checkpoint was not saved: {e}"));
                } else if matches!(error, Error::Cancelled) && !checkpoint.is_empty() {
                    context.message("stopped: to continue, run the same command with --resume");
                }
            }
        }
        done
    }
}

/// Path of the checkpoint; `None` if the output is a stream.
fn checkpoint_path(output: &Path) -> Result<Option<PathBuf>> {
    if output::is_stream(output)? {
        return Ok(None);
    }
    let mut path = output.to_path_buf().into_os_string();
    path.push(".checkpoint");
    Ok(Some(PathBuf::from(path)))
}

pub fn trained(done: &CompressedModel) -> String {
    let mut text = String::new();
    for t in &done.trained {
        let run = if t.run.is_empty() { String::new() } else { format!(" {}", t.run) };
        let steps = match t.iterations == t.of {
            true => format!("{} steps", t.of),
            false => format!("{} of {} steps, ended by the time limit", t.iterations, t.of),
        };
        text += &format!("\ntrained{run}: {steps}");
        if let [Some(before), Some(after)] = t.scores {
            text += &format!(", {before:.2} to {after:.2} dB masked PSNR on held-out views, before coding");
        }
        if t.not_finite > 0 {
            text += &format!("; gradients were not finite in {} steps", t.not_finite);
        }
    }
    text
}

pub fn report(output: &Path, done: &CompressedModel, verdict: &[Assessment], seconds: f64) -> serde_json::Value {
    let (bytes, raw_bytes) = (done.bytes.len(), done.model.raw_bytes());
    json!({
        "output": output.to_string_lossy(), "gaussians": done.model.gaussians(), "model_bytes": bytes,
        "raw_bytes": raw_bytes, "compression_ratio": raw_bytes as f64 / bytes as f64,
        "step_factor": done.step_factor, "trained": done.trained, "seconds": seconds,
        "seconds_by_phase": done.seconds.iter().copied().collect::<BTreeMap<_, _>>(),
        "certificate": done.model.certificate, "verdict": verdict,
    })
}
