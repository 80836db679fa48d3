//! Metadata of a model file on its snapshot.

use super::options::Options;
use particlegs_core::Result;
use particlegs_core::codec::source_statements;
use particlegs_core::model::{Mass, Metadata, Model, RecipeStep};
use particlegs_core::space::Bounds;
use particlegs_core::splat::DEFAULT_OPACITY;
use particlegs_particles::{Particles, SnapshotMeta};

/// Results of a pass over a snapshot.
pub(super) struct SourceFacts {
    pub count: u64,
    /// Their bounds, world units.
    pub bounds: Bounds,
    pub source_hash: [u8; 32],
}

/// Metadata of a model in `blocks` blocks; its mass is known when its blocks are.
pub(super) fn describe(meta: &SnapshotMeta, known: &SourceFacts, options: &Options, blocks: u32) -> Metadata {
    let SourceFacts { count, bounds, source_hash } = *known;
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
    /// Whether a model file of such `metadata`, with or without a certificate, is the one that these options make of
    /// `particles`. Never so after training, which time may have ended.
    pub fn made(&self, metadata: &Metadata, has_certificate: bool, particles: &Particles) -> Result<bool> {
        if self.training.is_some() || has_certificate != self.certificate.measures() || !self.ask_for(metadata) {
            return Ok(false);
        }
        let (count, source_hash) = (particles.len() as u64, particles.source_hash());
        let known = SourceFacts { count, bounds: metadata.bounds, source_hash };
        let expected_metadata = describe(&particles.meta, &known, self, self.blocks_of(particles)?);
        // What the hash decides, and how files are called, is not compared.
        let (source, fields, shared_species) =
            (metadata.source.clone(), metadata.fields.clone(), metadata.shared_species.clone());
        Ok(*metadata == Metadata { mass: metadata.mass, source, fields, shared_species, ..expected_metadata })
    }

    /// Whether these options can make a model file of such `metadata`, whatever the number of blocks that memory asks
    /// for.
    pub fn ask_for(&self, metadata: &Metadata) -> bool {
        self.training.is_none() && metadata.recipe == self.recipe(metadata.recipe.blocks)
    }
}

/// The reason why these are not the particles that a model was made from, if so: their hash differs, or, for a model of
/// several snapshots, which has no hash of particles, their number.
pub fn source_difference(particles: &Particles, model: &Model, of_several: bool) -> Option<&'static str> {
    let m = &model.metadata;
    match of_several {
        _ if particles.source_hash() == m.source_hash => None,
        true => (particles.len() as u64 != m.count).then_some("their numbers of particles differ"),
        false => Some("their hashes differ"),
    }
}

/// Metadata of a model that differ from its particles: name, stored value, value of the particles. Compared are bounds,
/// cell, units, cosmology, moment, layers and masses, and the particle radius and opacity that follow from them and
/// from the recipe; of a merge of several snapshots no texts of units.
pub fn differences_from(particles: &Particles, model: &Model, of_several: bool) -> Vec<[String; 3]> {
    let (m, bounds, count) = (&model.metadata, particles.bounds(), particles.len() as u64);
    let SnapshotMeta { cell, units, cosmology, epoch, .. } = particles.meta.clone();
    let source_metadata =
        Metadata { cell, units, cosmology, epoch, fields: m.fields.clone(), ..Metadata::new(m.law, count, bounds) };
    let recipe = &m.recipe;
    let as_made = recipe.differing.is_empty() && !recipe.steps.contains(&RecipeStep::Merge);
    let looks = [
        recipe.radius.unwrap_or(source_metadata.default_radius),
        recipe.opacity.unwrap_or(source_metadata.default_opacity),
    ];
    // A recipe's numbers are text: close is the same.
    let near = |a: f64, b: f64| if !as_made || (a / b - 1.0).abs() < 1e-12 { b } else { a };
    let [radius, opacity] = [near(m.default_radius, looks[0]), near(m.default_opacity, looks[1])];
    let layer = |name: &str, count: u64, mass: Mass| format!("{name}: {count} particles, {mass:?}");
    let stored_layers = model.layers.iter().map(|l| layer(&l.name, l.content.iter().map(|b| b.count).sum(), l.mass));
    let source_layers = particles.layers().iter().map(|l| layer(&l.name, l.content.len() as u64, l.mass));
    let listed = |mut layers: Vec<String>| {
        layers.sort();
        layers.join("; ")
    };
    // Adding 0 turns -0 into 0, which is the same corner.
    let corners = |b: &Bounds| format!("{:?} to {:?}", b.min.map(|v| v + 0.0), b.max.map(|v| v + 0.0));
    let direct = [
        ("bounds", corners(&m.bounds), corners(&bounds)),
        ("layers", listed(stored_layers.collect()), listed(source_layers.collect())),
        ("particle radius", radius.to_string(), looks[0].to_string()),
        ("opacity", opacity.to_string(), looks[1].to_string()),
    ];
    let stated = source_statements(m).into_iter().zip(source_statements(&source_metadata));
    // The first text of a statement is the size of a unit, by which two spellings of it are one.
    let stated = stated.filter(|((_, a), (_, b))| if of_several { a[0] != b[0] } else { a != b });
    let stated = stated.map(|((name, [_, a]), (_, [_, b]))| [name.into(), a, b]);
    let direct = direct.into_iter().filter(|(_, a, b)| a != b).map(|(name, a, b)| [name.into(), a, b]);
    stated.chain(direct).collect()
}
