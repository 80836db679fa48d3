//! Units as files and people write them: a text, and what it is in SI where the text can be read.

use serde::{Deserialize, Serialize};

/// A unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// As the source states it, e.g. `kpc/h`.
    pub text: String,
    /// Its size in SI; `None` where that is not known, as of a unit of a reduced (LJ) system.
    pub si: Option<Si>,
}

/// A number in a unit, in metres, kilograms or seconds, is: number times `factor` times the scale factor to the power
/// of `a` times the Hubble parameter h to the power of `h`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Si {
    /// Factor, positive and finite.
    pub factor: f64,
    /// Exponent of the scale factor: 1 in comoving lengths.
    pub a: f32,
    /// Exponent of h: -1 in `kpc/h`.
    pub h: f32,
}

/// The dimension of a unit, and the SI unit that factors are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Length, in metres.
    Length,
    /// Mass, in kilograms.
    Mass,
    /// Time, in seconds.
    Time,
}

/// A parsec (IAU 2015, resolution B2) in metres.
const PARSEC: f64 = 3.085_677_581_491_367e16;
/// The sun's mass in kilograms: IAU 2015 (resolution B3) over G of CODATA 2018.
const SUN: f64 = 1.988_41e30;
/// A dalton (CODATA 2018) in kilograms.
const DALTON: f64 = 1.660_539_066_60e-27;
/// A Julian year in seconds.
const YEAR: f64 = 3.155_76e7;
/// The factor of a unit that has a name but no size.
const REDUCED: f64 = 0.0;

/// Names of units of length, those of one size in one text, and their sizes in metres.
const LENGTHS: [(&str, f64); 18] = [
    ("pc parsec parsecs", PARSEC),
    ("kpc kiloparsec", 1e3 * PARSEC),
    ("Mpc megaparsec", 1e6 * PARSEC),
    ("Gpc gigaparsec", 1e9 * PARSEC),
    ("ly lyr", 9.460_730_472_580_8e15),
    ("AU au", 1.495_978_707e11),
    ("Rsun", 6.957e8),
    ("km", 1e3),
    ("m meter metre meters", 1.0),
    ("cm centimeter", 1e-2),
    ("mm", 1e-3),
    ("um \u{b5}m \u{3bc}m micron", 1e-6),
    ("nm", 1e-9),
    ("pm", 1e-12),
    ("fm", 1e-15),
    ("A Angstrom Angstroms \u{c5} \u{212b}", 1e-10),
    ("Bohr", 5.291_772_109_03e-11),
    ("sigma", REDUCED),
];
/// The same of mass, in kilograms.
const MASSES: [(&str, f64); 12] = [
    ("Msun Msol solMass solarmass", SUN),
    ("Mearth", 5.972_17e24),
    ("Mjup", 1.898_12e27),
    ("t", 1e3),
    ("kg", 1.0),
    ("g gram grams", 1e-3),
    ("mg", 1e-6),
    ("ug", 1e-9),
    ("pg", 1e-15),
    ("ag", 1e-21),
    ("amu u Da", DALTON),
    ("kDa", 1e3 * DALTON),
];
/// The same of time, in seconds.
const TIMES: [(&str, f64); 13] = [
    ("s", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("ps", 1e-12),
    ("fs", 1e-15),
    ("hr", 3600.0),
    ("day", 86_400.0),
    ("yr", YEAR),
    ("kyr", 1e3 * YEAR),
    ("Myr", 1e6 * YEAR),
    ("Gyr", 1e9 * YEAR),
    ("tau", REDUCED),
];

impl Dimension {
    fn table(self) -> (&'static str, &'static str, &'static [(&'static str, f64)]) {
        match self {
            Dimension::Length => ("length", "m", &LENGTHS),
            Dimension::Mass => ("mass", "kg", &MASSES),
            Dimension::Time => ("time", "s", &TIMES),
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        self.table().0
    }

    /// The SI unit that factors are of.
    pub fn base(self) -> &'static str {
        self.table().1
    }

    /// A unit by one of its names: as it is written, else whatever the case of its letters. Short names differ by
    /// case: mg and Mg. Its first name, and its factor.
    fn named(self, name: &str) -> Option<(&'static str, f64)> {
        let names = || self.table().2.iter().flat_map(|unit| unit.0.split(' ').map(move |n| (n, unit)));
        let lower = name.to_lowercase();
        let any_case = || names().find(|n| name.len() > 2 && n.0.to_lowercase() == lower);
        let (names, factor) = names().find(|n| n.0 == name).or_else(any_case)?.1;
        Some((names.split(' ').next()?, *factor))
    }
}

