//! Species and mass classes: contiguous runs of a snapshot's particles.

use super::{Column, Particles, Positions};
use std::ops::Range;

/// One kind of particles. Within it, count and mass mean the same unless it is weighted.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticleLayer {
    /// Name: the species', or the mass class's.
    pub name: String,
    /// Its particles.
    pub range: Range<usize>,
    /// Mass of a particle of weight 1, in the snapshot's unit of mass.
    pub particle_mass: Option<f64>,
    /// Do its particles have weights of their own?
    pub weighted: bool,
}

/// The name of the one layer of a snapshot that tells no kinds apart.
pub const ONE_LAYER: &str = "particles";

impl Particles {
    /// The layers, at least one: all particles where the snapshot tells no kinds apart. A kind of no
    /// particles is none.
    pub fn layers(&self) -> Vec<ParticleLayer> {
        let kinds: Vec<ParticleLayer> = self.kinds.iter().filter(|k| !k.range.is_empty()).cloned().collect();
        if !kinds.is_empty() {
            return kinds;
        }
        vec![ParticleLayer {
            name: ONE_LAYER.into(),
            range: 0..self.len(),
            particle_mass: self.meta.particle_mass,
            weighted: self.weights.is_some(),
        }]
    }

    /// The particles of one layer on their own, borrowed where they lie.
    pub fn of_layer(&self, layer: &ParticleLayer) -> Particles {
        let part = |c: &Column, width: usize| c.slice(width * layer.range.start..width * layer.range.end);
        let mut meta = self.meta.clone();
        meta.particle_mass = layer.particle_mass;
        Particles {
            positions: match &self.positions {
                Positions::Columns(c) => Positions::Columns([0, 1, 2].map(|k| part(&c[k], 1))),
                Positions::Triples(t) => Positions::Triples(part(t, 3)),
            },
            weights: self.weights.as_ref().filter(|_| layer.weighted).map(|w| part(w, 1)),
            origin: self.origin,
            meta,
            kinds: vec![layer.clone()].into_iter().map(|l| ParticleLayer { range: 0..l.range.len(), ..l }).collect(),
        }
    }

    /// Bytes of the particles as float32 columns: 12 each, 16 where their layer is weighted.
    pub fn raw_bytes(&self) -> u64 {
        self.layers().iter().map(|l| l.range.len() as u64 * if l.weighted { 16 } else { 12 }).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layer_is_a_snapshot_of_its_own() {
        let mut p = Particles::from_columns(vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0], vec![7.0, 8.0, 9.0]);
        assert_eq!(p.layers()[0].range, 0..3);
        let kind = |name: &str, range, weighted: bool| ParticleLayer {
            name: name.into(),
            range,
            particle_mass: (!weighted).then_some(0.5),
            weighted,
        };
        p.weights = Some(Column::owned(vec![0.5, 2.0, 3.0]));
        p.kinds = vec![kind("dm", 0..1, false), kind("gas", 1..3, true)];
        assert_eq!(p.raw_bytes(), 12 + 32);
        let [dm, gas] = [0, 1].map(|i| p.of_layer(&p.layers()[i]));
        assert_eq!((dm.len(), dm.weights.is_none(), dm.meta.particle_mass), (1, true, Some(0.5)));
        assert_eq!((gas.position(1), &gas.weights.unwrap()[..]), ([3.0, 6.0, 9.0], &[2.0, 3.0][..]));
    }
}
