//! Views and models for tests.

use crate::camera::{Camera, Projection, View};
use crate::model::{LawKind, Metadata, Model};
use crate::space::Bounds;

/// A camera of 30 degrees that looks at the origin.
pub fn view(position: [f64; 3], radius: f64, opacity: f64) -> View {
    let projection = Projection::Perspective { fov_deg: 30.0 };
    let camera = Camera { position, focal_point: [0.0; 3], view_up: [0.0, 1.0, 0.0], projection, clipping_range: None };
    View { name: "v".into(), camera, radius, opacity }
}

/// A model of the alpha-blend law without layers.
pub fn empty_model(bounds: Bounds, count: u64) -> Model {
    let metadata = Metadata { default_radius: 0.02, ..Metadata::new(LawKind::AlphaBlend, count, bounds) };
    Model { metadata, layers: Vec::new(), certificate: None }
}
