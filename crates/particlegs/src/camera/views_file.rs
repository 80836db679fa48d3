//! Views files: JSON with `width`, `height`, `fov_deg` and `views` (docs/guide/pictures.md).

use super::{Camera, Projection, View, ViewSet};
use crate::picture::Size;
use crate::progress::Progress;
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
    fov_deg: f64,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    clipping_range: Option<[f64; 2]>,
}

impl From<&View> for ViewForm {
    fn from(v: &View) -> Self {
        let Camera { position, focal_point, view_up, clipping_range, .. } = v.camera;
        let (name, radius, opacity) = (v.name.clone(), v.radius, v.opacity);
        ViewForm { name, position, focal_point, view_up, radius, opacity, clipping_range }
    }
}

/// The field of view that all have in common, degrees.
fn fov_deg(views: &[View]) -> Result<f64> {
    let mut angles = views.iter().map(|v| match v.camera.projection {
        Projection::Perspective { fov_deg } => Ok(fov_deg),
        Projection::Orthographic { .. } => {
            Err(Error::argument(format!("view `{}`: a views file holds perspective views only", v.name)))
        }
    });
    let first = angles.next().unwrap_or(Ok(super::FOV_DEG))?;
    for angle in angles {
        if angle? != first {
            return Err(Error::argument("the views of one file have one field of view; these have several"));
        }
    }
    Ok(first)
}

impl ViewsFile {
    /// Reads and checks a views file; `-` is standard input.
    ///
    /// # Errors
    /// [`Error::Io`] where it cannot be read; [`Error::Input`] where it is no views file, holds no view,
    /// two of one name, a name that no file can have, or a number outside its range; [`Error::Cancelled`].
    pub fn read(path: &Path, progress: &dyn Progress) -> Result<Self> {
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
        Ok(ViewsFile(set))
    }

    /// Its text, which [`ViewsFile::read`] reads back without a difference.
    ///
    /// # Errors
    /// [`Error::Argument`] for an orthographic view and for views of different angles: the file has one
    /// field of view.
    pub fn text(&self) -> Result<String> {
        let ViewsFile(set) = self;
        let form = FileForm {
            width: set.size.width,
            height: set.size.height,
            fov_deg: fov_deg(&set.views)?,
            views: set.views.iter().map(ViewForm::from).collect(),
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
                let projection = Projection::Perspective { fov_deg };
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
            prop_assert_eq!(ViewsFile::read(file.path(), &Silent).unwrap(), set);
        }
    }

    #[test]
    fn what_a_views_file_cannot_say_is_refused() {
        let camera = super::super::spherical_camera([0.0; 3], 10.0, 20.0, 5.0);
        let view = View { name: "a".into(), camera, radius: 1.0, opacity: 0.5 };
        let with = |projection: Projection| View { camera: Camera { projection, ..camera }, ..view.clone() };
        let size = Size { width: 4, height: 3 };
        let set = |views: Vec<View>| ViewsFile(ViewSet { size, views }).text();
        assert!(set(vec![view.clone(), view.clone()]).is_ok());
        assert!(set(vec![view.clone(), with(Projection::Perspective { fov_deg: 40.0 })]).is_err());
        assert!(set(vec![with(Projection::Orthographic { height_world: 1.0 })]).is_err());
    }

    /// The guide's example is a views file, and its table names every key of one.
    #[test]
    fn the_guide_describes_the_file() {
        let page = include_str!("../../../../docs/guide/pictures.md");
        let example = page.split("```json").nth(1).unwrap().split("```").next().unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), example).unwrap();
        let set = ViewsFile::read(file.path(), &Silent).unwrap();
        let written: serde_json::Value = serde_json::from_str(&set.text().unwrap()).unwrap();
        let inside = written["views"].as_array().unwrap().iter().find(|v| v.get("clipping_range").is_some()).unwrap();
        let keys = written.as_object().unwrap().keys().chain(inside.as_object().unwrap().keys());
        assert!(keys.clone().count() == 11);
        keys.for_each(|key| assert!(page.contains(&format!("`{key}`")), "{key}"));
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
        ViewsFile::read(&path, &Silent).err().map(|e| e.to_string())
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
