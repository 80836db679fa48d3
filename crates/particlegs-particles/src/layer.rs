//! Layers: species and mass classes, contiguous runs of a snapshot's particles. One mass stands for all of a layer where
//! all are the same; where masses are few, each becomes a layer.

use super::{Column, Particles, Positions, SnapshotMeta, Storage};
use particlegs_core::model::{Layer, Mass, density_of};
use particlegs_core::{Error, Hint, Result};
use particlegs_files::memory::require;
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

/// Classes of mass at most; more are no classes.
const MOST_CLASSES: usize = 64;

impl Particles {
    /// A layer whose particles all have the same weight needs none: the weight becomes its particle mass.
    /// If all layers then have one and the same, no weights are left.
    pub fn settle_masses(mut self) -> Particles {
        let Some(weights) = self.weights().cloned() else { return self };
        for layer in self.layers.iter_mut().filter(|l| l.mass.is_weighted()) {
            let layer_weights = &weights[layer.content.clone()];
            if layer_weights.iter().all(|w| *w == layer_weights[0]) {
                layer.mass = layer.mass.all_of_weight(layer_weights[0]);
            }
        }
        let one = self.layers[0].mass;
        if !one.is_weighted() && self.layers.iter().all(|l| l.mass == one) {
            self.meta.particle_mass = one.unit();
            return self.without_weights();
        }
        self
    }

    /// With the masses that the layers state as those of all particles together, as formats give them: one mass of a
    /// particle, or weights where masses differ. A weight in a layer that has none of its own is not its mass.
    pub fn with_layer_masses(mut self) -> Result<Particles> {
        let first = self.layers[0].mass;
        if self.layers.iter().all(|l| l.mass == first) && first.is_weighted() == self.weights().is_some() {
            self.meta.particle_mass = first.unit().or(self.meta.particle_mass);
            return Ok(self);
        }
        if self.weights().is_none() && self.layers.iter().any(|l| l.mass.unit().is_none()) {
            return Ok(self);
        }
        require("the particles' masses", 4 * self.len() as u64)?;
        // What float32 does not hold, such as grams, is held in a unit of its own.
        let units = || self.layers.iter().filter_map(|l| l.mass.unit());
        let is_far = units().any(|unit| !(1e-30..1e30).contains(&unit));
        let scale = if is_far { units().fold(0.0, f64::max) } else { 1.0 };
        let mut masses = vec![1.0f32; self.len()];
        if let Some(weights) = self.weights() {
            masses.copy_from_slice(weights);
        }
        for layer in &mut self.layers {
            let layer_masses = &mut masses[layer.content.clone()];
            match layer.mass {
                Mass::Weights(Some(unit)) => {
                    layer_masses.iter_mut().for_each(|w| *w = (f64::from(*w) * (unit / scale)) as f32)
                }
                Mass::Each(mass) => layer_masses.fill((mass / scale) as f32),
                _ => layer_masses.iter_mut().for_each(|w| *w = (f64::from(*w) / scale) as f32),
            }
            if layer.mass.is_weighted() {
                layer.mass = Mass::Weights(Some(scale).filter(|_| is_far));
            }
        }
        self.meta.particle_mass = Some(scale).filter(|_| is_far);
        Ok(self.with_weights(Column::owned(masses)))
    }

    /// The particles of every layer sorted into one layer for each mass, the lightest first, in columns of
    /// `storage`; order is kept within. Zoom simulations have a few masses, and count and mass then mean the
    /// same within a layer.
    pub fn layers_by_mass(&self, storage: &Storage) -> Result<Particles> {
        let Some(weights) = self.weights() else { return Ok(self.clone()) };
        let mut columns = storage.columns("the particles by mass", 4, self.len())?;
        let mut layers = Vec::new();
        let mut end = 0;
        // Takes the particles of `range` whose weight is `class`, or all.
        let mut take = |range: &std::ops::Range<usize>, class: Option<f32>| {
            let start = end;
            for i in range.clone().filter(|&i| class.is_none_or(|c| weights[i] == c)) {
                let [x, y, z] = match &self.positions {
                    Positions::Columns(c) => [c[0][i], c[1][i], c[2][i]],
                    Positions::Triples(t) => [t[3 * i], t[3 * i + 1], t[3 * i + 2]],
                };
                columns.iter_mut().zip([x, y, z, weights[i]]).for_each(|(c, v)| c[end] = v);
                end += 1;
            }
            start..end
        };
        for layer in self.layers() {
            if !layer.mass.is_weighted() {
                layers.push(layer.with(take(&layer.content, None)));
                continue;
            }
            let classes = mass_classes(&weights[layer.content.clone()]).ok_or_else(|| {
                let message =
                    format!("`{}` has more than {MOST_CLASSES} different masses: too many for layers", layer.name);
                Error::input_with(&self.meta.name, message, Hint::from("use ").option("layers-by", "species"))
            })?;
            for class in &classes {
                let name = if classes.len() == 1 { layer.name.clone() } else { format!("{} m={class}", layer.name) };
                let content = take(&layer.content, Some(*class));
                layers.push(Layer { name, mass: layer.mass.all_of_weight(*class), content });
            }
        }
        Particles::from_buffers(columns, self.origin, self.meta.clone(), layers)
    }
}

