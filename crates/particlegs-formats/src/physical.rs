//! Factors to peculiar velocities in km/s and physical specific energies in (km/s)^2: one rule for all formats.

use particlegs_particles::{PhysicalUnit, SnapshotMeta, SourceField};

/// The convention of velocities and specific energies where their own attributes and units do not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct VelocityConvention {
    /// The unit of velocity in cm/s, where the file states one.
    pub unit: Option<f64>,
    /// Powers of the scale factor that make velocities peculiar and energies physical in cosmological runs of the code
    /// that wrote the file; `None` where it is not known.
    pub powers: Option<[f64; 2]>,
    /// Whether the run is cosmological; `None` where nothing decides.
    pub cosmological: Option<bool>,
    /// The scale factor, where the file states it.
    pub scale_factor: Option<f64>,
}

impl VelocityConvention {
    /// Gadget's and its descendants': velocities over sqrt(a), energies without a.
    pub const GADGET: [f64; 2] = [0.5, 0.0];
    /// SWIFT's: peculiar velocities, comoving energies of gas with gamma = 5/3.
    pub const SWIFT: [f64; 2] = [0.0, -2.0];

    /// Whether it leaves open what velocities without attributes are.
    pub fn is_undecided(&self) -> bool {
        let depends = self.powers.is_some_and(|[power, _]| power != 0.0);
        depends && self.cosmological.is_none() && self.scale_factor != Some(1.0)
    }
}

/// The note for the user where nothing decides.
pub const UNDECIDED: &str = "the file does not say whether the run is cosmological: velocities keep the file's values";

/// Difference of a time from the scale factor of a redshift, at most, for their rounding.
pub const SAME_MOMENT: f64 = 1e-5;

/// Whether a header's time shows that it is no scale factor. The redshift of isolated runs is 0, whatever their time,
/// and their `matter` density and box may be 0.
pub fn is_isolated(time: Option<f64>, redshift: Option<f64>, matter: Option<f64>, box_size: Option<f64>) -> bool {
    let is_another_time = time.is_some_and(|t| (t - 1.0).abs() > SAME_MOMENT);
    match redshift {
        Some(z) => z.abs() < SAME_MOMENT && (is_another_time || matter == Some(0.0)),
        None => matter == Some(0.0) || matter.is_none() && is_another_time && box_size == Some(0.0),
    }
}

/// The factor for a field and why it is that: by its attributes (SWIFT, EAGLE, AREPO, Gadget-4), by its unit's text, else
/// by the convention of the code. `None` where nothing tells, where a is needed and not known, and for other fields.
pub fn physical(
    (name, components): (&str, u32),
    unit: Option<&str>,
    attributes: &[(String, f64)],
    convention: &VelocityConvention,
    meta: &SnapshotMeta,
) -> Option<PhysicalUnit> {
    let is_energy = components == 1 && ENERGIES.iter().any(|n| n.eq_ignore_ascii_case(name));
    if !is_energy && !SourceField::is_velocity(name, components) {
        return None;
    }
    let (index, dimension) = if is_energy { (1, 2) } else { (0, 1) };
    let (km_s, unit_name) = (1e5f64.powi(dimension), ["km/s", "(km/s)^2"][index]);
    let number = |names: &[&str]| {
        names.iter().find_map(|n| attributes.iter().find(|a| a.0 == *n && a.1.is_finite()).map(|a| a.1))
    };
    let states_none = unit.is_none_or(|text| text.trim().is_empty());
    let text = unit.and_then(|text| of_text(text, dimension));
    let cgs = number(&["to_cgs", "CGSConversionFactor", SWIFT_CGS]).filter(|v| *v > 0.0).or(text.map(|t| t.0));
    let cgs = cgs.or(convention.unit.map(|v| v.powi(dimension)));
    // A unit whose text is not understood must not be taken for km/s.
    let unit = cgs.or(convention.powers.filter(|_| states_none).map(|_| km_s))? / km_s;
    let stated = number(&["a_scaling", "aexp-scale-exponent", "a-scale exponent"]).or(text.map(|t| t.1));
    let scale_factor = convention.scale_factor.or(meta.epoch.scale_factor);
    let power = match (convention.cosmological, stated, convention.powers.map(|p| p[index])) {
        // AREPO writes its power of a for isolated runs, too.
        (Some(false), ..) => 0.0,
        (_, Some(power), _) | (Some(true), None, Some(power)) => power,
        // Without a power it does not matter whether the run is cosmological.
        (None, None, Some(0.0)) => 0.0,
        _ if scale_factor == Some(1.0) => 0.0,
        _ => return None,
    };
    let hubble = match number(&["h_scaling", "h-scale-exponent", "h-scale exponent"]).unwrap_or(0.0) {
        0.0 => 1.0,
        power => meta.cosmology.hubble?.powf(power),
    };
    let a = if power == 0.0 { 1.0 } else { scale_factor? };
    let factor = a.powf(power) * hubble * unit;
    if !factor.is_normal() || factor < 0.0 {
        return None;
    }
    let kind = if is_energy { "" } else { "peculiar " };
    let mut why = vec![format!("{kind}{unit_name}, the file's values times {factor:.6}")];
    why.extend((power != 0.0).then(|| format!("a^{power} with a = {a}")));
    why.extend(cgs.is_none().then(|| format!("the file's unit is taken as {unit_name}")));
    Some(PhysicalUnit { factor, note: why.join("; ") })
}

