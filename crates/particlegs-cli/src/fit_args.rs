//! What a model is to be: target, effort, what it stores. The same for `compress` and `plan`.

use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use crate::train_args::TrainArgs;
use clap::{Args, ValueEnum};
use particlegs::compress::{Options, Target};
use particlegs::fit::Effort;
use particlegs::{Error, Result};

/// What a model is to be.
#[derive(Args, Clone, Debug)]
pub struct FitArgs {
    #[command(flatten)]
    target: TargetArgs,
    /// Effort of the fit.
    ///
    /// docs/guide/choosing.md says when to use which.
    #[arg(long, value_enum, value_name = "LEVEL", default_value_t = EffortArg::Default)]
    effort: EffortArg,
    /// Particle radius to store as the default, world units [default: 0.0406 of the mean spacing].
    #[arg(long, value_name = "R", hide_short_help = true)]
    radius: Option<f64>,
    /// Particle opacity to store as the default, in (0, 1] [default: 0.05].
    #[arg(long, value_name = "A", hide_short_help = true)]
    opacity: Option<f64>,
    /// Do not measure the decoded model: the file holds no scores.
    #[arg(long, hide_short_help = true)]
    no_certificate: bool,
    #[command(flatten)]
    pub train: TrainArgs,
}

/// One target at most.
#[derive(Args, Clone, Debug)]
#[group(multiple = false)]
struct TargetArgs {
    /// Compression ratio to reach [default: 300, less for small snapshots].
    ///
    /// The size of the particles as float32, 12 bytes each (16 with weights), divided by the file size.
    #[arg(long, value_name = "R")]
    ratio: Option<f64>,
    /// File size to reach, such as 11MB, 900kB or 1.5GiB.
    #[arg(long, value_name = "SIZE")]
    size: Option<String>,
    /// Number of Gaussians, stored at the nominal precision.
    #[arg(long, value_name = "K")]
    gaussians: Option<u64>,
    /// Masked PSNR to reach, in dB.
    ///
    /// Of the style `expected`, averaged over held-out views.
    #[arg(long, value_name = "DB")]
    psnr: Option<f64>,
}

/// Effort on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum EffortArg {
    /// Partition only: ten times as fast; at ratio 300 and above it has fewer small groups.
    Fast,
    /// Partition, then refinement by expectation maximisation.
    Default,
    /// Refinement for longer; the scores are no better than those of default in any measured table.
    High,
}

impl TargetArgs {
    fn target(&self) -> Result<Target> {
        match (self.ratio, &self.size, self.gaussians, self.psnr) {
            (Some(r), ..) => Target::Ratio(r).check(),
            (_, Some(s), ..) => Target::parse_size(s),
            (_, _, Some(k), _) => Target::Gaussians(k).check(),
            (.., Some(d)) => Target::Psnr(d).check(),
            _ => Ok(Target::Default),
        }
    }

    /// As stored in the file.
    fn text(&self) -> String {
        match (self.ratio, &self.size, self.gaussians, self.psnr) {
            (Some(r), ..) => format!(" --ratio {r}"),
            (_, Some(s), ..) => format!(" --size {s}"),
            (_, _, Some(k), _) => format!(" --gaussians {k}"),
            (.., Some(d)) => format!(" --psnr {d}"),
            _ => String::new(),
        }
    }
}

impl FitArgs {
    /// For pictures alone?
    pub fn is_fast(&self) -> bool {
        self.effort == EffortArg::Fast
    }

    /// The options of a job in one block, in memory.
    pub fn options(
        &self,
        snapshot: &SnapshotArgs,
        (selection, window): (&SelectionArgs, &WindowArgs),
        seed: u64,
    ) -> Result<Options> {
        for (name, value) in [("--radius", self.radius), ("--opacity", self.opacity)] {
            if value.is_some_and(|v| !(v > 0.0 && v.is_finite())) {
                return Err(Error::argument(format!("{name} must be positive")));
            }
        }
        if self.opacity.is_some_and(|a| a > 1.0) {
            return Err(Error::argument("--opacity must be above 0 and at most 1"));
        }
        let (effort, name) = match self.effort {
            EffortArg::Fast => (Effort::Fast, "fast"),
            EffortArg::Default => (Effort::Default, "default"),
            EffortArg::High => (Effort::High, "high"),
        };
        let mut command = format!("compress{} --effort {name} --seed {seed}", self.target.text());
        command += &self.train.text()?;
        command += &snapshot.text();
        command += &selection.text(window);
        for (option, value) in [("radius", self.radius), ("opacity", self.opacity)] {
            if let Some(v) = value {
                command += &format!(" --{option} {v}");
            }
        }
        Ok(Options {
            target: self.target.target()?,
            effort,
            radius: self.radius,
            opacity: self.opacity,
            training: self.train.config()?,
            seed,
            certificate: !self.no_certificate,
            command,
            ..Options::default()
        })
    }
}
