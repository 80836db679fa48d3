//! Options of the fit: target of size or quality, effort, certificate, fields. Shared by `compress`, `plan` and
//! `series`; `finetune` and `simplify` take the target alone.

use crate::common::named;
use crate::train_args::TrainArgs;
use clap::{Arg, Args};
use particlegs_compress::{Options, Target};
use particlegs_core::model::{CertificateLevel, Goal, GoalKind};
use particlegs_core::{Error, Result};
use particlegs_fit::Effort;
use particlegs_particles::StarFormingGas;

pub fn number_of_blocks(text: &str) -> std::result::Result<u32, String> {
    text.parse().map_err(|_| "not a number (--gadget-blocks names the blocks of a Gadget file)".to_string())
}

/// Position in the help: after the options of the fit.
pub const LATER: usize = 500;

#[derive(Args, Clone, Debug)]
#[command(mut_arg("ratio", |a| with_default(a, "300, less for small snapshots")))]
pub struct FitArgs {
    #[command(flatten)]
    target: TargetArgs,
    #[command(flatten)]
    goal: GoalArgs,
    /// Effort of the fit.
    ///
    /// docs/guide/choosing.md says when to use which.
    #[arg(long, value_name = "LEVEL", default_value = "default", hide_default_value = true, value_parser = named::<Effort>())]
    effort: Effort,
    /// Particle radius to store as the default, world units [default: 0.0406 of the mean spacing].
    #[arg(long, value_name = "R", hide_short_help = true)]
    radius: Option<f64>,
    /// Particle opacity to store as the default, in (0, 1] [default: 0.05].
    #[arg(long, value_name = "A", hide_short_help = true)]
    opacity: Option<f64>,
    /// How much to measure on the decoded model and store in the file [default: quick].
    #[arg(long, value_name = "LEVEL", value_parser = named::<CertificateLevel>())]
    pub certificate: Option<CertificateLevel>,
    /// Fields to store as well, such as velocity, or `all`.
    ///
    /// Names are those that `info` lists, case aside; `velocity` also finds Velocities, or vx, vy and vz. Velocities of
    /// cosmological snapshots are stored as peculiar velocities in km/s where the file says how. The target is met
    /// without the fields, and the report says what they add.
    #[arg(long, display_order = LATER, value_name = "NAME,...", value_delimiter = ',')]
    pub fields: Vec<String>,
    /// Temperature of star-forming gas, where it is computed from internal energy: keep, drop, or a value in K.
    ///
    /// Such gas follows an effective equation of state in many simulations, so its internal energy is not thermal.
    #[arg(long, display_order = LATER, value_name = "keep|drop|K", hide_short_help = true, requires = "fields", default_value = "keep", hide_default_value = true)]
    pub star_forming: StarFormingGas,
    #[command(flatten)]
    pub train: TrainArgs,
}

impl FitArgs {
    pub fn is_fast(&self) -> bool {
        self.effort == Effort::Fast
    }

    /// The library's options for one block in memory.
    pub fn options(&self, seed: u64) -> Result<Options> {
        // All targets are in one group of clap, so at most one is given.
        let target = match self.goal.target()? {
            Some(goal) => goal,
            None => self.target.target()?,
        };
        let options = Options {
            target,
            effort: self.effort,
            radius: self.radius,
            opacity: self.opacity,
            training: self.train.config()?,
            seed,
            certificate: self.certificate.unwrap_or_default(),
            fields: self.fields.clone(),
            star_forming: self.star_forming,
            ..Options::default()
        };
        options.check().map(|()| options)
    }
}

pub const HEADING: &str = "Target (choose one)";

#[derive(Args, Clone, Debug)]
#[group(multiple = false)]
pub struct TargetArgs {
    /// Compression ratio to reach.
    ///
    /// The size of the particles as float32, 12 bytes each (16 with weights), divided by the file size.
    #[arg(long, help_heading = HEADING, value_name = "R")]
    ratio: Option<f64>,
    /// File size to reach, such as 11MB, 900kB or 1.5GiB.
    #[arg(long, help_heading = HEADING, value_name = "SIZE")]
    size: Option<String>,
    /// Number of Gaussians; the file size follows from it.
    #[arg(long, help_heading = HEADING, value_name = "K")]
    gaussians: Option<u64>,
}

/// Adds a default to the help of --ratio.
pub fn with_default(ratio: Arg, default: &str) -> Arg {
    let help_with_default = |help: Option<&clap::builder::StyledStr>| {
        help.map(|h| h.to_string().replace("to reach", &format!("to reach [default: {default}]")))
    };
    let (short, long) = (help_with_default(ratio.get_help()), help_with_default(ratio.get_long_help()));
    ratio.help(short.unwrap_or_default()).long_help(long.unwrap_or_default())
}

impl TargetArgs {
    pub fn target(&self) -> Result<Target> {
        match (self.ratio, &self.size, self.gaussians) {
            (Some(r), ..) => Target::Ratio(r),
            (_, Some(s), _) => Target::Size(parse_bytes(s)?),
            (.., Some(k)) => Target::Gaussians(k),
            _ => Target::Default,
        }
        .check()
    }
}

