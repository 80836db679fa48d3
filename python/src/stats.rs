//! Comparison of particles or models.

use crate::compress::{FieldArray, layer_fields};
use crate::errors::{InputError, named};
use crate::model::Model;
use crate::snapshot::Snapshot;
use crate::work::WorkOptions;
use particlegs_core::NamedValue;
use particlegs_measure::stats::{Measure, StatsOptions, StatsSide, Subject, compare};
use particlegs_particles::LayerFields;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// A value as the library reads it in records.
fn value(given: &Bound<'_, PyAny>) -> PyResult<Value> {
    if given.is_none() {
        return Ok(Value::Null);
    }
    let flag = given.is_instance_of::<PyBool>().then(|| given.extract::<bool>());
    let number = || given.extract::<u64>().map(Value::from).or_else(|_| given.extract::<i64>().map(Value::from));
    let other = || given.extract::<f64>().map(Value::from).or_else(|_| given.extract::<String>().map(Value::from));
    if let Some(value) = flag.map(|f| f.map(Value::from)).or_else(|| number().or_else(|_| other()).ok().map(Ok)) {
        return value;
    }
    given.try_iter()?.map(|item| value(&item?)).collect::<PyResult<Vec<_>>>().map(Value::from)
}

/// A record of options of the library, by the names that they have there or on the command line.
pub fn record<T: DeserializeOwned>(given: &Bound<'_, PyDict>) -> PyResult<T> {
    let fields = given.iter().map(|(name, given)| Ok((name.extract()?, value(&given)?)));
    serde_json::from_value(Value::Object(fields.collect::<PyResult<Map<_, _>>>()?)).map_err(|error| {
        let what = error.to_string();
        if what.starts_with("invalid type") { PyTypeError::new_err(what) } else { InputError::new_err(what) }
    })
}

/// An option, which the others then are without.
pub fn take<'py>(options: &Bound<'py, PyDict>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
    let value = options.get_item(name)?;
    value.is_some().then(|| options.del_item(name)).transpose()?;
    Ok(value.filter(|v| !v.is_none()))
}

fn take_named<T: NamedValue>(options: &Bound<'_, PyDict>, name: &str) -> PyResult<Option<T>> {
    take(options, name)?.map(|text| named(name, &text.extract::<String>()?)).transpose()
}

/// What to measure; the names are those of the command.
pub fn measure_options(asked: &Bound<'_, PyDict>) -> PyResult<StatsOptions> {
    let only: Vec<String> = take(asked, "only")?.map_or(Ok(Vec::new()), |names| names.extract())?;
    let only = only.iter().map(|name| named("only", name)).collect::<PyResult<Vec<Measure>>>()?;
    let (convention, assignment) = (take_named(asked, "convention")?, take_named(asked, "assignment")?);
    let spectrum_assignment = take_named(asked, "spectrum_assignment")?;
    let centers: Option<Vec<[f64; 3]>> = take(asked, "centers")?.map(|all| all.extract()).transpose()?;
    let read: StatsOptions = record(asked)?;
    Ok(StatsOptions {
        measures: if only.is_empty() { read.measures } else { only },
        convention: convention.unwrap_or(read.convention),
        assignment: assignment.unwrap_or(read.assignment),
        spectrum_assignment: spectrum_assignment.unwrap_or(read.spectrum_assignment),
        centers: centers.map(|all| all.into_iter().map(|c| (c, None)).collect()),
        ..read
    })
}

/// A snapshot or a model.
#[derive(FromPyObject)]
pub enum StatsSource<'py> {
    Snapshot(Bound<'py, Snapshot>),
    Model(Bound<'py, Model>),
}

impl StatsSource<'_> {
    pub fn subject(&self) -> Subject<'_> {
        match self {
            StatsSource::Snapshot(s) => Subject::Particles(&s.get().particles),
            StatsSource::Model(m) => Subject::Model(m.get().inner()),
        }
    }

    /// Fields given for a snapshot, else those that it was drawn with.
    pub fn fields(&self, given: &[FieldArray<'_>]) -> PyResult<Vec<LayerFields>> {
        match self {
            StatsSource::Snapshot(s) if given.is_empty() => Ok(s.get().fields.clone()),
            StatsSource::Snapshot(s) => layer_fields(&s.get().particles, given),
            StatsSource::Model(_) => Ok(Vec::new()),
        }
    }
}

/// Compares `other` with `truth`, snapshots with fields; returns JSON as the command writes it.
#[pyfunction]
#[pyo3(signature = (truth, other, asked, fields=Default::default(), threads=None, progress=None))]
pub fn stats(
    py: Python<'_>,
    truth: StatsSource<'_>,
    other: StatsSource<'_>,
    asked: &Bound<'_, PyDict>,
    fields: [Vec<FieldArray<'_>>; 2],
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let options = measure_options(asked)?;
    let [of_truth, of_other] = [truth.fields(&fields[0])?, other.fields(&fields[1])?];
    let truth = StatsSide { subject: truth.subject(), fields: &of_truth };
    let other = StatsSide { subject: other.subject(), fields: &of_other };
    let found = WorkOptions { threads, progress }.run(py, |context| compare(truth, other, &options, context))?;
    Ok(serde_json::to_string(&found).expect("plain data"))
}
