//! Densities that bound haloes: those of a cosmology at a moment, in a snapshot's own units.

use particlegs_core::model::{Cosmology, Epoch, UnitSystem, Units};
use particlegs_core::{Error, Result};
use std::f64::consts::PI;

/// The critical density today, in Msun/h / (Mpc/h)^3: 3 (100 km/s/Mpc)^2 / (8 pi G), with the solar mass and parsec of
/// the IAU (2015) and the G of CODATA 2018.
const CRITICAL: f64 = 2.775_366e11;
/// G in Mpc (km/s)^2 / Msun.
const GRAVITY: f64 = 4.300_917e-9;

particlegs_core::named_values! {
    /// Mean density inside a halo's sphere.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Overdensity {
        Mean200 = "200m": "200 times the mean density of matter",
        Critical200 = "200c": "200 times the critical density",
        Critical500 = "500c": "500 times the critical density",
        Virial = "vir": "The virial density (Bryan and Norman 1998)",
    }
}

/// Sizes of a snapshot's units, as far as they are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HaloUnits {
    /// A length of 1 in comoving Mpc/h.
    pub length: Option<f64>,
    /// A mass of 1 in Msun/h.
    pub mass: Option<f64>,
    /// Hubble parameter h.
    pub hubble: Option<f64>,
    /// Scale factor.
    pub scale_factor: Option<f64>,
}

/// Densities that spheres of haloes have, in the snapshot's masses and lengths; one for each [`Overdensity`].
#[derive(Clone, Debug, PartialEq)]
pub struct HaloDensities {
    /// `None` where the source does not state enough.
    pub density: [Option<f64>; Overdensity::ALL.len()],
    /// Units.
    pub units: HaloUnits,
    /// Densities that are left out or assumed, and the reasons.
    pub notes: Vec<String>,
}

impl HaloUnits {
    fn new(system: &UnitSystem<'_>) -> Self {
        let to = Units::new(Some("Mpc/h"), Some("Msun/h"), Some(true));
        let to = UnitSystem { units: &to, ..*system };
        let known = |unit: Option<&particlegs_core::model::Unit>| unit.is_some_and(|u| u.si.is_some());
        let conversion_from = |units: Units| UnitSystem { units: &units, ..*system }.conversion(&to).ok();
        // Whether lengths are comoving does not matter today.
        let comoving = system.units.comoving.or((system.scale_factor == Some(1.0)).then_some(true));
        // Converted one by one: an unknown unit of mass does not hide that of length.
        let lengths = Units { mass: None, comoving, ..system.units.clone() };
        let masses = Units { length: None, ..system.units.clone() };
        let length = known(lengths.length.as_ref()) && comoving.is_some();
        let length = conversion_from(lengths).filter(|_| length).map(|c| c.length);
        let mass = conversion_from(masses).filter(|_| known(system.units.mass.as_ref())).map(|c| c.mass);
        HaloUnits { length, mass, hubble: system.hubble, scale_factor: system.scale_factor }
    }

    /// Circular velocity squared, in (km/s)^2, of a mass over a radius of 1 and 1; `None` where units are not known.
    pub fn velocity_square(&self) -> Option<f64> {
        Some(GRAVITY * self.mass? / (self.length? * self.scale_factor?))
    }
}

impl HaloDensities {
    /// Of a snapshot or model. `mean` is its mean density, where its box is periodic: it stands for that of matter
    /// where the cosmology does not say; `masses` = its masses are known.
    pub fn new(
        system: &UnitSystem<'_>,
        (epoch, cosmology): (&Epoch, &Cosmology),
        mean: Option<f64>,
        masses: bool,
    ) -> Result<HaloDensities> {
        let mut units = HaloUnits::new(system);
        units.mass = units.mass.filter(|_| masses);
        let mut notes = Vec::new();
        let missing = missing_of(system, &units, (epoch, cosmology), masses);
        let critical = missing.is_empty().then(|| CriticalDensity::new(&units, epoch, cosmology)).flatten();
        let stated = critical.as_ref().map(|c| c.matter);
        let matter = stated.or(mean);
        if matter.is_none() {
            let message = format!(
                "the mean density is not known: the box is not periodic, and the file does not state {}",
                missing.join(", ")
            );
            return Err(Error::argument(message));
        }
        if stated.is_none() {
            notes.push(format!("200m is relative to the mean density of the box; 200c, 500c and vir are left out: the file does not state {}", missing.join(", ")));
        }
        if let (Some(stated), Some(mean)) = (stated, mean)
            && (mean / stated - 1.0).abs() > 0.05
        {
            notes.push(format!(
                "the mean density of the box is {:.3} times that of all matter: some matter was not read",
                mean / stated
            ));
        }
        let density_of = |kind: Overdensity| match kind {
            Overdensity::Mean200 => matter.map(|m| 200.0 * m),
            Overdensity::Critical200 => critical.as_ref().map(|c| 200.0 * c.density),
            Overdensity::Critical500 => critical.as_ref().map(|c| 500.0 * c.density),
            Overdensity::Virial => critical.as_ref().map(|c| c.virial() * c.density),
        };
        Ok(HaloDensities { density: std::array::from_fn(|i| density_of(Overdensity::ALL[i])), units, notes })
    }

