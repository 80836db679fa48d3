//! Checks that a snapshot is the one that a model was made from.

use crate::model::Model;
use crate::particles::Particles;
use crate::{Error, Result, codec};

/// Is a file merged from several snapshots? Its hash is that of its blocks, so no snapshot matches.
pub fn is_of_several(bytes: &[u8], model: &Model, place: &str) -> Result<bool> {
    Ok(model.metadata.source_hash == codec::blocks_hash(&codec::coded_layers(bytes, place)?))
}

/// Refuses particles with another hash, or, for a merge of several snapshots, another number. The error names
/// `snapshot` and the model's `place`.
pub fn check_source(model: &Model, of_several: bool, particles: &Particles, snapshot: &str, place: &str) -> Result<()> {
    let told = model.metadata.source_hash;
    let matches = particles.source_hash() == told || of_several && particles.len() as u64 == model.metadata.count;
    if matches {
        return Ok(());
    }
    let why = if of_several { "their numbers of particles differ" } else { "their hashes differ" };
    Err(Error::input(snapshot, format!("it is not the snapshot that {place} was made from ({why})")))
}
