//! The subcommands for models: `simplify`, `merge`, `eval`, `verify`, `export`.

use crate::compress::{FieldArray, layer_fields};
use crate::errors::{InputError, IntoPyResult, named};
use crate::model::{Model, refuse};
use crate::snapshot::Snapshot;
use crate::work::WorkOptions;
use particlegs_core::codec;
use particlegs_core::codec::Merge;
use particlegs_core::model::Target;
use particlegs_core::picture::Size;
use particlegs_export::{
    Cells, ColorBy, Coloring, Density, Group, Kind, Notes, as_splats, fields_named, write_as_splats, write_density,
    write_gaussians,
};
use particlegs_files::model_file;
use particlegs_files::output::write_bytes;
use particlegs_measure::score;
use particlegs_view::page::{ModelFile, PageOpening, offline};
use pyo3::prelude::*;
use serde_json::json;
use std::path::PathBuf;

/// A smaller model made from a model.
#[pyfunction]
#[pyo3(signature = (model, ratio=None, size=None, gaussians=None, threads=None, progress=None))]
pub fn simplify(
    py: Python<'_>,
    model: &Model,
    ratio: Option<f64>,
    size: Option<u64>,
    gaussians: Option<u64>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let target = match (ratio, size, gaussians) {
        (Some(ratio), None, None) => Target::Ratio(ratio),
        (None, Some(bytes), None) => Target::Size(bytes),
        (None, None, Some(number)) => Target::Gaussians(number),
        _ => return Err(InputError::new_err("give one target: ratio, size or gaussians")),
    };
    let (whole, bytes) = (model.inner().clone(), model.bytes().len() as u64);
    made(py, model.called(), WorkOptions { threads, progress }, |progress| {
        particlegs_compress::simplify(whole, bytes, target, progress)
    })
}

/// Merges models; their coded blocks are copied.
#[pyfunction]
#[pyo3(signature = (models, fields=None, threads=None, progress=None))]
pub fn merge(
    py: Python<'_>,
    models: Vec<Py<Model>>,
    fields: Option<Vec<String>>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let parts: Vec<&Model> = models.iter().map(|m| m.get()).collect();
    let name = parts.first().map_or("merged", |m| m.called());
    made(py, name, WorkOptions { threads, progress }, |progress| {
        let mut merge = fields.map_or_else(Merge::default, Merge::with_fields);
        parts.iter().try_for_each(|part| merge.add(part.bytes(), part.called(), progress))?;
        merge.finish()
    })
}

