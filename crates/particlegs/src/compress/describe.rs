//! What the model file says about its snapshot.

use crate::model::{Law, Metadata};
use crate::particles::{Bounds, Particles, source_hash};

/// Metadata of a model of these particles; `mass` is the sum of their weights, 1 where a layer has
/// none.
pub fn describe(
    particles: &Particles,
    bounds: Bounds,
    mass: f64,
    radius: Option<f64>,
    opacity: Option<f64>,
    command: String,
) -> Metadata {
    let meta = &particles.meta;
    let count = particles.len() as u64;
    Metadata {
        law: Law::OpticalDepth,
        count,
        mass,
        bounds,
        cell: meta.cell,
        default_radius: radius.unwrap_or_else(|| bounds.default_radius(count)),
        default_opacity: opacity.unwrap_or(DEFAULT_OPACITY),
        source: meta.name.clone(),
        source_hash: source_hash(particles),
        length_unit: meta.length_unit.clone(),
        mass_unit: meta.mass_unit.clone(),
        comoving: meta.comoving,
        scale_factor: meta.scale_factor,
        hubble: meta.hubble,
        time: meta.time,
        command,
        tool_version: env!("CARGO_PKG_VERSION").to_string(),
    }
}

/// ParaView users' usual opacity, and the published default.
pub const DEFAULT_OPACITY: f64 = 0.05;