/// The different weights, rising; `None` where there are too many.
pub fn mass_classes(weights: &[f32]) -> Option<Vec<f32>> {
    let mut classes: Vec<f32> = Vec::new();
    for &w in weights {
        if let Err(place) = classes.binary_search_by(|c| c.total_cmp(&w)) {
            if classes.len() == MOST_CLASSES {
                return None;
            }
            classes.insert(place, w);
        }
    }
    Some(classes)
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

    fn weighted(weights: Vec<f32>) -> Particles {
        let x: Vec<f32> = (0..weights.len()).map(|i| i as f32).collect();
        Particles::from_columns(x.clone(), x.clone(), x).with_weights(Column::owned(weights))
    }

    #[test]
    fn equal_weights_become_a_particle_mass() {
        let p = weighted(vec![2.5; 4]).settle_masses();
        assert!(p.weights().is_none());
        assert_eq!(p.meta.particle_mass, Some(2.5));
        assert!(weighted(vec![2.5, 1.0]).settle_masses().weights().is_some());
    }

    #[test]
    fn masses_that_layers_state_are_those_of_all_particles() {
        let layered = |masses: [Mass; 2], weights: Option<[f32; 4]>| {
            let x = || vec![0.0f32; 4];
            let p = Particles::from_columns(x(), x(), x());
            let p = weights.map_or(p.clone(), |w| p.with_weights(Column::owned(w.to_vec())));
            let layer = |i: usize| Layer { name: format!("{i}"), mass: masses[i], content: 2 * i..2 * i + 2 };
            let p = p.with_layers(vec![layer(0), layer(1)]).with_layer_masses().unwrap();
            let unit = p.meta.particle_mass.unwrap_or(1.0);
            (0..4).map(|i| unit * p.weights().map_or(1.0, |w| f64::from(w[i]))).collect::<Vec<_>>()
        };
        let (ten, two) = (Mass::Each(10.0), Mass::Each(2.0));
        assert_eq!(layered([ten, ten], None), [10.0; 4]);
        assert_eq!(layered([ten, two], None), [10.0, 10.0, 2.0, 2.0]);
        let weights = Some([1.0, 1.0, 3.0, 4.0]);
        assert_eq!(layered([ten, Mass::Weights(None)], weights), [10.0, 10.0, 3.0, 4.0]);
        assert_eq!(layered([ten, Mass::Weights(Some(2.0))], weights), [10.0, 10.0, 6.0, 8.0]);
        assert_eq!(layered([Mass::Weights(Some(2.0)); 2], weights), [2.0, 2.0, 6.0, 8.0]);
        assert_eq!(layered([ten, Mass::Unknown], None), [1.0; 4]);
    }

    #[test]
    fn classes_are_layers_and_keep_order() {
        let p = weighted(vec![4.0, 0.5, 4.0, 0.5, 0.5]).layers_by_mass(&Storage::Memory).unwrap();
        let layers = p.layers();
        assert_eq!(layers.iter().map(|l| l.content.clone()).collect::<Vec<_>>(), [0..3, 3..5]);
        assert_eq!((&layers[0].name[..], layers[0].mass), ("particles m=0.5", Mass::Each(0.5)));
        assert_eq!((0..5).map(|i| p.position(i)[0]).collect::<Vec<_>>(), [1.0, 3.0, 4.0, 0.0, 2.0]);
        let total = p.total_mass();
        assert_eq!(total, layers.iter().map(|l| l.mass.unit().unwrap() * l.content.len() as f64).sum::<f64>());
        assert!(weighted((0..100).map(|i| i as f32 + 1.0).collect()).layers_by_mass(&Storage::Memory).is_err());
    }
}