    /// Spheres of one of these densities: the mass in one of radius r is this times r^3.
    pub fn mass_per_cube(&self, kind: Overdensity) -> Option<f64> {
        self.density[kind as usize].map(|d| 4.0 / 3.0 * PI * d)
    }
}

/// The cosmology that a user states: `h=0.68,Om=0.31,OL=0.69`; flat without OL.
///
/// # Errors
/// The fault, in words.
pub fn stated_cosmology(text: &str) -> std::result::Result<Cosmology, String> {
    let mut cosmology = Cosmology::default();
    for part in text.split(',') {
        let (name, value) =
            part.split_once('=').ok_or_else(|| format!("`{part}` is not NAME=VALUE, such as h=0.68"))?;
        let value = value.trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
        let value = value.ok_or_else(|| format!("`{part}` does not have a number from 0 on"))?;
        // H0 below 10 or h above it is the other quantity by mistake, and is refused.
        match &name.trim().to_lowercase()[..] {
            "h" if value > 0.0 && value < 10.0 => cosmology.hubble = Some(value),
            "h0" if value >= 10.0 => cosmology.hubble = Some(value / 100.0),
            "om" | "om0" | "omega_m" if value > 0.0 => cosmology.omega_matter = Some(value),
            "ol" | "ode0" | "omega_lambda" => cosmology.omega_lambda = Some(value),
            _ => return Err(format!("`{part}`: there are h (or H0 in km/s/Mpc), Om and OL")),
        }
    }
    cosmology.omega_lambda = cosmology.omega_lambda.or(cosmology.omega_matter.map(|m| 1.0 - m));
    Ok(cosmology)
}

/// Names of the statements that the critical density needs and that are missing.
fn missing_of(
    system: &UnitSystem<'_>,
    units: &HaloUnits,
    (epoch, cosmology): (&Epoch, &Cosmology),
    masses: bool,
) -> Vec<&'static str> {
    let today = epoch.scale_factor == Some(1.0);
    let statements = [
        (masses, "masses"),
        (!masses || units.mass.is_some(), "the unit of mass, or h"),
        (system.units.length.as_ref().is_some_and(|u| u.si.is_some()), "the unit of length"),
        (system.units.length.is_none() || units.length.is_some(), "whether lengths are comoving, or h"),
        (epoch.scale_factor.is_some_and(|a| a > 0.0), "the scale factor"),
        (cosmology.omega_matter.is_some_and(|m| m > 0.0), "Omega_m"),
        (today || cosmology.omega_lambda.is_some(), "Omega_Lambda"),
    ];
    statements.iter().filter(|(is_stated, _)| !is_stated).map(|(_, name)| *name).collect()
}

/// The critical density at a moment, comoving, in a snapshot's units.
struct CriticalDensity {
    density: f64,
    /// Of all matter.
    matter: f64,
}

impl CriticalDensity {
    fn new(units: &HaloUnits, epoch: &Epoch, cosmology: &Cosmology) -> Option<Self> {
        let (a, matter) = (epoch.scale_factor?, cosmology.omega_matter?);
        let lambda = cosmology.omega_lambda.unwrap_or(1.0 - matter);
        let expansion = matter / a.powi(3) + (1.0 - matter - lambda) / (a * a) + lambda;
        // From Msun/h and (Mpc/h)^3 to the snapshot's own units.
        let unit = units.length?.powi(3) / units.mass?;
        // Times a^3, since lengths are comoving.
        let density = CRITICAL * expansion * a.powi(3) * unit;
        (density > 0.0 && density.is_finite()).then_some(CriticalDensity { density, matter: CRITICAL * matter * unit })
    }

