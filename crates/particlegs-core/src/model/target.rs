//! Targets that a user may ask for: a ratio, a size, a number of Gaussians, a quality, or a goal in the terms of the data;
//! and what a file reached of its goal.

use super::metric::{enum_values, record};
use super::unit::per_length;
use super::{GROUP_CLASSES, Metric};
use crate::Error;
use crate::model::Coding::{F64, Name};
use std::fmt;

/// The default compression ratio of large snapshots.
pub const DEFAULT_RATIO: f64 = 300.0;
/// Bytes below which the default does not go while particles are there to fill them.
const DEFAULT_LEAST_BYTES: u64 = 250_000;
/// Particles that were not fitted gain little by a larger file than this ratio gives (docs/guide/certificate.md).
const LEVEL_RATIO: f64 = 100.0;
/// Below so many bytes, some 2000 Gaussians, pictures gain by a larger file all the same: of few particles the default
/// is a tenth of their bytes, and what every file has beside its Gaussians. Of 5000 clustered ones a third of that scores
/// 1 dB less, twice that 2 dB more.
const FEW_BYTES: u64 = 10_240;
const FEW_RATIO: f64 = 10.0;
const BESIDE_GAUSSIANS: u64 = 1200;

/// The target that the file is to meet.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// Ratio 300, but 250 kB of smaller snapshots down to ratio 100; of few particles more again, so that their
    /// structure has enough Gaussians ([`Target::bytes`]). Where header and one Gaussian do not fit, the smallest
    /// file with a note.
    #[default]
    Default,
    /// Raw bytes / file bytes.
    Ratio(f64),
    /// File bytes.
    Size(u64),
    /// Gaussians, at the nominal precision.
    Gaussians(u64),
    /// Masked PSNR in dB, `expected` look, mean over held-out views.
    Psnr(f64),
    /// A figure of the decoded model, by the smallest number of Gaussians that reaches it.
    Goal(Goal),
}

impl Target {
    /// The largest file that meets a ratio or size.
    pub fn bytes(self, raw_bytes: u64) -> Option<u64> {
        match self {
            Target::Default => {
                let at = |ratio: f64| (raw_bytes as f64 / ratio) as u64;
                let few = (at(FEW_RATIO) + BESIDE_GAUSSIANS).min(FEW_BYTES);
                Some(at(LEVEL_RATIO).max(few).min(DEFAULT_LEAST_BYTES).max(at(DEFAULT_RATIO)))
            }
            Target::Ratio(r) => Some((raw_bytes as f64 / r).floor() as u64),
            Target::Size(s) => Some(s),
            Target::Gaussians(_) | Target::Psnr(_) | Target::Goal(_) => None,
        }
    }

    /// The figure to reach, where the number of Gaussians is searched for one.
    pub fn goal(self) -> Option<Goal> {
        match self {
            Target::Psnr(asked) => Some(Goal { kind: GoalKind::Psnr, asked, at: 0.0 }),
            Target::Goal(goal) => Some(goal),
            Target::Default | Target::Ratio(_) | Target::Size(_) | Target::Gaussians(_) => None,
        }
    }

    /// The choice of the default for particles of `raw_bytes`, and why, in one line; `None` for a target of
    /// the user's own.
    pub fn describe_choice(self, raw_bytes: u64) -> Option<String> {
        let bytes = (self == Target::Default).then(|| self.bytes(raw_bytes))??;
        let ratio = raw_bytes as f64 / bytes.max(1) as f64;
        let of_ratio = |ratio| Target::Ratio(ratio).bytes(raw_bytes);
        let why = if Some(bytes) == of_ratio(DEFAULT_RATIO) {
            String::new()
        } else if bytes == DEFAULT_LEAST_BYTES {
            format!("; ratio {DEFAULT_RATIO} is for larger snapshots")
        } else if Some(bytes) == of_ratio(LEVEL_RATIO) {
            "; a larger file would add little detail".into()
        } else {
            format!("; ratio {LEVEL_RATIO} leaves too few Gaussians for such a small snapshot")
        };
        Some(format!("no target given: using ratio {ratio:.1}, {bytes} bytes{why}"))
    }

    /// Checks the number.
    pub fn check(self) -> crate::Result<Self> {
        let valid = match self {
            Target::Default => true,
            Target::Ratio(v) | Target::Psnr(v) => v > 0.0 && v.is_finite(),
            Target::Size(v) | Target::Gaussians(v) => v > 0,
            Target::Goal(goal) => return check_goal(goal).map(Target::Goal),
        };
        if valid { Ok(self) } else { Err(Error::argument(format!("{} is not positive and finite", self.describe()))) }
    }

