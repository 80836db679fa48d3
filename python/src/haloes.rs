//! Catalogues of haloes.

use crate::compress::FieldArray;
use crate::errors::InputError;
use crate::stats::{StatsSource, asked_options, read};
use crate::work::WorkOptions;
use numpy::{IntoPyArray, PyArray1};
use particlegs_measure::haloes::{HaloOptions, find_haloes, stated_cosmology};
use particlegs_measure::stats::StatsSide;
use pyo3::prelude::*;

/// Options of finding haloes; the names are those of the command.
fn finder_options(json: &str) -> PyResult<HaloOptions> {
    let mut options = asked_options(json)?;
    let cosmology: Option<String> = read(options.remove("cosmology").unwrap_or_default())?;
    let cosmology = cosmology.map(|text| stated_cosmology(&text)).transpose();
    let cosmology =
        cosmology.map_err(|message| InputError::new_err(format!("cosmology: {message}")))?.unwrap_or_default();
    Ok(HaloOptions { cosmology, ..read(options.into())? })
}

/// A column: name, unit, description, whether its values are whole numbers, and these.
type CatalogueColumn<'py> = (String, String, String, bool, Bound<'py, PyArray1<f64>>);

/// Finds haloes of a snapshot, with fields, or of a model; returns columns, remarks and notes.
#[pyfunction]
#[pyo3(signature = (source, asked, fields=Vec::new(), threads=None, progress=None))]
pub fn haloes<'py>(
    py: Python<'py>,
    source: StatsSource<'py>,
    asked: &str,
    fields: Vec<FieldArray<'py>>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Vec<CatalogueColumn<'py>>, Vec<String>, Vec<String>)> {
    let options = finder_options(asked)?;
    let (fields, subject) = (source.fields(&fields)?, source.subject());
    let side = StatsSide { subject, fields: &fields };
    let catalogue = WorkOptions { threads, progress }.run(py, |context| find_haloes(side, &options, context))?;
    let columns = catalogue.columns.into_iter();
    let columns = columns.map(|c| (c.name, c.unit, c.description, c.whole, c.values.into_pyarray(py)));
    Ok((columns.collect(), catalogue.remarks, catalogue.notes))
}
