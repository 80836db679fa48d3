//! Masses of layers: one for all where all are the same, classes where they are few.

use super::{Particles, Positions, Storage};
use crate::model::Layer;
use crate::{Error, Hint, Result};

/// Classes of mass at most; more are no classes.
const MOST_CLASSES: usize = 64;

impl Particles {
    /// A layer whose particles all have the same weight needs none: the weight becomes its particle mass.
    /// Where all layers then have one and the same, no weights are left.
    pub fn settle_masses(mut self) -> Particles {
        let Some(weights) = self.weights().cloned() else { return self };
        for layer in self.layers.iter_mut().filter(|l| l.mass.is_weighted()) {
            let own = &weights[layer.content.clone()];
            if own.iter().all(|w| *w == own[0]) {
                layer.mass = layer.mass.all_of_weight(own[0]);
            }
        }
        let one = self.layers[0].mass;
        if !one.is_weighted() && self.layers.iter().all(|l| l.mass == one) {
            self.meta.particle_mass = one.unit();
            return self.without_weights();
        }
        self
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
                let what =
                    format!("`{}` has more than {MOST_CLASSES} different masses: too many for layers", layer.name);
                Error::input_with(&self.meta.name, what, Hint::from("use ").option("layers-by", "species"))
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
pub(crate) fn mass_classes(weights: &[f32]) -> Option<Vec<f32>> {
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
    use super::super::Column;
    use super::*;
    use crate::model::Mass;

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
