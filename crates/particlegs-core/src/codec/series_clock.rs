//! The clock of a series.

use crate::model::{Cosmology, Metadata, Units};
use crate::picture::journal_unit;
use crate::{Error, Result};

/// Units of time, in seconds.
const SECONDS: [(&str, f64); 9] = [
    ("Gyr", 3.15576e16),
    ("Myr", 3.15576e13),
    ("yr", 3.15576e7),
    ("fs", 1e-15),
    ("ps", 1e-12),
    ("ns", 1e-9),
    ("us", 1e-6),
    ("ms", 1e-3),
    ("s", 1.0),
];

/// The quantity that the clock of a series shows. Motions are proportional to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeriesClock {
    /// The number of the frame.
    Frame,
    /// The scale factor.
    ScaleFactor,
    /// The time, in the unit of time.
    Time,
    /// The time step.
    Step,
}

impl SeriesClock {
    pub(super) const ALL: [SeriesClock; 4] =
        [SeriesClock::Frame, SeriesClock::ScaleFactor, SeriesClock::Time, SeriesClock::Step];

    /// Its reading for a frame of some metadata; `None` where these do not say.
    pub fn time(self, frame: usize, metadata: &Metadata) -> Option<f64> {
        let epoch = &metadata.epoch;
        match self {
            SeriesClock::Frame => Some(frame as f64),
            SeriesClock::ScaleFactor => epoch.scale_factor,
            SeriesClock::Time => epoch.time,
            SeriesClock::Step => epoch.step.map(|s| s as f64),
        }
    }

    /// Its quantity, in words.
    pub fn name(self) -> &'static str {
        match self {
            SeriesClock::Frame => "frame",
            SeriesClock::ScaleFactor => "scale factor",
            SeriesClock::Time => "time",
            SeriesClock::Step => "time step",
        }
    }

    /// Its reading, as it is written into a picture: `z = 0.500`, `t = 12.5 ps`, `step 1000` or `frame 12`.
    pub fn text(self, time: f64, units: &Units) -> String {
        match self {
            SeriesClock::ScaleFactor => {
                // Rounding may leave a little less than 0 of today, which would be written as -0.000.
                let z = 1.0 / time - 1.0;
                format!("z = {:.3}", if z.abs() < 5e-4 { 0.0 } else { z })
            }
            SeriesClock::Time => {
                let unit = units.time.as_ref().map(|u| journal_unit(&u.text)).unwrap_or_default();
                format!("t = {} {unit}", rounded(time)).trim_end().to_string()
            }
            SeriesClock::Step => format!("step {time:.0}"),
            SeriesClock::Frame => format!("frame {}", rounded(time)),
        }
    }

    /// Its reading at a moment that a user names: `a=0.5`, `z=1`, `step=1000`, a time such as `500ps`, which takes the
    /// `units` of the series, or `5Gyr` after the big bang, which takes its cosmology if the clock is the scale factor.
    ///
    /// # Errors
    /// [`Error::Argument`]: the text names no moment, one of another clock, or a time where units or cosmology are not
    /// known.
    pub fn moment(self, text: &str, units: &Units, cosmology: &Cosmology) -> Result<f64> {
        let wrong =
            || Error::argument(format!("time {text}: write a=0.5, z=1, step=1000 or a time such as 500ps or 5Gyr"));
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
        let (clock, value) = if let Some(a) = text.strip_prefix("a=") {
            (SeriesClock::ScaleFactor, number(a)?)
        } else if let Some(z) = text.strip_prefix("z=") {
            (SeriesClock::ScaleFactor, 1.0 / (1.0 + number(z)?))
        } else if let Some(step) = text.strip_prefix("step=") {
            (SeriesClock::Step, number(step)?)
        } else {
            // `s` is the last of the list, as the names of other units end with it.
            let (unit, length) = SECONDS.iter().find(|(name, _)| text.ends_with(name)).ok_or_else(wrong)?;
            let seconds = number(text.trim_end_matches(unit))? * length;
            if self == SeriesClock::ScaleFactor {
                let message = format!(
                    "time {text}: the series does not state h, Omega_m and Omega_Lambda, or its universe has no such moment"
                );
                return cosmology.scale_factor_at(seconds).ok_or_else(|| Error::argument(message));
            }
            // A unit that changes with a or h is no number of seconds.
            let si = units.time.as_ref().and_then(|u| u.si).filter(|si| si.a == 0.0 && si.h == 0.0);
            let si =
                si.ok_or_else(|| Error::argument(format!("time {text}: the series does not state its unit of time")));
            (SeriesClock::Time, if self == SeriesClock::Time { seconds / si?.factor } else { seconds })
        };
        if clock != self {
            let message =
                format!("time {text}: the clock of the series is its {}, not its {}", self.name(), clock.name());
            return Err(Error::argument(message));
        }
        Ok(value)
    }

    /// The first that metadata have: scale factor, time, step, or else the frame's number.
    pub fn of(metadata: &Metadata) -> SeriesClock {
        let [frame, others @ ..] = SeriesClock::ALL;
        others.into_iter().find(|c| c.time(0, metadata).is_some()).unwrap_or(frame)
    }
}