    /// The target as people say it.
    fn describe(self) -> String {
        match self {
            Target::Default => "the default size".into(),
            Target::Ratio(v) => format!("a ratio of {v}"),
            Target::Size(v) => format!("a size of {v} bytes"),
            Target::Gaussians(v) => format!("a number of {v} Gaussians"),
            Target::Psnr(v) => format!("a quality of {v} dB"),
            Target::Goal(goal) => goal.describe(None),
        }
    }
}

/// As options of the command, each behind a space: ` --ratio 300`; nothing where nothing was asked for.
impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Target::Default => Ok(()),
            Target::Ratio(r) => write!(f, " --ratio {r}"),
            Target::Size(bytes) => write!(f, " --size {bytes}B"),
            Target::Gaussians(k) => write!(f, " --gaussians {k}"),
            Target::Psnr(d) => write!(f, " --psnr {d}"),
            Target::Goal(Goal { kind, asked, at }) => match kind {
                GoalKind::Psnr => write!(f, " --psnr {asked}"),
                GoalKind::PowerSpectrum => write!(f, " --max-pk-error {asked} --k-max {at}"),
                GoalKind::Correlation => write!(f, " --min-correlation {asked} --cell {at}"),
                GoalKind::Groups => write!(f, " --groups-within {asked} --from {at}"),
            },
        }
    }
}

/// Checks that a goal can be met at all; whether these particles can meet it is found when they are measured.
fn check_goal(goal: Goal) -> crate::Result<Goal> {
    let Goal { kind, asked, at } = goal;
    let in_range = asked > 0.0 && asked < if kind == GoalKind::Psnr { f64::INFINITY } else { 1.0 };
    let message = match kind {
        _ if !in_range && kind == GoalKind::Correlation => format!("the correlation {asked} is not between 0 and 1"),
        _ if !in_range => format!("{asked} is not a share between 0 and 1 (0 % and 100 %)"),
        GoalKind::PowerSpectrum if !(at > 0.0 && at.is_finite()) => format!("{at} is not a positive wave number"),
        GoalKind::Correlation if !(at > 0.0 && at.is_finite()) => format!("{at} is not a positive cell size"),
        GoalKind::Groups if !(at >= GROUP_CLASSES[0] as f64 && at < (1u64 << 53) as f64) || at.fract() != 0.0 => {
            format!("the smallest group must be a whole number of at least {} particles, not {at}", GROUP_CLASSES[0])
        }
        _ => return Ok(goal),
    };
    Err(Error::argument(message))
}

/// The figure that a goal is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GoalKind {
    /// Masked PSNR, `expected` look, mean over held-out views, dB; at least.
    #[default]
    Psnr,
    /// Largest deviation of P(k) from the particles' in any shell of wave numbers up to [`Goal::at`]; at most.
    PowerSpectrum,
    /// Pearson's coefficient of the densities in cells of edge [`Goal::at`]; at least.
    Correlation,
    /// Largest deviation of the number of friends-of-friends groups in any class of sizes from [`Goal::at`] particles
    /// on, mean of several draws; at most.
    Groups,
}

impl GoalKind {
    const ALL: [GoalKind; 4] = [GoalKind::Psnr, GoalKind::PowerSpectrum, GoalKind::Correlation, GoalKind::Groups];
    const NAMES: &[&str] = &["masked PSNR", "deviation of P(k)", "correlation in cells", "deviation of groups"];
}

enum_values!(GoalKind);

record! {
    /// A figure, and what it is to be.
    #[derive(serde::Deserialize)]
    Goal {
        kind: GoalKind = Metric::new("figure", Name(GoalKind::NAMES));
        /// The value asked for: a share (0.01 = 1 %) for the power spectrum and groups.
        asked: f64 = Metric::new("asked for", F64);
        /// The place: a wave number (one over the unit of length), an edge (units of length), particles; 0 for PSNR.
        at: f64 = Metric::new("at", F64);
    }
}

record! {
    /// A goal, and what the decoded file was measured to have.
    GoalResult {
        #[serde(flatten)]
        goal: Goal = "";
        /// The value reached, as [`Goal::asked`].
        reached: f64 = Metric::new("reached", F64).signed();
    }
}

impl Goal {
    /// Whether `reached` is as good as what is asked for, or better.
    pub fn is_met(&self, reached: f64) -> bool {
        match self.kind {
            GoalKind::Psnr | GoalKind::Correlation => reached >= self.asked,
            GoalKind::PowerSpectrum | GoalKind::Groups => reached <= self.asked,
        }
    }

