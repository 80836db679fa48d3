//! Opens files in every format that the command reads.

use crate::errors::IntoPyResult;
use crate::snapshot::Snapshot;
use crate::work::WorkOptions;
use particlegs_core::model::{Dimension, Unit};
use particlegs_core::space::Bounds;
use particlegs_formats::{AtomSelection, Choice, Weights};
use particlegs_particles::{Selection, Storage};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Options of reading; the names are those of the command.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ReadOptions {
    format: Option<String>,
    species: Vec<String>,
    positions: Option<String>,
    /// `auto`, `none` or a field.
    mass_field: String,
    frame: Option<i64>,
    topology: Option<PathBuf>,
    select: Option<String>,
    by_mass: bool,
    box_lengths: Option<[f64; 3]>,
    length_unit: Option<String>,
    mass_unit: Option<String>,
    skip_invalid: bool,
    strict: bool,
    keep_unwrapped: bool,
    blocks: Vec<String>,
    region: Option<[f64; 6]>,
    center: Option<[f64; 3]>,
    width: Option<[f64; 3]>,
    every: u64,
    sample: Option<u64>,
    left_out: bool,
    seed: u64,
}

impl ReadOptions {
    pub fn choice(self) -> particlegs_core::Result<Choice> {
        let selection = match (self.region, self.center, self.width) {
            (Some([x0, x1, y0, y1, z0, z1]), ..) => {
                Selection { crop: Some(Bounds { min: [x0, y0, z0], max: [x1, y1, z1] }), ..Selection::all() }
            }
            (None, Some(center), Some(width)) => Selection::window(center, width),
            _ => Selection::all(),
        };
        let ReadOptions { every, sample, left_out, seed, .. } = self;
        Ok(Choice {
            format: self.format,
            frame: self.frame,
            topology: self.topology,
            select: self.select.as_deref().map(AtomSelection::parse).transpose()?,
            species: self.species,
            positions: self.positions,
            weights: match &self.mass_field[..] {
                "auto" => Weights::Auto,
                "none" => Weights::None,
                field => Weights::Field(field.into()),
            },
            by_mass: self.by_mass,
            skip_invalid: self.skip_invalid,
            strict: self.strict,
            keep_unwrapped: self.keep_unwrapped,
            blocks: self.blocks,
            box_lengths: self.box_lengths,
            length_unit: self.length_unit,
            mass_unit: self.mass_unit,
            convert_units: true,
            selection: Some(Selection { every, sample, left_out, seed, ..selection }.check()?),
            ..Choice::default()
        })
    }
}

/// Opens a snapshot.
#[pyfunction]
#[pyo3(signature = (paths, asked, scratch=None, memory=false, threads=None, progress=None))]
pub fn open(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    asked: ReadOptions,
    scratch: Option<PathBuf>,
    memory: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Snapshot> {
    let choice = asked.choice().or_raise()?;
    let storage = scratch.map_or(Storage::Memory, Storage::Disk);
    let particles = WorkOptions { threads, progress }.run(py, |progress| {
        let particles = choice.read(&paths, &storage, progress)?;
        if memory { particles.in_memory() } else { Ok(particles) }
    })?;
    let snapshot = Snapshot::of(particles, choice.options());
    Ok(Snapshot { files: Some((paths, choice)), ..snapshot })
}

/// Splits a unit of dimension `length` or `mass`: factor, name, size in SI, exponents of a and h; `None` if unknown.
#[pyfunction]
pub fn unit_parts(text: &str, dimension: &str) -> Option<(f64, &'static str, f64, f32, f32)> {
    Unit::parts(text, if dimension == "mass" { Dimension::Mass } else { Dimension::Length })
}

/// Names of the readable formats.
#[pyfunction]
pub fn formats() -> Vec<&'static str> {
    Choice::formats().collect()
}
