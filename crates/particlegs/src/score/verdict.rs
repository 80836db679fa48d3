//! What a model is good for, in plain words: one judgement of a certificate, the same wherever it is
//! told. The thresholds and their reasons: docs/guide/certificate.md.

use crate::model::{Certificate, Limit, LookBaselines, LookScore, Science, per_length};
use serde::Serialize;

/// Pictures hold where the worst orbit's masked PSNR against the noise-free picture is this far above the
/// better trivial picture, dB: half of its error.
pub const PICTURES_HOLD: f64 = 6.0;
/// And roughly from here on: seven tenths of its error.
pub const PICTURES_ROUGHLY: f64 = 3.0;
/// The density holds from this correlation on, with at most [`DENSITY_ERROR_HOLDS`] of the error of the
/// better trivial density.
pub const DENSITY_HOLDS: f64 = 0.99;
/// And roughly from here on, with less error than the better trivial density.
pub const DENSITY_ROUGHLY: f64 = 0.9;
/// See [`DENSITY_HOLDS`].
pub const DENSITY_ERROR_HOLDS: f64 = 0.5;
/// The power spectrum holds where it is within 1 % up to this share of the wave numbers measured, and
/// roughly where it is within 5 %.
pub const SPECTRUM_SHARE: f64 = 0.25;
/// Groups hold where their numbers are within 10 % from this size on, particles.
pub const GROUPS_HOLD: f64 = 100.0;
/// And roughly from this size on.
pub const GROUPS_ROUGHLY: f64 = 1000.0;

/// What a model may be used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Use {
    /// Pictures at the default radius and opacity.
    Pictures,
    /// The density on the certificate's grid.
    Density,
    /// P(k).
    PowerSpectrum,
    /// Numbers of friends-of-friends groups.
    Groups,
}

/// How far that goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Word {
    /// Use it.
    #[serde(rename = "holds")]
    Holds,
    /// For a first look.
    #[serde(rename = "roughly")]
    Roughly,
    /// Do not.
    #[serde(rename = "does not")]
    DoesNot,
    /// Nothing is known.
    #[serde(rename = "not measured")]
    NotMeasured,
}

/// One use, its word, and the figures that decided it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What for.
    #[serde(rename = "use")]
    pub of: Use,
    /// The word.
    pub word: Word,
    /// Why, in one line.
    pub why: String,
}

impl Use {
    /// As it is printed.
    pub fn name(self) -> &'static str {
        match self {
            Use::Pictures => "pictures",
            Use::Density => "density",
            Use::PowerSpectrum => "power spectrum",
            Use::Groups => "groups",
        }
    }
}

impl Word {
    /// As it is printed.
    pub fn name(self) -> &'static str {
        match self {
            Word::Holds => "holds",
            Word::Roughly => "roughly",
            Word::DoesNot => "does not",
            Word::NotMeasured => "not measured",
        }
    }
}

/// Judges a certificate: pictures, density, power spectrum and groups, in this order. `unit` is the unit of
/// length, for the words. Without a certificate nothing is measured.
pub fn verdict(certificate: Option<&Certificate>, unit: Option<&str>) -> Vec<Finding> {
    let Some(c) = certificate else {
        let none = |of| Finding { of, word: Word::NotMeasured, why: "the file has no certificate".into() };
        return [Use::Pictures, Use::Density, Use::PowerSpectrum, Use::Groups].map(none).into();
    };
    let science = c.science.as_ref();
    vec![pictures(c), density(c), spectrum(science, unit), groups(science)]
}

/// The smallest gain of the `expected` look, whose score has no sampling noise in it.
fn pictures(c: &Certificate) -> Finding {
    let finding = |word, why| Finding { of: Use::Pictures, word, why };
    let Some(b) = &c.baselines else {
        return finding(
            Word::NotMeasured,
            "the file does not say what an empty picture or a uniform box scores".into(),
        );
    };
    let gains: Vec<Gain> =
        c.orbits.iter().zip(&b.orbits).filter_map(|(o, b)| Gain::of(&o.expected, &b.expected)).collect();
    let Some(worst) = gains.into_iter().min_by(|a, b| a.decibels.total_cmp(&b.decibels)) else {
        return finding(Word::NotMeasured, "nothing is lit at the default radius and opacity".into());
    };
    let word = if !worst.more_similar {
        Word::DoesNot
    } else {
        graded(worst.decibels >= PICTURES_HOLD, worst.decibels >= PICTURES_ROUGHLY)
    };
    finding(word, worst.in_words())
}

