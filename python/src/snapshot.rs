//! Particles from arrays, from a file, or drawn from a model.

use crate::arrays;
use crate::errors::{InputError, IntoPyResult};
use crate::pictures::{self, CameraArgs};
use crate::work::WorkOptions;
use numpy::{PyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray};
use particlegs::pictures::ViewSubject;
use particlegs_core::context::Context;
use particlegs_core::model::{Cosmology, Epoch, Layer, Units, is_species};
use particlegs_core::picture::Size;
use particlegs_core::space::{Bounds, Cell};
use particlegs_files::output::Outputs;
use particlegs_formats::Choice;
use particlegs_particles::{
    LayerFields, LayeredParticles, Number, Particles, Positions, Selection, SnapshotMeta, SourceField, Storage,
};
use particlegs_reference::Reference;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Particles. Immutable.
#[pyclass(frozen, subclass, module = "particlegs._particlegs")]
pub struct Snapshot {
    pub particles: Arc<Particles>,
    /// Options that the files were read with, for the recipe of a model.
    pub read: BTreeMap<String, String>,
    /// Notes on drawn particles, as JSON; `None` for others.
    pub drawn: Option<String>,
    /// Fields of each layer that were drawn with the particles; none of others.
    pub fields: Vec<LayerFields>,
    /// The files that the particles were read from, and how.
    pub files: Option<(Vec<PathBuf>, Choice)>,
}

impl Snapshot {
    /// Particles from files.
    pub fn of(particles: Particles, read: BTreeMap<String, String>) -> Self {
        Snapshot { particles: Arc::new(particles), read, drawn: None, fields: Vec::new(), files: None }
    }

    /// Fields of each layer: those of the files that the particles were read from, or those that were drawn with them.
    pub fn layer_fields(&self, context: &Context<'_>) -> particlegs_core::Result<Vec<LayerFields>> {
        let Some((paths, choice)) = &self.files else {
            let none =
                || particlegs_core::Error::argument("the snapshot has no fields of its own: give arrays by name");
            return if self.fields.is_empty() { Err(none()) } else { Ok(self.fields.clone()) };
        };
        let (particles, fields) = choice.clone().read_fields(paths, &Storage::Memory, context)?;
        if particles.source_hash() != self.particles.source_hash() {
            return Err(particlegs_core::Error::input(
                &self.particles.meta.name,
                "its files have changed since they were opened",
            ));
        }
        Ok(fields)
    }

    /// The particles for the library, with fields: arrays, or if `with_fields` its own.
    pub fn source(
        &self,
        arrays: Vec<LayerFields>,
        with_fields: bool,
        context: &Context<'_>,
    ) -> particlegs_core::Result<particlegs::Snapshot> {
        self.particles.check_files()?;
        let fields = match with_fields && arrays.is_empty() && (self.files.is_some() || !self.fields.is_empty()) {
            true => self.layer_fields(context)?,
            false => arrays,
        };
        particlegs::Snapshot::from((*self.particles).clone()).with_fields(fields)
    }

    /// The particles, to be read: refused where their file has become shorter.
    pub fn checked(&self) -> PyResult<&Particles> {
        self.particles.check_files().or_raise()?;
        Ok(&self.particles)
    }
}

/// Metadata of particles.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ParticleInfo {
    name: String,
    cell: Option<([f64; 3], [[f64; 3]; 3], [bool; 3])>,
    length_unit: Option<String>,
    mass_unit: Option<String>,
    particle_mass: Option<f64>,
    comoving: Option<bool>,
    scale_factor: Option<f64>,
    hubble: Option<f64>,
    time: Option<f64>,
    /// Names of layers and their numbers of particles.
    layers: Vec<(String, usize)>,
}

