//! Numbers in one unit as numbers in another.

use super::{Cosmology, Dimension, Epoch, LawKind, Layer, Mass, Metadata, Model, Si, Unit, Units};
use crate::context::Context;
use crate::{Error, Result};

/// The scale factor or h of two subjects differ where they do by more than this share.
const SAME: f64 = 1e-5;
/// A unit that a source states by a number has the size of its name where the two differ by no more than this share:
/// programs have different masses of the sun.
const NAMED: f64 = 1e-3;

/// Units of numbers, with the scale factor and h that these contain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitSystem<'a> {
    /// Units.
    pub units: &'a Units,
    /// The scale factor, where it is known.
    pub scale_factor: Option<f64>,
    /// Hubble parameter h, where it is known.
    pub hubble: Option<f64>,
}

/// From one system of units to another.
#[derive(Clone, Debug, PartialEq)]
pub struct Conversion {
    /// Lengths are multiplied by this.
    pub length: f64,
    /// Masses are multiplied by this.
    pub mass: f64,
    /// Statements that one of the two lacks, and that are therefore taken from the other, in words.
    pub unstated: Vec<String>,
}

impl Conversion {
    /// Whether numbers stay as they are.
    pub fn is_identity(&self) -> bool {
        self.length == 1.0 && self.mass == 1.0
    }

    /// A layer whose masses are converted; its weights are relative to the mass of weight 1.
    pub fn layer<T>(&self, layer: Layer<T>) -> Layer<T> {
        let mass = match layer.mass {
            Mass::Each(each) => Mass::Each(each * self.mass),
            Mass::Weights(unit) if self.mass != 1.0 => Mass::Weights(Some(unit.unwrap_or(1.0) * self.mass)),
            mass => mass,
        };
        Layer { mass, ..layer }
    }
}

impl Metadata {
    /// The units of the model's numbers.
    pub fn unit_system(&self) -> UnitSystem<'_> {
        UnitSystem::new(&self.units, &self.epoch, &self.cosmology)
    }
}

impl<'a> UnitSystem<'a> {
    /// Units at a moment of a cosmology.
    pub fn new(units: &'a Units, epoch: &Epoch, cosmology: &Cosmology) -> Self {
        UnitSystem { units, scale_factor: epoch.scale_factor, hubble: cosmology.hubble }
    }

    /// The conversion of numbers of this system to `to`. Comoving lengths stay comoving, whatever the two moments. A
    /// statement that one of the two lacks (a unit, or whether lengths are comoving) is taken to be as in the other.
    ///
    /// # Errors
    /// In words, for a unit without a size against another text, and where a or h is needed that is not known, or
    /// that the two state differently.
    pub fn conversion(&self, to: &UnitSystem<'_>) -> std::result::Result<Conversion, String> {
        let mut unstated = Vec::new();
        let comoving = [(self, to), (to, self)].map(|(system, other)| system.units.comoving.or(other.units.comoving));
        let both = self.units.length.is_some() && to.units.length.is_some();
        if both && self.units.comoving.is_some() != to.units.comoving.is_some() {
            let word = if comoving[0] == Some(true) { "comoving" } else { "physical" };
            let one = if self.units.comoving.is_none() { "it" } else { "the other" };
            unstated.push(format!("{one} does not say whether lengths are comoving (assumed {word})"));
        }
        let mut factor = |dimension: Dimension| {
            let [from, into] = [self.units, to.units].map(|u| u.of_dimension(dimension));
            let (Some(from), Some(into)) = (from, into) else {
                let (name, stated) = (dimension.name(), from.or(into).map(|u| &u.text));
                let states_unit = from.is_some();
                unstated.extend(stated.map(|text| match states_unit {
                    true => format!("its unit of {name} is {text}, but the other states no unit"),
                    false => format!("it states no unit of {name} (assumed {text})"),
                }));
                return Ok(1.0);
            };
            let a = |comoving: Option<bool>| (dimension == Dimension::Length).then_some(comoving).flatten();
            self.factor([from, into], dimension, comoving.map(a), to)
        };
        let (length, mass) = (factor(Dimension::Length)?, factor(Dimension::Mass)?);
        Ok(Conversion { length, mass, unstated })
    }

