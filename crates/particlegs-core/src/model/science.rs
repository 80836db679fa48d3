//! What statistics of a decoded model said when its file was made.

/// A place up to which, or from which on, something holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// It was not measured, or there was too little to judge by.
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

/// What the statistics are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ScienceOf {
    /// As many particles as the snapshot's, drawn from the model by `recover`'s default method.
    DrawnParticles,
    /// The mixture itself, integrated over cells: what no draw adds its noise to.
    Mixture,
}

/// Statistics against the snapshot (module `stats` of this library). Fixed length in the file.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Science {
    /// What was compared with the snapshot.
    pub of: ScienceOf,
    /// Cells of the spectrum's grid along the longest edge.
    pub spectrum_grid: u16,
    /// Largest wave number measured, one over the unit of length; 0 where none was. A limit of this
    /// size means "at least": the grid goes no further.
    pub k_max: f64,
    /// P(k), shot noise subtracted, is within 1 % of the snapshot's up to this wave number.
    pub power_within_1_percent_to: Limit,
    /// And within 5 %.
    pub power_within_5_percent_to: Limit,
    /// r(k), noise included, is at least 0.99 up to this wave number.
    pub r_above_0_99_to: Limit,
    /// And at least 0.9.
    pub r_above_0_9_to: Limit,
    /// Friends-of-friends groups (linking length 0.2 of the mean spacing) of this many particles and
    /// more are within 10 % of the snapshot's number, in classes of sizes joined to hold 100 or more.
    pub groups_within_10_percent_from: Limit,
}

impl Science {
    /// P(k), r(k) and groups in plain words: how far, of what, or that it was not measured. `unit` is
    /// the unit of length.
    pub fn in_words(&self, unit: Option<&str>) -> [String; 3] {
        let of = match self.of {
            ScienceOf::DrawnParticles => "of particles drawn by method `count`",
            ScienceOf::Mixture => "of the mixture itself; a draw adds its shot noise",
        };
        let unit = unit.map_or_else(|| "1/length".into(), per_length);
        let up_to = |limit: Limit| match limit {
            Limit::NotMeasured => "not measured".to_string(),
            Limit::Never => "nowhere".into(),
            Limit::At(k) if k >= self.k_max => format!("up to k = {k:.4} {unit} at least (the grid goes no further)"),
            Limit::At(k) => format!("up to k = {k:.4} {unit}"),
        };
        [
            format!(
                "power spectrum ({of}): within 1 % of the source's {}; within 5 % {}",
                up_to(self.power_within_1_percent_to),
                up_to(self.power_within_5_percent_to)
            ),
            format!(
                "cross-correlation with the source ({of}): r(k) of 0.99 and more {}; of 0.9 and more {}",
                up_to(self.r_above_0_99_to),
                up_to(self.r_above_0_9_to)
            ),
            match self.groups_within_10_percent_from {
                Limit::NotMeasured => "friends-of-friends groups: numbers not measured".into(),
                Limit::Never => "friends-of-friends groups: their number is within 10 % at no size".into(),
                Limit::At(n) => format!(
                    "friends-of-friends groups (of particles drawn by method `count`): numbers within 10 % of the source's for groups of {n} particles and more"
                ),
            },
        ]
    }
}

/// The reciprocal of a unit of length: `h/Mpc` of `Mpc/h`.
pub fn per_length(unit: &str) -> String {
    match unit.split_once('/') {
        Some((a, b)) if !b.contains('/') => format!("{b}/{a}"),
        Some(_) => format!("1/({unit})"),
        None => format!("1/{unit}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_told_from_each_other() {
        let science = Science {
            of: ScienceOf::DrawnParticles,
            spectrum_grid: 128,
            k_max: 4.0,
            power_within_1_percent_to: Limit::Never,
            power_within_5_percent_to: Limit::At(4.0),
            r_above_0_99_to: Limit::At(1.25),
            r_above_0_9_to: Limit::NotMeasured,
            groups_within_10_percent_from: Limit::At(57.0),
        };
        let [power, r, groups] = science.in_words(Some("Mpc/h"));
        assert!(
            power.contains("1 % of the source's nowhere") && power.contains("k = 4.0000 h/Mpc at least"),
            "{power}"
        );
        assert!(r.contains("k = 1.2500 h/Mpc;") && r.ends_with("not measured"), "{r}");
        assert!(groups.contains("57 particles"), "{groups}");
        let none = Science { groups_within_10_percent_from: Limit::NotMeasured, ..science };
        assert!(none.in_words(None)[2].contains("not measured"));
        assert_eq!(serde_json::to_value(science).unwrap()["r_above_0_9_to"], "not measured");
    }

    #[test]
    fn units_are_turned_over() {
        assert_eq!(["Mpc/h", "kpc", "a/b/c"].map(per_length), ["h/Mpc", "1/kpc", "1/(a/b/c)"]);
    }
}
