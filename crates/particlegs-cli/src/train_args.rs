//! Options of training and of long runs: presets, a configuration file, limits, checkpoint and log. Shared by
//! `compress`, `plan` and `finetune`.

use crate::common::{OrNone, named, named_or};
use crate::inputs::WaitNotice;
use clap::{Args, ValueEnum, ValueHint};
use particlegs::RunOptions;
use particlegs_compress::CompressedModel;
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_core::{Error, Result};
use particlegs_files::input::{Begins, Form, read_whole};
use particlegs_measure::score::Assessment;
use particlegs_train::{Config, Preset};
use serde::Deserialize;
use serde_json::json;
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Training")]
pub struct TrainArgs {
    /// Train on pictures of the particles.
    ///
    /// docs/guide/training.md describes presets, laws and hyper-parameters.
    #[arg(long, value_name = "PRESET", help_heading = None, hide_default_value = true, default_value = "none", value_parser = named_or::<Preset>("none", "No training; the default"))]
    train: OrNone<Preset>,
    /// Image law to train for [default: optical-depth, or that of --config].
    #[arg(long, value_name = "LAW", hide_short_help = true, value_parser = named::<LawKind>())]
    law: Option<LawKind>,
    #[command(flatten)]
    pub tune: TuneArgs,
}

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Training")]
pub struct TuneArgs {
    /// Training hyper-parameters as TOML; missing keys keep the values of the preset.
    ///
    /// docs/guide/training.md describes them.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath)]
    config: Option<PathBuf>,
    /// Print the hyper-parameters as TOML and exit.
    #[arg(long, value_enum, value_name = "WHICH", hide_short_help = true, num_args = 0..=1, default_missing_value = "all")]
    print_config: Option<PrintConfigArg>,
    /// Scale resolution, number of steps and counts by this factor, in (0, 1].
    #[arg(long, value_name = "S", hide_short_help = true)]
    scale: Option<f64>,
    /// Total number of training steps; the stages keep their proportions.
    #[arg(long, value_name = "N", hide_short_help = true)]
    iterations: Option<u64>,
    /// The text of --config, after reading.
    #[arg(skip)]
    file: OnceCell<String>,
}

const FILE: Form = Form { title: "a configuration in TOML", begins: Begins::Text, most: 1 << 20, expansion: 32 };

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PrintConfigArg {
    /// All hyper-parameters.
    All,
    /// Only those that differ from the preset.
    Changed,
}

impl TrainArgs {
    /// The preset; `None` = no training. A configuration file without a preset changes `fast`.
    fn preset(&self) -> Option<Config> {
        let changed = self.tune.config.is_some() || self.tune.print_config.is_some();
        let preset = self.train.or(changed.then_some(Preset::Fast))?;
        Some(Config::preset(preset, self.law.unwrap_or(LawKind::OpticalDepth)))
    }

    pub fn config(&self) -> Result<Option<Config>> {
        if let Some(preset) = self.preset() {
            return self.tune.config(preset, self.law).map(Some);
        }
        if self.tune.scale.is_some() || self.tune.iterations.is_some() || self.law.is_some() {
            return Err(Error::argument("--law, --scale and --iterations need --train fast|best|paper, or --config"));
        }
        Ok(None)
    }

    /// The hyper-parameters as TOML, for --print-config.
    pub fn printed(&self) -> Result<Option<String>> {
        self.preset().map_or(Ok(None), |preset| self.tune.printed(preset, self.law))
    }
}

impl TuneArgs {
    pub fn config_file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn text_of(&self, path: &Path) -> Result<&str> {
        if let Some(text) = self.file.get() {
            return Ok(text);
        }
        let bytes = read_whole(path, FILE, &Context::SILENT.with_sink(&WaitNotice))?;
        let text = String::from_utf8(bytes).map_err(|_| Error::input(path, "not UTF-8 text"))?;
        Ok(self.file.get_or_init(|| text))
    }

    /// `preset` changed by the file, then by the other options; `law` is the required law, if any.
    pub fn config(&self, preset: Config, law: Option<LawKind>) -> Result<Config> {
        let mut config = preset;
        if let Some(path) = &self.config {
            let text = self.text_of(path)?;
            let changes: toml::Table = toml::from_str(text).map_err(|e| {
                // toml says at which byte; people look for a line.
                let line = e.span().map_or(1, |s| 1 + text[..s.start.min(text.len())].matches('\n').count());
                Error::input(path, format!("line {line}: {}", one_line(e.message())))
            })?;
            config = changed(&config, changes).map_err(|e| {
                Error::input_with(path, one_line(&e.to_string()), "--print-config prints all keys with their values")
            })?;
            if let Some(law) = law.filter(|l| *l != config.law) {
                let message = format!("law = \"{}\", but this command trains with {}", config.law.name(), law.name());
                return Err(Error::input(path, message));
            }
        }
        if let Some(scale) = self.scale {
            config = config.scaled(scale).map_err(|e| e.at("--scale"))?;
        }
        // After --scale, which would change this number, too.
        if let Some(n) = self.iterations {
            config = config.with_iterations(n).map_err(|e| e.at("--iterations"))?;
        }
        config.check()?;
        Ok(config)
    }

    /// The hyper-parameters as TOML, for --print-config.
    pub fn printed(&self, preset: Config, law: Option<LawKind>) -> Result<Option<String>> {
        let Some(which) = self.print_config else { return Ok(None) };
        let mut all = table(&self.config(preset.clone(), law)?)?;
        if which == PrintConfigArg::Changed {
            all = differing(all, &table(&preset)?);
        }
        toml::to_string(&all).map(Some).map_err(|e| Error::argument(e.to_string()))
    }
}

/// The first line of an error, and the rest in brief.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn changed(config: &Config, changes: toml::Table) -> std::result::Result<Config, toml::de::Error> {
    let mut all = toml::Table::try_from(config).map_err(serde::de::Error::custom)?;
    overlay(&mut all, changes);
    Config::deserialize(toml::Value::Table(all))
}

fn table(config: &Config) -> Result<toml::Table> {
    toml::Table::try_from(config).map_err(|e| Error::argument(e.to_string()))
}

fn overlay(all: &mut toml::Table, changes: toml::Table) {
    for (key, value) in changes {
        match (all.get_mut(&key), value) {
            (Some(toml::Value::Table(base)), toml::Value::Table(more)) => overlay(base, more),
            (_, value) => {
                all.insert(key, value);
            }
        }
    }
}

/// The values of `all` that `other` does not have.
fn differing(all: toml::Table, other: &toml::Table) -> toml::Table {
    let mut out = toml::Table::new();
    for (key, value) in all {
        match (value, other.get(&key)) {
            (value, Some(same)) if value == *same => {}
            (toml::Value::Table(table), Some(toml::Value::Table(other_table))) => {
                out.insert(key, toml::Value::Table(differing(table, other_table)));
            }
            (value, _) => {
                out.insert(key, value);
            }
        }
    }
    out
}

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

/// A line for each training of a run.
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

/// A run as JSON.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_lie_over_the_preset_and_come_out_again() {
        let config = Config::preset(Preset::Fast, LawKind::OpticalDepth);
        let changes: toml::Table = toml::from_str("[loss]\nsmooth = 0.5\n[optical_depth.rates]\ncount = 0.0").unwrap();
        let changed = changed(&config, changes.clone()).unwrap();
        let all = table(&changed).unwrap();
        assert_eq!((changed.loss.smooth, changed.optical_depth.rates.count), (0.5, 0.0));
        assert_eq!(changed.cameras, config.cameras);
        assert_eq!(differing(all, &table(&config).unwrap()), changes);
    }
}