    /// [`UnitSystem::conversion`] of the subject `name`, and in words what is converted and what is not stated.
    pub fn conversion_of(&self, name: &str, to: &UnitSystem<'_>) -> Result<(Conversion, Vec<String>)> {
        let conversion = self.conversion(to).map_err(|message| Error::input(name, message))?;
        let mut words: Vec<String> = conversion.unstated.iter().map(|message| format!("{name}: {message}")).collect();
        for (plural, factor, dimension) in
            [("lengths", conversion.length, Dimension::Length), ("masses", conversion.mass, Dimension::Mass)]
        {
            let text = |units: &Units| units.of_dimension(dimension).map_or(String::new(), |u| u.text.clone());
            if factor != 1.0 {
                words.push(format!("{name}: {plural} are converted from {} to {}", text(self.units), text(to.units)));
            }
        }
        Ok((conversion, words))
    }

    /// The factor of two units, which are comoving or not where that is known.
    fn factor(
        &self,
        units: [&Unit; 2],
        dimension: Dimension,
        comoving: [Option<bool>; 2],
        to: &UnitSystem<'_>,
    ) -> std::result::Result<f64, String> {
        let words = || {
            let word = |k: usize| match (comoving[k], comoving[0] != comoving[1]) {
                (Some(true), true) => format!("comoving {}", units[k].text),
                (Some(false), true) => format!("physical {}", units[k].text),
                _ => units[k].text.clone(),
            };
            format!("{} cannot be converted to {}", word(0), word(1))
        };
        let same_text = units[0].text == units[1].text;
        // Two units of one text are the same, even where nothing says how large they are.
        let label = Si { factor: 1.0, a: 0.0, h: 0.0 };
        let sizes = units.map(|u| size(u, dimension).or(same_text.then_some(label)));
        let [Some(from), Some(into)] = sizes else { return Err(format!("{}: the size of one is unknown", words())) };
        // Where it is known whether lengths are comoving, that decides, whatever the unit's text says.
        let exponent = |k: usize, si: Si| comoving[k].map_or(si.a, |c| f32::from(u8::from(c)));
        let a = f64::from(exponent(0, from)) - f64::from(exponent(1, into));
        let h = f64::from(from.h) - f64::from(into.h);
        let mut factor = from.factor / into.factor;
        for (power, name, source, target) in
            [(a, "the scale factor", self.scale_factor, to.scale_factor), (h, "h", self.hubble, to.hubble)]
        {
            if power == 0.0 {
                continue;
            }
            let value = match (source, target) {
                (Some(x), Some(y)) if (x - y).abs() > SAME * y.abs() => {
                    return Err(format!("{}: {name} is {x} in one and {y} in the other", words()));
                }
                (source, target) => source.or(target).filter(|v| *v > 0.0),
            };
            let Some(value) = value else { return Err(format!("{}: {name} is unknown", words())) };
            factor *= libm::pow(value, power);
        }
        // The last digits are those of quotients: 1 Mpc is 1000 kpc.
        let factor = format!("{factor:.13e}").parse().unwrap_or(factor);
        if factor > 0.0 && factor.is_finite() { Ok(factor) } else { Err(words()) }
    }
}

/// The size of a unit in SI.
fn size(unit: &Unit, dimension: Dimension) -> Option<Si> {
    let (si, named) = (unit.si?, Unit::parse(&unit.text, dimension).si);
    let factor = named.map(|n| n.factor).filter(|named| (si.factor / named - 1.0).abs() < NAMED);
    Some(Si { factor: factor.unwrap_or(si.factor), ..si })
}

impl Model {
    /// The model in the units of another system; what the two do not state is taken from the other. The certificate
    /// goes where lengths are converted: its figures are in the model's own unit.
    pub fn in_units(mut self, to: &UnitSystem<'_>, name: &str, context: &Context<'_>) -> Result<Self> {
        let (by, words) = self.metadata.unit_system().conversion_of(name, to)?;
        words.iter().for_each(|words| context.message(&format!("note: {words}")));
        let m = &mut self.metadata;
        m.units = m.units.replaced(to.units);
        let f = by.length;
        if f != 1.0 {
            if m.law == LawKind::AlphaBlend {
                return Err(Error::input(name, "lengths of an alpha-blend model cannot be converted"));
            }
            (m.bounds, m.cell, m.default_radius) =
                (m.bounds.scaled(f), m.cell.map(|c| c.scaled(f)), m.default_radius * f);
            self.certificate = None;
            for block in self.layers.iter_mut().flat_map(|l| &mut l.content) {
                block.bounds = block.bounds.scaled(f);
                block.gaussians.mean.iter_mut().flatten().for_each(|v| *v *= f);
                block.gaussians.cov.iter_mut().flatten().for_each(|v| *v *= f * f);
                for (_, field) in block.gaussians.fields.iter_mut() {
                    field.slope.iter_mut().flatten().flatten().for_each(|v| *v /= f);
                }
            }
        }
        self.layers = self.layers.into_iter().map(|l| by.layer(l)).collect();
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(units: &Units, scale_factor: Option<f64>, hubble: Option<f64>) -> UnitSystem<'_> {
        UnitSystem { units, scale_factor, hubble }
    }

