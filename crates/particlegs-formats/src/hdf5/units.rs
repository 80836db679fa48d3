//! Units as text: what a file says in centimetres, grams and powers of h, by name where it has one.

use super::attributes::Attributes;
use super::header::Groups;

/// Lengths with names, in centimetres.
const LENGTHS: [(&str, f64); 9] = [
    ("cm", 1.0),
    ("m", 1e2),
    ("km", 1e5),
    ("Rsun", 6.957e10),
    ("AU", 1.495_978_707e13),
    ("pc", 3.085_677_581_5e18),
    ("kpc", 3.085_677_581_5e21),
    ("Mpc", 3.085_677_581_5e24),
    ("Gpc", 3.085_677_581_5e27),
];

/// The sun's mass in grams.
const SUN: f64 = 1.988_41e33;

/// How far a file's number may be from a named unit's: codes differ in the digits they keep.
const TOLERANCE: f64 = 1e-3;

/// A data set's unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unit {
    /// As text.
    pub text: Option<String>,
    /// Does it grow with the scale factor?
    pub comoving: Option<bool>,
}

/// What a unit measures.
#[derive(Clone, Copy, PartialEq)]
pub enum Quantity {
    /// Length.
    Length,
    /// Mass.
    Mass,
}

/// What a file says of the simulation as a whole.
pub struct Simulation<'a> {
    /// The attributes of its groups.
    pub groups: &'a Groups,
    /// Does its space expand?
    pub cosmological: Option<bool>,
    /// h.
    pub hubble: Option<f64>,
}

/// The unit of a data set with attributes `own`. What they do not say about h, those of the `positions` may.
pub fn unit(
    own: &Attributes,
    positions: &Attributes,
    simulation: &Simulation<'_>,
    quantity: Quantity,
    notes: &mut Vec<String>,
) -> Unit {
    let &Simulation { groups, cosmological, hubble } = simulation;
    let comoving = comoving(own, cosmological);
    if let Some(text) = own.text(&["unit", "units", "Units"]).filter(|t| !t.starts_with("arepo_")) {
        return Unit { text: Some(text.to_string()), comoving };
    }
    let Some(cgs) = in_cgs(own, groups, quantity) else { return Unit { text: None, comoving } };
    let stated = h_power(own, groups).or_else(|| h_power(positions, groups));
    let Some(power) = stated.or_else(|| h_power_by_rule(cosmological, hubble, notes)) else {
        return Unit { text: None, comoving };
    };
    let name = match quantity {
        Quantity::Length => length_name,
        Quantity::Mass => mass_name,
    };
    // GIZMO writes its unit with h in it: 4.4e21 cm is kpc/h where h is 0.7.
    let without = hubble.filter(|_| power == 0.0 && name(cgs).1).map(|h| name(cgs * h)).filter(|n| !n.1);
    let text = match (without, power) {
        (Some((name, _)), _) => format!("{name}/h"),
        (None, 0.0) => name(cgs).0,
        (None, -1.0) => format!("{}/h", name(cgs).0),
        (None, p) => format!("{} h^{p}", name(cgs).0),
    };
    Unit { text: Some(text), comoving }
}

fn comoving(own: &Attributes, cosmological: Option<bool>) -> Option<bool> {
    // AREPO writes its power of a for isolated runs, too: what the run says comes first.
    match (cosmological, a_power(own)) {
        (Some(false), _) => Some(false),
        (_, Some(power)) => Some(power != 0.0),
        (said, None) => said,
    }
}

/// The power of the scale factor that a data set's attributes state.
pub fn a_power(own: &Attributes) -> Option<f64> {
    own.number(&["a_scaling", "aexp-scale-exponent", "a-scale exponent"])
}

fn in_cgs(own: &Attributes, groups: &Groups, quantity: Quantity) -> Option<f64> {
    const SWIFT: &str = "Conversion factor to CGS (not including cosmological corrections)";
    let named: &[&str] = match quantity {
        Quantity::Length => &["UnitLength_in_cm", "UnitLength_In_CGS", "Unit length in cgs (U_L)"],
        Quantity::Mass => &["UnitMass_in_g", "UnitMass_In_CGS", "Unit mass in cgs (U_M)"],
    };
    let sound = |v: &f64| v.is_finite() && *v > 0.0;
    let own = own.number(&["to_cgs", "CGSConversionFactor", SWIFT]).filter(sound);
    let elsewhere =
        [&groups.header, &groups.parameters, &groups.units].into_iter().find_map(|a| a.number(named).filter(sound));
    own.or(elsewhere)
}

fn h_power(own: &Attributes, groups: &Groups) -> Option<f64> {
    let stated = own.number(&["h_scaling", "h-scale-exponent", "h-scale exponent"]);
    // Paicos keeps units as formulas: `arepo_length small_a / small_h`.
    let formula = own.text(&["unit"]).filter(|t| t.starts_with("arepo_"));
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
        (_, Some(false)) => (None, "no attribute says whether units are per h: units left out"),
        // Gadget's own rule: its unit is so many cm/h.
        _ => (Some(-1.0), "lengths and masses are taken as per h, which is Gadget's rule; no attribute says so"),
    };
    if !notes.iter().any(|n| n == note) {
        notes.push(note.to_string());
    }
    power
}

