//! Pictures in a JSON report: cameras by the keys of a views file, so that `--views` reads the report.

use crate::inputs::path_as_text;
use crate::view_args::ViewSubject;
use particlegs::camera::{DensityView, Projection, View};
use serde::{Serialize, Serializer};
use std::path::PathBuf;

#[derive(Serialize)]
pub struct RenderedView {
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
    /// Radius, world units, and opacity of the particles; a surface density does not depend on them.
    radius: f64,
    opacity: f64,
    seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "some_path")]
    path: Option<PathBuf>,
}

impl RenderedView {
    /// The picture of a view; no path where it is a frame that went into a film.
    pub fn new(view: &View, subject: &ViewSubject, seconds: f64, path: Option<PathBuf>) -> Self {
        let camera = &view.camera;
        let (fov_deg, height_world) = match camera.projection {
            Projection::Perspective { fov_deg } => (Some(fov_deg), None),
            Projection::Orthographic { height_world } => (None, Some(height_world)),
        };
        let range = subject.density.then(|| DensityView::of_view(view, &subject.bounds).range);
        RenderedView {
            name: view.name.clone(),
            position: camera.position,
            focal_point: camera.focal_point,
            view_up: camera.view_up,
            fov_deg,
            height_world,
            clipping_range: range.or(camera.clipping_range),
            radius: view.radius,
            opacity: view.opacity,
            seconds,
            path,
        }
    }

    /// Vertical field of view, degrees; `None` for an orthographic view.
    pub fn fov_deg(&self) -> Option<f64> {
        self.fov_deg
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}

fn some_path<S: Serializer>(path: &Option<PathBuf>, to: S) -> Result<S::Ok, S::Error> {
    path_as_text(path.as_deref().unwrap_or(std::path::Path::new("")), to)
}
