//! A species or mass class: its name, what its particles weigh, and whatever there is of it.

/// Masses of a layer's particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mass {
    /// Not known: particles are counted.
    #[default]
    Unknown,
    /// Each has this one, in the snapshot's unit of mass.
    Each(f64),
    /// Each has a weight of its own; a weight of 1 is this mass, where that is known.
    Weights(Option<f64>),
}

impl Mass {
    /// Of particles with weights of their own, or without; `unit` = the mass of weight 1, where known.
    pub fn new(weighted: bool, unit: Option<f64>) -> Self {
        match (weighted, unit) {
            (true, unit) => Mass::Weights(unit),
            (false, Some(each)) => Mass::Each(each),
            (false, None) => Mass::Unknown,
        }
    }

    /// Whether particles have weights of their own.
    pub fn is_weighted(self) -> bool {
        matches!(self, Mass::Weights(_))
    }

    /// Mass of a particle of weight 1, where it is known.
    pub fn unit(self) -> Option<f64> {
        match self {
            Mass::Unknown => None,
            Mass::Each(unit) => Some(unit),
            Mass::Weights(unit) => unit,
        }
    }

    /// [`Mass::unit`], or 1 where it is not known: particles are counted.
    pub fn unit_or_one(self) -> f64 {
        self.unit().unwrap_or(1.0)
    }

    /// The same unit without weights.
    pub fn without_weights(self) -> Self {
        Mass::new(false, self.unit())
    }

    /// Of particles that all have this weight.
    pub fn all_of_weight(self, weight: f32) -> Self {
        Mass::Each(self.unit_or_one() * f64::from(weight))
    }

    /// Columns of its particles: x, y, z and the weight, where they have one.
    pub fn columns(self) -> usize {
        if self.is_weighted() { 4 } else { 3 }
    }

    /// Bytes of a particle as float32 columns.
    pub fn particle_bytes(self) -> u64 {
        4 * self.columns() as u64
    }
}

/// A species or mass class: blocks of a model, particles of a snapshot, coded blocks of a file, ...
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Layer<T> {
    /// Name, e.g. `dm`; at most 255 bytes in a file, where names differ.
    pub name: String,
    /// Masses of its particles.
    pub mass: Mass,
    /// Its content.
    pub content: T,
}

impl<T> Layer<T> {
    /// The same layer, of something else.
    pub fn with<U>(&self, content: U) -> Layer<U> {
        Layer { name: self.name.clone(), mass: self.mass, content }
    }

    /// The same layer, of what `f` makes of its content.
    pub fn map<U>(self, f: impl FnOnce(T) -> U) -> Layer<U> {
        Layer { name: self.name, mass: self.mass, content: f(self.content) }
    }
}
