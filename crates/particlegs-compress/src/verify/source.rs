//! Checks that a snapshot is the one that a model was made from.

use crate::source_difference;
use particlegs_core::model::Model;
use particlegs_core::{Error, Result};
use particlegs_particles::Particles;

/// Refuses particles that the model was not made from. The error names `snapshot` and the model's `place`.
pub fn check_source(model: &Model, of_several: bool, particles: &Particles, snapshot: &str, place: &str) -> Result<()> {
    let Some(why) = source_difference(particles, model, of_several) else { return Ok(()) };
    Err(Error::input(snapshot, format!("it is not the snapshot that {place} was made from ({why})")))
}
