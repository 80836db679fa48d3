//! Options of long runs: time limit, checkpoint and log. Shared by `compress` and `finetune`.

use clap::{Args, ValueHint};
use particlegs::RunOptions;
use particlegs_compress::CompressedModel;
use particlegs_measure::score::Assessment;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

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
    /// The options of a run; `replace` is that of --force.
    pub fn options(&self, replace: bool) -> RunOptions {
        RunOptions {
            minutes: self.minutes,
            resume: self.resume,
            replace,
            log: self.log.clone(),
            ..RunOptions::default()
        }
    }
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
