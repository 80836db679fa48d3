//! Comparison of particles or models.

use crate::compress::{FieldArray, layer_fields};
use crate::errors::{InputError, named};
use crate::model::Model;
use crate::snapshot::Snapshot;
use crate::work::WorkOptions;
use particlegs_core::NamedValue;
use particlegs_measure::stats::{Assignment, Convention, Measure, StatsOptions, StatsSide, Subject, compare};
use particlegs_particles::LayerFields;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Options that were given as JSON.
pub type AskedOptions = Map<String, Value>;

/// A value that was given as JSON.
pub fn read<T: DeserializeOwned>(given: Value) -> PyResult<T> {
    serde_json::from_value(given).map_err(|error| match error.to_string() {
        message if message.starts_with("invalid type") => PyTypeError::new_err(message),
        message => InputError::new_err(message),
    })
}

/// Options that were given as JSON, which the Python package makes.
pub fn asked_options(json: &str) -> PyResult<AskedOptions> {
    serde_json::from_str(json).map_err(|error| InputError::new_err(error.to_string()))
}

/// Refuses a name that an option has no value of.
fn check_name<T: NamedValue>(option: &str, given: Option<&Value>) -> PyResult<()> {
    given.and_then(Value::as_str).map_or(Ok(()), |name| named::<T>(option, name).map(drop))
}

/// Options of measuring; the names are those of the command.
pub fn measure_options(json: &str) -> PyResult<StatsOptions> {
    let mut options = asked_options(json)?;
    let only = options.get("only").and_then(Value::as_array).cloned().unwrap_or_default();
    only.iter().try_for_each(|name| check_name::<Measure>("only", Some(name)))?;
    if only.is_empty() {
        options.remove("only");
    }
    check_name::<Convention>("convention", options.get("convention"))?;
    ["assignment", "spectrum_assignment"].into_iter().try_for_each(|o| check_name::<Assignment>(o, options.get(o)))?;
    let centers: Option<Vec<[f64; 3]>> = read(options.remove("centers").unwrap_or_default())?;
    let centers = centers.map(|all| all.into_iter().map(|c| (c, None)).collect());
    Ok(StatsOptions { centers, ..read(options.into())? })
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
    asked: &str,
    fields: [Vec<FieldArray<'_>>; 2],
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let options = measure_options(asked)?;
    let [of_truth, of_other] = [truth.fields(&fields[0])?, other.fields(&fields[1])?];
    let truth = StatsSide { subject: truth.subject(), fields: &of_truth };
    let other = StatsSide { subject: other.subject(), fields: &of_other };
    let statistics = WorkOptions { threads, progress }.run(py, |context| compare(truth, other, &options, context))?;
    Ok(serde_json::to_string(&statistics).expect("plain data"))
}
