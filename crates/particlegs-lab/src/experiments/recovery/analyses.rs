//! Analyses that recovered particles support, judged only by the numbers of the other tables.

use super::facts::Facts;
use super::{RecoveryMeasurements, SizeRecovery};
use crate::results::{ResultTable, TableCell};

/// An analysis with its limits for `yes` and `care`, and the number that is compared with them.
struct Analysis {
    what: &'static str,
    limits: [f64; 2],
    /// The limits as text.
    said: &'static str,
    figure: fn(&SizeRecovery) -> Option<f64>,
}

impl Analysis {
    const fn new(
        what: &'static str,
        limits: [f64; 2],
        said: &'static str,
        figure: fn(&SizeRecovery) -> Option<f64>,
    ) -> Analysis {
        Analysis { what, limits, said, figure }
    }
}

const ANALYSES: [Analysis; 11] = [
    Analysis::new("density in cells: 1 - correlation", [0.002, 0.01], "0.002 / 0.01", |o| {
        Some(1.0 - o.count.correlation?)
    }),
    Analysis::new("counts in cells: MAE of delta", [0.21, 0.3], "0.21 / 0.3", |o| o.count.mae),
    Analysis::new("P(k) to a quarter of the last k", [0.01, 0.05], "1 % / 5 %", |o| power_off(&o.count, 0.25)),
    Analysis::new("P(k) to the last k, the particles' Nyquist frequency", [0.01, 0.05], "1 % / 5 %", |o| {
        power_off(&o.count, 1.0)
    }),
    Analysis::new("phases to a quarter of the last k: 1 - r", [0.01, 0.1], "0.01 / 0.1", |o| {
        phases_off(&o.count, 0.25)
    }),
    Analysis::new("phases to the last k: 1 - r", [0.01, 0.1], "0.01 / 0.1", |o| phases_off(&o.count, 1.0)),
    Analysis::new("number of groups of 100 or more", [0.05, 0.1], "5 % / 10 %", |o| groups_off(&o.count, 100)),
    Analysis::new("number of groups of 50 to 99", [0.05, 0.1], "5 % / 10 %", |o| groups_off(&o.count, 50)),
    Analysis::new("number of groups of 20 to 49", [0.05, 0.1], "5 % / 10 %", |o| groups_off(&o.count, 20)),
    Analysis::new("core mass of groups of 100 to 299: 1 - median", [0.05, 0.2], "5 % / 20 %", |o| {
        Some((1.0 - o.count.core_mass?).abs())
    }),
    Analysis::new("nearest neighbours, drawn `spaced`: mean and median", [0.05, 0.15], "5 % / 15 %", |o| {
        Some((o.spaced.nearest_mean()? - 1.0).abs().max((o.spaced.nearest_median? - 1.0).abs()))
    }),
];

/// One row per analysis, one column per ratio.
pub(super) fn table(m: &RecoveryMeasurements) -> ResultTable {
    let mut columns = vec!["analysis".to_string(), "limits: yes / with care".into()];
    columns.extend(m.sizes.iter().map(|o| format!("ratio {}", o.name)));
    let title = "Analyses that particles drawn by `count` support, by ratio".to_string();
    let mut t = ResultTable { name: "recovery-analyses".into(), title, columns, rows: Vec::new() };
    for a in &ANALYSES {
        let judged = m.sizes.iter().map(|o| TableCell::text(grade((a.figure)(o), a.limits)));
        t.row([TableCell::text(a.what), TableCell::text(a.said)].into_iter().chain(judged));
    }
    let never = m.sizes.iter().map(|_| TableCell::text("no"));
    t.row(
        [TableCell::text("single particles, velocities, histories"), TableCell::text("never")].into_iter().chain(never),
    );
    t
}

fn grade(figure: Option<f64>, [good, fair]: [f64; 2]) -> &'static str {
    match figure {
        None => "not measured",
        Some(v) if v <= good => "yes",
        Some(v) if v <= fair => "care",
        Some(_) => "no",
    }
}

/// The largest deviation of P(k) in shells up to a share of the last k.
fn power_off(facts: &Facts, share: f64) -> Option<f64> {
    // The last shell counts, even if its k was rounded.
    let last = share * facts.k_max()? * (1.0 + 1e-9);
    let off = facts.shells.iter().filter(|s| s.k <= last).map(|s| s.ratio.map(|r| (r - 1.0).abs()));
    off.collect::<Option<Vec<f64>>>()?.into_iter().reduce(f64::max)
}

fn phases_off(facts: &Facts, share: f64) -> Option<f64> {
    let last = share * facts.k_max()? * (1.0 + 1e-9);
    let off = facts.shells.iter().filter(|s| s.k <= last).map(|s| s.r.map(|r| 1.0 - r));
    off.collect::<Option<Vec<f64>>>()?.into_iter().reduce(f64::max)
}

fn groups_off(facts: &Facts, from: u64) -> Option<f64> {
    facts.classes.iter().find(|c| c.from == from)?.off().map(f64::abs)
}

#[cfg(test)]
mod tests {
    use super::super::facts::{GroupCounts, Power};
    use super::*;

    #[test]
    fn the_worst_shell_within_reach_is_judged() {
        let shell = |k, ratio, r| Power { k, ratio: Some(ratio), r: Some(r) };
        let shells = vec![shell(1.0, 1.02, 0.999), shell(2.0, 0.995, 0.99), shell(8.0, 0.9, 0.8)];
        let classes = vec![GroupCounts { from: 20, to: Some(49), number: [100, 80] }];
        let facts = Facts { shells, classes, ..Facts::default() };
        assert!((power_off(&facts, 0.25).unwrap() - 0.02).abs() < 1e-12);
        assert!((power_off(&facts, 1.0).unwrap() - 0.1).abs() < 1e-12);
        assert!((phases_off(&facts, 0.25).unwrap() - 0.01).abs() < 1e-12);
        assert!((groups_off(&facts, 20).unwrap() - 0.2).abs() < 1e-12);
        assert_eq!((groups_off(&facts, 50), power_off(&Facts::default(), 1.0)), (None, None));
        let said = [Some(0.01), Some(0.05), Some(0.2), None].map(|v| grade(v, [0.02, 0.1]));
        assert_eq!(said, ["yes", "care", "no", "not measured"]);
    }
}