/// A unit as its text states it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ParsedUnit {
    number: f64,
    /// The first of its names.
    name: &'static str,
    /// Size of the name in SI; [`REDUCED`] of a unit without a size.
    size: f64,
    a: f32,
    h: f32,
    /// Whether it is comoving, where the text says that.
    comoving: Option<bool>,
}

impl Unit {
    /// A unit of `text`, with its size where the text is a unit of `dimension` that is known by name.
    pub fn parse(text: &str, dimension: Dimension) -> Unit {
        let si = read(text, dimension).filter(|r| r.size != REDUCED);
        Unit { text: text.trim().into(), si: si.map(|r| Si { factor: r.number * r.size, a: r.a, h: r.h }) }
    }

    /// Whether `text` is a unit that is known by name, with or without a size.
    pub fn is_known(text: &str, dimension: Dimension) -> bool {
        read(text, dimension).is_some()
    }

    /// Of a unit's text: a number, the name of a unit and its size in SI, and the exponents of a and h that it is
    /// multiplied by; `None` where the text is no unit with a size. `1e10 Msun/h` is 1e10, `Msun`, 1.98841e30, 0, -1.
    pub fn parts(text: &str, dimension: Dimension) -> Option<(f64, &'static str, f64, f32, f32)> {
        let ParsedUnit { number, name, size, a, h, .. } = read(text, dimension)?;
        (size != REDUCED).then_some((number, name, size, a, h))
    }

    /// Its size in SI: ` (3.0856776e19 m a h^-1)`; nothing where that is not known.
    pub fn describe_size(&self, dimension: Dimension) -> String {
        let power = |name: &str, p: f32| match p {
            0.0 => String::new(),
            1.0 => format!(" {name}"),
            p => format!(" {name}^{p}"),
        };
        self.si.map_or_else(String::new, |Si { factor, a, h }| {
            // In ten digits: more are those of a product.
            let factor: f64 = format!("{factor:.9e}").parse().unwrap_or(factor);
            format!(" ({factor:e} {}{}{})", dimension.base(), power("a", a), power("h", h))
        })
    }

    /// The text, and its size in SI.
    pub fn describe(&self, dimension: Dimension) -> String {
        self.text.clone() + &self.describe_size(dimension)
    }
}

/// A product of numbers, one name, and powers of h and a, with `*`, `/`, blanks or nothing between them:
/// `1e10 Msun/h`, `h^-1 Mpc`, `kpccm/h`, `kpc a h**-1`, `ckpc`, `comoving Mpc/h`, `g/mol`.
fn read(text: &str, dimension: Dimension) -> Option<ParsedUnit> {
    let mut plain = text.trim().trim_matches(['[', ']', '(', ')']).replace(['{', '}', '$'], "");
    // Each pair acts on what those before it left: `10**10 M_{\odot}` becomes `1e10 Msun` in four steps.
    for (written, meant) in [
        ("**", "^"),
        ("10^", "1e"),
        ("\\odot", "sun"),
        ("\u{2609}", "sun"),
        ("M_", "M"),
        ("R_", "R"),
        ("solar masses", "Msun"),
        ("solar mass", "Msun"),
        ("gram/mole", "amu"),
        ("g/mol", "amu"),
    ] {
        plain = plain.replace(written, meant);
    }
    let spaced = plain.replace('/', " / ").replace(['*', '\u{d7}', '\u{b7}'], " ");
    let mut unit = ParsedUnit { number: 1.0, name: "", size: REDUCED, a: 0.0, h: 0.0, comoving: None };
    let mut below = false;
    for word in spaced.split_whitespace() {
        if word == "/" {
            below = true;
            continue;
        }
        // A `/` is for the next word alone, as in `kpc/h a`.
        let sign = if std::mem::take(&mut below) { -1.0 } else { 1.0 };
        let (number, word) = number(word);
        unit.number *= if sign < 0.0 { 1.0 / number } else { number };
        if word.is_empty() {
            continue;
        }
        let (name, power) = powered(word);
        match name {
            "h" | "littleh" | "small_h" => unit.h += sign * power,
            "a" | "small_a" | "aexp" => unit.a += sign * power,
            "comoving" => unit.comoving = Some(true),
            "physical" | "proper" => unit.comoving = Some(false),
            // A second unit, or a power of one as in `Mpc^2` and `1/Mpc`, makes another dimension.
            _ if !unit.name.is_empty() || sign * power != 1.0 => return None,
            _ => {
                let ((name, size), comoving) = lengths_apart(name, dimension)?;
                (unit.name, unit.size) = (name, size);
                unit.comoving = comoving.or(unit.comoving);
            }
        }
    }
    // A power of a says that a length is comoving, and the first power belongs to it (docs/format.md, section 2).
    if dimension == Dimension::Length {
        match unit.comoving {
            Some(true) => unit.a = 1.0,
            None if unit.a != 0.0 => unit.comoving = Some(true),
            _ => {}
        }
    }
    // A unit without a size is a unit all the same: then its number alone must be sound.
    let size = unit.number * if unit.size == REDUCED { 1.0 } else { unit.size };
    let sound = [f64::from(unit.a), f64::from(unit.h), unit.number, size].iter().all(|v| v.is_finite());
    (!unit.name.is_empty() && !below && sound && unit.number > 0.0 && size > 0.0).then_some(unit)
}

