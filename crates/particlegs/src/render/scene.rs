//! What is drawn: the Gaussians, borrowed, and the bounds that clip where a view does not say.

use crate::model::{Mixture, Model};
use crate::particles::Bounds;

/// Gaussians to draw. Cheap to make: nothing is copied.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// The parts, drawn in this order, and the mass of a particle of weight 1 in each.
    pub(super) parts: Vec<(&'a Mixture, f64)>,
    /// Bounds of the particles, world units.
    pub(super) bounds: Bounds,
}

impl<'a> Scene<'a> {
    /// All blocks of all layers of a model.
    pub fn of(model: &'a Model) -> Self {
        let parts = model.layers.iter().flat_map(|l| l.blocks.iter().map(|b| (&b.gaussians, l.unit_mass())));
        Scene { parts: parts.collect(), bounds: model.metadata.bounds }
    }

    /// One mixture, fitted to particles with these bounds.
    pub fn of_mixture(mixture: &'a Mixture, bounds: Bounds) -> Self {
        Scene { parts: vec![(mixture, 1.0)], bounds }
    }
}