    /// The goal in words; `unit` is the unit of length.
    pub fn describe(&self, unit: Option<&str>) -> String {
        let (value, at) = (self.describe_value(self.asked), self.at);
        match self.kind {
            GoalKind::Psnr => format!("a masked PSNR of {value}"),
            GoalKind::PowerSpectrum => {
                let unit = unit.map_or_else(|| "1/length".into(), per_length);
                format!("P(k) within {value} up to k = {at} {unit}")
            }
            GoalKind::Correlation => {
                let unit = unit.map_or(String::new(), |u| format!(" {u}"));
                format!("a correlation of {value} of densities in cells of {at}{unit}")
            }
            GoalKind::Groups => format!("numbers of groups within {value} from {at} particles on"),
        }
    }

    /// A value of this figure in words: `31.92 dB`, `0.931 %`, `0.99931`.
    pub fn describe_value(&self, value: f64) -> String {
        // So many digits, and no zeros that say nothing.
        let digits = |v: f64, n: usize| {
            let text = format!("{v:.n$}");
            let short = text.trim_end_matches('0').trim_end_matches('.');
            if short.is_empty() || short == "-" { text.clone() } else { short.to_string() }
        };
        match self.kind {
            GoalKind::Psnr => format!("{} dB", digits(value, 2)),
            GoalKind::Correlation => digits(value, 6),
            GoalKind::PowerSpectrum | GoalKind::Groups => format!("{} %", digits(100.0 * value, 3)),
        }
    }
}

impl GoalResult {
    /// Both in one line; `unit` is the unit of length.
    pub fn describe(&self, unit: Option<&str>) -> String {
        let goal = &self.goal;
        format!("{}: reached {}", goal.describe(unit), goal.describe_value(self.reached))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ratio 300 of large snapshots, 250 kB of smaller ones, ratio 100 of small ones, and more of few particles.
    #[test]
    fn smaller_snapshots_have_a_lower_default() {
        let bytes = |particles: u64| Target::Default.bytes(12 * particles).unwrap();
        assert_eq!([bytes(1 << 24), bytes(6_250_100)], [671_088, 250_004]);
        assert_eq!([bytes(6_000_000), bytes(1 << 21), bytes(2_083_334)], [250_000; 3]);
        assert_eq!([bytes(1 << 18), bytes(100_000)], [31_457, 12_000]);
        assert_eq!([bytes(60_000), bytes(32_768), bytes(5_000), bytes(100)], [10_240, 10_240, 7_200, 1_320]);
        assert!((1..8_000_000).step_by(9_973).is_sorted_by_key(bytes));
        assert_eq!(Target::Ratio(300.0).bytes(12 * 5000), Some(200));
    }

    #[test]
    fn the_choice_is_said_with_its_reason() {
        let words = |particles: u64| Target::Default.describe_choice(12 * particles).unwrap();
        assert_eq!(words(1 << 24), "no target given: using ratio 300.0, 671088 bytes");
        let choices =
            [(1 << 21, "ratio 100.7, 250000 bytes; ratio 300 is"), (1 << 18, "ratio 100.0, 31457 bytes; a larger")];
        for (particles, start) in choices.into_iter().chain([(5000, "ratio 8.3, 7200 bytes; ratio 100 leaves too few")])
        {
            assert!(words(particles).starts_with(&format!("no target given: using {start}")), "{}", words(particles));
        }
        assert_eq!(Target::Ratio(300.0).describe_choice(1000), None);
    }

    #[test]
    fn goals_are_met_from_their_own_side() {
        let goal = |kind, asked, at| Goal { kind, asked, at };
        let power = goal(GoalKind::PowerSpectrum, 0.01, 2.0);
        assert!(power.is_met(0.01) && power.is_met(0.0) && !power.is_met(0.011) && !power.is_met(f64::NAN));
        let density = goal(GoalKind::Correlation, 0.999, 1.0);
        assert!(density.is_met(0.9991) && !density.is_met(0.998));
        assert_eq!(power.describe(Some("Mpc/h")), "P(k) within 1 % up to k = 2 h/Mpc");
        assert_eq!(density.describe(None), "a correlation of 0.999 of densities in cells of 1");
        let groups = GoalResult { goal: goal(GoalKind::Groups, 0.1, 50.0), reached: 0.0625 };
        assert_eq!(groups.describe(None), "numbers of groups within 10 % from 50 particles on: reached 6.25 %");
        assert_eq!(goal(GoalKind::Psnr, 32.0, 0.0).describe(None), "a masked PSNR of 32 dB");
        assert_eq!(power.describe_value(0.0), "0 %");
    }
}
