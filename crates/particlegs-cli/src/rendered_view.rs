//! Pictures in a JSON report, with the keys of a views file, so that `--views` can read it.

use crate::view_args::ViewSubject;
use particlegs_core::camera::{DensityView, View};
use serde::Serialize;
use std::path::PathBuf;

#[derive(Serialize)]
pub struct RenderedView {
    /// The view; a surface density has no radius and opacity.
    #[serde(flatten)]
    pub view: View,
    pub seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<String>,
}

impl RenderedView {
    /// The picture of a view, without a path if it only went into a film.
    pub fn new(view: &View, subject: &ViewSubject, seconds: f64, path: Option<PathBuf>) -> Self {
        let mut view = view.clone();
        if subject.density {
            view.camera.clipping_range = Some(DensityView::of_view(&view, &subject.bounds).range);
        }
        RenderedView { view, seconds, path: path.map(|p| p.to_string_lossy().into_owned()) }
    }
}