/// How far a picture is above the better of the trivial ones.
struct Gain {
    model: Option<f64>,
    trivial: f64,
    name: &'static str,
    decibels: f64,
    /// Is its SSIM above both?
    more_similar: bool,
}

impl Gain {
    /// `None` where a trivial picture is identical, or nothing is lit.
    fn of(model: &LookScore, trivial: &LookBaselines) -> Option<Gain> {
        let (black, even) = (trivial.all_black.masked_psnr?, trivial.uniform_box.masked_psnr?);
        let (trivial_psnr, name) = if black >= even { (black, "an empty picture") } else { (even, "a uniform box") };
        let similar = model.ssim > trivial.all_black.ssim.max(trivial.uniform_box.ssim);
        // Identical pictures have no decibels.
        let decibels = model.masked_psnr.map_or(f64::INFINITY, |v| v - trivial_psnr);
        let more_similar = similar || model.masked_psnr.is_none();
        Some(Gain { model: model.masked_psnr, trivial: trivial_psnr, name, decibels, more_similar })
    }

    fn in_words(&self) -> String {
        let Some(model) = self.model else { return "identical to the noise-free picture".into() };
        let less = if self.more_similar { "" } else { ", with no better SSIM" };
        format!("{model:.1} dB where {} scores {:.1}{less} (masked PSNR, worst orbit)", self.name, self.trivial)
    }
}

fn density(c: &Certificate) -> Finding {
    // An empty density has an error of 1; files without baselines have nothing else to compare with.
    let trivial = c.baselines.map_or(1.0, |b| b.uniform_density_mae.min(1.0));
    let word = graded(
        c.density_correlation >= DENSITY_HOLDS && c.density_mae <= DENSITY_ERROR_HOLDS * trivial,
        c.density_correlation >= DENSITY_ROUGHLY && c.density_mae < trivial,
    );
    let why = format!(
        "correlation {:.4} on {} cells along the longest edge, mean error {:.2} where a trivial density has {trivial:.2}",
        c.density_correlation, c.grid, c.density_mae
    );
    Finding { of: Use::Density, word, why }
}

fn spectrum(science: Option<&Science>, unit: Option<&str>) -> Finding {
    let finding = |word, why| Finding { of: Use::PowerSpectrum, word, why };
    let Some(s) = science.filter(|s| s.power_within_5_percent_to != Limit::NotMeasured) else {
        return finding(Word::NotMeasured, "too few particles, or a file of an early version".into());
    };
    let unit = unit.map_or_else(|| "1/length".into(), per_length);
    let reaches = |limit: Limit| limit.place().is_some_and(|k| k >= SPECTRUM_SHARE * s.k_max);
    let within = |percent: u32, limit: Limit| match limit {
        Limit::At(k) => format!("within {percent} % up to k = {k:.3} {unit}"),
        Limit::Never => format!("within {percent} % nowhere"),
        Limit::NotMeasured => format!("within {percent} %: not measured"),
    };
    let word = graded(reaches(s.power_within_1_percent_to), reaches(s.power_within_5_percent_to));
    let why = match word {
        Word::Holds => within(1, s.power_within_1_percent_to),
        _ => format!("{}, {}", within(5, s.power_within_5_percent_to), within(1, s.power_within_1_percent_to)),
    };
    finding(word, format!("{why} (measured to {:.3})", s.k_max))
}

fn groups(science: Option<&Science>) -> Finding {
    let finding = |word, why| Finding { of: Use::Groups, word, why };
    match science.map_or(Limit::NotMeasured, |s| s.groups_within_10_percent_from) {
        Limit::NotMeasured => finding(Word::NotMeasured, "too few groups, too many particles, or an early file".into()),
        Limit::Never => finding(Word::DoesNot, "numbers are within 10 % at no size".into()),
        Limit::At(n) => {
            let why = format!("numbers within 10 % from {n} particles a group on");
            finding(graded(n <= GROUPS_HOLD, n <= GROUPS_ROUGHLY), why)
        }
    }
}

