//! The goal of a compression, in the terms of the data, and what its file reached.

use super::Metric;
use super::metric::{enum_values, record};
use super::unit::per_length;
use crate::model::Coding::{F64, Name};

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
