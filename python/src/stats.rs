//! Comparison of particles or models.

use crate::compress::{FieldArray, layer_fields};
use crate::errors::named;
use crate::model::Model;
use crate::snapshot::Snapshot;
use crate::work::WorkOptions;
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_measure::stats::{Measure, ParticleFields, StatsOptions, StatsSide, Subject, compare};
use particlegs_particles::LayerFields;
use pyo3::prelude::*;

/// What to measure; the names are those of the command.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct MeasureOptions {
    only: Vec<String>,
    convention: String,
    grid: Option<usize>,
    assignment: String,
    spectrum_grid: usize,
    spectrum_assignment: String,
    interlacing: bool,
    k_max: Option<f64>,
    separations: Option<[f64; 2]>,
    pairs: u64,
    rdf_max: Option<f64>,
    profile_bins: usize,
    centers: Option<Vec<[f64; 3]>>,
    halo_radius: Option<f64>,
    halo_bins: usize,
    linking: f64,
    linking_length: Option<String>,
    aperture: f64,
    neighbours: usize,
    joint: Option<[String; 2]>,
    joint_bins: usize,
    open: bool,
    seed: u64,
}

impl MeasureOptions {
    fn options(self) -> PyResult<StatsOptions> {
        let measures = match self.only.is_empty() {
            true => Measure::ALL.to_vec(),
            false => self.only.iter().map(|name| named("only", name)).collect::<PyResult<_>>()?,
        };
        let centers = self.centers.map(|all| all.into_iter().map(|c| (c, None)).collect());
        Ok(StatsOptions {
            measures,
            convention: named("convention", &self.convention)?,
            open: self.open,
            cells: self.grid,
            assignment: named("assignment", &self.assignment)?,
            spectrum_cells: self.spectrum_grid,
            spectrum_assignment: named("spectrum_assignment", &self.spectrum_assignment)?,
            interlaced: self.interlacing,
            k_max: self.k_max,
            separations: self.separations,
            pair_budget: self.pairs,
            rdf_max: self.rdf_max,
            profile_bins: self.profile_bins,
            centers,
            halo_radius: self.halo_radius,
            halo_bins: self.halo_bins,
            linking: self.linking,
            linking_length: self.linking_length,
            aperture: self.aperture,
            neighbour_sample: self.neighbours,
            joint: self.joint,
            joint_bins: self.joint_bins,
            seed: self.seed,
            ..StatsOptions::default()
        })
    }
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

/// Particles with these fields, or those drawn from a model.
fn particle_fields(
    subject: Subject<'_>,
    fields: &[LayerFields],
    o: &StatsOptions,
    context: &Context<'_>,
) -> Result<Option<ParticleFields>> {
    match subject {
        _ if !o.needs_fields() => Ok(None),
        Subject::Particles(_) if fields.is_empty() => Ok(None),
        Subject::Particles(p) => ParticleFields::read(p, fields, o),
        Subject::Model(m) => ParticleFields::draw(m, o, context),
    }
}

/// Compares `other` with `truth`, snapshots with fields; returns JSON as the command writes it.
#[pyfunction]
#[pyo3(signature = (truth, other, asked, fields=Default::default(), threads=None, progress=None))]
pub fn stats(
    py: Python<'_>,
    truth: StatsSource<'_>,
    other: StatsSource<'_>,
    asked: MeasureOptions,
    fields: [Vec<FieldArray<'_>>; 2],
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let options = asked.options()?;
    let fields = [truth.fields(&fields[0])?, other.fields(&fields[1])?];
    let subjects = [truth.subject(), other.subject()];
    let found = WorkOptions { threads, progress }.run(py, |progress| {
        let of = |side: usize| particle_fields(subjects[side], &fields[side], &options, progress);
        let own = [of(0)?, of(1)?];
        let side = |i: usize| StatsSide { subject: subjects[i], fields: own[i].as_ref() };
        compare(side(0), side(1), &options, progress)
    })?;
    Ok(serde_json::to_string(&found).expect("plain data"))
}
