//! Films of series.

use crate::errors::{InputError, named};
use crate::series::ModelSeries;
use crate::work::WorkOptions;
use particlegs::pictures::{FieldOptions, FilmOptions, PictureOptions, RenderOptions, ViewOptions, render_series};
use particlegs::{Outputs, Size};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Options of a film; the names are those of the command's `render`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FilmArguments {
    frames: String,
    follow: Option<String>,
    center: Option<String>,
    style: Option<String>,
    field: Option<String>,
    layers: Vec<String>,
    azimuth: f64,
    elevation: f64,
    distance: f64,
    orthographic: bool,
    width: Option<f64>,
    depth: Option<f64>,
    size: (usize, usize),
    radius: Option<f64>,
    opacity: Option<f64>,
    colormap: Option<String>,
    range: Option<[f64; 2]>,
    fps: u32,
}

fn parsed<T: FromStr<Err = String>>(text: &str) -> PyResult<T> {
    text.parse().map_err(InputError::new_err)
}

impl FilmArguments {
    fn options(&self, film: PathBuf) -> PyResult<RenderOptions> {
        let view = ViewOptions {
            azimuth: self.azimuth,
            elevation: self.elevation,
            distance: self.distance,
            radius: self.radius,
            opacity: self.opacity,
            size: Some(Size { width: self.size.0, height: self.size.1 }),
            orthographic: self.orthographic,
            center: self.center.as_deref().map(parsed).transpose()?,
            width: self.width,
            depth: self.depth,
            ..ViewOptions::default()
        };
        let frames = Some(parsed(&self.frames)?);
        let pictures = PictureOptions {
            style: self.style.as_deref().map(|name| named("style", name)).transpose()?,
            view,
            film: FilmOptions { frames, video: Some(film), fps: self.fps, ..FilmOptions::default() },
            field: FieldOptions { name: self.field.clone(), ..FieldOptions::default() },
            colormap: self.colormap.as_deref().map(|name| named("colormap", name)).transpose()?,
            range: self.range,
            ..PictureOptions::default()
        };
        let follow = self.follow.as_deref().map(parsed).transpose()?;
        Ok(RenderOptions { pictures, layers: self.layers.clone(), follow, ..RenderOptions::default() })
    }
}

/// Draws a film of a series: the record of the command as JSON.
#[pyfunction]
#[pyo3(signature = (series, path, asked, threads=None, progress=None))]
pub fn film(
    py: Python<'_>,
    series: &ModelSeries,
    path: PathBuf,
    asked: FilmArguments,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (options, file) = (asked.options(path)?, &series.file);
    let report = WorkOptions { threads, progress }.run(py, |context| {
        render_series(Path::new(file.name()), file.bytes(), &options, &Outputs::default(), context)
    })?;
    Ok(serde_json::to_string(&report).expect("plain data"))
}
