//! Pictures in a JSON report: cameras by the keys of a views file, so that `--views` reads the report.

use crate::view_args::ViewSubject;
use particlegs_pipeline::camera::{DensityView, View};
use serde::Serialize;
use std::path::PathBuf;

#[derive(Serialize)]
pub struct RenderedView {
    /// Its view; a surface density does not depend on radius and opacity.
    #[serde(flatten)]
    pub view: View,
    pub seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<String>,
}

impl RenderedView {
    /// The picture of a view; no path where it is a frame that went into a film.
    pub fn new(view: &View, subject: &ViewSubject, seconds: f64, path: Option<PathBuf>) -> Self {
        let mut view = view.clone();
        if subject.density {
            view.camera.clipping_range = Some(DensityView::of_view(&view, &subject.bounds).range);
        }
        RenderedView { view, seconds, path: path.map(|p| p.to_string_lossy().into_owned()) }
    }
}
