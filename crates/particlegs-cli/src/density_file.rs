//! Surface density as numbers: NAME.f32, little-endian float32 by rows from the top, and NAME.json, which describes
//! them. `--raw` writes and `compare` reads them.

use particlegs_core::camera::{CameraRecord, DensityView, Projection};
use particlegs_core::context::Context;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::{Error, Result};
use particlegs_files::input::{Begins, Form, read_whole};
use particlegs_files::output::{FileSet, write_atomic, write_bytes};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Larger pictures are refused before memory is allocated.
const LARGEST_SIDE: usize = 65_536;
/// Relative tolerance for equal cameras.
const SAME: f64 = 1e-6;

const JSON: Form = Form { title: "a description of values", begins: Begins::Object, most: 1 << 20, expansion: 16 };

#[derive(Serialize, Deserialize)]
pub struct DensityDescription {
    width: usize,
    height: usize,
    values: String,
    #[serde(flatten)]
    means: Means,
    projection: String,
    /// The camera; `projection` and `world_per_pixel` define the window.
    #[serde(flatten)]
    camera: Option<CameraRecord>,
    name: String,
}

/// Part of the description that the plane and its view do not know.
#[derive(Serialize, Deserialize)]
pub struct Means {
    pub quantity: String,
    /// Unit of the values.
    pub unit: String,
    /// Are lengths comoving?
    pub comoving: bool,
    /// Number of neighbours for smoothing, for pictures of particles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smooth: Option<usize>,
    /// World units per pixel; in perspective, at the focal point.
    pub world_per_pixel: f64,
}

const FLOAT64: &str = "float64, little-endian, rows from the top";

/// Writes the two files of a view into a folder, values as float32 or `wide`; returns the path of the values.
pub fn write(folder: &Path, view: &DensityView, (plane, wide): (&Plane<f64>, bool), means: Means) -> Result<PathBuf> {
    let set = FileSet::in_folder(folder)?;
    let name = format!("{}.{}", view.name, if wide { "f64" } else { "f32" });
    let bytes = |run: &[f64]| -> Vec<u8> {
        match wide {
            true => run.iter().flat_map(|v| v.to_le_bytes()).collect(),
            false => run.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect(),
        }
    };
    write_atomic(&set.path().join(&name), |w| plane.data.chunks(1 << 14).try_for_each(|run| w.write_all(&bytes(run))))?;
    let mut described = described(view, plane.size, means);
    if wide {
        described.values = FLOAT64.into();
    }
    let mut text = serde_json::to_vec_pretty(&described).expect("plain data");
    text.push(b'\n');
    write_bytes(&set.path().join(format!("{}.json", view.name)), &text)?;
    set.finish()?;
    Ok(folder.join(name))
}

fn described(view: &DensityView, size: Size, means: Means) -> DensityDescription {
    let perspective = matches!(view.camera.projection, Projection::Perspective { .. });
    let record = CameraRecord::from(view.camera);
    DensityDescription {
        width: size.width,
        height: size.height,
        values: "float32, little-endian, rows from the top".into(),
        means,
        projection: if perspective { "perspective" } else { "orthographic" }.into(),
        camera: Some(CameraRecord { fov_deg: None, height_world: None, clipping_range: Some(view.range), ..record }),
        name: view.name.clone(),
    }
}

/// Reads what [`write`] wrote for a view, given one of the two files.
pub fn read(file: &Path, context: &Context<'_>) -> Result<(DensityDescription, Plane)> {
    let path = file.with_extension("json");
    let text = read_whole(&path, JSON, context)?;
    let described: DensityDescription =
        serde_json::from_slice(&text).map_err(|e| Error::input(&path, format!("not written by --raw: {e}")))?;
    let size = Size { width: described.width, height: described.height };
    if ![size.width, size.height].iter().all(|side| (1..=LARGEST_SIDE).contains(side)) {
        return Err(Error::input(&path, format!("{}x{} pixels: out of range", size.width, size.height)));
    }
    if described.values == FLOAT64 {
        return Err(Error::input(&path, "its values are float64, which are not compared"));
    }
    let path = file.with_extension("f32");
    let most = 4 * size.pixels() as u64;
    // Compare numbers, as they are read back.
    let form = Form { title: "values of surface density", begins: Begins::With(b""), most, expansion: 2 };
    let bytes = read_whole(&path, form, context)?;
    let (numbers, rest) = bytes.as_chunks::<4>();
    if numbers.len() != size.pixels() || !rest.is_empty() {
        let what = format!("{} bytes, but {}x{} pixels take {most}", bytes.len(), size.width, size.height);
        return Err(Error::input(&path, what));
    }
    let data: Vec<f32> = numbers.iter().map(|v| f32::from_le_bytes(*v)).collect();
    if data.iter().any(|v| !v.is_finite()) {
        return Err(Error::input(&path, "it holds values that are not finite"));
    }
    Ok((described, Plane { size, data }))
}

impl DensityDescription {
    /// Why these values cannot be compared with others pixel by pixel, if so.
    pub fn differs(&self, other: &DensityDescription) -> Option<String> {
        let pair =
            |what: &str, a: &dyn std::fmt::Display, b: &dyn std::fmt::Display| Some(format!("{what}{a} and {b}"));
        if (self.width, self.height) != (other.width, other.height) {
            let [a, b] = [self, other].map(|d| format!("{}x{}", d.width, d.height));
            return pair("sizes differ: ", &a, &b);
        }
        let [a, b] = [&self.means, &other.means];
        if (&a.quantity, &a.unit) != (&b.quantity, &b.unit) {
            let [a, b] = [a, b].map(|m| format!("{} in {}", m.quantity, m.unit));
            return pair("quantities differ: ", &a, &b);
        }
        if a.comoving != b.comoving {
            let [a, b] = [a, b].map(|m| if m.comoving { "comoving" } else { "not comoving" });
            return pair("lengths differ: ", &a, &b);
        }
        if self.projection != other.projection {
            return pair("projections differ: ", &self.projection, &other.projection);
        }
        let [a, b] = [self, other].map(|d| d.numbers());
        let largest = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let same_pixels = (a[0] - b[0]).abs() <= SAME * a[0].abs();
        let same = a.len() != b.len() || a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= SAME * largest);
        (!(same_pixels && same)).then(|| "their views differ: use --save-views on one and --views on the other".into())
    }

    /// Size of a pixel, and the camera if it is known.
    fn numbers(&self) -> Vec<f64> {
        let mut all = vec![self.means.world_per_pixel];
        if let Some(c) = &self.camera {
            all.extend(
                [c.position, c.focal_point, c.view_up].as_flattened().iter().chain(c.clipping_range.iter().flatten()),
            );
        }
        all
    }
}