impl ParticleInfo {
    pub fn meta(self) -> PyResult<SnapshotMeta> {
        let cell = |(origin, vectors, periodic): ([f64; 3], _, _)| {
            let cell = Cell::stated(origin, vectors, periodic).filter(|_| origin.iter().all(|v| v.is_finite()));
            cell.ok_or_else(|| InputError::new_err("the box must be finite and have a volume"))
        };
        if self.particle_mass.is_some_and(|m| !(m > 0.0 && m.is_finite())) {
            return Err(InputError::new_err("the mass of a particle must be positive and finite"));
        }
        Ok(SnapshotMeta {
            name: self.name,
            cell: self.cell.map(cell).transpose()?,
            units: Units::new(self.length_unit.as_deref(), self.mass_unit.as_deref(), self.comoving),
            particle_mass: self.particle_mass,
            weight_name: None,
            cosmology: Cosmology { hubble: self.hubble, ..Cosmology::default() },
            epoch: Epoch { scale_factor: self.scale_factor, time: self.time, ..Epoch::default() },
            ..SnapshotMeta::default()
        })
    }
}

/// Divides particles into layers with these names and numbers of particles; does nothing without layers.
fn in_layers(particles: Particles, layers: Vec<(String, usize)>) -> particlegs_core::Result<Particles> {
    let count = particles.len();
    let total = layers.iter().fold(0, |sum: usize, (_, n)| sum.saturating_add(*n));
    if !layers.is_empty() && total != count {
        let message = format!("the layers have {total} particles in all, but there are {count}");
        return Err(particlegs_core::Error::input(&particles.meta.name, message));
    }
    let (mass, mut end) = (particles.layers()[0].mass, 0);
    let layers = layers.into_iter().map(|(name, n)| {
        end += n;
        Layer { name, mass, content: end - n..end }
    });
    let layers = layers.collect();
    Ok(particles.with_layers(layers))
}

/// Positions as given.
enum InputPositions {
    InPlace(Positions),
    Rows(particlegs_formats::Array),
}

impl InputPositions {
    fn of(positions: &Bound<'_, PyAny>) -> PyResult<InputPositions> {
        if let Ok(columns) = positions.cast::<PyTuple>() {
            let column = |i: usize| arrays::column(&columns.get_item(i)?.extract::<PyReadonlyArrayDyn<'_, f32>>()?);
            let columns = [column(0)?, column(1)?, column(2)?];
            if columns.iter().any(|c| c.len() != columns[0].len()) {
                return Err(InputError::new_err("x, y and z must have the same length"));
            }
            return Ok(InputPositions::InPlace(Positions::Columns(columns)));
        }
        if let Ok(triples) = positions.extract::<PyReadonlyArrayDyn<'_, f32>>()
            && matches!(triples.as_array().shape(), [_, 3])
            && let Ok(column) = arrays::column(&triples)
        {
            return Ok(InputPositions::InPlace(Positions::Triples(column)));
        }
        arrays::rows(positions.cast::<PyUntypedArray>()?).map(InputPositions::Rows)
    }
}

#[pymethods]
impl Snapshot {
    /// From an (n, 3) array of numbers, or a tuple of three contiguous float32 columns.
    #[new]
    #[pyo3(signature = (positions, weights, known, skip_invalid=false, threads=None))]
    fn new(
        py: Python<'_>,
        positions: &Bound<'_, PyAny>,
        weights: Option<PyReadonlyArrayDyn<'_, f32>>,
        mut known: ParticleInfo,
        skip_invalid: bool,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let (input_positions, layers) = (InputPositions::of(positions)?, std::mem::take(&mut known.layers));
        let meta = known.meta()?;
        let weights = weights.map(|w| arrays::column(&w)).transpose()?;
        let particles = WorkOptions::quietly(threads).run(py, move |progress| {
            let particles = match input_positions {
                InputPositions::InPlace(positions) => Particles::new(positions, [0.0; 3], meta),
                InputPositions::Rows(array) => {
                    let reader = array.reader(meta)?;
                    LayeredParticles::new(vec![(Particles::ONE_LAYER.into(), reader)])?
                        .load(&Storage::Memory, progress)?
                }
            };
            let name = particles.meta.name.clone();
            if particles.is_empty() {
                return Err(particlegs_core::Error::input(&name, "no particles"));
            }
            let particles = match weights {
                Some(w) if w.len() != particles.len() => {
                    let message = format!("there are {} weights for {} particles", w.len(), particles.len());
                    return Err(particlegs_core::Error::input(&name, message));
                }
                Some(weights) => particles.with_weights(weights),
                None => particles,
            };
            let particles = in_layers(particles, layers)?;
            let drop = skip_invalid.then_some(&Storage::Memory);
            Ok(particles.checked(&name, drop)?.settle_masses())
        })?;
        Ok(Snapshot::of(particles, BTreeMap::new()))
    }

