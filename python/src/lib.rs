//! The native module of the Python package. The user interface is written in Python (`python/particlegs`). This module
//! passes arrays without copies, works without the interpreter's lock, and turns errors into exceptions.
//!
//! All long work runs through `work`, and all input arrays come through `arrays`.

mod arrays;
mod choice;
mod compress;
mod density;
mod errors;
mod films;
mod gaussians;
mod haloes;
mod model;
mod pictures;
mod series;
mod snapshot;
mod stats;
mod verbs;
mod work;

use pyo3::prelude::*;

/// The native module of `particlegs`; import `particlegs` instead.
#[pymodule]
fn _particlegs(py: Python<'_>, m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    errors::add(py, m)?;
    m.add_class::<snapshot::Snapshot>()?;
    m.add_class::<model::Model>()?;
    m.add_class::<series::ModelSeries>()?;
    m.add_class::<gaussians::Gaussians>()?;
    m.add_function(wrap_pyfunction!(choice::open, m)?)?;
    m.add_function(wrap_pyfunction!(choice::formats, m)?)?;
    m.add_function(wrap_pyfunction!(choice::unit_parts, m)?)?;
    m.add_function(wrap_pyfunction!(compress::compress, m)?)?;
    m.add_function(wrap_pyfunction!(series::make_series, m)?)?;
    m.add_function(wrap_pyfunction!(films::film, m)?)?;
    m.add_function(wrap_pyfunction!(pictures::camera_around, m)?)?;
    m.add_function(wrap_pyfunction!(pictures::density_range, m)?)?;
    m.add_function(wrap_pyfunction!(stats::stats, m)?)?;
    m.add_function(wrap_pyfunction!(haloes::haloes, m)?)?;
    m.add_function(wrap_pyfunction!(verbs::simplify, m)?)?;
    m.add_function(wrap_pyfunction!(verbs::merge, m)?)?;
    m.add_function(wrap_pyfunction!(verbs::evaluate, m)?)?;
    m.add_function(wrap_pyfunction!(verbs::verify, m)?)?;
    m.add_function(wrap_pyfunction!(verbs::export, m)?)?;
    Ok(())
}
