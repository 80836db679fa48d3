//! Metadata from a snapshot's groups: counts, box, masses, time, cosmology.

use super::attributes::{Attributes, HeaderGroups};
use super::container::Container;
use super::units;
use crate::physical::{SAME_MOMENT, VelocityConvention, is_isolated};
use particlegs_core::model::Cosmology;
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};

/// Types of particles that are looked for; SWIFT has 7, other codes 6.
pub const TYPES: usize = 16;

#[derive(Clone)]
pub struct Hdf5Header {
    pub groups: HeaderGroups,
    /// Particles of each type in this file, where it says.
    pub here: Option<Vec<u64>>,
    /// Particles of each type in all files, where it says.
    pub total: Option<Vec<u64>>,
    pub files: u64,
    place: String,
}

impl Hdf5Header {
    pub fn read(container: &Container) -> Result<Self> {
        let groups = HeaderGroups {
            header: container.attributes("Header")?,
            parameters: container.attributes("Parameters")?,
            config: container.attributes("Config")?,
            units: container.attributes("Units")?,
            cosmology: container.attributes("Cosmology")?,
        };
        let place = format!("{}: Header", container.place);
        let counts = |name: &str| match groups.header.numbers(name) {
            Some(numbers) => numbers.iter().map(|&n| count(n, name, &place)).collect::<Result<Vec<u64>>>().map(Some),
            None => Ok(None),
        };
        let here = counts("NumPart_ThisFile")?;
        let total = match (counts("NumPart_Total")?, counts("NumPart_Total_HighWord")?) {
            (Some(low), Some(high)) => Some(joined(low, &high)),
            (low, _) => low,
        };
        let files = match groups.header.number(&["NumFilesPerSnapshot"]) {
            Some(n) => count(n, "NumFilesPerSnapshot", &place)?.max(1),
            None => 1,
        };
        Ok(Hdf5Header { groups, here, total, files, place })
    }

    /// The simulation box. `None` for an isolated run (BoxSize 0, or none).
    pub fn cell(&self, notes: &mut Vec<String>) -> Result<Option<Cell>> {
        let Some(size) = self.groups.header.numbers("BoxSize") else { return Ok(None) };
        let lengths: [f64; 3] = match *size {
            [l] => [l; 3],
            [x, y, z, ..] => [x, y, z],
            _ => return Err(Error::input(&self.place, "BoxSize must have one number or three")),
        };
        if lengths.iter().any(|l| !l.is_finite() || *l < 0.0) {
            let text = if size.len() == 1 { lengths[0].to_string() } else { format!("{lengths:?}") };
            let hint = "the header is damaged: copy the file again";
            return Err(Error::input_with(&self.place, format!("BoxSize is {text}"), hint));
        }
        let Cell { origin, vectors, periodic } = Cell::orthogonal(lengths);
        let Some(mut cell) = Cell::stated(origin, vectors, periodic) else {
            notes.push("BoxSize is 0: the box is not periodic".into());
            return Ok(None);
        };
        if self.groups.parameters.number(&["PeriodicBoundariesOn"]) == Some(0.0) {
            cell.periodic = [false; 3];
            notes.push("PeriodicBoundariesOn is 0: the box is not periodic".into());
        }
        // What this program adds for boxes that Gadget does not have.
        if let Some(&[x, y, z]) = self.groups.header.numbers("BoxOrigin") {
            cell.origin = [x, y, z];
        }
        if let Some(&[x, y, z]) = self.groups.header.numbers("BoxPeriodic") {
            let stated = [x, y, z].map(|p| p != 0.0);
            cell.periodic = std::array::from_fn(|k| cell.periodic[k] && stated[k]);
        }
        if lengths.contains(&0.0) {
            notes.push(format!("BoxSize is 0 along an axis: {cell}"));
        }
        for (k, name) in ["LONG_X", "LONG_Y", "LONG_Z"].into_iter().enumerate() {
            if let Some(stretch) = self.groups.config.number(&[name]).filter(|&s| s != 1.0) {
                cell.periodic[k] = false;
                notes.push(format!(
                    "built with {name}={stretch}: the box is {stretch} times BoxSize along this axis and is treated as not periodic"
                ));
            }
        }
        Ok(Some(cell))
    }

