//! Units: what a file says in centimetres, grams and powers of h and a, by name where it has one.

use super::attributes::{Attributes, HeaderGroups};
use crate::physical::SWIFT_CGS;
use particlegs_core::model::{Dimension, Si, Unit};

/// Names that lengths get, the smallest first.
const LENGTHS: [&str; 9] = ["cm", "m", "km", "Rsun", "AU", "pc", "kpc", "Mpc", "Gpc"];

/// Relative difference of a file's number from a named unit's, at most: codes differ in the digits they keep.
const TOLERANCE: f64 = 1e-3;

/// Metadata of the simulation as a whole.
pub struct Simulation<'a> {
    pub groups: &'a HeaderGroups,
    pub cosmological: Option<bool>,
    pub hubble: Option<f64>,
}

/// The unit of a data set with these attributes, and whether it grows with the scale factor. The power of h, where they
/// do not state it, may be stated by those of the `positions`.
pub fn unit(
    attributes: &Attributes,
    positions: &Attributes,
    simulation: &Simulation<'_>,
    dimension: Dimension,
    notes: &mut Vec<String>,
) -> (Option<Unit>, Option<bool>) {
    let &Simulation { groups, cosmological, hubble } = simulation;
    let comoving = comoving(attributes, cosmological);
    if let Some(text) = attributes.text(&["unit", "units", "Units"]).filter(|t| !t.starts_with("arepo_")) {
        return (Some(Unit::parse(text, dimension)), comoving);
    }
    let Some(size) = in_si(attributes, groups, dimension) else { return (None, comoving) };
    let stated = h_power(attributes, groups).or_else(|| h_power(positions, groups));
    let Some(power) = stated.or_else(|| h_power_by_rule(cosmological, hubble, notes)) else { return (None, comoving) };
    // GIZMO writes its unit with h in it: 4.4e21 cm is kpc/h where h is 0.7.
    let without = hubble.filter(|_| power == 0.0 && name(size, dimension).1).map(|h| size * h);
    let (factor, power) = match without.filter(|&size| !name(size, dimension).1) {
        Some(size) => (size, -1.0),
        None => (size, power),
    };
    let name = name(factor, dimension).0;
    let text = match power {
        0.0 => name,
        -1.0 => format!("{name}/h"),
        p => format!("{name} h^{p}"),
    };
    let a = if dimension == Dimension::Length && comoving == Some(true) { 1.0 } else { 0.0 };
    (Some(Unit { text, si: Some(Si { factor, a, h: power as f32 }) }), comoving)
}

fn comoving(attributes: &Attributes, cosmological: Option<bool>) -> Option<bool> {
    // AREPO writes its power of a for isolated runs, too: what the run says comes first.
    match (cosmological, a_power(attributes)) {
        (Some(false), _) => Some(false),
        (_, Some(power)) => Some(power != 0.0),
        (said, None) => said,
    }
}

/// The power of the scale factor that a data set's attributes state.
pub fn a_power(attributes: &Attributes) -> Option<f64> {
    attributes.number(&["a_scaling", "aexp-scale-exponent", "a-scale exponent"])
}

/// A unit in metres or kilograms: files have it in centimetres or grams.
fn in_si(attributes: &Attributes, groups: &HeaderGroups, dimension: Dimension) -> Option<f64> {
    let named: &[&str] = match dimension {
        Dimension::Length => &["UnitLength_in_cm", "UnitLength_In_CGS", "Unit length in cgs (U_L)"],
        Dimension::Mass => &["UnitMass_in_g", "UnitMass_In_CGS", "Unit mass in cgs (U_M)"],
        Dimension::Time => &[],
    };
    let sound = |v: &f64| (1e-200..1e200).contains(v);
    let set_cgs = attributes.number(&["to_cgs", "CGSConversionFactor", SWIFT_CGS]).filter(sound);
    let elsewhere =
        [&groups.header, &groups.parameters, &groups.units].into_iter().find_map(|a| a.number(named).filter(sound));
    set_cgs.or(elsewhere).map(|cgs| cgs / per_si(dimension))
}

/// The unit of velocity in cm/s: stated, or that of length over that of time.
pub fn velocity(groups: &HeaderGroups) -> Option<f64> {
    let stated = |names: &[&str]| {
        let all = [&groups.header, &groups.parameters, &groups.units].into_iter();
        all.filter_map(|a| a.number(names)).find(|v| (1e-200..1e200).contains(v))
    };
    let time = || stated(&["Unit time in cgs (U_t)", "UnitTime_in_s", "UnitTime_In_CGS"]);
    let length = || stated(&["Unit length in cgs (U_L)", "UnitLength_in_cm", "UnitLength_In_CGS"]);
    stated(&["UnitVelocity_in_cm_per_s", "UnitVelocity_In_CGS"]).or_else(|| Some(length()? / time()?))
}

/// CGS units in the SI unit.
pub fn per_si(dimension: Dimension) -> f64 {
    match dimension {
        Dimension::Length => 1e2,
        Dimension::Mass => 1e3,
        Dimension::Time => 1.0,
    }
}

/// The unit of a file's time, which SWIFT states in seconds.
pub fn time_unit(groups: &HeaderGroups) -> Option<Unit> {
    let seconds = groups.units.number(&["Unit time in cgs (U_t)"])?;
    Some(Unit::parse(&format!("{seconds:e} s"), Dimension::Time))
}

