//! Views files: JSON with `width`, `height`, `fov_deg` and `views` (docs/guide/pictures.md).

use super::{Camera, Projection, View, ViewSet};
use crate::context::Context;
use crate::picture::Size;
use crate::{Error, Result};
use particlegs_files::input::{Begins, Form, read_whole};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A hundred thousand views.
const FORM: Form = Form { title: "a views file", begins: Begins::Object, most: 64 << 20, expansion: 4 };
/// Bytes of a view's name at most: pictures are named after it, with an ending.
const LONGEST_NAME: usize = 200;

/// A views file and what it holds: a size of pictures and views.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewsFile(
    /// The views, every one checked where the file was read.
    pub ViewSet,
);

#[derive(Serialize, Deserialize)]
struct FileForm {
    width: usize,
    height: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    fov_deg: Option<f64>,
    views: Vec<ViewForm>,
}

#[derive(Serialize, Deserialize)]
struct ViewForm {
    name: String,
    position: [f64; 3],
    focal_point: [f64; 3],
    view_up: [f64; 3],
    radius: f64,
    opacity: f64,
    /// Of a view in perspective that has not the file's.
    #[serde(skip_serializing_if = "Option::is_none")]
    fov_deg: Option<f64>,
    /// Of an orthographic view.
    #[serde(skip_serializing_if = "Option::is_none")]
    height_world: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    clipping_range: Option<[f64; 2]>,
}

impl ViewForm {
    /// A view of a file with this field of view.
    fn new(v: &View, of_file: Option<f64>) -> Self {
        let Camera { position, focal_point, view_up, clipping_range, projection } = v.camera;
        let (name, radius, opacity) = (v.name.clone(), v.radius, v.opacity);
        let (fov_deg, height_world) = match projection {
            Projection::Perspective { fov_deg } => (Some(fov_deg).filter(|f| Some(*f) != of_file), None),
            Projection::Orthographic { height_world } => (None, Some(height_world)),
        };
        ViewForm { name, position, focal_point, view_up, radius, opacity, fov_deg, height_world, clipping_range }
    }
}

/// The field of view of the first perspective view, degrees.
fn fov_deg(views: &[View]) -> Option<f64> {
    views.iter().find_map(|v| match v.camera.projection {
        Projection::Perspective { fov_deg } => Some(fov_deg),
        Projection::Orthographic { .. } => None,
    })
}

impl ViewsFile {
    /// Reads and checks a views file; `-` is standard input.
    ///
    /// # Errors
    /// [`Error::Io`] where it cannot be read; [`Error::Input`] where it is no views file, holds no view,
    /// two of one name, a name that no file can have, or a number outside its range; [`Error::Cancelled`].
    pub fn read(path: &Path, context: &Context<'_>) -> Result<Self> {
        Self::of_bytes(&read_whole(path, FORM, context)?, path)
    }

    /// [`ViewsFile::read`] of a views file's bytes, which `path` names in errors.
    ///
    /// # Errors
    /// As [`ViewsFile::read`].
    pub fn of_bytes(text: &[u8], path: &Path) -> Result<Self> {
        let form: FileForm =
            serde_json::from_slice(text).map_err(|e| Error::input(path, format!("not a views file: {e}")))?;
        let views = form.views.into_iter().map(|v| view(v, form.fov_deg).map_err(|what| Error::input(path, what)));
        let set =
            ViewSet { size: Size { width: form.width, height: form.height }, views: views.collect::<Result<_>>()? };
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
        Ok(ViewsFile(set))
    }