    /// The mass of every particle of type `index`, where the header has one.
    pub fn mass(&self, index: usize) -> Option<f64> {
        let mass = *self.groups.header.numbers("MassTable")?.get(index)?;
        (mass.is_finite() && mass > 0.0).then_some(mass)
    }

    pub fn time(&self) -> Option<f64> {
        self.groups.header.number(&["Time"]).filter(|t| t.is_finite())
    }

    pub fn hubble(&self) -> Option<f64> {
        let g = &self.groups;
        let named = |a: &Attributes| a.number(&["HubbleParam", "Hubble_parameter", "h"]);
        named(&g.header)
            .or_else(|| named(&g.cosmology))
            .or_else(|| named(&g.parameters))
            .filter(|h| h.is_finite() && *h > 0.0)
    }

    pub fn cosmology(&self) -> Cosmology {
        let g = &self.groups;
        let number = |names: &[&str]| {
            let stated_number = [&g.header, &g.cosmology, &g.parameters].into_iter().find_map(|a| a.number(names));
            stated_number.filter(|v| v.is_finite())
        };
        Cosmology {
            hubble: self.hubble(),
            omega_matter: number(&["Omega0", "Omega_Matter", "Omega_m"]),
            omega_lambda: number(&["OmegaLambda", "Omega_Lambda", "Omega_lambda"]),
            omega_baryon: number(&["OmegaBaryon", "Omega_Baryon", "Omega_b"]),
        }
    }

    /// Whether it is a cosmological run, whose positions grow with the scale factor; `None` where nothing says.
    pub fn cosmological(&self, notes: &mut Vec<String>) -> Option<bool> {
        let g = &self.groups;
        let said = [&g.parameters, &g.header, &g.config].into_iter().find_map(|a| a.number(&["ComovingIntegrationOn"]));
        if let Some(on) = said.or_else(|| g.cosmology.number(&["Cosmological run"])) {
            return Some(on != 0.0);
        }
        let matter = self.cosmology().omega_matter.filter(|&o| o > 0.0);
        let (time, redshift) = (self.time()?, g.header.number(&["Redshift"])?);
        if matter.is_some() && redshift > -1.0 && (time * (1.0 + redshift) - 1.0).abs() < SAME_MOMENT {
            notes.push(
                "assumed cosmological: Time is 1/(1 + Redshift) and Omega0 is given, but no parameter says so".into(),
            );
            return Some(true);
        }
        notes.push("the file does not say whether lengths are comoving".into());
        None
    }

    /// The convention of velocities and energies without attributes: Gadget's rule, in all but SWIFT's files.
    pub fn convention(&self, cosmological: Option<bool>) -> VelocityConvention {
        let h = &self.groups.header;
        let redshift = h.number(&["Redshift"]);
        let matter = self.cosmology().omega_matter;
        let is_isolated = || is_isolated(self.time(), redshift, matter, h.number(&["BoxSize"]));
        let is_swift = self.groups.units.has("Unit length in cgs (U_L)") || self.code().is_some_and(|c| c == "SWIFT");
        // Otherwise the scale factor would be taken from Time, which may be a time.
        let known = redshift.is_some() || cosmological == Some(true);
        VelocityConvention {
            unit: units::velocity(&self.groups),
            powers: Some(if is_swift { VelocityConvention::SWIFT } else { VelocityConvention::GADGET }),
            cosmological: cosmological.or_else(|| is_isolated().then_some(false)),
            scale_factor: self.scale_factor().filter(|_| known),
        }
    }

    /// The time of a run that is cosmological or not. Gadget's is then the scale factor: not again a time.
    pub fn time_apart(&self, cosmological: bool) -> Option<f64> {
        let is_factor = cosmological && !self.groups.header.has("Scale-factor");
        self.time().filter(|_| !is_factor)
    }

