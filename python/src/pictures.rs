//! Cameras, and pictures as arrays.

use crate::arrays::shaped;
use crate::errors::{InputError, IntoPyResult, named};
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use particlegs::pictures::{PictureCenter, ViewOptions, ViewSubject};
use particlegs_core::camera::View;
use particlegs_core::picture::{DensityColors, Gray8, Plane, Size};
use particlegs_core::space::Bounds;
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

impl CameraArgs {
    /// The view of a subject, checked.
    pub fn view(self, subject: &ViewSubject, size: Size, [radius, opacity]: [Option<f64>; 2]) -> Result<View> {
        let angles = match self {
            CameraArgs::Angles(angles) => angles,
            CameraArgs::Whole(json) => {
                let camera =
                    serde_json::from_str(&json).map_err(|e| Error::argument(format!("invalid camera: {e}")))?;
                let (radius, opacity) = (radius.unwrap_or(subject.radius), opacity.unwrap_or(subject.opacity));
                let view = View { name: "view".into(), camera, radius, opacity };
                return view.check(size).map(|()| view);
            }
        };
        let options = ViewOptions {
            azimuth: angles.azimuth,
            elevation: angles.elevation,
            distance: angles.distance,
            center: angles.center.map(PictureCenter::Place),
            orthographic: angles.width.is_some(),
            width: angles.width,
            depth: angles.depth,
            size: Some(size),
            radius,
            opacity,
            ..ViewOptions::default()
        };
        options.view(subject)
    }
}

/// A camera at these angles about bounds, as JSON; the distance is in base distances of a wide picture.
#[pyfunction]
pub fn camera_around(bounds: [[f64; 3]; 2], azimuth: f64, elevation: f64, distance: f64) -> PyResult<String> {
    let [min, max] = bounds;
    let subject = ViewSubject::of_particles(Bounds { min, max }, None, 1, false);
    let angles = Angles { azimuth, elevation, distance, center: None, width: None, depth: None };
    let view = CameraArgs::Angles(angles).view(&subject, Size { width: 16, height: 9 }, [Some(1.0); 2]).or_raise()?;
    let camera = view.camera;
    serde_json::to_string(&camera).map_err(|e| InputError::new_err(e.to_string()))
}

/// The tone style; `None` = brightness without rounding.
pub fn look(style: &str) -> PyResult<Option<ToneStyle>> {
    Ok(Some(named("style", style)?).filter(|style| *style != ToneStyle::Expected))
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
