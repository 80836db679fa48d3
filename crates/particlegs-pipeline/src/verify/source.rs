//! Checks that a snapshot is the one that a model was made from.

use crate::model::Model;
use crate::particles::Particles;
use crate::{Error, Result};

/// Refuses particles that the model was not made from. The error names `snapshot` and the model's `place`.
pub fn check_source(model: &Model, of_several: bool, particles: &Particles, snapshot: &str, place: &str) -> Result<()> {
    let Some(why) = particles.source_difference(model, of_several) else { return Ok(()) };
    Err(Error::input(snapshot, format!("it is not the snapshot that {place} was made from ({why})")))
}
