//! Species and mass classes: contiguous runs of a snapshot's particles.

use super::{Column, Particles, Positions, SnapshotMeta};
use particlegs_core::model::{Layer, Mass, density_of};
use std::ops::Range;

impl Particles {
    /// The name of the one layer of a snapshot that tells no kinds apart.
    pub const ONE_LAYER: &str = "particles";

    /// The layers and where their particles lie; at least one. A layer of no particles is none.
    pub fn layers(&self) -> &[Layer<Range<usize>>] {
        &self.layers
    }

    /// Whether the snapshot tells no kinds apart.
    pub(super) fn is_one_kind(&self) -> bool {
        matches!(&self.layers[..], [one] if one.name == Particles::ONE_LAYER)
    }

    /// All particles as one layer.
    pub(super) fn one_layer(&self) -> Layer<Range<usize>> {
        let mass = Mass::new(self.weights().is_some(), self.meta.particle_mass);
        Layer { name: Particles::ONE_LAYER.into(), mass, content: 0..self.len() }
    }

    /// The particles of one layer on their own, borrowed where they lie.
    pub fn of_layer(&self, layer: &Layer<Range<usize>>) -> Particles {
        let range = &layer.content;
        let part = |c: &Column, width: usize| c.slice(width * range.start..width * range.end);
        let positions = match &self.positions {
            Positions::Columns(c) => Positions::Columns([0, 1, 2].map(|k| part(&c[k], 1))),
            Positions::Triples(t) => Positions::Triples(part(t, 3)),
        };
        let meta = SnapshotMeta { particle_mass: layer.mass.unit(), ..self.meta.clone() };
        let alone = Particles::new(positions, self.origin, meta);
        let alone = match self.weights().filter(|_| layer.mass.is_weighted()) {
            Some(weights) => alone.with_weights(part(weights, 1)),
            None => alone,
        };
        alone.with_layers(vec![layer.with(0..range.len())])
    }

    /// The quantity that their density sums ([`density_of`]).
    pub fn density_of(&self) -> &str {
        let has_masses = self.weights().is_some() || self.meta.particle_mass.is_some();
        density_of(has_masses, self.meta.weight_name.as_deref())
    }

    /// Bytes of the particles as float32 columns: 12 each, 16 where their layer is weighted.
    pub fn raw_bytes(&self) -> u64 {
        self.layers.iter().map(|l| l.content.len() as u64 * l.mass.particle_bytes()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layer_is_a_snapshot_of_its_own() {
        let p = Particles::from_columns(vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0], vec![7.0, 8.0, 9.0]);
        assert_eq!((p.layers()[0].content.clone(), p.layers()[0].mass), (0..3, Mass::Unknown));
        let p = p.with_weights(Column::owned(vec![0.5, 2.0, 3.0]));
        assert_eq!(p.layers()[0].mass, Mass::Weights(None));
        let layer = |name: &str, content, mass| Layer { name: name.into(), mass, content };
        let p = p.with_layers(vec![layer("dm", 0..1, Mass::Each(0.5)), layer("gas", 1..3, Mass::Weights(None))]);
        assert_eq!(p.raw_bytes(), 12 + 32);
        let [dm, gas] = [0, 1].map(|i| p.of_layer(&p.layers()[i]));
        assert_eq!((dm.len(), dm.weights().is_none(), dm.meta.particle_mass), (1, true, Some(0.5)));
        assert_eq!((gas.position(1), &gas.weights().unwrap()[..]), ([3.0, 6.0, 9.0], &[2.0, 3.0][..]));
    }
}
