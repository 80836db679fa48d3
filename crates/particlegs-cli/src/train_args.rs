//! How a fit is trained further: presets, a configuration file, limits. The same for `compress` and
//! `plan`.

use clap::{Args, ValueEnum};
use particlegs::model::Law;
use particlegs::train::{Config, Preset};
use particlegs::{Error, Result};
use serde::Deserialize;
use std::path::PathBuf;

/// Training.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Training")]
pub struct TrainArgs {
    /// Train the fitted Gaussians on pictures of the particles.
    #[arg(long, value_enum, default_value_t = TrainArg::None)]
    train: TrainArg,
    /// Image law to train by.
    #[arg(long, value_enum, default_value_t = LawArg::OpticalDepth)]
    law: LawArg,
    /// Hyper-parameters in TOML; what it leaves out is the preset's.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print the hyper-parameters as TOML and stop: all of them, or those that differ from the preset.
    #[arg(long, value_enum, value_name = "WHICH", num_args = 0..=1, default_missing_value = "all")]
    print_config: Option<Which>,
    /// Shrink resolution, steps and counts in proportion, in (0, 1].
    #[arg(long, value_name = "S")]
    scale: Option<f64>,
    /// Steps in all; stages keep their proportions.
    #[arg(long, value_name = "N")]
    iterations: Option<u64>,
}

/// Presets on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TrainArg {
    /// No training: the fit as it is.
    None,
    /// At most five minutes on two cores for a few million particles.
    Fast,
    /// At most thirty minutes.
    Best,
    /// The published recipe.
    Paper,
}

/// Laws on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LawArg {
    /// Depths add up; no order, no network.
    OpticalDepth,
    /// Sorted and blended as published, with the VizMapper.
    AlphaBlend,
}

/// What --print-config prints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Which {
    /// Every hyper-parameter.
    All,
    /// What differs from the preset.
    Changed,
}

impl TrainArgs {
    fn law(&self) -> Law {
        match self.law {
            LawArg::OpticalDepth => Law::OpticalDepth,
            LawArg::AlphaBlend => Law::AlphaBlend,
        }
    }

    /// The preset, where one is asked for; the published law's own is `paper`.
    fn preset(&self) -> Option<Preset> {
        match self.train {
            TrainArg::None if self.config.is_some() || self.print_config.is_some() => Some(Preset::Fast),
            TrainArg::None => None,
            TrainArg::Fast => Some(Preset::Fast),
            TrainArg::Best => Some(Preset::Best),
            TrainArg::Paper => Some(Preset::Paper),
        }
    }

    /// The hyper-parameters; `None` = no training.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that need --train, and where the file does not parse or holds a
    /// number out of range.
    pub fn config(&self) -> Result<Option<Config>> {
        let Some(preset) = self.preset() else {
            if self.scale.is_some() || self.iterations.is_some() || self.law != LawArg::OpticalDepth {
                return Err(Error::argument("--law, --scale and --iterations need --train fast|best|paper"));
            }
            return Ok(None);
        };
        let mut config = Config::preset(preset, self.law());
        if let Some(path) = &self.config {
            let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
            let bad = |what: String| Error::input(path, what.trim().replace('\n', " "));
            let changes: toml::Table = toml::from_str(&text).map_err(|e| bad(e.to_string()))?;
            let mut all = table(&config)?;
            overlay(&mut all, changes);
            config = Config::deserialize(toml::Value::Table(all)).map_err(|e| bad(e.to_string()))?;
        }
        if let Some(scale) = self.scale {
            config = config.scaled(scale)?;
        }
        if let Some(n) = self.iterations {
            config = config.with_iterations(n)?;
        }
        config.check()?;
        Ok(Some(config))
    }

    /// Prints the hyper-parameters where that is asked for.
    ///
    /// # Errors
    /// As [`TrainArgs::config`].
    pub fn printed(&self) -> Result<Option<String>> {
        let (Some(which), Some(config)) = (self.print_config, self.config()?) else { return Ok(None) };
        let mut all = table(&config)?;
        if which == Which::Changed {
            let preset = table(&Config::preset(self.preset().unwrap_or(Preset::Fast), self.law()))?;
            all = differing(all, &preset);
        }
        toml::to_string(&all).map(Some).map_err(|e| Error::argument(e.to_string()))
    }

    /// As stored in the file: what decides its bytes.
    pub fn text(&self) -> Result<String> {
        let Some(config) = self.config()? else { return Ok(String::new()) };
        let preset = self.train.to_possible_value().map(|v| v.get_name().to_string()).unwrap_or_default();
        let mut text = format!(" --train {preset}");
        if self.law == LawArg::AlphaBlend {
            text += " --law alpha-blend";
        }
        if self.config.is_some() {
            let all = toml::to_string(&config).map_err(|e| Error::argument(e.to_string()))?;
            text += &format!(" --config blake3:{}", particlegs::compress::name_of(&all));
        }
        for (option, value) in [("scale", self.scale), ("iterations", self.iterations.map(|n| n as f64))] {
            if let Some(v) = value {
                text += &format!(" --{option} {v}");
            }
        }
        Ok(text)
    }
}

fn table(config: &Config) -> Result<toml::Table> {
    toml::Table::try_from(config).map_err(|e| Error::argument(e.to_string()))
}

/// Puts the values of `changes` over those of `all`, table by table.
fn overlay(all: &mut toml::Table, changes: toml::Table) {
    for (key, value) in changes {
        match (all.get_mut(&key), value) {
            (Some(toml::Value::Table(own)), toml::Value::Table(more)) => overlay(own, more),
            (_, value) => {
                all.insert(key, value);
            }
        }
    }
}

/// The values of `all` that `other` has not.
fn differing(all: toml::Table, other: &toml::Table) -> toml::Table {
    let mut out = toml::Table::new();
    for (key, value) in all {
        match (value, other.get(&key)) {
            (value, Some(same)) if value == *same => {}
            (toml::Value::Table(own), Some(toml::Value::Table(theirs))) => {
                out.insert(key, toml::Value::Table(differing(own, theirs)));
            }
            (value, _) => {
                out.insert(key, value);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_lie_over_the_preset_and_come_out_again() {
        let config = Config::preset(Preset::Fast, Law::OpticalDepth);
        let mut all = table(&config).unwrap();
        let changes: toml::Table = toml::from_str("[loss]\nsmooth = 0.5\n[optical_depth.rates]\ncount = 0.0").unwrap();
        overlay(&mut all, changes.clone());
        let changed = Config::deserialize(toml::Value::Table(all.clone())).unwrap();
        assert_eq!((changed.loss.smooth, changed.optical_depth.rates.count), (0.5, 0.0));
        assert_eq!(changed.cameras, config.cameras);
        assert_eq!(differing(all, &table(&config).unwrap()), changes);
    }
}
