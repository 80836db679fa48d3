//! A model: its bytes, its Gaussians, pictures and densities.

use crate::density::{self, CellNumbers, FieldName};
use crate::errors::{InputError, IntoPyResult, named, refuse};
use crate::gaussians::Gaussians;
use crate::pictures::{self, CameraArgs};
use crate::snapshot::Snapshot;
use crate::work::WorkOptions;
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use particlegs::input::FrameChoice;
use particlegs::pictures::ViewSubject;
use particlegs_core::camera::{Camera, Projection, View};
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, Layer, Mass, Metadata, Quantity};
use particlegs_core::picture::{Gray8, Pixels, Plane, Size};
use particlegs_core::render::{
    FieldQuery, Scene, Scratch, draw_into, extent, field_map, first_means, mean_vector, optical_depth_into,
    surface_density,
};
use particlegs_core::{codec, parallel};
use particlegs_export::density_unit;
use particlegs_fit::recover::Options;
use particlegs_measure::score::Assessment;
use particlegs_particles::RawForm;
use particlegs_view::page::PageOpening;
use particlegs_view::poster;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::OnceLock;

/// A model. Immutable.
#[pyclass(frozen, subclass, module = "particlegs._particlegs")]
pub struct Model {
    pub file: particlegs::Model,
    scratch: parallel::Scratch<Scratch>,
    gaussians: OnceLock<Py<Gaussians>>,
}

impl From<particlegs::Model> for Model {
    fn from(file: particlegs::Model) -> Self {
        Model { file, scratch: parallel::Scratch::default(), gaussians: OnceLock::new() }
    }
}

impl Model {
    pub fn inner(&self) -> &particlegs_core::model::Model {
        self.file.decoded()
    }

    fn subject(&self) -> ViewSubject {
        ViewSubject::of_model(self.inner(), false)
    }

    /// A flag for each layer, whether it is used; all are without names.
    fn shown(&self, names: Option<&[String]>) -> PyResult<Vec<bool>> {
        let Some(names) = names else { return Ok(vec![true; self.inner().layers.len()]) };
        self.inner().which(names).or_raise()
    }

    /// The model with only some layers, copied unless these are all.
    fn only(&self, names: Option<&[String]>) -> PyResult<std::borrow::Cow<'_, particlegs_core::model::Model>> {
        Ok(match names {
            None => std::borrow::Cow::Borrowed(self.inner()),
            Some(names) => std::borrow::Cow::Owned(self.inner().clone().only(names).or_raise()?),
        })
    }

    fn surface_density(
        &self,
        py: Python<'_>,
        (shown, view, size): (&[bool], &View, Size),
        threads: Option<usize>,
    ) -> PyResult<Plane> {
        self.inner().check_density(|l| shown[l]).or_raise()?;
        let view = self.subject().density_view(view, size);
        let scene = Scene::from_layers(self.inner(), |l| shown[l]);
        WorkOptions::quietly(threads).run(py, |progress| surface_density(&scene, &view, size, progress))
    }
}

#[pymethods]
impl Model {
    /// Decodes the bytes of a model file.
    #[new]
    #[pyo3(signature = (bytes, name, threads=None))]
    fn decode(py: Python<'_>, bytes: Vec<u8>, name: String, threads: Option<usize>) -> PyResult<Self> {
        WorkOptions::quietly(threads)
            .run(py, |context| particlegs::Model::decode(bytes, &name, context))
            .map(Model::from)
    }

    /// Reads a model file.
    #[staticmethod]
    #[pyo3(signature = (path, threads=None))]
    fn read(py: Python<'_>, path: PathBuf, threads: Option<usize>) -> PyResult<Self> {
        let open_model = |context: &Context<'_>| particlegs::Model::open_frame(&path, &FrameChoice::Last, context);
        WorkOptions::quietly(threads).run(py, open_model).map(Model::from)
    }

    #[getter]
    fn name(&self) -> String {
        self.file.file_name()
    }

