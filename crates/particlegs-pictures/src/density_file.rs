//! Raw values of a surface density or field: NAME.f32, little-endian float32 by rows from the top, and NAME.json, which
//! describes them.

use crate::field_choice::FieldLegend;
use crate::picture_out::PictureOut;
use crate::subject::Quantities;
use crate::view_content::ViewContent;
use particlegs_core::camera::{CameraRecord, DensityView, Projection, View};
use particlegs_core::context::Context;
use particlegs_core::math::float32_holds;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::{Error, Result};
use particlegs_files::input::{Begins, Form, read_whole};
use particlegs_files::output::{FileSet, Outputs, kinds, write_atomic, write_bytes};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Larger pictures are refused before memory is allocated.
const LARGEST_SIDE: usize = 65_536;
/// Relative tolerance for equal cameras.
const SAME: f64 = 1e-6;

const DESCRIPTION: Form =
    Form { title: "a description of values", begins: Begins::Object, most: 1 << 20, expansion: 16 };

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
    /// Whether lengths are comoving.
    pub comoving: bool,
    /// Number of neighbours for smoothing, for pictures of particles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smooth: Option<usize>,
    /// World units per pixel; in perspective, at the focal point.
    pub world_per_pixel: f64,
}

const FLOAT64: &str = "float64, little-endian, rows from the top";

/// Declares the files of values for these views.
pub fn declare(out: &PictureOut, views: &[View], outputs: &Outputs, context: &Context<'_>) -> Result<()> {
    let path = |view: &View, ending| out.folder().join(format!("{}.{ending}", view.name));
    views.iter().try_for_each(|view| {
        // Whether float32 holds the values is known only when they are there, so both files are declared.
        outputs.writes(&path(view, "f32"), &kinds::VALUES, context)?;
        outputs.writes(&path(view, "f64"), &kinds::VALUES, context)?;
        outputs.writes(&path(view, "json"), &kinds::JSON, context).map(drop)
    })
}

/// Writes the values of a density, or of a field that is shown instead: as float64 where float32 does not hold
/// them.
pub fn write_content(
    out: &PictureOut,
    view: &DensityView,
    content: &ViewContent,
    q: &Quantities,
    field: Option<&FieldLegend>,
) -> Result<PathBuf> {
    let (plane, wide) = match content {
        ViewContent::Field(plane, _) => {
            let values = || plane.data.iter().copied().filter(|v| v.is_finite());
            let range = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
            (plane.clone(), range[0] <= range[1] && !float32_holds(range))
        }
        ViewContent::Density(plane) => {
            (Plane { size: plane.size, data: plane.data.iter().map(|v| f64::from(*v)).collect() }, false)
        }
        _ => return Err(Error::argument("raw values are those of densities and fields")),
    };
    let perspective = matches!(view.camera.projection, Projection::Perspective { .. });
    let focal = view.camera.focal_pixels(plane.size);
    let world_per_pixel = if perspective { view.camera.distance() / focal } else { 1.0 / focal };
    let (comoving, smooth) = (q.comoving, q.smooth);
    let (quantity, unit) = match field {
        Some(field) => (field.title.clone(), field.unit.clone()),
        None => (format!("surface density{}", q.of_what()), q.unit()),
    };
    let means = Means { quantity, unit, comoving, smooth, world_per_pixel };
    write(out.folder(), view, (&plane, wide), means)
}

/// Writes the two files of a view into a folder, values as float32 or `wide`; returns the path of the values.
fn write(folder: &Path, view: &DensityView, (plane, wide): (&Plane<f64>, bool), means: Means) -> Result<PathBuf> {
    let set = FileSet::in_folder(folder)?;
    let name = format!("{}.{}", view.name, if wide { "f64" } else { "f32" });
    let bytes = |run: &[f64]| -> Vec<u8> {
        match wide {
            true => run.iter().flat_map(|v| v.to_le_bytes()).collect(),
            false => run.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect(),
        }
    };
    write_atomic(&set.path().join(&name), |w| plane.data.chunks(1 << 14).try_for_each(|run| w.write_all(&bytes(run))))?;
    let mut description = described(view, plane.size, means);
    if wide {
        description.values = FLOAT64.into();
    }
    let mut text = serde_json::to_vec_pretty(&description).expect("plain data");
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
    let text = read_whole(&path, DESCRIPTION, context)?;
    let description: DensityDescription = serde_json::from_slice(&text)
        .map_err(|e| Error::input(&path, format!("it does not describe raw values: {e}")))?;
    let size = Size { width: description.width, height: description.height };
    if ![size.width, size.height].iter().all(|side| (1..=LARGEST_SIDE).contains(side)) {
        return Err(Error::input(&path, format!("{}x{} pixels: out of range", size.width, size.height)));
    }
    if description.values == FLOAT64 {
        return Err(Error::input(&path, "its values are float64, which are not compared"));
    }
    let path = file.with_extension("f32");
    let most = 4 * size.pixels() as u64;
    // Compare numbers, as they are read back.
    let form = Form { title: "values of surface density", begins: Begins::With(b""), most, expansion: 2 };
    let bytes = read_whole(&path, form, context)?;
    let (numbers, rest) = bytes.as_chunks::<4>();
    if numbers.len() != size.pixels() || !rest.is_empty() {
        let message = format!("{} bytes, but {}x{} pixels take {most}", bytes.len(), size.width, size.height);
        return Err(Error::input(&path, message));
    }
    let data: Vec<f32> = numbers.iter().map(|v| f32::from_le_bytes(*v)).collect();
    if data.iter().any(|v| !v.is_finite()) {
        return Err(Error::input(&path, "it holds values that are not finite"));
    }
    Ok((description, Plane { size, data }))
}

impl DensityDescription {
    /// Why these values cannot be compared with others pixel by pixel, if so.
    pub fn differs(&self, other: &DensityDescription) -> Option<String> {
        let pair =
            |label: &str, a: &dyn std::fmt::Display, b: &dyn std::fmt::Display| Some(format!("{label}{a} and {b}"));
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
        // Coordinates near 0 are compared by the size of all: their own says nothing.
        let largest = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let same_pixels = (a[0] - b[0]).abs() <= SAME * a[0].abs();
        let same = a.len() != b.len() || a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= SAME * largest);
        (!(same_pixels && same)).then(|| "their views differ: save those of one, and draw the other with them".into())
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
