//! Raw float32 columns: a folder with xx.f32, yy.f32, zz.f32, or those files. Their layers are species.

use crate::{Description, Field, Fields, Mass, Snapshot, Species, Weights};
use particlegs::Result;
use particlegs::particles::{ParticleLayer, Particles, SnapshotReader, open_raw};
use std::path::PathBuf;

const POSITIONS: &str = "xx,yy,zz";
const WEIGHTS: &str = "ww";

/// Mapped columns.
struct Raw {
    description: Description,
    particles: Particles,
}

/// Raw data have no head: a folder with columns, or columns that no format claims.
pub fn is_raw(paths: &[PathBuf]) -> bool {
    match paths {
        [folder] => folder.join("xx.f32").exists(),
        [x, ..] => (3..=4).contains(&paths.len()) && crate::registry::detect(x).is_err(),
        [] => false,
    }
}

/// Opens them.
///
/// # Errors
/// Those of [`open_raw`].
pub fn open(paths: &[PathBuf]) -> Result<Box<dyn Snapshot>> {
    let particles = open_raw(paths)?;
    let description = Description {
        format: "raw float32 columns, little-endian".into(),
        files: paths.to_vec(),
        meta: particles.meta.clone(),
        species: particles.layers().iter().map(|l| species(l, particles.weights.is_some())).collect(),
        ..Description::default()
    };
    Ok(Box::new(Raw { description, particles }))
}

fn species(layer: &ParticleLayer, weights: bool) -> Species {
    let scalar = |name: &str| Field { name: name.into(), kind: "f32".into(), components: 1, unit: None };
    Species {
        name: layer.name.clone(),
        aliases: Vec::new(),
        count: layer.range.len() as u64,
        mass: match (layer.weighted, layer.particle_mass) {
            (true, _) => Mass::Field(WEIGHTS.into()),
            (false, Some(m)) => Mass::Each(m),
            (false, None) => Mass::Unknown,
        },
        positions: POSITIONS.into(),
        fields: POSITIONS.split(',').chain(weights.then_some(WEIGHTS)).map(scalar).collect(),
    }
}

impl Raw {
    /// The columns with the weights chosen, or none: there are no other fields to choose.
    fn with(&self, species: &Species, fields: &Fields) -> Result<Particles> {
        let place = &self.description.meta.name;
        if let Some(name) = fields.positions.as_deref().filter(|name| *name != POSITIONS) {
            return Err(species.missing(place, name, [POSITIONS].into_iter()));
        }
        let mut particles = self.particles.clone();
        match &fields.weights {
            Weights::Auto => {}
            Weights::None => {
                particles.weights = None;
                particles.kinds.iter_mut().for_each(|k| (k.weighted, k.particle_mass) = (false, None));
            }
            Weights::Field(name) if name.strip_suffix(".f32").unwrap_or(name) == WEIGHTS => {}
            Weights::Field(name) => {
                let there = self.particles.weights.as_ref().map(|_| WEIGHTS);
                return Err(species.missing(place, name, there.into_iter()));
            }
        }
        Ok(particles)
    }
}

impl Snapshot for Raw {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, fields: &Fields) -> Result<Box<dyn SnapshotReader>> {
        let particles = self.with(&self.description.species[species], fields)?;
        Ok(Box::new(particles.of_layer(&particles.layers()[species])))
    }

    fn in_place(&self, species: &[usize], fields: &Fields) -> Result<Option<Particles>> {
        let all = &self.description.species;
        let particles = self.with(&all[species[0]], fields)?;
        Ok(match species {
            _ if species.len() == all.len() => Some(particles),
            [one] => Some(particles.of_layer(&particles.layers()[*one])),
            _ => None,
        })
    }
}