    fn __len__(&self) -> usize {
        self.particles.len()
    }

    /// Positions relative to `origin`, float32, (n, 3): a read-only view if possible, otherwise a copy.
    #[getter]
    fn local_positions<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let (py, this) = (slf.py(), slf.get());
        match &this.checked()?.positions {
            Positions::Triples(t) => arrays::view(slf.as_any(), t, &[this.particles.len(), 3]),
            Positions::Columns(c) => {
                let columns = c.each_ref().map(|c| &c[..]);
                let triples = py.detach(|| {
                    let mut triples = Vec::with_capacity(3 * columns[0].len());
                    (0..columns[0].len()).for_each(|i| triples.extend(columns.map(|c| c[i])));
                    triples
                });
                PyArray::from_vec(py, triples).reshape([this.particles.len(), 3]).map(|a| a.to_dyn().clone())
            }
        }
    }

    /// The origin of the positions, world units.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.particles.origin
    }

    /// Weights, float32, (n,): a read-only view; `None` if all are equal.
    #[getter]
    fn weights<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let weights = slf.get().checked()?.weights();
        weights.map(|w| arrays::view(slf.as_any(), w, &[w.len()])).transpose()
    }

    /// The lowest and the highest corner.
    #[pyo3(signature = (threads=None))]
    fn bounds(&self, py: Python<'_>, threads: Option<usize>) -> PyResult<[[f64; 3]; 2]> {
        let particles = self.checked()?;
        let bounds = WorkOptions::quietly(threads).run(py, |_| Ok(particles.bounds()))?;
        Ok([bounds.min, bounds.max])
    }

    /// Layers: name, first particle, end, mass of a particle (or of weight 1) if known, whether it has weights.
    #[getter]
    fn layers(&self) -> Vec<(String, usize, usize, Option<f64>, bool)> {
        let entry = |l: &Layer<std::ops::Range<usize>>| {
            (l.name.clone(), l.content.start, l.content.end, l.mass.unit(), l.mass.is_weighted())
        };
        self.particles.layers().iter().map(entry).collect()
    }

    /// The particles of a species.
    fn of_species(&self, name: &str) -> PyResult<Snapshot> {
        let layers = self.particles.layers();
        let named_layers: Vec<_> = layers.iter().filter(|l| l.name == name).collect();
        let of_species = || layers.iter().filter(|l| is_species(&l.name, name)).collect();
        let matching_layers: Vec<_> = if named_layers.is_empty() { of_species() } else { named_layers };
        let [layer] = matching_layers[..] else {
            let all: Vec<&str> = layers.iter().map(|l| &l.name[..]).collect();
            let message = format!("\"{name}\" does not name one species; the species are {}", all.join(", "));
            return Err(InputError::new_err(message));
        };
        let mut read_options = self.read.clone();
        read_options.insert("particle-type".into(), layer.name.clone());
        let particles = self
            .particles
            .of_layer(layer)
            .with_layers(vec![Layer { content: 0..layer.content.len(), ..layer.clone() }]);
        Ok(Snapshot { drawn: self.drawn.clone(), ..Snapshot::of(particles, read_options) })
    }

    /// The particles inside a box.
    #[pyo3(signature = (low, high, threads=None))]
    fn region(&self, py: Python<'_>, low: [f64; 3], high: [f64; 3], threads: Option<usize>) -> PyResult<Snapshot> {
        let selection =
            Selection { crop: Some(Bounds { min: low, max: high }), ..Selection::all() }.check().or_raise()?;
        let particles = WorkOptions::quietly(threads)
            .run(py, |progress| self.particles.select(selection, &Storage::Memory, progress))?;
        let mut read_options = self.read.clone();
        let corners = [low[0], high[0], low[1], high[1], low[2], high[2]].map(|v| v.to_string());
        read_options.insert("region".into(), corners.join(","));
        Ok(Snapshot { drawn: self.drawn.clone(), ..Snapshot::of(particles, read_options) })
    }

    /// Metadata as JSON.
    #[getter]
    fn metadata(&self) -> String {
        serde_json::to_string(&self.particles.meta).expect("plain data")
    }

    /// Notes on drawn particles, as JSON.
    #[getter]
    fn drawn(&self) -> Option<&str> {
        self.drawn.as_deref()
    }

    /// Writes the particles in the format of the name's ending; returns the number of bytes.
    #[pyo3(signature = (path, overwrite=false, threads=None, progress=None))]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        overwrite: bool,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<u64> {
        crate::errors::refuse(&path, overwrite)?;
        let saved = WorkOptions { threads, progress }.run(py, |context| {
            let source = self.source(self.fields.clone(), false, context)?;
            source.convert(&path, (None, None), &Outputs::new(overwrite), context)
        })?;
        Ok(saved.bytes)
    }

    /// Fields of the files, or those that were drawn with the particles, that every layer has: name, unit, values of shape
    /// (n,) or (n, 3), float64 where float32 does not hold them.
    #[getter]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Vec<(String, Option<String>, Bound<'py, PyAny>)>> {
        let layers = match &self.files {
            Some(_) => WorkOptions::quietly(None).run(py, |context| self.layer_fields(context))?,
            None => self.fields.clone(),
        };
        let Some(first) = layers.first() else { return Ok(Vec::new()) };
        let mut all = Vec::with_capacity(first.fields.len());
        for field in &first.fields {
            let same = |f: &SourceField| f.name == field.name && f.components == field.components;
            let numbers: Option<Vec<usize>> = layers.iter().map(|l| l.fields.iter().position(same)).collect();
            let Some(numbers) = numbers else { continue };
            let components = field.components as usize;
            let mut rows: Vec<f64> = Vec::with_capacity(components * self.particles.len());
            for ((layer, fields), number) in self.particles.layers().iter().zip(&layers).zip(numbers) {
                let columns = fields.values(number, layer.content.len()).or_raise()?;
                rows.extend((0..layer.content.len()).flat_map(|i| columns.iter().map(move |c| c[i])));
            }
            let mut shape = vec![self.particles.len()];
            shape.extend((components > 1).then_some(components));
            let array = match field.number {
                Number::F32 => arrays::shaped(py, &shape, rows.iter().map(|v| *v as f32).collect())?.into_any(),
                _ => arrays::shaped(py, &shape, rows)?.into_any(),
            };
            all.push((field.name.clone(), field.unit.clone(), array));
        }
        Ok(all)
    }

    /// A picture of all particles by ParaView's own rules, or without noise.
    #[pyo3(signature = (style, size, camera, radius=None, opacity=None, threads=None))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        style: &str,
        size: (usize, usize),
        camera: CameraArgs,
        radius: Option<f64>,
        opacity: Option<f64>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (tone, size) = (pictures::look(style)?, Size { width: size.0, height: size.1 });
        let particles = self.checked()?;
        let reference = WorkOptions::quietly(threads).run(py, |_| Ok(Reference::new(particles)))?;
        let (cell, count) = (particles.meta.cell, particles.len() as u64);
        let subject = ViewSubject::of_particles(*reference.bounds(), cell, count, false);
        let view = camera.view(&subject, size, [radius, opacity]).or_raise()?;
        let how = WorkOptions::quietly(threads);
        match tone {
            Some(tone) => {
                let picture = how.run(py, |progress| reference.draw(&view, size, tone, progress))?;
                pictures::levels(py, picture)
            }
            None => {
                let plane = how.run(py, |progress| reference.optical_depth(&view, size, progress))?;
                pictures::brightness(py, &plane)
            }
        }
    }
}
