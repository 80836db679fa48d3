//! The limit up to which something that a certificate measures holds.

use super::MetricValue;

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
    pub(super) fn reaches_beyond(self, loose: Limit) -> bool {
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
