//! From a model to files of particles, run by run.

use super::Method;
use super::draw::{Rules, Scratch};
use super::notes::notes;
use super::plan::Plan;
use super::wrap::Wrap;
use crate::memory::require;
use crate::model::Model;
use crate::particles::{Described, ONE_LAYER, RUN, RawForm, Run, SnapshotMeta, SnapshotWriter};
use crate::progress::Progress;
use crate::{Error, Result};
use rayon::prelude::*;
use std::path::Path;

/// How to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Particles (`None`: as many as the model stands for).
    pub particles: Option<u64>,
    /// How they are placed.
    pub method: Method,
    /// Factor on the Gaussians' standard deviations (the published variants: 1.2 to 3).
    pub scale: f64,
    /// Seed of the draws.
    pub seed: u64,
    /// Columns, or triples.
    pub form: RawForm,
    /// The model file's name, for meta.json.
    pub model_name: String,
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Recovered {
    /// Particles.
    pub particles: u64,
    /// Bytes of their columns.
    pub bytes: u64,
}

/// Draws particles from `model` (whose file has the BLAKE3 `model_hash`) and writes them to `out`
/// with a meta.json that says what they are. Memory stays at the model and a few runs a thread,
/// whatever the number of particles; the same model, options and seed give the same bytes for any
/// number of threads.
///
/// # Errors
/// [`Error::Argument`] for no particles or a scale that is not positive; [`Error::Input`] where
/// positions do not fit into float32 or weights would be lost; [`Error::Io`]; [`Error::Memory`];
/// [`Error::Cancelled`].
pub fn recover(
    model: Model,
    model_hash: [u8; 32],
    options: &Options,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Recovered> {
    if !(options.scale > 0.0 && options.scale.is_finite()) {
        return Err(Error::argument(format!("a scale of {} is not positive", options.scale)));
    }
    require("drawing", (rayon::current_num_threads() * RUN * BYTES_A_DRAW + model.gaussians() * 8) as u64)?;
    let (metadata, certificate) = (model.metadata.clone(), model.certificate);
    let plan = Plan::new(model, options.particles, options.method)?;
    let weighted = plan.weighted();
    let volume: f64 = metadata.bounds.extent_nonzero().iter().product();
    let rules = Rules {
        method: options.method,
        scale: options.scale,
        seed: options.seed,
        bounds: metadata.bounds,
        mean_density: plan.total as f64 / volume,
        wrap: Wrap::new(metadata.cell.as_ref(), &metadata.bounds),
        weighted,
    };
    let writer = SnapshotWriter::create(out, options.form, plan.total, weighted)?;
    progress.begin("drawing particles", plan.total);
    (0..plan.runs()).into_par_iter().try_for_each_init(
        || (Scratch::default(), Run::default(), Vec::new()),
        |(scratch, run, triples), id| {
            progress.check()?;
            let (layer, number, range) = plan.run(id);
            let (first, count) = (layer.first + range.start, range.end - range.start);
            rules.fill(layer, number, range, scratch, run)?;
            writer.write(first, run, triples)?;
            progress.advance(count);
            Ok::<_, Error>(())
        },
    )?;
    let layers = plan.described();
    let one = layers.len() == 1 && layers[0].name == ONE_LAYER;
    let meta = SnapshotMeta {
        name: format!("{} (synthetic)", metadata.source),
        cell: metadata.cell,
        length_unit: metadata.length_unit.clone(),
        mass_unit: metadata.mass_unit.clone(),
        particle_mass: layers[0].particle_mass.filter(|_| one),
        comoving: metadata.comoving,
        scale_factor: metadata.scale_factor,
        hubble: metadata.hubble,
        time: metadata.time,
    };
    writer.finish(&Described {
        meta: &meta,
        layers,
        order: "layer by layer, Gaussian by Gaussian",
        notes: notes(&metadata, certificate.as_ref(), model_hash, options, plan.total),
    })?;
    progress.end();
    Ok(Recovered { particles: plan.total, bytes: plan.total * if weighted { 16 } else { 12 } })
}

/// Bytes of a particle in a thread's scratch space: numbers and positions in f64, columns and
/// triples in f32.
const BYTES_A_DRAW: usize = 8 * 7 + 4 * 7;
