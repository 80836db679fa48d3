//! Long runs: how long they may take, what they go on from, what they say. The same for `compress` and
//! `finetune`.

use crate::common::Context;
use crate::train_log::logged;
use clap::Args;
use particlegs::compress::{Checkpoint, Compressed, Found};
use particlegs::fit::{NoPieces, Pieces};
use particlegs::progress::Progress;
use particlegs::train::Limits;
use particlegs::{Error, Result};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Share of --minutes that is left for coding and measuring ...
const SHARE_AFTER: f64 = 0.1;
/// ... and seconds that it is at most.
const MOST_AFTER: f64 = 60.0;

/// A long run.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Training")]
pub struct RunArgs {
    /// Be done after about so many minutes, all in all: training ends when a tenth of them (a minute
    /// at most) is left; its rates fall so that they are at their end by then.
    #[arg(long, value_name = "M")]
    minutes: Option<f64>,
    /// Go on from OUTPUT.checkpoint, which an interrupted run of the same command left.
    #[arg(long)]
    resume: bool,
    /// Log of the training, JSON lines, and its curves beside it as SVG and PNG (default: none).
    #[arg(long, value_name = "FILE.jsonl")]
    log: Option<PathBuf>,
}

impl RunArgs {
    /// How far training goes in a command that began at `began`; scratch files go to `scratch`.
    ///
    /// # Errors
    /// [`Error::Argument`].
    pub fn limits(&self, began: Instant, scratch: PathBuf) -> Result<Limits> {
        if self.minutes.is_some_and(|m| !(m > 0.0 && m.is_finite())) {
            return Err(Error::argument("--minutes must be positive"));
        }
        let seconds = self.minutes.map(|m| 60.0 * m - (60.0 * m * SHARE_AFTER).min(MOST_AFTER));
        Ok(Limits { began, seconds, scratch: Some(scratch), run: String::new() })
    }

    /// The checkpoint beside `output` of the work that `whose` names.
    ///
    /// # Errors
    /// [`Error::Input`], [`Error::Argument`] where there is none to go on from.
    pub fn checkpoint(&self, output: &Path, whose: &[u8; 32], context: &Context) -> Result<Checkpoint> {
        let mut path = output.to_path_buf().into_os_string();
        path.push(".checkpoint");
        let path = PathBuf::from(path);
        let place = path.display().to_string();
        if !self.resume {
            if path.exists() {
                context.message(&format!("note: {place}, which --resume would have gone on from, is given up"));
            }
            return Ok(Checkpoint::fresh(path, whose));
        }
        let checkpoint = Checkpoint::open(path, whose)?;
        let hint = "without --resume the run begins anew";
        match checkpoint.found() {
            Found::Ours => Ok(checkpoint),
            Found::Nothing => {
                Err(Error::Argument { what: format!("{place}: there is no checkpoint"), hint: hint.into() })
            }
            Found::Broken => Err(Error::input_hint(&place, "half-written or changed: no checkpoint", hint)),
            Found::Other => Err(Error::input_hint(&place, "of another command, snapshot or configuration", hint)),
        }
    }

    /// Does the work, with its log and its checkpoint. The checkpoint stays where the work ends early.
    ///
    /// # Errors
    /// Those of the work.
    pub fn run(
        &self,
        context: &Context,
        mut checkpoint: Option<&mut Checkpoint>,
        work: impl FnOnce(&mut dyn Pieces, &dyn Progress) -> Result<Compressed>,
    ) -> Result<Compressed> {
        let mut none = NoPieces;
        let pieces: &mut dyn Pieces = match &mut checkpoint {
            Some(c) => *c,
            None => &mut none,
        };
        let done = match &self.log {
            Some(log) => logged(log, self.resume, context, |progress| work(pieces, progress)),
            None => work(pieces, context),
        };
        let Some(checkpoint) = checkpoint else { return done };
        match &done {
            Ok(done) if done.stopped => checkpoint.save()?,
            Ok(_) => {}
            Err(error) => {
                // What went wrong first is the error.
                if let Err(e) = checkpoint.save() {
                    context.message(&format!("warning: the checkpoint was not saved: {e}"));
                } else if matches!(error, Error::Cancelled) && !checkpoint.is_empty() {
                    context.message("stopped: the same command with --resume goes on");
                }
            }
        }
        done
    }
}

/// Says of a run that was stopped what there is.
pub fn stopped(output: &Path, context: &Context) -> Error {
    let output = output.display();
    context.message(&format!("stopped: {output} holds the best so far; the same command with --resume goes on"));
    Error::Cancelled
}

/// How the training runs went, a line each.
pub fn trained(done: &Compressed) -> String {
    let mut text = String::new();
    for t in &done.trained {
        let run = if t.run.is_empty() { String::new() } else { format!(" {}", t.run) };
        let steps = match t.iterations == t.of {
            true => format!("{} steps", t.of),
            false => format!("{} of {} steps, then the time was up", t.iterations, t.of),
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
