//! Cameras, and pictures as arrays.

use crate::arrays::shaped;
use crate::errors::{InputError, IntoPyResult, named};
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use particlegs_core::camera::{Camera, DensityView, View, Window, base_distance, spherical_camera};
use particlegs_core::picture::{DensityColors, Gray8, Plane, Size};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use pyo3::prelude::*;

/// A camera from Python: angles, or JSON with the keys of views files.
#[derive(FromPyObject)]
pub enum CameraArgs {
    #[pyo3(transparent)]
    Whole(String),
    #[pyo3(transparent)]
    Angles(Angles),
}

/// As in the command: angles in degrees, distance in base distances, or a window.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Angles {
    azimuth: f64,
    elevation: f64,
    distance: f64,
    center: Option<[f64; 3]>,
    /// Width of an orthographic picture, world units.
    width: Option<f64>,
    depth: Option<f64>,
}

/// What the camera looks at.
pub struct ViewDefaults {
    pub bounds: Bounds,
    pub cell: Option<Cell>,
    /// Default radius and opacity.
    pub usual: [f64; 2],
}

impl ViewDefaults {
    /// The view, checked.
    pub fn view(&self, args: &CameraArgs, size: Size, radius: Option<f64>, opacity: Option<f64>) -> Result<View> {
        check(size)?;
        let camera = match args {
            CameraArgs::Whole(json) => {
                serde_json::from_str(json).map_err(|e| Error::argument(format!("invalid camera: {e}")))?
            }
            CameraArgs::Angles(a) => self.turned(a, size)?,
        };
        let [usual_radius, usual_opacity] = self.usual;
        let view = View {
            name: "view".into(),
            camera,
            radius: radius.unwrap_or(usual_radius),
            opacity: opacity.unwrap_or(usual_opacity),
        };
        view.check(size)?;
        Ok(view)
    }

    fn turned(&self, a: &Angles, size: Size) -> Result<Camera> {
        let center = a.center.unwrap_or(self.bounds.center());
        if center.iter().chain([&a.azimuth, &a.elevation]).any(|v| !v.is_finite()) {
            return Err(Error::argument("the centre and angles must be finite"));
        }
        if let Some(width) = a.width {
            let window = Window { center, angles_deg: [a.azimuth, a.elevation], width, depth: a.depth };
            return Ok(DensityView::orthographic("view", &window, size, &self.bounds, self.cell)?.camera);
        }
        if !(a.distance > 0.0 && a.distance.is_finite()) {
            return Err(Error::argument(format!("distance must be positive, not {}", a.distance)));
        }
        let distance = a.distance * base_distance(&self.bounds, size);
        Ok(spherical_camera(center, a.azimuth, a.elevation, distance))
    }

    /// The view of a density.
    pub fn density_view(&self, view: &View, size: Size) -> DensityView {
        DensityView::of_cell(view, size, &self.bounds, self.cell)
    }
}

/// A camera at these angles about bounds, as JSON; the distance is in base distances of a wide picture.
#[pyfunction]
pub fn camera_around(bounds: [[f64; 3]; 2], azimuth: f64, elevation: f64, distance: f64) -> PyResult<String> {
    let [min, max] = bounds;
    let subject = ViewDefaults { bounds: Bounds { min, max }, cell: None, usual: [1.0; 2] };
    let angles = Angles { azimuth, elevation, distance, center: None, width: None, depth: None };
    let camera = subject.turned(&angles, Size { width: 16, height: 9 }).or_raise()?;
    serde_json::to_string(&camera).map_err(|e| InputError::new_err(e.to_string()))
}

/// Checks the size of a picture.
pub fn check(size: Size) -> Result<()> {
    let fine = |n: usize| (1..=32_768).contains(&n);
    if fine(size.width) && fine(size.height) {
        return Ok(());
    }
    Err(Error::argument(format!("width and height must be 1 to 32768 pixels, not {} x {}", size.width, size.height)))
}

/// The tone style; `None` = brightness without rounding.
pub fn look(style: &str) -> PyResult<Option<ToneStyle>> {
    Ok(Some(named("style", style)?).filter(|look| *look != ToneStyle::Expected))
}

/// 8-bit levels, (height, width).
pub fn levels(py: Python<'_>, picture: Gray8) -> PyResult<Bound<'_, PyAny>> {
    Ok(array(py, picture.size, picture.data)?.into_any())
}

/// `1 - exp(-tau)` of an optical depth, (height, width).
pub fn brightness<'py>(py: Python<'py>, depth: &Plane) -> PyResult<Bound<'py, PyAny>> {
    Ok(array(py, depth.size, depth.data.iter().map(|tau| -(-tau).exp_m1()).collect())?.into_any())
}

/// Values of a picture, (height, width).
pub fn array<T: numpy::Element>(py: Python<'_>, size: Size, values: Vec<T>) -> PyResult<Bound<'_, PyArrayDyn<T>>> {
    shaped(py, &[size.height, size.width], values)
}

/// float64 values of a plane, (height, width).
pub fn plane<'py, T: Copy + Into<f64>>(py: Python<'py>, plane: &Plane<T>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    array(py, plane.size, plane.data.iter().map(|v| (*v).into()).collect())
}

/// The density range of a map, unless it is empty, and the position of its lowest colour in a colour map.
#[pyfunction]
pub fn density_range(values: PyReadonlyArrayDyn<'_, f64>) -> (Option<[f64; 2]>, f32) {
    let data: Vec<f32> = values.as_array().iter().map(|v| *v as f32).collect();
    (Plane { size: Size { width: data.len(), height: 1 }, data }.log_range(), DensityColors::LOWEST)
}