/// The model from a file made by `work`.
fn made(
    py: Python<'_>,
    name: &str,
    how: WorkOptions,
    work: impl FnOnce(&particlegs_core::context::Context<'_>) -> particlegs_core::Result<Vec<u8>> + Send,
) -> PyResult<Model> {
    let (bytes, model) = how.run(py, |progress| {
        let bytes = work(progress)?;
        let model = codec::decode_with(&bytes, name, progress)?;
        Ok((bytes, model))
    })?;
    Ok(Model::new(bytes, model, name.into()))
}

/// Scores over views, as JSON.
#[pyfunction]
#[pyo3(signature = (model, snapshot, frames, size, seed, threads=None, progress=None))]
pub fn evaluate(
    py: Python<'_>,
    model: &Model,
    snapshot: &Snapshot,
    frames: usize,
    size: (usize, usize),
    seed: u64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    if !(1..=10_000).contains(&frames) {
        return Err(InputError::new_err(format!("frames must be 1 to 10000, not {frames}")));
    }
    let (whole, size) = (model.inner(), Size { width: size.0, height: size.1 });
    let views = score::evaluation_views(&whole.metadata, size, seed, frames);
    let particles = snapshot.checked()?;
    let scores = WorkOptions { threads, progress }.run(py, |progress| {
        let of_several = model_file::is_of_several(model.bytes(), &whole.metadata, model.called())?;
        let matches = particlegs_compress::source_difference(particles, whole, of_several).is_none();
        let mut scores = json!(score::evaluate(whole, particles, &views, size, None, progress)?);
        scores["source_matches"] = matches.into();
        Ok(scores)
    })?;
    Ok(scores.to_string())
}

/// What the command's `verify` finds: JSON, and what is wrong where anything is.
#[pyfunction]
#[pyo3(signature = (model, snapshot=None, full=false, fields=Vec::new(), threads=None, progress=None))]
pub fn verify(
    py: Python<'_>,
    model: &Model,
    snapshot: Option<&Snapshot>,
    full: bool,
    fields: Vec<FieldArray<'_>>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Option<String>)> {
    let particles = snapshot.map(Snapshot::checked).transpose()?;
    let sources = match particles {
        Some(particles) if !fields.is_empty() => layer_fields(particles, &fields)?,
        _ => Vec::new(),
    };
    let (found, sound) = WorkOptions { threads, progress }.run(py, |context| {
        let stored = model.stored(context)?;
        let snapshot = particles.map(|particles| (particles, &sources[..]));
        let found = stored.verify(snapshot, (full, 42), context)?;
        let wrong = found.judge(&stored.place).err().map(|e| e.to_string());
        Ok((found, wrong))
    })?;
    Ok((serde_json::to_string(&found).expect("plain data"), sound))
}

/// Options of an export.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ExportOptions {
    kind: Option<String>,
    layers: Option<Vec<String>>,
    cells: Option<usize>,
    radius: Option<f64>,
    opacity: Option<f64>,
    color: String,
    overwrite: bool,
    fields: Vec<String>,
}

/// Exports a model; returns the number of bytes.
#[pyfunction]
#[pyo3(signature = (model, path, asked, threads=None, progress=None))]
pub fn export(
    py: Python<'_>,
    model: &Model,
    path: PathBuf,
    asked: ExportOptions,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<u64> {
    let kind = asked.kind.as_deref().map(|name| named("kind", name)).transpose()?;
    let kind = Kind::for_output(&path, kind).or_raise()?;
    let color: ColorBy = named("color", &asked.color)?;
    refuse(&path, asked.overwrite)?;
    let mut shown = match &asked.layers {
        None => model.inner().clone(),
        Some(names) => model.inner().clone().only(names).or_raise()?,
    };
    shown.drop_empty();
    let fields = fields_named(kind, &shown, &asked.fields).or_raise()?;
    let mut notes = Notes::new(kind, &shown, model.called(), &fields);
    WorkOptions { threads, progress }.run(py, |progress| match kind.group() {
        Group::Page if asked.layers.is_some() => {
            Err(particlegs_core::Error::argument("an exported page contains all layers: leave layers= out"))
        }
        Group::Page => {
            let file = ModelFile { name: model.called(), bytes: model.bytes() };
            let html = offline(&[(file, model.inner())], &PageOpening::default(), progress)?;
            write_bytes(&path, &html).map(|()| html.len() as u64)
        }
        Group::Gaussians => write_gaussians(kind, &shown, &notes, &path, progress),
        Group::Splats => {
            let m = &shown.metadata;
            let (radius, opacity) =
                (asked.radius.unwrap_or(m.default_radius), asked.opacity.unwrap_or(m.default_opacity));
            let coloring = Coloring::new(&shown, color, Default::default(), None)?;
            notes.set("radius", radius);
            notes.set("opacity", opacity);
            coloring.describe(&shown, color, Default::default(), &mut notes);
            let (splats, faint) = as_splats(shown, radius, opacity, progress)?;
            notes.set("fainter_than_viewers_draw", json!(faint));
            write_as_splats(kind, &splats, coloring.colors.as_deref(), &notes, &path, progress)
        }
        Group::Grid => {
            let mut density = Density::new(&shown, asked.cells.map_or_else(Cells::default, Cells::Along), progress)?;
            density.add_fields(&shown, fields, progress)?;
            notes.set("density", json!({ "unit": density.unit, "total": density.total, "outside": density.outside }));
            write_density(kind, &density, &notes, &path, progress)
        }
    })
}