    /// Bryan and Norman (1998), equation 6: over the critical density.
    fn virial(&self) -> f64 {
        let x = self.matter / self.density - 1.0;
        18.0 * PI * PI + 82.0 * x - 39.0 * x * x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn densities(length: &str, mass: Option<&str>, a: f64, masses: bool) -> Result<HaloDensities> {
        let units = Units::new(Some(length), mass, Some(true));
        let epoch = Epoch { scale_factor: Some(a), ..Epoch::default() };
        let cosmology =
            Cosmology { hubble: Some(0.7), omega_matter: Some(0.3), omega_lambda: Some(0.7), omega_baryon: None };
        HaloDensities::new(&UnitSystem::new(&units, &epoch, &cosmology), (&epoch, &cosmology), Some(3.0), masses)
    }

    /// Values of colossus 1.3 (`cosmology.setCosmology('x', flat, H0 = 70, Om0 = 0.3, Tcmb0 = 0)`,
    /// `mass_so.densityThreshold`), physical kpc^3 / h^2 turned to comoving Mpc.
    #[test]
    fn densities_follow_the_cosmology_and_the_units() {
        let at = |a: f64| densities("Mpc/h", Some("Msun/h"), a, true).unwrap();
        let ratio = |d: &HaloDensities, kind: Overdensity| d.density[kind as usize].unwrap() / CRITICAL;
        let today = at(1.0);
        assert!((ratio(&today, Overdensity::Mean200) / 60.0 - 1.0).abs() < 1e-9);
        assert!((ratio(&today, Overdensity::Critical200) / 200.0 - 1.0).abs() < 1e-9);
        let x: f64 = -0.7;
        let virial = 18.0 * PI * PI + 82.0 * x - 39.0 * x * x;
        assert!((ratio(&today, Overdensity::Virial) / virial - 1.0).abs() < 1e-9 && (virial - 101.14).abs() < 0.01);
        let early = at(0.5);
        assert!((ratio(&early, Overdensity::Mean200) / 60.0 - 1.0).abs() < 1e-9);
        assert!((ratio(&early, Overdensity::Critical500) / (500.0 * (0.3 * 8.0 + 0.7) / 8.0) - 1.0).abs() < 1e-9);
        // Other units, the same densities.
        let kpc = densities("kpc", Some("1e10 Msun"), 0.5, true).unwrap();
        let factor = 0.7 * 0.7 / 1e9 / 1e10;
        assert!(
            (ratio(&kpc, Overdensity::Critical200) / ratio(&early, Overdensity::Critical200) / factor - 1.0).abs()
                < 1e-6
        );
        assert!((kpc.units.velocity_square().unwrap() / (GRAVITY * 1e10 / (1e-3 * 0.5)) - 1.0).abs() < 1e-6);
        assert!(early.notes[0].contains("some matter was not read"));
    }

    #[test]
    fn cosmologies_are_read() {
        let cosmology = stated_cosmology("H0=70, Om0=0.3").unwrap();
        assert_eq!(
            (cosmology.hubble, cosmology.omega_matter, cosmology.omega_lambda),
            (Some(0.7), Some(0.3), Some(0.7))
        );
        assert_eq!(stated_cosmology("h=0.68,Om=0.3,OL=0").unwrap().omega_lambda, Some(0.0));
        for wrong in ["", "h", "h=x", "h=70", "H0=0.7", "Om=-1", "w=-1"] {
            assert!(stated_cosmology(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_is_not_stated_is_named() {
        let counted = densities("Mpc/h", Some("Msun/h"), 1.0, false).unwrap();
        assert_eq!(counted.density, [Some(600.0), None, None, None]);
        assert!(counted.notes[0].ends_with("the file does not state masses"), "{:?}", counted.notes);
        let unknown = densities("Mpc/h", None, 1.0, true).unwrap();
        assert!(unknown.notes[0].ends_with("the unit of mass, or h"), "{:?}", unknown.notes);
        let (units, epoch, none) = (Units::default(), Epoch::default(), Cosmology::default());
        let error =
            HaloDensities::new(&UnitSystem::new(&units, &epoch, &none), (&epoch, &none), None, true).unwrap_err();
        assert!(error.to_string().contains("the box is not periodic"), "{error}");
    }
}