/// Five significant digits, without an exponent where that is readable.
fn rounded(value: f64) -> String {
    let digits = 4.0 - libm::floor(libm::log10(value.abs().max(1e-99)));
    match digits {
        _ if value == 0.0 => "0".into(),
        -5.0..=8.0 => {
            let text = format!("{value:.0$}", digits.max(0.0) as usize);
            if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
        }
        _ => format!("{value:.4e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Dimension, Unit};
    use std::f64::consts::PI;

    #[test]
    fn moments_are_read_as_users_write_them() {
        let (none, no_cosmology) = (Units::default(), Cosmology::default());
        let a = |text| SeriesClock::ScaleFactor.moment(text, &none, &no_cosmology).ok();
        assert_eq!([a("a=0.5"), a("z=1"), a("z= 3 ")], [Some(0.5), Some(0.5), Some(0.25)]);
        assert_eq!([a("0.5"), a("step=3"), a("z=x"), a("a=inf"), a("500ps"), a("")], [None; 6]);
        assert_eq!(SeriesClock::Step.moment("step=1000", &none, &no_cosmology).ok(), Some(1000.0));
        let units = Units { time: Some(Unit::parse("fs", Dimension::Time)), ..Units::default() };
        assert_eq!(SeriesClock::Time.moment("3ps", &units, &no_cosmology).ok(), Some(3000.0));
        assert!(
            SeriesClock::Time.moment("3ps", &none, &no_cosmology).unwrap_err().to_string().contains("unit of time")
        );
        let [hubble, omega_matter, omega_lambda] = [Some(0.68), Some(0.31), Some(0.69)];
        let flat = Cosmology { hubble, omega_matter, omega_lambda, omega_baryon: None };
        // 2 / (3 sqrt(0.69)) asinh(sqrt(0.69 / 0.31)) / H0.
        let today = SeriesClock::ScaleFactor.moment("13.7375Gyr", &none, &flat).unwrap();
        assert!((today - 1.0).abs() < 1e-4, "{today}");
    }

    #[test]
    fn ages_are_those_of_universes_with_and_without_a_cosmological_constant() {
        let factor = |matter, lambda, ages: f64| {
            let (omega_matter, omega_lambda) = (Some(matter), Some(lambda));
            let c = Cosmology { hubble: Some(0.5), omega_matter, omega_lambda, omega_baryon: None };
            c.scale_factor_at(ages / (0.5 * 3.240_779_289e-18))
        };
        let near = |value: Option<f64>, wanted: f64| assert!((value.unwrap() / wanted - 1.0).abs() < 1e-9, "{value:?}");
        // Einstein and de Sitter's, at two thirds of the Hubble time and at an eighth of that.
        near(factor(1.0, 0.0, 2.0 / 3.0), 1.0);
        near(factor(1.0, 0.0, 1.0 / 12.0), 0.25);
        // Open and closed ones of matter: a = 0.5 and 1, where cosh and cos of the development angle are 3 and 0.
        near(factor(0.5, 0.0, (8f64.sqrt() - 3f64.acosh()) * 0.5 / (2.0 * 0.5f64.powf(1.5))), 1.0);
        near(factor(2.0, 0.0, PI / 2.0 - 1.0), 1.0);
        assert_eq!(
            (factor(2.0, 0.0, 4.0), factor(0.0, 1.0, 1.0), factor(0.3, 0.7, -1.0), factor(1.0, 0.0, 0.0)),
            (None, None, None, None)
        );
        near(factor(0.0, 0.0, 0.7), 0.7);
        // The flat one's closed form, from both sides of where it is used.
        let flat = factor(0.3, 0.7, 0.9).unwrap();
        assert!((factor(0.3, 0.6989, 0.9).unwrap() / flat - 1.0).abs() < 1e-3);
    }

    #[test]
    fn pictures_show_the_clock() {
        let none = Units::default();
        let text = |clock: SeriesClock, time| clock.text(time, &none);
        assert_eq!(text(SeriesClock::ScaleFactor, 0.5), "z = 1.000");
        assert_eq!(text(SeriesClock::ScaleFactor, 1.0), "z = 0.000");
        assert_eq!(text(SeriesClock::Step, 1000.0), "step 1000");
        assert_eq!(text(SeriesClock::Time, 12.5), "t = 12.5");
        assert_eq!(text(SeriesClock::Frame, 1.5), "frame 1.5");
    }
}
