//! Reports of drawn pictures. A report has the keys of a views file, and can be read as one.

use crate::subject::ViewSubject;
use particlegs_core::camera::{DensityView, View};
use serde::Serialize;
use std::path::PathBuf;

/// Pictures that were drawn, of models or of particles.
#[derive(Debug, Default, Serialize)]
pub struct PictureReport {
    /// The style's name.
    pub style: String,
    /// Number of Gaussians of all models.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaussians: Option<usize>,
    /// Number of particles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub particles: Option<u64>,
    /// Number of neighbours that were smoothed over, and the seconds to find them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smooth: Option<usize>,
    /// Seconds of that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smooth_seconds: Option<f64>,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Vertical angle of view in degrees; none of orthographic pictures.
    pub fov_deg: Option<f64>,
    /// Values of the first and last colour, if all pictures share one range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// The pictures.
    pub views: Vec<RenderedView>,
    /// In words, what was written of a film or a figure of panels.
    #[serde(skip)]
    pub lines: Vec<String>,
}

/// A picture of a view.
#[derive(Debug, Serialize)]
pub struct RenderedView {
    /// The view; a surface density has no radius and opacity.
    #[serde(flatten)]
    pub view: View,
    /// Seconds to draw it, of a frame also to write it.
    pub seconds: f64,
    /// Its file, unless it only went into a film.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// Of particles in grey levels, their radius in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_px: Option<f64>,
    /// Of particles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub particles_per_second: Option<f64>,
}

impl RenderedView {
    /// The picture of a view of a model.
    pub(crate) fn new(view: &View, subject: &ViewSubject, seconds: f64, path: Option<PathBuf>) -> Self {
        let mut view = view.clone();
        if subject.density {
            view.camera.clipping_range = Some(DensityView::of_view(&view, &subject.bounds).range);
        }
        let path = path.map(|p| p.to_string_lossy().into_owned());
        RenderedView { view, seconds, path, radius_px: None, particles_per_second: None }
    }
}
