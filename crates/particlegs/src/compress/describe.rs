//! What the model file says about its snapshot.

use super::Options;
use crate::model::Metadata;
use crate::particles::{Bounds, SnapshotMeta};

/// Metadata of a model of `count` particles within `bounds`; its mass is known when its blocks are.
pub fn describe(meta: &SnapshotMeta, count: u64, bounds: Bounds, source_hash: [u8; 32], options: &Options) -> Metadata {
    let blocks = if options.blocks > 1 { format!(" --blocks {}", options.blocks) } else { String::new() };
    Metadata {
        law: options.law(),
        count,
        mass: count as f64,
        bounds,
        cell: meta.cell,
        default_radius: options.radius.unwrap_or_else(|| bounds.default_radius(count)),
        default_opacity: options.opacity.unwrap_or(DEFAULT_OPACITY),
        source: meta.name.clone(),
        source_hash,
        length_unit: meta.length_unit.clone(),
        mass_unit: meta.mass_unit.clone(),
        comoving: meta.comoving,
        scale_factor: meta.scale_factor,
        hubble: meta.hubble,
        time: meta.time,
        command: options.command.clone() + &blocks,
        tool_version: env!("CARGO_PKG_VERSION").to_string(),
    }
}

/// ParaView users' usual opacity, and the published default.
pub const DEFAULT_OPACITY: f64 = 0.05;
