//! The subject of statistics: particles, or a model's mixture itself.

use super::Domain;
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::{Cosmology, Epoch, Mixture, Model, UnitSystem};
use particlegs_core::space::{Bounds, Cell};
use particlegs_particles::{Particles, Storage};

/// Particles, or a model.
#[derive(Clone, Copy)]
pub enum Subject<'a> {
    /// A snapshot.
    Particles(&'a Particles),
    /// A mixture; particles are nowhere drawn from it.
    Model(&'a Model),
}

/// A subject in other units.
pub(super) enum ConvertedSubject {
    Particles(Box<Particles>),
    Model(Box<Model>),
}

impl ConvertedSubject {
    pub(super) fn particles(self) -> Option<Particles> {
        match self {
            ConvertedSubject::Particles(p) => Some(*p),
            ConvertedSubject::Model(_) => None,
        }
    }
}

impl<'a> Subject<'a> {
    pub(crate) fn moment(&self) -> (&'a Epoch, &'a Cosmology) {
        match self {
            Subject::Particles(p) => (&p.meta.epoch, &p.meta.cosmology),
            Subject::Model(m) => (&m.metadata.epoch, &m.metadata.cosmology),
        }
    }

    /// Units, with the moment and cosmology that they are relative to.
    pub fn unit_system(&self) -> UnitSystem<'a> {
        match self {
            Subject::Particles(p) => p.meta.unit_system(),
            Subject::Model(m) => m.metadata.unit_system(),
        }
    }

    /// The quantity that its density sums, and the mass of a particle where all have the same; 1 where it is unknown.
    pub(super) fn density_of(&self) -> (&'a str, Option<f64>) {
        match self {
            Subject::Particles(p) => {
                (p.density_of(), p.weights().is_none().then(|| p.meta.particle_mass.unwrap_or(1.0)))
            }
            Subject::Model(m) => {
                let first_mass = m.layers[0].mass;
                let alike = !first_mass.is_weighted() && m.layers.iter().all(|l| l.mass == first_mass);
                (m.density_of(), alike.then(|| first_mass.unit_or_one()))
            }
        }
    }

    /// The subject in the units of `truth`, where they differ, and notes for a reader of the results.
    pub(super) fn in_units_of(&self, truth: Subject<'_>) -> Result<(Option<ConvertedSubject>, Vec<String>)> {
        let to = truth.unit_system();
        let (by, words) = self.unit_system().conversion_of("the other", &to)?;
        let converted = match self {
            _ if by.is_identity() => None,
            Subject::Particles(p) => Some(ConvertedSubject::Particles(Box::new((*p).clone().in_units(
                &to,
                &Storage::Memory,
                &Context::SILENT,
            )?))),
            Subject::Model(m) => Some(ConvertedSubject::Model(Box::new((*m).clone().in_units(
                &to,
                &m.metadata.source,
                &Context::SILENT,
            )?))),
        };
        Ok((converted, words))
    }

    /// Its periodic box, if there is one.
    pub fn cell(&self) -> Option<Cell> {
        match self {
            Subject::Particles(p) => p.meta.cell,
            Subject::Model(m) => m.metadata.cell,
        }
    }

    /// The box that it lies in.
    pub fn domain(&self) -> Domain {
        match self {
            Subject::Particles(p) => Domain::from_particles(p),
            Subject::Model(m) => Domain::from_model(m),
        }
    }

    /// Particles, or those that the model stands for.
    pub fn count(&self) -> u64 {
        match self {
            Subject::Particles(p) => p.len() as u64,
            Subject::Model(m) => m.layers.iter().map(particlegs_core::model::Layer::count).sum(),
        }
    }

    pub(super) fn bounds(&self) -> Bounds {
        match self {
            Subject::Particles(p) => p.bounds(),
            Subject::Model(m) => m.metadata.bounds,
        }
    }

    /// The particles, where there are any.
    pub fn particles(&self) -> Option<&'a Particles> {
        match self {
            Subject::Particles(p) => Some(p),
            Subject::Model(_) => None,
        }
    }

    /// The volume that a unit of power is measured in: V sum w^2 / (sum w)^2 of particles, which is
    /// the shot noise of P(k); a mixture has none.
    pub fn shot_noise(&self, domain: &Domain) -> f64 {
        let Subject::Particles(p) = self else { return 0.0 };
        let squares: f64 = match p.weights() {
            None => p.len() as f64,
            Some(_) => p
                .par_chunks(|_, c| c.weight.unwrap_or(&[]).iter().map(|&w| f64::from(w) * f64::from(w)).sum::<f64>())
                .iter()
                .sum(),
        };
        domain.volume() * squares / p.total_mass().powi(2)
    }
}

/// The mixtures of a model, and the mass that a weight of 1 stands for in each.
pub(super) fn mixtures(model: &Model) -> impl Iterator<Item = (f64, &Mixture)> {
    model.layers.iter().flat_map(|l| l.content.iter().map(|b| (l.mass.unit_or_one(), &b.gaussians)))
}
