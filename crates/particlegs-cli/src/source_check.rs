//! Checks that a snapshot is the one that a model was made from.

use particlegs_pipeline::model::Model;
use particlegs_pipeline::particles::Particles;
use particlegs_pipeline::{Error, Result};
use std::path::Path;

/// Refuses particles that the model was not made from. The error names `snapshot` and the model's `file`.
pub fn check(model: &Model, of_several: bool, particles: &Particles, snapshot: &Path, file: &Path) -> Result<()> {
    let Some(why) = particles.source_difference(model, of_several) else { return Ok(()) };
    Err(Error::input(snapshot, format!("it is not the snapshot that {} was made from ({why})", file.display())))
}
