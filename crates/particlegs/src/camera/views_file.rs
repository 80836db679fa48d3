//! Views files: JSON with `width`, `height`, `fov_deg` and `views`.

use super::view::{Camera, Projection, View, ViewSet};
use crate::input::{Begins, Form, read_whole};
use crate::picture::Size;
use crate::progress::Progress;
use crate::{Error, Result};
use serde::Deserialize;
use std::path::Path;

/// A hundred thousand views.
const FORM: Form = Form { title: "a views file", begins: Begins::Object, most: 64 << 20, expansion: 4 };
/// Bytes of a view's name at most: pictures are named after it, with an ending.
const LONGEST_NAME: usize = 200;

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

/// Reads and checks a views file; `-` is standard input.
///
/// # Errors
/// [`Error::Io`] where it cannot be read; [`Error::Input`] where it is no views file, holds no view,
/// two of one name, a name that no file can have, or a number outside its range; [`Error::Cancelled`].
pub fn read_views(path: &Path, progress: &dyn Progress) -> Result<ViewSet> {
    let text = read_whole(path, FORM, progress)?;
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
        if let Some(fault) = fault_of_name(&v.name) {
            let start: String = v.name.chars().take(40).collect();
            return Err(Error::input(path, format!("view name `{start}` {fault}; pictures are named after it")));
        }
        if !names.insert(v.name.as_str()) {
            return Err(Error::input(path, format!("two views are named `{}`", v.name)));
        }
        v.check(set.size).map_err(|e| Error::input(path, e.to_string()))?;
    }
    Ok(set)
}

/// Why a name is none of a file, if it is none.
fn fault_of_name(name: &str) -> Option<&'static str> {
    match name {
        "" => Some("is empty"),
        _ if name.len() > LONGEST_NAME => Some("is longer than 200 bytes"),
        _ if name.starts_with('.') => Some("begins with a dot"),
        _ if name.contains(['/', '\\']) => Some("has a slash or a backslash"),
        _ if name.contains(char::is_control) => Some("has control characters"),
        _ => None,
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn refusal(name: &str) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("views.json");
        let view = |name: &str| {
            serde_json::json!({
                "name": name, "position": [0, 0, 9], "focal_point": [0, 0, 0], "view_up": [0, 1, 0],
                "radius": 0.1, "opacity": 0.5,
            })
        };
        let views = [view("other"), view(name)];
        let text = serde_json::json!({ "width": 8, "height": 8, "fov_deg": 30.0, "views": views });
        std::fs::write(&path, text.to_string()).unwrap();
        read_views(&path, &Silent).err().map(|e| e.to_string())
    }

    #[test]
    fn names_that_are_no_names_of_files_are_refused() {
        assert_eq!(refusal("near 1 (é)"), None);
        for (name, why) in [
            ("", "is empty"),
            ("..", "begins with a dot"),
            (".hidden", "begins with a dot"),
            ("a/b", "slash"),
            ("a\\b", "slash"),
            ("a\0b", "control"),
            ("a\u{1b}[2J", "control"),
            ("a\u{9b}2J", "control"),
            ("other", "two views are named"),
            (&"x".repeat(201), "longer than 200"),
        ] {
            let refusal = refusal(name).unwrap_or_else(|| panic!("`{name}` passes"));
            assert!(refusal.contains(why) && refusal.len() < 250, "{refusal}");
        }
    }
}
