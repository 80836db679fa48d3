//! Statistics of a decoded model from when its file was made, and the limits up to which they hold.

use super::metric::{enum_values, record};
use super::{GROUP_CLASSES, Metric, MetricUnit, MetricValue};
use crate::model::Coding::{F32, From as FromSize, Name, UpTo, Whole};

/// The subject of the statistics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ScienceSubject {
    /// As many particles as the snapshot's, drawn from the model by `recover`'s default method.
    #[default]
    DrawnParticles,
    /// The mixture itself, integrated over cells: what no draw adds its noise to.
    Mixture,
}

impl ScienceSubject {
    const ALL: [ScienceSubject; 2] = [ScienceSubject::DrawnParticles, ScienceSubject::Mixture];
    const NAMES: &[&str] = &["particles drawn by method `count`", "the mixture itself"];
}

enum_values!(ScienceSubject);

record! {
    /// Statistics against the snapshot (module `stats` of this library).
    ScienceMetrics agrees by Self::limits_are_measured {
        of: ScienceSubject = Metric::new("of", Name(ScienceSubject::NAMES));
        /// Cells of the spectrum's grid along the longest edge.
        spectrum_grid: u16 = Metric::new("cells", Whole(2));
        /// Largest wave number measured, one over the unit of length; 0 where none was. A limit of this
        /// size means "at least": the grid goes no further.
        k_max: f64 = Metric::new("largest wave number", F32).unit(MetricUnit::WaveNumber);
        /// P(k), shot noise subtracted, is within 1 % of the snapshot's up to this wave number.
        power_within_1_percent_to: Limit = Metric::new("P(k) within 1 %", UpTo);
        /// And within 5 %.
        power_within_5_percent_to: Limit = Metric::new("P(k) within 5 %", UpTo);
        /// r(k), noise included, is at least 0.99 up to this wave number.
        r_above_0_99_to: Limit = Metric::new("r(k) of 0.99 and more", UpTo);
        /// And at least 0.9.
        r_above_0_9_to: Limit = Metric::new("r(k) of 0.9 and more", UpTo);
        /// Friends-of-friends groups (linking length 0.2 of the mean spacing) of this many particles and
        /// more are within 10 % of the snapshot's number, in classes of sizes joined to hold 100 or more.
        groups_within_10_percent_from: Limit = Metric::new("number of groups within 10 %", FromSize);
    }
}

impl ScienceMetrics {
    fn limits_are_measured(&self) -> Result<(), String> {
        let power = [self.power_within_1_percent_to, self.power_within_5_percent_to];
        let r = [self.r_above_0_99_to, self.r_above_0_9_to];
        if let Some(k) = power.into_iter().chain(r).filter_map(Limit::place).find(|k| *k > self.k_max) {
            return Err(format!("wave number {k} is above the largest, {}", self.k_max));
        }
        // Whatever is within 1 % is within 5 %, and r of 0.99 is above 0.9.
        if power[0].reaches_beyond(power[1]) {
            return Err("P(k) is within 1 % at a larger k than within 5 %".into());
        }
        if r[0].reaches_beyond(r[1]) {
            return Err("r(k) is above 0.99 at a larger k than above 0.9".into());
        }
        match self.groups_within_10_percent_from {
            Limit::At(n) if n < GROUP_CLASSES[0] as f64 => Err(format!("groups start at {n} particles, too few")),
            _ => Ok(()),
        }
    }
}

/// A place up to which, or from which on, something holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Limit {
    /// It was not measured, or there was too little to judge by.
    #[default]
    NotMeasured,
    /// It was measured and holds nowhere.
    Never,
    /// It holds up to here (wave numbers), or from here on (sizes).
    At(f64),
}

impl Limit {
    /// The limit of something measured: `None` = nowhere.
    pub fn measured(place: Option<f64>) -> Self {
        place.map_or(Limit::Never, Limit::At)
    }

    /// Whether it holds further than `loose`, or only one of the two was measured.
    fn reaches_beyond(self, loose: Limit) -> bool {
        match (self, loose) {
            (Limit::At(a), Limit::At(b)) => a > b,
            (Limit::At(_), _) => true,
            (Limit::NotMeasured, other) | (other, Limit::NotMeasured) => other != Limit::NotMeasured,
            (Limit::Never, _) => false,
        }
    }

    /// The place, where there is one.
    pub fn place(self) -> Option<f64> {
        match self {
            Limit::At(v) => Some(v),
            Limit::NotMeasured | Limit::Never => None,
        }
    }
}

/// As a number, or as text that says which of the other two it is.
impl serde::Serialize for Limit {
    fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Limit::NotMeasured => s.serialize_str("not measured"),
            Limit::Never => s.serialize_str("never"),
            Limit::At(v) => s.serialize_f64(*v),
        }
    }
}

impl From<Limit> for MetricValue {
    fn from(limit: Limit) -> Self {
        match limit {
            Limit::NotMeasured => MetricValue::None,
            Limit::Never => MetricValue::Never,
            Limit::At(v) => MetricValue::Real(v),
        }
    }
}

impl From<MetricValue> for Limit {
    fn from(value: MetricValue) -> Self {
        match value {
            MetricValue::Real(v) => Limit::At(v),
            MetricValue::Never => Limit::Never,
            _ => Limit::NotMeasured,
        }
    }
}