/// Parses a number of bytes: `11MB`, `900 kB`, `1.5GiB`, `83886`.
pub fn parse_bytes(text: &str) -> Result<u64> {
    let fail = || Error::argument(format!("size `{text}` is not a number with B, kB, MB, GB, KiB, MiB or GiB"));
    let split = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let number: f64 = text[..split].parse().map_err(|_| fail())?;
    let unit = match text[split..].trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" | "k" => 1e3,
        "mb" | "m" => 1e6,
        "gb" | "g" => 1e9,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        _ => return Err(fail()),
    };
    Ok((number * unit).floor() as u64)
}

#[derive(Args, Clone, Debug)]
struct GoalArgs {
    /// Masked PSNR to reach, in dB; --help lists more targets.
    ///
    /// Measured in the style `expected`, averaged over held-out views. This and the targets below are found by search: up
    /// to eight fits are decoded and measured, and the smallest file that reaches the target is kept. The certificate
    /// states the target and what the file reaches.
    #[arg(long, help_heading = HEADING, value_name = "DB", group = "TargetArgs")]
    psnr: Option<f64>,
    /// Power spectrum: P(k) within this share of the particles', such as 1% or 0.01, up to --k-max.
    ///
    /// In every shell of wave numbers (of width 2 pi over the longest edge) where the particles' power is above the
    /// scatter of their shot noise. Measured as in the certificate: on as many particles drawn from the model, with shot
    /// noise subtracted (above three million particles, on the mixture itself). Needs a periodic box.
    #[arg(long, help_heading = HEADING, value_name = "SHARE", group = "TargetArgs", requires = "k_max", value_parser = parse_share, hide_short_help = true)]
    max_pk_error: Option<f64>,
    /// Largest wave number of --max-pk-error, in the inverse of the data's unit of length.
    ///
    /// At most the particles' Nyquist frequency, pi over their mean spacing, or what the grid of 256 cells measures.
    #[arg(long, help_heading = HEADING, value_name = "K", requires = "max_pk_error", hide_short_help = true)]
    k_max: Option<f64>,
    /// Density: Pearson correlation of model and particles, in cells of edge --cell.
    #[arg(long, help_heading = HEADING, value_name = "R", group = "TargetArgs", requires = "cell", hide_short_help = true)]
    min_correlation: Option<f64>,
    /// Edge of the cells of --min-correlation, in the data's unit of length.
    ///
    /// Reduced so that equal cells fill the box, or the particles' bounds if there is no box.
    #[arg(long, help_heading = HEADING, value_name = "LENGTH", requires = "min_correlation", hide_short_help = true)]
    cell: Option<f64>,
    /// Groups: numbers of friends-of-friends groups within this share, such as 10% or 0.1, from --from on.
    ///
    /// The group mass function: the mean number over four draws from the model, in every size class. Classes begin at
    /// --from and grow by the square root of 2; from the largest down they are joined until each has 100 of the
    /// particles' groups, so that too many small groups do not make up for missing large ones. For at most 3 145 728
    /// particles.
    #[arg(long, help_heading = HEADING, value_name = "SHARE", group = "TargetArgs", requires = "from", value_parser = parse_share, hide_short_help = true)]
    groups_within: Option<f64>,
    /// Smallest groups of --groups-within, in particles: 20 or more.
    #[arg(long, help_heading = HEADING, value_name = "N", requires = "groups_within", hide_short_help = true)]
    from: Option<u64>,
}

impl GoalArgs {
    /// The target; `None` without a target of quality.
    fn target(&self) -> Result<Option<Target>> {
        if let Some(d) = self.psnr {
            return Target::Psnr(d).check().map(Some);
        }
        let goals = [
            (GoalKind::PowerSpectrum, "--max-pk-error", self.max_pk_error, self.k_max),
            (GoalKind::Correlation, "--min-correlation", self.min_correlation, self.cell),
            (GoalKind::Groups, "--groups-within", self.groups_within, self.from.map(|n| n as f64)),
        ];
        let goal = |(kind, name, limit, at)| {
            // clap has refused one without the other.
            let (limit, at) = (Option::<f64>::zip(limit, at))?;
            Some(Target::Goal(Goal { kind, asked: limit, at }).check().map_err(|e| e.at(name)))
        };
        goals.into_iter().find_map(goal).transpose()
    }
}

/// Parses a share: `1%`, `0.01`.
fn parse_share(text: &str) -> std::result::Result<f64, String> {
    // In decimal, so that 1% and 0.01 are one number.
    let plain = text.strip_suffix('%').map_or_else(|| text.to_string(), |percent| format!("{}e-2", percent.trim_end()));
    plain.parse().map_err(|_| "not a share, such as 1% or 0.01".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares() {
        for (text, share) in [("1%", 0.01), ("0.01", 0.01), ("0.7 %", 0.007), ("10%", 0.1), (".5%", 0.005)] {
            assert_eq!(parse_share(text), Ok(share), "{text}");
        }
        for bad in ["", "%", "1%%", "one", "1 percent", "1e-3e", "1e1%"] {
            assert!(parse_share(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn sizes() {
        assert_eq!(parse_bytes("11MB").unwrap(), 11_000_000);
        assert_eq!(parse_bytes("1.5 KiB").unwrap(), 1536);
        assert_eq!(parse_bytes("83886").unwrap(), 83_886);
        for bad in ["", "MB", "0", "-3MB", "1.2.3", "5 parsecs", "nan"] {
            assert!(parse_bytes(bad).and_then(|b| Target::Size(b).check()).is_err(), "{bad}");
        }
    }
}