    /// Its text, which [`ViewsFile::read`] reads back without a difference.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number that JSON cannot hold.
    pub fn text(&self) -> Result<String> {
        let ViewsFile(set) = self;
        let fov_deg = fov_deg(&set.views);
        let form = FileForm {
            width: set.size.width,
            height: set.size.height,
            fov_deg,
            views: set.views.iter().map(|v| ViewForm::new(v, fov_deg)).collect(),
        };
        serde_json::to_string_pretty(&form).map(|text| text + "\n").map_err(|e| Error::argument(e.to_string()))
    }
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

/// A view of a file with this field of view, or why it is none.
fn view(v: ViewForm, of_file: Option<f64>) -> std::result::Result<View, String> {
    let projection = match (v.height_world, v.fov_deg.or(of_file)) {
        (Some(height_world), _) if v.fov_deg.is_none() => Projection::Orthographic { height_world },
        (None, Some(fov_deg)) => Projection::Perspective { fov_deg },
        (None, None) => {
            let what = "it has neither fov_deg (perspective) nor height_world (orthographic): its window is missing";
            return Err(format!("view `{}`: {what}", v.name));
        }
        (Some(_), _) => return Err(format!("view `{}`: it has both fov_deg and height_world", v.name)),
    };
    let (position, focal_point, view_up) = (v.position, v.focal_point, v.view_up);
    let camera = Camera { position, focal_point, view_up, projection, clipping_range: v.clipping_range };
    Ok(View { name: v.name, camera, radius: v.radius, opacity: v.opacity })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Context;
    use proptest::prelude::*;

    /// Numbers of every size, whose decimals do not end early.
    fn number() -> impl Strategy<Value = f64> {
        any::<f64>().prop_filter("finite", |v| v.is_finite())
    }

    prop_compose! {
        fn views()(
            size in (1usize..=32_768, 1usize..=32_768),
            fov_deg in 1e-3..179.0f64,
            eyes in prop::collection::vec((prop::array::uniform3(number()), prop::array::uniform3(number())), 1..5),
            looks in prop::collection::vec((1e-300..1e300f64, 1e-12..=1.0f64, prop::option::of(1e-9..1e9f64)), 5),
        ) -> ViewsFile {
            let view = |(i, (position, focal_point)): (usize, &([f64; 3], [f64; 3]))| {
                let (radius, opacity, near) = looks[i];
                let clipping_range = near.map(|n| [n, 3.0 * n]);
                let projection = match i % 3 {
                    0 => Projection::Perspective { fov_deg },
                    1 => Projection::Perspective { fov_deg: 0.5 * fov_deg },
                    _ => Projection::Orthographic { height_world: radius },
                };
                let camera = Camera {
                    position: *position, focal_point: *focal_point, view_up: [0.1, 0.7, 0.3], projection, clipping_range,
                };
                View { name: format!("view \"{i}\" é"), camera, radius, opacity }
            };
            let views = eyes.iter().enumerate().map(view).collect();
            ViewsFile(ViewSet { size: Size { width: size.0, height: size.1 }, views })
        }
    }

    proptest! {
        /// To the last bit: a picture of the views that were written is the same picture.
        #[test]
        fn what_is_written_is_read_again(set in views()) {
            prop_assume!(set.0.views.iter().all(|v| v.check(set.0.size).is_ok()));
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), set.text().unwrap()).unwrap();
            prop_assert_eq!(ViewsFile::read(file.path(), &Context::SILENT).unwrap(), set);
        }
    }

    #[test]
    fn a_view_without_a_window_says_so() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let read = |of_file: serde_json::Value, more: serde_json::Value| {
            let mut view = serde_json::json!({
                "name": "a", "position": [0, 0, 9], "focal_point": [0, 0, 0], "view_up": [0, 1, 0],
                "radius": 0.1, "opacity": 0.5, "clipping_range": [0.0, 20.0],
            });
            view.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            let text = serde_json::json!({ "width": 8, "height": 8, "fov_deg": of_file, "views": [view] });
            std::fs::write(file.path(), text.to_string()).unwrap();
            ViewsFile::read(file.path(), &Context::SILENT).map_err(|e| e.to_string())
        };
        let none = serde_json::Value::Null;
        let height = serde_json::json!({ "height_world": 5.0 });
        for of_file in [none.clone(), 30.0.into()] {
            let set = read(of_file, height.clone()).unwrap();
            assert_eq!(set.0.views[0].camera.projection, Projection::Orthographic { height_world: 5.0 });
        }
        let fails = |of_file, more, text: &str| {
            let said = read(of_file, more).unwrap_err();
            assert!(said.contains(text), "{said}");
        };
        fails(none.clone(), serde_json::json!({}), "its window is missing");
        fails(none.clone(), serde_json::json!({ "height_world": 5.0, "fov_deg": 30.0 }), "both");
        fails(none.clone(), serde_json::json!({ "height_world": -5.0 }), "must be positive");
        // A perspective view begins in front of the eye.
        fails(none, serde_json::json!({ "fov_deg": 30.0 }), "clipping range");
    }

    /// The guide's example is a views file, and its table names every key of one.
    #[test]
    fn the_guide_describes_the_file() {
        let page = include_str!("../../../../docs/guide/pictures.md");
        let example = page.split("```json").nth(1).unwrap().split("```").next().unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), example).unwrap();
        let set = ViewsFile::read(file.path(), &Context::SILENT).unwrap();
        let written: serde_json::Value = serde_json::from_str(&set.text().unwrap()).unwrap();
        let views = written["views"].as_array().unwrap().iter().flat_map(|v| v.as_object().unwrap().keys());
        let keys: std::collections::BTreeSet<&String> = written.as_object().unwrap().keys().chain(views).collect();
        assert_eq!(keys.len(), 12);
        keys.iter().for_each(|key| assert!(page.contains(&format!("`{key}`")), "{key}"));
    }

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
        ViewsFile::read(&path, &Context::SILENT).err().map(|e| e.to_string())
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
