//! The subcommands for models: `simplify`, `merge`, `eval`, `verify`, `export`.

use crate::compress::{FieldArray, layer_fields};
use crate::errors::{InputError, IntoPyResult, named, refuse};
use crate::model::Model;
use crate::snapshot::Snapshot;
use crate::work::WorkOptions;
use particlegs::evaluation::EvaluationViews;
use particlegs_core::model::Target;
use particlegs_core::picture::Size;
use particlegs_export::{Cells, Kind};
use particlegs_files::output::Outputs;
use particlegs_view::page::PageOpening;
use pyo3::prelude::*;
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
    WorkOptions { threads, progress }.run(py, |context| model.file.simplify(target, context)).map(Model::from)
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
    let parts: Vec<&particlegs::Model> = models.iter().map(|m| &m.get().file).collect();
    WorkOptions { threads, progress }.run(py, |context| particlegs::merge(&parts, fields, context)).map(Model::from)
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
    let views = EvaluationViews::Orbits { frames, size: Size { width: size.0, height: size.1 }, seed };
    let report = WorkOptions { threads, progress }.run(py, |context| {
        model.file.evaluate(&[], &snapshot.source(Vec::new(), false, context)?, views, None, context)
    })?;
    Ok(serde_json::to_string(&report).expect("plain data"))
}

/// The findings of the command's `verify`: JSON, and the fault in words where there is one.
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
    let arrays = snapshot.map_or(Ok(Vec::new()), |s| layer_fields(s.checked()?, &fields))?;
    let with_fields = !model.inner().metadata.fields.is_empty();
    let (verified, wrong) = WorkOptions { threads, progress }.run(py, |context| {
        let source = snapshot.map(|s| s.source(arrays, with_fields, context)).transpose()?;
        let verified = model.file.verify(source.as_ref(), (full, 42), context)?;
        let wrong = verified.judge().err().map(|e| e.to_string());
        Ok((verified, wrong))
    })?;
    Ok((serde_json::to_string(&verified).expect("plain data"), wrong))
}

/// Options of an export.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ExportArguments {
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
    asked: ExportArguments,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<u64> {
    let options = particlegs::ExportOptions {
        kind: asked.kind.as_deref().map(|name| named("kind", name)).transpose()?,
        layers: asked.layers.clone().unwrap_or_default(),
        cells: asked.cells.map_or_else(Cells::default, Cells::Along),
        fields: asked.fields,
        color: named("color", &asked.color)?,
        radius: asked.radius,
        opacity: asked.opacity,
        opening: PageOpening { layers: asked.layers.unwrap_or_default(), ..PageOpening::default() },
        ..particlegs::ExportOptions::default()
    };
    Kind::for_output(&path, options.kind).or_raise()?;
    refuse(&path, asked.overwrite)?;
    let outputs = Outputs::new(asked.overwrite);
    let export =
        WorkOptions { threads, progress }.run(py, |context| model.file.export(&path, &options, &outputs, context))?;
    Ok(export.bytes)
}