fn graded(holds: bool, roughly: bool) -> Word {
    match (holds, roughly) {
        (true, _) => Word::Holds,
        (false, true) => Word::Roughly,
        (false, false) => Word::DoesNot,
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::certificate;
    use super::*;
    use crate::model::{Baselines, PictureScore};

    fn finding(c: &Certificate, of: Use) -> Finding {
        verdict(Some(c), None).into_iter().find(|f| f.of == of).unwrap()
    }

    fn word(c: &Certificate, of: Use) -> Word {
        finding(c, of).word
    }

    #[test]
    fn pictures_are_judged_against_the_better_trivial_one() {
        let c = certificate();
        assert_eq!(word(&c, Use::Pictures), Word::Holds);
        let with = |black: Option<f64>, even: Option<f64>| {
            let mut c = c;
            // One orbit that is worse than the others decides.
            let look = &mut c.baselines.as_mut().unwrap().orbits[1].expected;
            (look.all_black.masked_psnr, look.uniform_box.masked_psnr) = (black, even);
            c
        };
        assert_eq!(word(&with(Some(26.0), Some(12.0)), Use::Pictures), Word::Roughly);
        assert_eq!(word(&with(Some(12.0), Some(29.4)), Use::Pictures), Word::DoesNot);
        let why = finding(&with(Some(29.4), Some(12.0)), Use::Pictures).why;
        assert!(why.contains("30.5 dB where an empty picture scores 29.4"), "{why}");
        // No better in structure is no better.
        let mut dim = c;
        dim.baselines.as_mut().unwrap().orbits[0].expected.uniform_box.ssim = 0.76;
        assert_eq!(word(&dim, Use::Pictures), Word::DoesNot);
        let mut dark = c;
        for orbit in &mut dark.baselines.as_mut().unwrap().orbits {
            orbit.expected.all_black = PictureScore { masked_psnr: None, ssim: 1.0 };
        }
        assert_eq!(word(&dark, Use::Pictures), Word::NotMeasured);
        assert_eq!(word(&Certificate { baselines: None, ..c }, Use::Pictures), Word::NotMeasured);
    }

    #[test]
    fn densities_spectra_and_groups_have_their_words() {
        let c = certificate();
        let density = |correlation, mae| {
            word(&Certificate { density_correlation: correlation, density_mae: mae, ..c }, Use::Density)
        };
        assert_eq!(
            [density(0.997, 0.4), density(0.997, 0.7), density(0.95, 0.6)],
            [Word::Holds, Word::Roughly, Word::Roughly]
        );
        assert_eq!([density(0.95, 1.1), density(-0.0006, 0.9)], [Word::DoesNot; 2]);
        // Against a uniform density that errs little, little error is needed.
        let even = Baselines { uniform_density_mae: 0.3, ..c.baselines.unwrap() };
        assert_eq!(word(&Certificate { baselines: Some(even), ..c }, Use::Density), Word::DoesNot);
        let science = |one, five, groups| Certificate {
            science: Some(Science {
                power_within_1_percent_to: one,
                power_within_5_percent_to: five,
                groups_within_10_percent_from: groups,
                ..c.science.unwrap()
            }),
            ..c
        };
        let all = science(Limit::At(2.0), Limit::At(8.0), Limit::At(57.0));
        assert_eq!([word(&all, Use::PowerSpectrum), word(&all, Use::Groups)], [Word::Holds; 2]);
        let some = science(Limit::Never, Limit::At(8.0), Limit::At(160.0));
        assert_eq!([word(&some, Use::PowerSpectrum), word(&some, Use::Groups)], [Word::Roughly; 2]);
        let none = science(Limit::Never, Limit::At(1.0), Limit::Never);
        assert_eq!([word(&none, Use::PowerSpectrum), word(&none, Use::Groups)], [Word::DoesNot; 2]);
        let early = Certificate { science: None, ..c };
        assert_eq!([word(&early, Use::PowerSpectrum), word(&early, Use::Groups)], [Word::NotMeasured; 2]);
        assert!(verdict(None, None).iter().all(|f| f.word == Word::NotMeasured));
    }

    #[test]
    fn json_says_use_word_and_why() {
        let json = serde_json::to_value(verdict(None, None)).unwrap();
        assert_eq!(json[2]["use"], "power_spectrum");
        assert_eq!(json[2]["word"], "not measured");
        assert!(json[2]["why"].as_str().is_some_and(|w| !w.is_empty()));
    }
}
