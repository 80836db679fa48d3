//! Kinds of weights: masses, something else that adds up over particles, or something that does not.

use super::{LawKind, Mass, Metadata, Model};
use crate::{Error, Hint, Result};

/// The kind of a field as weights, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WeightKind {
    /// Masses, or weights that nothing says more of.
    Mass,
    /// Something else, such as charge or a star formation rate, that adds up as far as its name tells.
    Additive,
    /// Something whose sum over particles means nothing; what its values are called.
    Intensive(&'static str),
}

/// Names of weights as such, and of masses that do not hold the word: letters and digits alone, in lower case. Masses of
/// haloes are `m` and a number, too.
const MASS_NAMES: [&str; 12] =
    ["m", "weight", "weights", "w", "ww", "mvir", "mtot", "mhalo", "mstar", "mgas", "mbound", "mpeak"];

/// Names of what does not add up: letters and digits alone, in lower case. Those with a star hold within longer names.
const INTENSIVE: [(&str, &str); 17] = [
    ("temperatures", "temp tempk *temperature"),
    (
        "velocities",
        "vel vx vy vz v0 v1 v2 velx vely velz speed mach *machnumber *veldisp *velocity *velocities *soundspeed",
    ),
    ("densities", "rho *density *densities"),
    ("pressures", "pth *pressure"),
    ("energies per mass", "u utherm pot phi potential potentials *internalenerg *specificenerg"),
    ("entropies", "*entropy *entropies"),
    ("fractions", "metals zmet ne nh hi *metallicit *fraction *abundance"),
    ("smoothing lengths", "h *hsml *smoothinglength *softening"),
    ("radii", "*radius *radii *diameter"),
    ("times", "age ages aform tform dt *formationtime *birthtime *timestep *redshift *scalefactor"),
    ("accelerations", "acc ax ay az *acceleration"),
    ("field strengths", "bfield bx by bz *magneticfield"),
    ("forces", "fx fy fz force forces"),
    ("coordinates", "x y z xu yu zu xs ys zs pos ix iy iz *coordinate *position"),
    ("numbers of particles", "id ids parentid type types mol molecule element species *particleid"),
    ("magnitudes", "*magnitude"),
    ("gradients", "curl *divergence *vorticity *gradient"),
];

/// Units of what does not add up.
const INTENSIVE_UNITS: [(&str, &[&str]); 4] = [
    ("temperatures", &["K", "kelvin", "Kelvin"]),
    ("velocities", &["km/s", "cm/s", "m/s", "km s^-1", "cm s^-1", "m s^-1", "km s**-1", "cm s**-1", "m s**-1"]),
    ("densities", &["g/cm^3", "g cm^-3", "g/cm**3", "g cm**-3", "kg/m^3", "kg m^-3", "cm^-3", "cm**-3", "1/cm^3"]),
    ("pressures", &["Pa", "bar", "atm", "dyn/cm^2", "dyn cm^-2", "Ba"]),
];

impl WeightKind {
    /// Of a field of this name, and of this unit where it states one.
    pub fn from_name(name: &str, unit: Option<&str>) -> WeightKind {
        let plain: String = name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect();
        let by_unit = INTENSIVE_UNITS.iter().find(|(_, units)| unit.is_some_and(|u| units.contains(&u.trim())));
        let is = |word: &str| word.strip_prefix('*').map_or(plain == word, |part| plain.contains(part));
        let by_name = INTENSIVE.iter().find(|(_, words)| words.split(' ').any(is));
        let intensive_name = by_unit.map(|f| f.0).or_else(|| by_name.map(|f| f.0));
        let of_haloes = plain.strip_prefix('m').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
        match intensive_name {
            Some(values) => WeightKind::Intensive(values),
            None if of_haloes || plain.contains("mass") || MASS_NAMES.contains(&&plain[..]) => WeightKind::Mass,
            None => WeightKind::Additive,
        }
    }
}

/// The summand of a density: `mass`, or `particles` where no mass is known, or the name of weights that are not masses.
pub fn density_of(has_masses: bool, weight_name: Option<&str>) -> &str {
    weight_name.unwrap_or(if has_masses { "mass" } else { "particles" })
}

/// Refuses densities of different things, which neither share colours nor can be compared: `one` and `other` are names
/// with [`density_of`].
pub fn check_densities(one: (&str, &str), other: (&str, &str)) -> Result<()> {
    if one.1 == other.1 {
        return Ok(());
    }
    let message = format!("its density is of {}, that of {} of {}: they cannot be compared", other.1, one.0, one.1);
    Err(Error::input_with(other.0, message, "show each on its own, or make both with masses, or both without"))
}

impl Model {
    /// Refuses the density of the layers that `shown` names where it has no meaning: of splats, which hold opacities
    /// instead of masses, and of layers of which only some have masses.
    ///
    /// # Errors
    /// [`Error::Argument`] for these.
    pub fn check_density(&self, shown: impl Fn(usize) -> bool) -> Result<()> {
        if self.metadata.law == LawKind::AlphaBlend {
            let message = "an alpha-blend model has no density, because its splats have opacities instead of masses";
            return Err(Error::argument_with(message, Hint::from("draw particles with ").command("recover", "")));
        }
        let with_masses = |(i, layer): (usize, &super::Layer<_>)| shown(i).then_some(layer.mass != Mass::Unknown);
        let mut with_masses = self.layers.iter().enumerate().filter_map(with_masses);
        let first = with_masses.next();
        if with_masses.all(|one| Some(one) == first) {
            return Ok(());
        }
        let message = "some layers have masses and others do not, so they cannot be added";
        let hint = Hint::from("choose only layers with masses, or only layers without, with ");
        Err(Error::argument_with(message, hint.option("layer", "NAMES")))
    }

    /// The summand of its density ([`density_of`]).
    pub fn density_of(&self) -> &str {
        density_of(self.has_masses(), self.metadata.weight_name())
    }
}

impl Metadata {
    /// Name of the weights where they are not masses: that of the field that they were read from.
    pub fn weight_name(&self) -> Option<&str> {
        let name = self.recipe.read.get("weights")?;
        (name != "none" && WeightKind::from_name(name, None) == WeightKind::Additive).then_some(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_told_apart_by_name_and_unit() {
        for name in ["Masses", "mass", "ww", "Particle_Mass", "mvir", "M200c", "MassHII"] {
            assert_eq!(WeightKind::from_name(name, None), WeightKind::Mass, "{name}");
        }
        for name in ["Charge", "q", "StarFormationRate", "Luminosity", "XrayLuminosities", "PotentialEnergy", "Volume"]
        {
            assert_eq!(WeightKind::from_name(name, None), WeightKind::Additive, "{name}");
        }
        for (name, plural) in [
            ("Temperature", "temperatures"),
            ("GasTemperatures", "temperatures"),
            ("Velocities", "velocities"),
            ("v_x", "velocities"),
            ("Density", "densities"),
            ("GFM_Metallicity", "fractions"),
            ("MetalMassFractions", "fractions"),
            ("InternalEnergies", "energies per mass"),
            ("SmoothingLength", "smoothing lengths"),
            ("ParticleIDs", "numbers of particles"),
            ("StellarFormationTime", "times"),
        ] {
            assert_eq!(WeightKind::from_name(name, None), WeightKind::Intensive(plural), "{name}");
        }
        assert_eq!(WeightKind::from_name("c_1", Some("K")), WeightKind::Intensive("temperatures"));
        assert_eq!(WeightKind::from_name("flux", Some("km/s")), WeightKind::Intensive("velocities"));
    }
}
