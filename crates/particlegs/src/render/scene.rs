//! What is drawn: the Gaussians, borrowed, and the bounds that clip where a view does not say.

use crate::model::{Mixture, Model};
use crate::particles::Bounds;

/// Gaussians to draw. Cheap to make: nothing is copied.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// The parts, drawn in this order.
    pub(super) parts: Vec<&'a Mixture>,
    /// Bounds of the particles, world units.
    pub(super) bounds: Bounds,
}

impl<'a> Scene<'a> {
    /// All blocks of all layers of a model.
    pub fn of(model: &'a Model) -> Self {
        Scene { parts: model.blocks().map(|b| &b.gaussians).collect(), bounds: model.metadata.bounds }
    }

    /// One mixture, fitted to particles with these bounds.
    pub fn of_mixture(mixture: &'a Mixture, bounds: Bounds) -> Self {
        Scene { parts: vec![mixture], bounds }
    }
}
