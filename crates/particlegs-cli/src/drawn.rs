//! Pictures in a JSON report: cameras by the keys of a views file, so that `--views` reads the report.

use crate::inputs::path_as_text;
use particlegs::camera::{Camera, DensityView, Projection, View};
use serde::Serialize;
use std::path::PathBuf;

/// A picture that was drawn.
#[derive(Serialize)]
pub struct Drawn {
    name: String,
    position: [f64; 3],
    focal_point: [f64; 3],
    view_up: [f64; 3],
    /// Vertical field of view, degrees; of perspective views.
    #[serde(skip_serializing_if = "Option::is_none")]
    fov_deg: Option<f64>,
    /// Height of the picture, world units; of orthographic views.
    #[serde(skip_serializing_if = "Option::is_none")]
    height_world: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    clipping_range: Option<[f64; 2]>,
    /// Radius, world units, and opacity of the particles; surface density has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    radius: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    opacity: Option<f64>,
    seconds: f64,
    #[serde(serialize_with = "path_as_text")]
    path: PathBuf,
}

impl Drawn {
    /// A picture of particles.
    pub fn of_view(view: &View, seconds: f64, path: PathBuf) -> Self {
        let drawn = Drawn::of_camera(&view.name, &view.camera, seconds, path);
        Drawn { radius: Some(view.radius), opacity: Some(view.opacity), ..drawn }
    }

    /// A picture of surface density.
    pub fn of_density(view: &DensityView, seconds: f64, path: PathBuf) -> Self {
        let drawn = Drawn::of_camera(&view.name, &view.camera, seconds, path);
        Drawn { clipping_range: Some(view.range), ..drawn }
    }

    fn of_camera(name: &str, camera: &Camera, seconds: f64, path: PathBuf) -> Self {
        let (fov_deg, height_world) = match camera.projection {
            Projection::Perspective { fov_deg } => (Some(fov_deg), None),
            Projection::Orthographic { height_world } => (None, Some(height_world)),
        };
        Drawn {
            name: name.to_string(),
            position: camera.position,
            focal_point: camera.focal_point,
            view_up: camera.view_up,
            fov_deg,
            height_world,
            clipping_range: camera.clipping_range,
            radius: None,
            opacity: None,
            seconds,
            path,
        }
    }

    /// Vertical field of view, degrees; `None` for an orthographic view.
    pub fn fov_deg(&self) -> Option<f64> {
        self.fov_deg
    }

    /// The view's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Time that it took.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}
