//! Models for tests.

use crate::model::{LawKind, Metadata, Model};
use crate::space::Bounds;

/// A model of the alpha-blend law without layers.
pub fn empty_model(bounds: Bounds, count: u64) -> Model {
    let metadata = Metadata { default_radius: 0.02, ..Metadata::new(LawKind::AlphaBlend, count, bounds) };
    Model { metadata, layers: Vec::new(), certificate: None }
}