    pub fn scale_factor(&self) -> Option<f64> {
        let h = &self.groups.header;
        let redshift = h.number(&["Redshift"]).filter(|&z| z > -1.0).map(|z| 1.0 / (1.0 + z));
        let a = h.number(&["Scale-factor"]).or(redshift).or_else(|| self.time());
        a.filter(|a| a.is_finite() && *a > 0.0)
    }

    pub fn code(&self) -> Option<String> {
        let g = &self.groups;
        match g.header.text(&["Code"]) {
            Some(code) => Some(code.to_string()),
            None if g.config.has("VORONOI") => Some("AREPO".into()),
            None if g.header.has("GIZMO_version") => Some("GIZMO".into()),
            None if g.header.has("Git_commit") => Some("Gadget-4".into()),
            None => None,
        }
    }
}

fn count(number: f64, name: &str, place: &str) -> Result<u64> {
    // Beyond 2^53 numbers are no longer whole; no snapshot has so many particles.
    if number >= 0.0 && number.fract() == 0.0 && number <= 9e15 {
        Ok(number as u64)
    } else {
        Err(Error::input_with(place, format!("{name} has {number}, not a count"), "the header is damaged"))
    }
}

/// Low and high words of 32 bits. Codes that count in 64 bits have the whole number in the first.
fn joined(low: Vec<u64>, high: &[u64]) -> Vec<u64> {
    let word = |(i, &n): (usize, &u64)| match high.get(i) {
        // A larger high word would count more than 2^56 particles.
        Some(&h) if n <= u64::from(u32::MAX) && h <= u64::from(u32::MAX >> 8) => n | h << 32,
        _ => n,
    };
    low.iter().enumerate().map(word).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(header: &[(&str, f64)], parameters: &[(&str, f64)]) -> Hdf5Header {
        let groups = HeaderGroups {
            header: Attributes::from_numbers(header),
            parameters: Attributes::from_numbers(parameters),
            ..HeaderGroups::default()
        };
        Hdf5Header { groups, here: None, total: None, files: 1, place: "a".into() }
    }

    #[test]
    fn counts_have_a_high_word() {
        assert_eq!(joined(vec![5, 7, 1 << 33], &[1, 0, 2]), [(1 << 32) + 5, 7, 1 << 33]);
        assert!(count(-1.0, "n", "a").is_err() && count(f64::NAN, "n", "a").is_err() && count(1.5, "n", "a").is_err());
    }

    #[test]
    fn boxes_are_checked() {
        let cell = |size| header(&[("BoxSize", size)], &[]).cell(&mut Vec::new());
        assert_eq!(cell(2.0).unwrap().unwrap().lengths(), Some([2.0; 3]));
        assert_eq!(cell(0.0).unwrap(), None);
        assert!(cell(f64::NAN).is_err() && cell(-1.0).is_err() && cell(f64::INFINITY).is_err());
        let open =
            header(&[("BoxSize", 1.0)], &[("PeriodicBoundariesOn", 0.0)]).cell(&mut Vec::new()).unwrap().unwrap();
        assert_eq!(open.periodic, [false; 3]);
    }

    #[test]
    fn comoving_is_stated_only_where_the_file_supports_it() {
        let said = |h: &[(&str, f64)], p: &[(&str, f64)]| header(h, p).cosmological(&mut Vec::new());
        assert_eq!(said(&[], &[("ComovingIntegrationOn", 0.0)]), Some(false));
        assert_eq!(said(&[], &[("ComovingIntegrationOn", 1.0)]), Some(true));
        assert_eq!(said(&[("Time", 0.25), ("Redshift", 3.0), ("Omega0", 0.3)], &[]), Some(true));
        assert_eq!(said(&[("Time", 0.25), ("Redshift", 0.0), ("Omega0", 0.3)], &[]), None);
        assert_eq!(said(&[("Time", 0.25), ("Redshift", 3.0)], &[]), None);
    }
}