    #[getter]
    fn nbytes(&self) -> usize {
        self.file.bytes().len()
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, self.file.bytes())
    }

    /// Writes the file, completely or not at all.
    #[pyo3(signature = (path, overwrite=false))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        refuse(&path, overwrite)?;
        self.file.save(path).or_raise()
    }

    /// Metadata, layers, certificate and verdict, as JSON.
    #[getter]
    fn description(&self) -> String {
        let m = self.inner();
        let layer = |l: &Layer<Vec<particlegs_core::model::Block>>| {
            serde_json::json!({
                "name": l.name, "particles": l.count(), "particle_mass": l.mass.unit(),
                "weighted": l.mass.is_weighted(), "blocks": l.content.len(),
                "gaussians": l.content.iter().map(|b| b.gaussians.len()).sum::<usize>(),
            })
        };
        let mut metadata = serde_json::json!(m.metadata);
        metadata["redshift"] = m.metadata.epoch.redshift().into();
        metadata["weighting"] = Metadata::WEIGHTING.into();
        metadata["kept"] = serde_json::json!(m.metadata.quantities(m.layers.iter().any(|l| l.mass.is_weighted())));
        serde_json::json!({
            "metadata": metadata,
            "mass": m.mass(),
            "gaussians": m.gaussians(),
            "raw_bytes": m.raw_bytes(),
            "layers": m.layers.iter().map(layer).collect::<Vec<_>>(),
            "certificate": m.certificate,
            "verdict": Assessment::verdict(m.certificate.as_ref(), &m.metadata),
        })
        .to_string()
    }

    /// Centre and width of the smallest map that shows everything, seen from `toward`.
    fn whole(&self, toward: [f64; 3], up: [f64; 3], size: (usize, usize)) -> PyResult<([f64; 3], f64)> {
        let size = Size { width: size.0, height: size.1 };
        let projection = Projection::Orthographic { height_world: 1.0 };
        let camera = Camera { position: toward, focal_point: [0.0; 3], view_up: up, projection, clipping_range: None };
        let frame = camera.frame().or_raise()?;
        let whole = extent(&Scene::new(self.inner()), self.inner().metadata.cell.as_ref());
        Ok((whole.center, whole.width(&frame, size)))
    }

    #[getter]
    fn gaussians(slf: &Bound<'_, Self>) -> PyResult<Py<Gaussians>> {
        let (py, this) = (slf.py(), slf.get());
        if let Some(gaussians) = this.gaussians.get() {
            return Ok(gaussians.clone_ref(py));
        }
        let gaussians = Py::new(py, py.detach(|| Gaussians::of(this.inner())))?;
        Ok(this.gaussians.get_or_init(|| gaussians).clone_ref(py))
    }

    /// A picture: 8-bit levels, or brightness in [0, 1] for style `expected`.
    #[pyo3(signature = (style, size, camera, radius=None, opacity=None, layers=None, threads=None))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        style: &str,
        size: (usize, usize),
        camera: CameraArgs,
        radius: Option<f64>,
        opacity: Option<f64>,
        layers: Option<Vec<String>>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (tone, size) = (pictures::look(style)?, Size { width: size.0, height: size.1 });
        let view = camera.view(&self.subject(), size, [radius, opacity]).or_raise()?;
        let mask = self.shown(layers.as_deref())?;
        let scene = Scene::from_layers(self.inner(), |l| mask[l]);
        let how = WorkOptions::quietly(threads);
        match tone {
            Some(tone) => {
                let picture = how.run(py, |progress| {
                    progress.require_memory("a picture", size.pixels() as u64)?;
                    let mut picture = Gray8::black(size);
                    let out = Pixels::new(size, &mut picture.data)?;
                    self.scratch.with(|scratch| draw_into(&scene, &view, tone, out, scratch, progress))?;
                    Ok(picture)
                })?;
                pictures::levels(py, picture)
            }
            None => {
                let plane = how.run(py, |progress| {
                    // Optical depth and brightness.
                    progress.require_memory("a picture", 8 * size.pixels() as u64)?;
                    let mut plane = Plane::zeros(size);
                    let out = Pixels::new(size, &mut plane.data)?;
                    self.scratch.with(|scratch| optical_depth_into(&scene, &view, out, scratch, progress))?;
                    Ok(plane)
                })?;
                pictures::brightness(py, &plane)
            }
        }
    }

    /// Surface density along the lines of sight, averaged over each pixel.
    #[pyo3(signature = (size, camera, layers=None, threads=None))]
    fn density<'py>(
        &self,
        py: Python<'py>,
        size: (usize, usize),
        camera: CameraArgs,
        layers: Option<Vec<String>>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let size = Size { width: size.0, height: size.1 };
        let view = camera.view(&self.subject(), size, [None; 2]).or_raise()?;
        let mask = self.shown(layers.as_deref())?;
        pictures::plane(py, &self.surface_density(py, (&mask, &view, size), threads)?)
    }

    /// Mean of a field along the lines of sight, its unit, what it is, and the scale of its colours.
    #[pyo3(signature = (field, size, camera, bulk=None, subtract_mean=false, weight="mass", layers=None, threads=None))]
    fn field_map<'py>(
        &self,
        py: Python<'py>,
        field: &str,
        size: (usize, usize),
        camera: CameraArgs,
        bulk: Option<[f64; 3]>,
        subtract_mean: bool,
        weight: &str,
        layers: Option<Vec<String>>,
        threads: Option<usize>,
    ) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, Option<String>, String, &'static str)> {
        let size = Size { width: size.0, height: size.1 };
        let view = camera.view(&self.subject(), size, [None; 2]).or_raise()?;
        let view = self.subject().density_view(&view, size);
        let mask = self.shown(layers.as_deref())?;
        let mut query = FieldQuery::new(field, &self.inner().metadata.fields).or_raise()?;
        if weight != "mass" {
            query = query.weighted(weight, &self.inner().metadata.fields).or_raise()?;
        }
        if subtract_mean {
            query.bulk = mean_vector(&self.inner().layers, &query.name);
        }
        query.bulk = bulk.unwrap_or(query.bulk);
        let scene = Scene::from_layers(self.inner(), |l| mask[l]);
        let map = WorkOptions::quietly(threads).run(py, |progress| field_map(&scene, &query, &view, size, progress))?;
        Ok((
            pictures::plane(py, &map.values)?,
            Some(query.unit(&self.inner().metadata.fields, self.inner().metadata.units.length_text()))
                .filter(|u| !u.is_empty()),
            query.title(),
            query.scale(|| first_means(&self.inner().layers, &query.name)).name(),
        ))
    }

    /// Fields: name, kind, unit, what weighs their means.
    #[getter]
    fn fields(&self) -> Vec<(String, &'static str, Option<String>, &'static str)> {
        let field_words = |q: &Quantity| {
            let unit = q.unit.as_ref().map(|u| u.text.clone());
            (q.name.clone(), kind_of(q), unit, if q.by_mass { "mass" } else { "count" })
        };
        self.inner().metadata.fields.iter().map(field_words).collect()
    }

    /// Unit of the densities of some layers, per area (2) or volume (3).
    #[pyo3(signature = (power, layers=None))]
    fn density_unit(&self, power: u8, layers: Option<Vec<String>>) -> PyResult<String> {
        let mask = self.shown(layers.as_deref())?;
        let mut masses = self.inner().layers.iter().zip(mask).filter(|(_, is_shown)| *is_shown).map(|(l, _)| l.mass);
        Ok(density_unit(&self.inner().metadata, masses.all(|m| m != Mass::Unknown), power))
    }

    /// Unit of a field's mean, or of its dispersion, at places and in cells.
    fn field_unit(&self, field: &str, dispersion: bool) -> Option<String> {
        let q = self.inner().metadata.fields.iter().find(|q| q.name == field)?;
        if dispersion { q.dispersion_unit() } else { q.place_unit(self.inner().metadata.units.length_text()) }
    }

    /// Density, or a field, in cells: values, origin, cell edges, mass beyond the grid.
    #[pyo3(signature = (cells, field=None, layers=None, threads=None))]
    fn grid<'py>(
        &self,
        py: Python<'py>,
        cells: CellNumbers,
        field: FieldName,
        layers: Option<Vec<String>>,
        threads: Option<usize>,
    ) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, [f64; 3], [f64; 3], f64)> {
        density::grid(py, &*self.only(layers.as_deref())?, field, cells, threads)
    }

    /// Density, or a field, at points.
    #[pyo3(signature = (points, field=None, layers=None, threads=None))]
    fn at<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArrayDyn<'py, f64>,
        field: FieldName,
        layers: Option<Vec<String>>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        density::at(py, &*self.only(layers.as_deref())?, field, &points, threads)
    }

    /// Synthetic particles.
    #[pyo3(signature = (n, method, scale, seed, layers=None, threads=None, progress=None))]
    fn recover(
        &self,
        py: Python<'_>,
        n: Option<u64>,
        method: &str,
        scale: f64,
        seed: u64,
        layers: Option<Vec<String>>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Snapshot> {
        let method = named("method", method)?;
        let options =
            Options { particles: n, method, scale, seed, form: RawForm::Columns, model_name: self.file.file_name() };
        let model = self.only(layers.as_deref())?.into_owned();
        let notes = options.notes(&model, codec::file_hash(self.file.bytes())).to_string();
        let particles_and_fields =
            WorkOptions { threads, progress }.run(py, |progress| options.draw_with_fields(model, progress))?;
        let (particles, fields) = particles_and_fields;
        Ok(Snapshot { drawn: Some(notes), fields, ..Snapshot::of(particles, BTreeMap::new()) })
    }

    /// A web page that shows the model offline; `opening` is JSON.
    fn to_html(&self, py: Python<'_>, opening: &str) -> PyResult<String> {
        let opening: PageOpening = serde_json::from_str(opening).map_err(|e| InputError::new_err(e.to_string()))?;
        let page = WorkOptions::quietly(None).run(py, |context| self.file.page(&opening, context))?;
        String::from_utf8(page).map_err(|e| InputError::new_err(e.to_string()))
    }

    /// A small PNG of the default view, and the surface densities of its first and last colour; `None` for grey levels.
    fn poster<'py>(&self, py: Python<'py>, size: (usize, usize)) -> PyResult<(Bound<'py, PyBytes>, Option<[f64; 2]>)> {
        let size = Size { width: size.0, height: size.1 };
        let poster = WorkOptions::quietly(None).run(py, |progress| poster::draw(self.inner(), size, progress))?;
        Ok((PyBytes::new(py, &poster.png), poster.range))
    }

    #[getter]
    fn is_alpha_blend(&self) -> bool {
        self.inner().metadata.law == LawKind::AlphaBlend
    }
}

/// The kind of a field, in Python.
fn kind_of(q: &Quantity) -> &'static str {
    match (q.extensive, q.logarithmic) {
        (true, _) => "sum",
        (_, true) => "logarithmic",
        _ => q.kind.name(),
    }
}
