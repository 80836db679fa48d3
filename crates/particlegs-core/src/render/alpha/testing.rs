//! Models for tests.

use crate::model::{LawKind, Metadata, Model, Recipe};
use crate::space::Bounds;

/// A model of the alpha-blend law without layers.
pub fn empty_model(bounds: Bounds, count: u64) -> Model {
    let metadata = Metadata {
        law: LawKind::AlphaBlend,
        count,
        mass: count as f64,
        bounds,
        cell: None,
        default_radius: 0.02,
        default_opacity: 0.05,
        source: String::new(),
        source_hash: [0; 32],
        length_unit: None,
        mass_unit: None,
        comoving: None,
        scale_factor: None,
        hubble: None,
        time: None,
        recipe: Recipe::default(),
        tool_version: String::new(),
    };
    Model { metadata, layers: Vec::new(), certificate: None }
}