    fn converted(from: (&str, Option<bool>), to: (&str, Option<bool>)) -> std::result::Result<Conversion, String> {
        let units_of = |(text, comoving)| Units::new(Some(text), None, comoving);
        let (from, to) = (units_of(from), units_of(to));
        system(&from, Some(0.5), Some(0.7)).conversion(&system(&to, None, None))
    }

    #[test]
    fn units_of_known_size_are_converted() {
        let (c, p) = (Some(true), Some(false));
        for (from, to, factor) in [
            (("kpc", None), ("Mpc", None), 1e-3),
            (("Mpc", None), ("kpc", None), 1e3),
            (("Mpc/h", c), ("kpccm/h", None), 1e3),
            (("kpc/h", c), ("kpc", c), 1.0 / 0.7),
            (("kpc", c), ("kpc", p), 0.5),
            (("kpc", p), ("ckpc/h", None), 2.0 * 0.7),
            (("comoving kpc", None), ("pkpc", None), 0.5),
            (("nm", None), ("Angstrom", None), 10.0),
            (("sigma", None), ("sigma", None), 1.0),
            (("a label", c), ("a label", p), 0.5),
            (("kpc", None), ("kpc", c), 1.0),
        ] {
            let ratio = converted(from, to).unwrap().length;
            assert!((ratio / factor - 1.0).abs() < 1e-13, "{from:?} to {to:?}: {ratio}");
        }
        let (from, to) = (Units::new(None, Some("1e10 Msun/h"), None), Units::new(None, Some("g"), None));
        let conversion = system(&from, None, Some(0.7)).conversion(&system(&to, None, None)).unwrap();
        assert!(
            (conversion.mass / (1.988_41e43 / 0.7) - 1.0).abs() < 1e-12 && conversion.length == 1.0,
            "{conversion:?}"
        );
    }

    #[test]
    fn what_cannot_be_converted_is_refused_by_name() {
        for (from, to, says) in [
            (("sigma", None), ("nm", None), "sigma cannot be converted to nm"),
            (("kpc", None), ("furlong", None), "kpc cannot be converted to furlong"),
        ] {
            let refused = converted(from, to).unwrap_err();
            assert!(refused.starts_with(says), "{refused}");
        }
        let (by_h, without) = (Units::new(Some("kpc/h"), None, Some(true)), Units::new(Some("kpc"), None, Some(false)));
        let says = |a: [Option<f64>; 2], h: [Option<f64>; 2], text: &str| {
            let refused = system(&by_h, a[0], h[0]).conversion(&system(&without, a[1], h[1])).unwrap_err();
            assert!(refused.contains(text) && refused.contains("comoving kpc/h"), "{refused}");
        };
        says([Some(1.0), None], [None, None], "h is unknown");
        says([None, None], [Some(0.7), None], "the scale factor is unknown");
        says([Some(1.0), Some(0.5)], [Some(0.7), None], "the scale factor is 1 in one and 0.5 in the other");
        says([Some(1.0), None], [Some(0.7), Some(0.68)], "h is 0.7 in one and 0.68 in the other");
    }

    #[test]
    fn what_is_not_stated_is_taken_from_the_other_and_said() {
        assert!(converted(("kpc", None), ("Mpc", None)).unwrap().unstated.is_empty());
        let comoving = converted(("kpc", None), ("Mpc", Some(true))).unwrap();
        assert_eq!(comoving.unstated, ["it does not say whether lengths are comoving (assumed comoving)"]);
        let (stated, silent) = (Units::new(Some("kpc"), Some("Msun"), Some(true)), Units::default());
        let conversion = system(&silent, None, None).conversion(&system(&stated, Some(0.5), None)).unwrap();
        assert!(conversion.is_identity());
        let sun = Units {
            mass: Some(Unit {
                si: Some(Si { factor: 1.989e30, a: 0.0, h: 0.0 }),
                ..Unit::parse("Msun", Dimension::Mass)
            }),
            ..Units::default()
        };
        assert_eq!(system(&stated, None, None).conversion(&system(&sun, None, None)).unwrap().mass, 1.0);
        assert_eq!(
            conversion.unstated,
            ["it states no unit of length (assumed kpc)", "it states no unit of mass (assumed Msun)"]
        );
    }
}
