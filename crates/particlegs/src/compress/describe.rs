//! What the model file says about its snapshot.

use super::options::Options;
use crate::Result;
use crate::model::Metadata;
use crate::particles::{Particles, SnapshotMeta};
use crate::space::Bounds;
use crate::splat::DEFAULT_OPACITY;

/// What a pass over a snapshot tells.
pub(super) struct Known {
    /// Particles.
    pub count: u64,
    /// Their bounds, world units.
    pub bounds: Bounds,
    /// Their hash.
    pub source_hash: [u8; 32],
}

/// Metadata of a model in `blocks` blocks; its mass is known when its blocks are.
pub(super) fn describe(meta: &SnapshotMeta, known: &Known, options: &Options, blocks: u32) -> Metadata {
    let Known { count, bounds, source_hash } = *known;
    Metadata {
        cell: meta.cell,
        default_radius: options.radius.unwrap_or_else(|| bounds.default_radius(count)),
        default_opacity: options.opacity.unwrap_or(DEFAULT_OPACITY),
        source: meta.name.clone(),
        source_hash,
        units: meta.units.clone(),
        cosmology: meta.cosmology,
        epoch: meta.epoch,
        recipe: options.recipe(blocks),
        ..Metadata::new(options.law(), count, bounds)
    }
}

impl Options {
    /// Is a model file of `told`, with or without a certificate, what these options make of `particles`? Never
    /// said of training, which time may have ended.
    ///
    /// # Errors
    /// As [`Options::blocks_of`].
    pub fn made(&self, told: &Metadata, has_certificate: bool, particles: &Particles) -> Result<bool> {
        if self.training.is_some() || has_certificate != self.certificate.measures() || !self.ask_for(told) {
            return Ok(false);
        }
        let (count, source_hash) = (particles.len() as u64, particles.source_hash());
        let known = Known { count, bounds: told.bounds, source_hash };
        let asked = describe(&particles.meta, &known, self, self.blocks_of(particles)?);
        // What the hash decides, and how files are called, is not compared.
        Ok(*told == Metadata { mass: told.mass, source: told.source.clone(), ..asked })
    }

    /// Can a model file of `told` be what these options make, whatever the number of blocks that memory asks for?
    pub fn ask_for(&self, told: &Metadata) -> bool {
        self.training.is_none() && told.recipe == self.recipe(told.recipe.blocks)
    }
}