fn h_power(attributes: &Attributes, groups: &HeaderGroups) -> Option<f64> {
    let stated = attributes.number(&["h_scaling", "h-scale-exponent", "h-scale exponent"]);
    // Paicos keeps units as formulas: `arepo_length small_a / small_h`.
    let formula = attributes.text(&["unit"]).filter(|t| t.starts_with("arepo_"));
    let formula = formula.map(|t| if t.split('/').skip(1).any(|d| d.trim() == "small_h") { -1.0 } else { 0.0 });
    // SWIFT has no h in any unit; GIZMO's names in capitals are for units that contain it.
    let swift = groups.units.has("Unit length in cgs (U_L)");
    let gizmo = groups.header.has("UnitLength_In_CGS") || groups.parameters.has("UnitLength_In_CGS");
    stated.filter(|p| p.is_finite()).or(formula).or((swift || gizmo).then_some(0.0))
}

/// The power of h where no attribute states it; `None` where nothing tells.
fn h_power_by_rule(cosmological: Option<bool>, hubble: Option<f64>, notes: &mut Vec<String>) -> Option<f64> {
    let (power, note) = match (hubble, cosmological) {
        (None, _) | (Some(1.0), _) => return Some(0.0),
        (_, Some(false)) => (None, "no attribute says whether units include h: units are ignored"),
        // Gadget's own rule: its unit is so many cm/h.
        _ => (Some(-1.0), "lengths and masses are assumed to be per h, as in Gadget; no attribute says so"),
    };
    if !notes.iter().any(|n| n == note) {
        notes.push(note.to_string());
    }
    power
}

/// The name of a unit in SI, and whether it has none but a number.
fn name(size: f64, dimension: Dimension) -> (String, bool) {
    let factor = |name: &str| Unit::parse(name, dimension).si.map_or(f64::NAN, |si| si.factor);
    let is = |text: &&str| (size / factor(text) - 1.0).abs() < TOLERANCE;
    if dimension == Dimension::Length {
        let known = LENGTHS.iter().find(|l| is(l));
        return known.map_or_else(|| (format!("{} cm", number(1e2 * size)), true), |l| (l.to_string(), false));
    }
    let suns = size / factor("Msun");
    let power = suns.log10().round();
    if (suns / 10f64.powf(power) - 1.0).abs() < TOLERANCE && (-6.0..=20.0).contains(&power) {
        return (if power == 0.0 { "Msun".into() } else { format!("1e{power} Msun") }, false);
    }
    match size {
        1e-3 => ("g".into(), false),
        1.0 => ("kg".into(), false),
        _ => (format!("{} g", number(1e3 * size)), true),
    }
}

/// A number in at most six digits: `3.2e21`.
fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    format!("{rounded:e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_of(
        numbers: &[(&str, f64)],
        parameters: &[(&str, f64)],
        run: (Option<bool>, Option<f64>),
    ) -> (Option<Unit>, Option<bool>) {
        let groups = HeaderGroups { parameters: Attributes::from_numbers(parameters), ..HeaderGroups::default() };
        let simulation = Simulation { groups: &groups, cosmological: run.0, hubble: run.1 };
        let attributes = Attributes::from_numbers(numbers);
        unit(&attributes, &Attributes::default(), &simulation, Dimension::Length, &mut Vec::new())
    }

    fn text(unit_and_comoving: (Option<Unit>, Option<bool>)) -> Option<String> {
        unit_and_comoving.0.map(|u| u.text)
    }

    #[test]
    fn units_are_named_as_the_file_says() {
        let kpc = [("UnitLength_in_cm", 3.085678e21)];
        let run = (Some(true), Some(0.7));
        let scaled = unit_of(&[("a_scaling", 1.0), ("h_scaling", -1.0), ("to_cgs", 3.085678e21)], &[], run);
        let si = Some(Si { factor: 3.085678e19, a: 1.0, h: -1.0 });
        assert_eq!(scaled, (Some(Unit { text: "kpc/h".into(), si }), Some(true)));
        let still = (Some(false), Some(1.0));
        let plain = unit_of(&[("a_scaling", 0.0), ("h_scaling", 0.0), ("to_cgs", 3.085678e24)], &[], still);
        assert_eq!((text(plain.clone()).as_deref(), plain.1), (Some("Mpc"), Some(false)));
        assert_eq!(text(unit_of(&[], &kpc, run)).as_deref(), Some("kpc/h"));
        assert_eq!(text(unit_of(&[], &kpc, still)).as_deref(), Some("kpc"));
        assert_eq!(unit_of(&[], &kpc, (Some(false), Some(0.7))).0, None);
        assert_eq!(unit_of(&[], &[], run), (None, Some(true)));
        let length = |cm: f64| name(cm / 1e2, Dimension::Length);
        let mass = |grams: f64| name(grams / 1e3, Dimension::Mass).0;
        assert_eq!(length(1.496e13).0, "AU");
        assert_eq!(length(3.2e21), ("3.2e21 cm".into(), true));
        assert_eq!([1.989e43, 1.989e33, 5e40, 1.0].map(mass), ["1e10 Msun", "Msun", "5e40 g", "g"]);
        // What is written is what is read by name.
        for text in ["AU", "kpc", "3.2e21 cm"] {
            let si = Unit::parse(text, Dimension::Length).si.unwrap();
            assert_eq!(name(si.factor, Dimension::Length).0, text);
        }
        let gizmo = |cm, h| unit_of(&[], &[("UnitLength_In_CGS", cm)], (Some(true), Some(h))).0.unwrap();
        let per_h = gizmo(3.085678e21 / 0.7, 0.7);
        assert_eq!((&per_h.text[..], per_h.si.map(|si| (si.a, si.h))), ("kpc/h", Some((1.0, -1.0))));
        assert_eq!(gizmo(3.085678e21, 0.7).text, "kpc");
        assert_eq!(gizmo(3.2e21, 0.7).text, "3.2e21 cm");
    }
}
