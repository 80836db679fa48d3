//! Views files: JSON with `width`, `height`, `fov_deg` and `views` (docs/guide/pictures.md).

use crate::input::{Begins, Form, read_whole};
use particlegs_core::camera::{Camera, CameraRecord, View, ViewSet};
use particlegs_core::context::Context;
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result};
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
    /// Of the views that say no window.
    #[serde(skip_serializing_if = "Option::is_none")]
    fov_deg: Option<f64>,
    views: Vec<ViewForm>,
}

#[derive(Serialize, Deserialize)]
struct ViewForm {
    name: String,
    #[serde(flatten)]
    camera: CameraRecord,
    radius: f64,
    opacity: f64,
}

impl ViewsFile {
    /// Reads and checks a views file; `-` is standard input.
    pub fn read(path: &Path, context: &Context<'_>) -> Result<Self> {
        Self::of_bytes(&read_whole(path, FORM, context)?, path)
    }

    /// [`ViewsFile::read`] of a views file's bytes, which `path` names in errors.
    pub fn of_bytes(text: &[u8], path: &Path) -> Result<Self> {
        let FileForm { width, height, fov_deg, views } =
            serde_json::from_slice(text).map_err(|e| Error::input(path, format!("not a views file: {e}")))?;
        let view = |ViewForm { name, mut camera, radius, opacity }: ViewForm| {
            // The angle of the file is for views in perspective, not for those with a height.
            camera.fov_deg = camera.fov_deg.or(fov_deg.filter(|_| camera.height_world.is_none()));
            match Camera::try_from(camera) {
                Ok(camera) => Ok(View { name, camera, radius, opacity }),
                Err(what) => Err(Error::input(path, format!("view `{name}`: {what}"))),
            }
        };
        let set = ViewSet { size: Size { width, height }, views: views.into_iter().map(view).collect::<Result<_>>()? };
        if set.views.is_empty() {
            return Err(Error::input(path, "the views file contains no views"));
        }
        let mut names = std::collections::BTreeSet::new();
        for v in &set.views {
            if let Some(fault) = fault_of_name(&v.name) {
                let start: String = v.name.chars().take(40).collect();
                return Err(Error::input(path, format!("view name `{start}` {fault}, so no file can have it")));
            }
            if !names.insert(v.name.as_str()) {
                return Err(Error::input(path, format!("two views are named `{}`", v.name)));
            }
            v.check(set.size).map_err(|e| Error::input(path, e.to_string()))?;
        }
        Ok(ViewsFile(set))
    }

    /// Its text, which [`ViewsFile::read`] reads back without a difference.
    pub fn text(&self) -> Result<String> {
        let ViewsFile(set) = self;
        let (Size { width, height }, fov_deg) = (set.size, set.fov_deg());
        let view = |v: &View| {
            let mut camera = CameraRecord::from(v.camera);
            camera.fov_deg = camera.fov_deg.filter(|angle| Some(*angle) != fov_deg);
            ViewForm { name: v.name.clone(), camera, radius: v.radius, opacity: v.opacity }
        };
        let form = FileForm { width, height, fov_deg, views: set.views.iter().map(view).collect() };
        serde_json::to_string_pretty(&form).map(|text| text + "\n").map_err(|e| Error::argument(e.to_string()))
    }
}

/// Why a name is none of a file, if it is none.
fn fault_of_name(name: &str) -> Option<&'static str> {
    match name {
        "" => Some("is empty"),
        _ if name.len() > LONGEST_NAME => Some("is longer than 200 bytes"),
        _ if name.starts_with('.') => Some("begins with a dot"),
        _ if name.contains(['/', '\\']) => Some("contains a slash or a backslash"),
        _ if name.contains(char::is_control) => Some("contains control characters"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::camera::Projection;
    use particlegs_core::context::Context;
    use proptest::prelude::*;
    use serde_json::{Value, json};

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

    fn read(text: &str) -> std::result::Result<ViewSet, String> {
        ViewsFile::of_bytes(text.as_bytes(), Path::new("views.json")).map(|file| file.0).map_err(|e| e.to_string())
    }

    #[test]
    fn a_view_without_a_window_says_so() {
        let read = |of_file: Value, more: Value| {
            let mut view = json!({
                "name": "a", "position": [0, 0, 9], "focal_point": [0, 0, 0], "view_up": [0, 1, 0],
                "radius": 0.1, "opacity": 0.5, "clipping_range": [0.0, 20.0],
            });
            view.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            read(&json!({ "width": 8, "height": 8, "fov_deg": of_file, "views": [view] }).to_string())
        };
        let none = Value::Null;
        let height = json!({ "height_world": 5.0 });
        for of_file in [none.clone(), 30.0.into()] {
            let set = read(of_file, height.clone()).unwrap();
            assert_eq!(set.views[0].camera.projection, Projection::Orthographic { height_world: 5.0 });
        }
        let fails = |of_file, more, text: &str| {
            let said = read(of_file, more).unwrap_err();
            assert!(said.contains(text), "{said}");
        };
        fails(none.clone(), json!({}), "set fov_deg");
        fails(none.clone(), json!({ "height_world": 5.0, "fov_deg": 30.0 }), "both");
        fails(none.clone(), json!({ "height_world": -5.0 }), "must be positive");
        // A perspective view begins in front of the eye.
        fails(none, json!({ "fov_deg": 30.0 }), "clipping range");
    }

    /// The guide's example is a views file, and its table names every key of one.
    #[test]
    fn the_guide_describes_the_file() {
        let page = include_str!("../../../docs/guide/pictures.md");
        let example = page.split("```json").nth(1).unwrap().split("```").next().unwrap();
        let set = ViewsFile(read(example).unwrap());
        let written: Value = serde_json::from_str(&set.text().unwrap()).unwrap();
        let views = written["views"].as_array().unwrap().iter().flat_map(|v| v.as_object().unwrap().keys());
        let keys: std::collections::BTreeSet<&String> = written.as_object().unwrap().keys().chain(views).collect();
        assert_eq!(keys.len(), 12);
        keys.iter().for_each(|key| assert!(page.contains(&format!("`{key}`")), "{key}"));
    }

    fn refusal(name: &str) -> Option<String> {
        let view = |name: &str| {
            json!({
                "name": name, "position": [0, 0, 9], "focal_point": [0, 0, 0], "view_up": [0, 1, 0],
                "radius": 0.1, "opacity": 0.5,
            })
        };
        let views = [view("other"), view(name)];
        read(&json!({ "width": 8, "height": 8, "fov_deg": 30.0, "views": views }).to_string()).err()
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
