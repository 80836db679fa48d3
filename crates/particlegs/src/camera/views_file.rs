//! Views files: JSON with `width`, `height`, `fov_deg` and `views`.

use super::view::{Camera, Projection, View, ViewSet};
use crate::picture::Size;
use crate::{Error, Result};
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
struct FileForm {
    width: usize,
    height: usize,
    fov_deg: f64,
    views: Vec<ViewForm>,
}

#[derive(Deserialize)]
struct ViewForm {
    name: String,
    position: [f64; 3],
    focal_point: [f64; 3],
    view_up: [f64; 3],
    radius: f64,
    opacity: f64,
    clipping_range: Option<[f64; 2]>,
}

/// Reads and checks a views file.
///
/// # Errors
/// [`Error::Io`] where it cannot be read; [`Error::Input`] where it is no views file, holds no view,
/// two of one name, or a number outside its range.
pub fn read_views(path: &Path) -> Result<ViewSet> {
    let text = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    let form: FileForm =
        serde_json::from_slice(&text).map_err(|e| Error::input(path, format!("not a views file: {e}")))?;
    let set = ViewSet {
        size: Size { width: form.width, height: form.height },
        views: form.views.into_iter().map(|v| view(v, form.fov_deg)).collect(),
    };
    if set.views.is_empty() {
        return Err(Error::input(path, "a views file without views"));
    }
    let mut names = std::collections::BTreeSet::new();
    for v in &set.views {
        let plain = !v.name.is_empty() && !v.name.starts_with('.') && !v.name.contains(['/', '\\', '\0']);
        if !plain || !names.insert(v.name.as_str()) {
            return Err(Error::input(path, format!("view name `{}` is empty, repeated or no file name", v.name)));
        }
        v.check(set.size).map_err(|e| Error::input(path, e.to_string()))?;
    }
    Ok(set)
}

fn view(v: ViewForm, fov_deg: f64) -> View {
    View {
        name: v.name,
        camera: Camera {
            position: v.position,
            focal_point: v.focal_point,
            view_up: v.view_up,
            projection: Projection::Perspective { fov_deg },
            clipping_range: v.clipping_range,
        },
        radius: v.radius,
        opacity: v.opacity,
    }
}
