//! Units of a density, and what it sums.

use particlegs_core::model::{Model, Units};
use particlegs_particles::Particles;

/// Units of a snapshot or model, and the meaning of its density.
#[derive(Clone, Debug)]
pub struct Quantities {
    length_unit: Option<String>,
    mass_unit: Option<String>,
    /// Name of the weights, if they are not masses.
    weight_name: Option<String>,
    /// Whether lengths are comoving.
    pub comoving: bool,
    /// Number of neighbours that particles are smoothed over.
    pub smooth: Option<usize>,
}

impl Quantities {
    /// For a snapshot, whose particles may be smoothed over neighbours.
    pub fn from_particles(p: &Particles, smooth: Option<usize>) -> Self {
        let (m, known) = (&p.meta, p.weights().is_some() || p.meta.particle_mass.is_some());
        Quantities { smooth, ..Quantities::new(&m.units, known, m.weight_name.as_deref()) }
    }

    pub fn from_model(model: &Model) -> Self {
        let m = &model.metadata;
        Quantities::new(&m.units, model.has_masses(), m.weight_name())
    }

    fn new(units: &Units, has_masses: bool, weight_name: Option<&str>) -> Self {
        Quantities {
            length_unit: units.length_text().map(str::to_string),
            mass_unit: has_masses.then(|| units.mass_text().unwrap_or("mass").to_string()),
            weight_name: weight_name.map(str::to_string),
            comoving: units.comoving == Some(true),
            smooth: None,
        }
    }

    /// Unit of length, as the file has it.
    pub fn length_unit(&self) -> Option<&str> {
        self.length_unit.as_deref()
    }

    /// The summed quantity, if it is not mass: ` of Charge`.
    pub fn of_what(&self) -> String {
        self.weight_name.as_ref().map_or_else(String::new, |name| format!(" of {name}"))
    }

    /// Unit of surface density: `Msun/h / (Mpc/h)²`, or particles where no mass is known.
    pub fn unit(&self) -> String {
        let mass = self.mass_unit.as_deref().unwrap_or("particles");
        match self.length_unit.as_deref() {
            None => format!("{mass} / length²"),
            Some(l) if l.contains(['/', ' ']) => format!("{mass} / ({l})²"),
            Some(l) => format!("{mass} / {l}²"),
        }
    }
}