/// A length's name, and whether it has none but a number.
fn length_name(cm: f64) -> (String, bool) {
    match LENGTHS.iter().find(|l| (cm / l.1 - 1.0).abs() < TOLERANCE) {
        Some(l) => (l.0.to_string(), false),
        None => (format!("{} cm", number(cm)), true),
    }
}

/// A mass's name, and whether it has none but a number.
fn mass_name(grams: f64) -> (String, bool) {
    let suns = grams / SUN;
    let power = suns.log10().round();
    if (suns / 10f64.powf(power) - 1.0).abs() < TOLERANCE && (-6.0..=20.0).contains(&power) {
        return (if power == 0.0 { "Msun".into() } else { format!("1e{power} Msun") }, false);
    }
    match grams {
        1.0 => ("g".into(), false),
        1e3 => ("kg".into(), false),
        _ => (format!("{} g", number(grams)), true),
    }
}

/// A number in at most six digits: `3.2e21`.
fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    format!("{rounded:e}")
}

/// Centimetres or grams of a unit's text, and its power of h: what [`unit`] writes.
pub fn parse(text: &str, quantity: Quantity) -> Option<(f64, f64)> {
    let (name, power) = match text.strip_suffix("/h") {
        Some(name) => (name.trim(), -1.0),
        None => (text.trim(), 0.0),
    };
    let (factor, name) = match name.split_once(' ') {
        Some((factor, name)) => (factor.parse().ok()?, name.trim()),
        None => (1.0, name),
    };
    let base = match (quantity, name) {
        (Quantity::Mass, "Msun") => SUN,
        (Quantity::Mass, "g") => 1.0,
        (Quantity::Mass, "kg") => 1e3,
        (Quantity::Length, name) => LENGTHS.iter().find(|l| l.0 == name)?.1,
        _ => return None,
    };
    Some((factor * base, power))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(own: &[(&str, f64)], parameters: &[(&str, f64)], cosmological: Option<bool>, hubble: Option<f64>) -> Unit {
        let groups = Groups { parameters: Attributes::of_numbers(parameters), ..Groups::default() };
        let simulation = Simulation { groups: &groups, cosmological, hubble };
        let own = Attributes::of_numbers(own);
        unit(&own, &Attributes::default(), &simulation, Quantity::Length, &mut Vec::new())
    }

    #[test]
    fn units_are_named_as_the_file_says() {
        let kpc = [("UnitLength_in_cm", 3.085678e21)];
        let scaled =
            of(&[("a_scaling", 1.0), ("h_scaling", -1.0), ("to_cgs", 3.085678e21)], &[], Some(true), Some(0.7));
        assert_eq!(scaled, Unit { text: Some("kpc/h".into()), comoving: Some(true) });
        let plain = of(&[("a_scaling", 0.0), ("h_scaling", 0.0), ("to_cgs", 3.085678e24)], &[], Some(false), Some(1.0));
        assert_eq!(plain, Unit { text: Some("Mpc".into()), comoving: Some(false) });
        assert_eq!(of(&[], &kpc, Some(true), Some(0.7)).text.as_deref(), Some("kpc/h"));
        assert_eq!(of(&[], &kpc, Some(false), Some(1.0)).text.as_deref(), Some("kpc"));
        assert_eq!(of(&[], &kpc, Some(false), Some(0.7)).text, None);
        assert_eq!(of(&[], &[], Some(true), Some(0.7)), Unit { text: None, comoving: Some(true) });
        assert_eq!(length_name(1.496e13).0, "AU");
        assert_eq!(length_name(3.2e21), ("3.2e21 cm".into(), true));
        assert_eq!(mass_name(1.989e43).0, "1e10 Msun");
        assert_eq!(mass_name(1.989e33).0, "Msun");
        assert_eq!(mass_name(5e40).0, "5e40 g");
        let gizmo = |cm, h| of(&[], &[("UnitLength_In_CGS", cm)], Some(true), Some(h)).text.unwrap();
        assert_eq!(gizmo(3.085678e21 / 0.7, 0.7), "kpc/h");
        assert_eq!(gizmo(3.085678e21, 0.7), "kpc");
        assert_eq!(gizmo(3.2e21, 0.7), "3.2e21 cm");
    }

    #[test]
    fn texts_are_read_back() {
        for text in ["kpc/h", "Mpc", "3.2e21 cm/h", "AU"] {
            let (cm, power) = parse(text, Quantity::Length).unwrap();
            let name = length_name(cm).0;
            assert_eq!(if power == 0.0 { name } else { format!("{name}/h") }, text);
        }
        assert_eq!(parse("1e10 Msun/h", Quantity::Mass), Some((1e10 * SUN, -1.0)));
        assert_eq!(parse("sigma", Quantity::Length), None);
    }
}