/// Names of specific energies of gas.
const ENERGIES: [&str; 3] = ["InternalEnergy", "InternalEnergies", "U"];

pub const SWIFT_CGS: &str = "Conversion factor to CGS (not including cosmological corrections)";

/// A unit of velocities (to the power 1) or specific energies (2) in CGS, and the power of a that makes them peculiar or
/// physical: of `comoving km/s`, `cm s^-1`, `(km/s)**2`.
fn of_text(text: &str, dimension: i32) -> Option<(f64, f64)> {
    let text = text.trim().to_ascii_lowercase();
    let (power, plain) = match text.split_once(' ') {
        Some(("comoving", rest)) => (f64::from(dimension), rest),
        Some(("sqrt(a)", rest)) => (0.5 * f64::from(dimension), rest),
        Some(("peculiar" | "physical" | "proper", rest)) => (0.0, rest),
        _ => (0.0, &text[..]),
    };
    // `km s**-1`, `km.s^-1` and the like become one spelling.
    let plain = plain.replace([' ', '*', '^', '(', ')', '.'], "");
    let forms = if dimension == 1 { &["/s", "s-1"][..] } else { &["/s2", "2/s2", "2s-2"] };
    let mut units = [("km", 1e5f64), ("m", 1e2), ("cm", 1.0)].into_iter();
    let unit = units.find(|(name, _)| plain.strip_prefix(name).is_some_and(|rest| forms.contains(&rest)));
    match (&plain[..], dimension) {
        ("erg/g" | "ergg-1", 2) => Some((1.0, power)),
        _ => unit.map(|(_, cgs)| (cgs.powi(dimension), power)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::model::{Cosmology, Epoch};

    const KNOWN: VelocityConvention = VelocityConvention {
        unit: None,
        powers: Some(VelocityConvention::GADGET),
        cosmological: Some(true),
        scale_factor: Some(0.25),
    };

    fn factor(name: &str, unit: Option<&str>, attributes: &[(&str, f64)], c: &VelocityConvention) -> Option<f64> {
        let attributes: Vec<_> = attributes.iter().map(|(n, v)| (n.to_string(), *v)).collect();
        let meta = SnapshotMeta {
            epoch: Epoch { scale_factor: c.scale_factor, ..Epoch::default() },
            cosmology: Cosmology { hubble: Some(0.5), ..Cosmology::default() },
            ..SnapshotMeta::default()
        };
        let components = if name == "InternalEnergy" { 1 } else { 3 };
        physical((name, components), unit, &attributes, c, &meta).map(|p| p.factor)
    }

    #[test]
    fn velocities_without_attributes_are_by_the_convention_of_their_code() {
        let factor_of = |c| factor("Velocities", None, &[], &c);
        assert_eq!(factor_of(KNOWN), Some(0.5));
        assert_eq!(factor_of(VelocityConvention { unit: Some(1e7), ..KNOWN }), Some(50.0));
        assert_eq!(factor_of(VelocityConvention { powers: Some(VelocityConvention::SWIFT), ..KNOWN }), Some(1.0));
        assert_eq!(factor_of(VelocityConvention { cosmological: Some(false), ..KNOWN }), Some(1.0));
        assert_eq!(factor_of(VelocityConvention { cosmological: None, ..KNOWN }), None);
        assert_eq!(factor_of(VelocityConvention { cosmological: None, scale_factor: Some(1.0), ..KNOWN }), Some(1.0));
        assert_eq!(factor_of(VelocityConvention::default()), None);
        assert_eq!(factor("Density", None, &[], &KNOWN), None);
    }

    #[test]
    fn the_unit_of_velocity_holds_for_energies() {
        let factor_of =
            |unit, powers| factor("InternalEnergy", None, &[], &VelocityConvention { unit, powers, ..KNOWN });
        assert_eq!(factor_of(Some(1e7), KNOWN.powers), Some(1e4));
        assert_eq!(factor_of(None, KNOWN.powers), Some(1.0));
        assert_eq!(factor_of(None, Some(VelocityConvention::SWIFT)), Some(16.0));
        let stated = [("to_cgs", 1e12), ("a_scaling", -2.0)];
        assert_eq!(factor("InternalEnergy", None, &stated, &VelocityConvention::default()), None);
        assert_eq!(factor("InternalEnergy", None, &stated, &KNOWN), Some(1600.0));
    }

    #[test]
    fn attributes_come_before_units_and_these_before_the_convention() {
        let eagle = [("aexp-scale-exponent", 1.0), ("h-scale-exponent", -1.0), ("CGSConversionFactor", 1e4)];
        assert_eq!(factor("Velocity", Some("km/s"), &eagle, &KNOWN), Some(0.25 / 0.5 * 0.1));
        let open = VelocityConvention { cosmological: None, powers: None, ..KNOWN };
        for (text, wanted) in [
            ("km/s", Some(1.0)),
            ("km s**-1", Some(1.0)),
            ("comoving km/s", Some(0.25)),
            ("sqrt(a) km/s", Some(0.5)),
            ("cm s^-1", Some(1e-5)),
            ("m/s", Some(1e-3)),
            ("km/h", None),
            ("nm ps-1", None),
        ] {
            assert_eq!(factor("velocity", Some(text), &[], &open), wanted, "{text}");
            assert_eq!(factor("velocity", Some(text), &[], &KNOWN), wanted, "{text}");
        }
        assert_eq!(factor("InternalEnergy", Some("(cm/s)^2"), &[], &open), Some(1e-10));
        assert_eq!(factor("InternalEnergy", Some("erg/g"), &[], &open), Some(1e-10));
    }

    #[test]
    fn a_time_that_is_no_scale_factor_is_that_of_an_isolated_run() {
        let (some, none) = (Some::<f64>, None);
        assert!(is_isolated(some(2.3), some(0.0), some(0.3), some(10.0)));
        assert!(is_isolated(some(0.0), some(0.0), none, none));
        assert!(is_isolated(some(1.0), some(0.0), some(0.0), none));
        assert!(is_isolated(some(0.25), none, some(0.0), none) && is_isolated(some(0.25), none, none, some(0.0)));
        assert!(!is_isolated(some(0.25), some(3.0), some(0.3), some(0.0)));
        assert!(!is_isolated(some(1.0), some(0.0), some(0.3), some(10.0)));
        assert!(!is_isolated(some(0.25), none, some(0.3), some(10.0)) && !is_isolated(none, none, none, none));
    }
}