/// A name's factor, and what its letters say of comoving: `ckpc`, `kpccm` and `pkpc` are lengths of cosmologists.
fn lengths_apart(name: &str, dimension: Dimension) -> Option<((&'static str, f64), Option<bool>)> {
    if let Some(unit) = dimension.named(name) {
        return Some((unit, None));
    }
    let named_length = |rest: Option<&str>, comoving: bool| {
        let rest = rest.filter(|r| dimension == Dimension::Length && r.to_lowercase().ends_with("pc"))?;
        Some((dimension.named(rest)?, Some(comoving)))
    };
    named_length(name.strip_prefix('c'), true)
        .or_else(|| named_length(name.strip_suffix("cm"), true))
        .or_else(|| named_length(name.strip_prefix('p'), false))
}

/// The number that a word begins with, at most 32 characters, else 1; and the rest.
fn number(word: &str) -> (f64, &str) {
    // Rust also reads `inf` and `nan` as numbers, so a digit or a point must come first.
    let begins = word.starts_with(|c: char| c.is_ascii_digit() || c == '.');
    let ends = (1..=word.len().min(32)).rev().filter(|&end| begins && word.is_char_boundary(end));
    // The longest beginning that is a number: 1e10 of `1e10Msun`, not 1.
    ends.filter_map(|end| Some((word[..end].parse().ok()?, &word[end..]))).next().unwrap_or((1.0, word))
}

/// A word and its exponent: `h^-1` and `h-1` are h and -1. Without one it is 1.
fn powered(word: &str) -> (&str, f32) {
    let at = word.find('^').or_else(|| word.find(['-', '+']));
    match at.and_then(|at| Some((&word[..at], word[at..].trim_start_matches('^').parse().ok()?))) {
        Some((name, power)) => (name, power),
        None => (word, 1.0),
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

/// Units of the numbers of a snapshot. `None` = the source does not say.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "SerializedUnits", into = "SerializedUnits")]
pub struct Units {
    /// Unit of length.
    pub length: Option<Unit>,
    /// Unit of mass.
    pub mass: Option<Unit>,
    /// Unit of time.
    pub time: Option<Unit>,
    /// Whether lengths are comoving. If that is known, the unit of length has the exponent of a that belongs to it.
    pub comoving: Option<bool>,
}

impl Units {
    /// Units of length and mass from their texts. A text of the length that says so goes before `comoving`.
    pub fn new(length: Option<&str>, mass: Option<&str>, comoving: Option<bool>) -> Self {
        let length = length.map(|text| Unit::parse(text, Dimension::Length));
        let mass = mass.map(|text| Unit::parse(text, Dimension::Mass));
        Units { length, mass, time: None, comoving }.settled()
    }

    /// The same, where `comoving` and the exponent of a in the unit of length say one thing.
    pub fn settled(mut self) -> Self {
        if let Some(unit) = &mut self.length {
            self.comoving = read(&unit.text, Dimension::Length).and_then(|r| r.comoving).or(self.comoving);
            if let (Some(si), Some(comoving)) = (&mut unit.si, self.comoving) {
                si.a = f32::from(u8::from(comoving));
            }
        }
        self
    }

    /// Those that `by` states, and the rest of these.
    pub fn replaced(&self, by: &Units) -> Units {
        Units {
            length: by.length.clone().or_else(|| self.length.clone()),
            mass: by.mass.clone().or_else(|| self.mass.clone()),
            time: self.time.clone(),
            comoving: by.comoving.or(self.comoving),
        }
        .settled()
    }

    /// The unit of a dimension.
    pub(super) fn of_dimension(&self, dimension: Dimension) -> Option<&Unit> {
        match dimension {
            Dimension::Length => self.length.as_ref(),
            Dimension::Mass => self.mass.as_ref(),
            Dimension::Time => self.time.as_ref(),
        }
    }

    /// The unit of length as text.
    pub fn length_text(&self) -> Option<&str> {
        self.length.as_ref().map(|u| &u.text[..])
    }

    /// The unit of mass as text.
    pub fn mass_text(&self) -> Option<&str> {
        self.mass.as_ref().map(|u| &u.text[..])
    }
}

/// [`Units`] in serde's terms: texts under the names that they have everywhere.
#[derive(Serialize, Deserialize)]
struct SerializedUnits {
    length_unit: Option<String>,
    length_unit_si: Option<Si>,
    mass_unit: Option<String>,
    mass_unit_si: Option<Si>,
    time_unit: Option<String>,
    time_unit_si: Option<Si>,
    comoving: Option<bool>,
}

impl From<Units> for SerializedUnits {
    fn from(u: Units) -> SerializedUnits {
        let apart = |u: Option<Unit>| u.map_or((None, None), |u| (Some(u.text), u.si));
        let (length_unit, length_unit_si) = apart(u.length);
        let (mass_unit, mass_unit_si) = apart(u.mass);
        let (time_unit, time_unit_si) = apart(u.time);
        let comoving = u.comoving;
        SerializedUnits { length_unit, length_unit_si, mass_unit, mass_unit_si, time_unit, time_unit_si, comoving }
    }
}

impl From<SerializedUnits> for Units {
    fn from(f: SerializedUnits) -> Units {
        let unit = |text: Option<String>, si| text.map(|text| Unit { text, si });
        Units {
            length: unit(f.length_unit, f.length_unit_si),
            mass: unit(f.mass_unit, f.mass_unit_si),
            time: unit(f.time_unit, f.time_unit_si),
            comoving: f.comoving,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn units_are_read_as_programs_write_them() {
        let kpc = 1e3 * PARSEC;
        let lengths: [(&str, f64, f32, f32, Option<bool>); 26] = [
            ("kpc/h", kpc, 0.0, -1.0, None),
            ("kpc / h", kpc, 0.0, -1.0, None),
            ("h^-1 Mpc", 1e3 * kpc, 0.0, -1.0, None),
            ("Mpc h^-1", 1e3 * kpc, 0.0, -1.0, None),
            ("Mpc h-1", 1e3 * kpc, 0.0, -1.0, None),
            ("$h^{-1}$ Mpc", 1e3 * kpc, 0.0, -1.0, None),
            ("mpc", 1e3 * kpc, 0.0, 0.0, None),
            // yt; AREPO and people; pynbody; astropy; Paicos.
            ("kpccm/h", kpc, 1.0, -1.0, Some(true)),
            ("Mpccm", 1e3 * kpc, 1.0, 0.0, Some(true)),
            ("ckpc/h", kpc, 1.0, -1.0, Some(true)),
            ("comoving Mpc/h", 1e3 * kpc, 1.0, -1.0, Some(true)),
            ("pkpc", kpc, 0.0, 0.0, Some(false)),
            ("physical kpc", kpc, 0.0, 0.0, Some(false)),
            ("kpc a h**-1", kpc, 1.0, -1.0, Some(true)),
            ("1.00e+03 kpc a", 1e3 * kpc, 1.0, 0.0, Some(true)),
            ("kpc / littleh", kpc, 0.0, -1.0, None),
            ("3.2e21 cm/h", 3.2e19, 0.0, -1.0, None),
            ("1e3 km", 1e6, 0.0, 0.0, None),
            ("[Mpc]", 1e3 * kpc, 0.0, 0.0, None),
            ("cm", 0.01, 0.0, 0.0, None),
            ("pc", PARSEC, 0.0, 0.0, None),
            // LAMMPS and its neighbours.
            ("Angstrom", 1e-10, 0.0, 0.0, None),
            ("A", 1e-10, 0.0, 0.0, None),
            ("nm", 1e-9, 0.0, 0.0, None),
            ("\u{b5}m", 1e-6, 0.0, 0.0, None),
            ("Bohr", 5.291_772_109_03e-11, 0.0, 0.0, None),
        ];
        for (text, factor, a, h, comoving) in lengths {
            let r = read(text, Dimension::Length).unwrap_or_else(|| panic!("{text}"));
            assert!((r.number * r.size / factor - 1.0).abs() < 1e-14, "{text}: {r:?}");
            assert_eq!((r.a, r.h, r.comoving), (a, h, comoving), "{text}");
        }
        let masses = [
            ("Msun/h", SUN, -1.0),
            ("1e10 Msun/h", 1e10 * SUN, -1.0),
            ("1e10Msun/h", 1e10 * SUN, -1.0),
            ("10^10 M_sun / h", 1e10 * SUN, -1.0),
            ("$10^{10} M_{\\odot}/h$", 1e10 * SUN, -1.0),
            ("10**10 M\u{2609}", 1e10 * SUN, 0.0),
            ("1.00e+10 Msol h**-1", 1e10 * SUN, -1.0),
            ("solar masses", SUN, 0.0),
            ("1.989e+43 g", 1.989e40, 0.0),
            ("g/mol", DALTON, 0.0),
            ("gram/mole", DALTON, 0.0),
        ];
        for (text, factor, h) in masses {
            let si = Unit::parse(text, Dimension::Mass).si.unwrap_or_else(|| panic!("{text}"));
            assert!((si.factor / factor - 1.0).abs() < 1e-14, "{text}: {}", si.factor);
            assert_eq!((si.a, si.h), (0.0, h), "{text}");
        }
        assert_eq!(Unit::parse("Gyr", Dimension::Time).si.unwrap().factor, 1e9 * YEAR);
        assert_eq!(Unit::parts("10^10 M_sun / h", Dimension::Mass), Some((1e10, "Msun", SUN, 0.0, -1.0)));
        assert_eq!(Unit::parts("ckpc/h", Dimension::Length), Some((1.0, "kpc", kpc, 1.0, -1.0)));
        assert_eq!(Unit::parts("sigma", Dimension::Length), None);
    }

    #[test]
    fn units_are_turned_over() {
        assert_eq!(["Mpc/h", "kpc", "a/b/c"].map(per_length), ["h/Mpc", "1/kpc", "1/(a/b/c)"]);
    }

    #[test]
    fn other_words_are_labels() {
        for text in [
            "parsecs-ish",
            "",
            "Mpcs",
            "furlong",
            "Msun",
            "1e10",
            "h",
            "a",
            "Mpc Mpc",
            "1/Mpc",
            "Mpc^2",
            "kpc/",
            "0 kpc",
            "kpc/0",
            "Mpc/(h a)",
            "1e999 m",
            "code_length",
            "nan kpc",
            "cm/s",
            "ccm",
            "m/h^1e99",
        ] {
            assert!(!Unit::is_known(text, Dimension::Length), "{text}");
            assert_eq!(Unit::parse(text, Dimension::Length), Unit { text: text.into(), si: None });
        }
        assert!(Unit::is_known("sigma", Dimension::Length));
        assert_eq!(Unit::parse("sigma", Dimension::Length).si, None);
    }

    #[test]
    fn comoving_and_the_exponent_of_a_say_one_thing() {
        let statements_of = |text, comoving| {
            let units = Units::new(Some(text), None, comoving);
            (units.comoving, units.length.unwrap().si.unwrap().a)
        };
        assert_eq!(statements_of("kpc/h", Some(true)), (Some(true), 1.0));
        assert_eq!(statements_of("kpc/h", Some(false)), (Some(false), 0.0));
        assert_eq!(statements_of("kpc/h", None), (None, 0.0));
        assert_eq!(statements_of("kpccm/h", None), (Some(true), 1.0));
        assert_eq!(statements_of("pkpc", Some(true)), (Some(false), 0.0));
    }

    #[test]
    fn units_come_back_from_json() {
        let units = Units::new(Some("1e3 kpc/h"), Some("a label"), Some(true));
        let json = serde_json::to_value(&units).unwrap();
        assert_eq!((&json["length_unit"], &json["mass_unit_si"]), (&"1e3 kpc/h".into(), &serde_json::Value::Null));
        assert_eq!(serde_json::from_value::<Units>(json).unwrap(), units);
        let words = units.length.unwrap().describe(Dimension::Length);
        assert!(words.starts_with("1e3 kpc/h (3.085677581") && words.ends_with("e22 m a h^-1)"), "{words}");
    }

    proptest! {
        #[test]
        fn any_text_is_a_unit_or_a_label(text in "\\PC{0,12}|[0-9e^*/ .hakpcmM-]{0,16}") {
            let unit = Unit::parse(&text, Dimension::Length);
            prop_assert!(unit.si.is_none_or(|si| si.factor > 0.0 && si.factor.is_finite() && si.h.is_finite()));
        }
    }
}
