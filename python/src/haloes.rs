//! Catalogues of haloes.

use crate::compress::FieldArray;
use crate::errors::InputError;
use crate::stats::StatsSource;
use crate::work::WorkOptions;
use numpy::{IntoPyArray, PyArray1};
use particlegs_measure::haloes::{HaloOptions, HaloSource, find_haloes, stated_cosmology};
use particlegs_measure::stats::{ParticleFields, Subject};
use particlegs_particles::Particles;
use pyo3::prelude::*;

/// How to find haloes; the names are those of the command.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FinderOptions {
    linking: f64,
    link: Vec<String>,
    min_particles: usize,
    softening: Option<f64>,
    sample_fraction: f64,
    particle_mass: Option<f64>,
    mass_unit: Option<String>,
    cosmology: Option<String>,
    redshift: Option<f64>,
    seed: u64,
}

impl FinderOptions {
    fn options(self) -> PyResult<HaloOptions> {
        let cosmology = self.cosmology.map(|text| stated_cosmology(&text)).transpose();
        Ok(HaloOptions {
            linking: self.linking,
            smallest: self.min_particles,
            linked: self.link,
            softening: self.softening,
            sample_fraction: self.sample_fraction,
            particle_mass: self.particle_mass,
            mass_unit: self.mass_unit,
            cosmology: cosmology.map_err(|what| InputError::new_err(format!("cosmology: {what}")))?.unwrap_or_default(),
            redshift: self.redshift,
            seed: self.seed,
        })
    }
}

/// A column: name, unit, description, whether its values are whole numbers, and these.
type CatalogueColumn<'py> = (String, String, String, bool, Bound<'py, PyArray1<f64>>);

/// Finds haloes of a snapshot, with fields, or of a model; returns columns, remarks and notes.
#[pyfunction]
#[pyo3(signature = (source, asked, fields=Vec::new(), threads=None, progress=None))]
pub fn haloes<'py>(
    py: Python<'py>,
    source: StatsSource<'py>,
    asked: FinderOptions,
    fields: Vec<FieldArray<'py>>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Vec<CatalogueColumn<'py>>, Vec<String>, Vec<String>)> {
    let options = asked.options()?;
    let (fields, subject) = (source.fields(&fields)?, source.subject());
    let found = WorkOptions { threads, progress }.run(py, |context| {
        let velocities = |p: &Particles| ParticleFields::moving(p, &fields);
        match subject {
            Subject::Model(m) => find_haloes(HaloSource::Model(m), &options, context),
            Subject::Particles(p) => find_haloes(HaloSource::Particles(p, velocities(p)?.as_ref()), &options, context),
        }
    })?;
    let columns = found.columns.into_iter();
    let columns = columns.map(|c| (c.name, c.unit, c.description, c.whole, c.values.into_pyarray(py)));
    Ok((columns.collect(), found.remarks, found.notes))
}
