//! What the model file says about its snapshot.

use crate::Result;
use crate::model::{Law, Metadata};
use crate::particles::{Bounds, Particles};
use crate::progress::Progress;

/// Particles that one step of hashing takes: large enough for the hash's own threads.
const STEP: usize = 1 << 22;

/// BLAKE3 of the particles: x, then y, then z, then weights, as little-endian f32; the f64 origin
/// first where it is not zero. The same for raw columns, triples and .npy of equal values.
pub fn source_hash(particles: &Particles, progress: &dyn Progress) -> Result<[u8; 32]> {
    let mut hasher = blake3::Hasher::new();
    if particles.origin != [0.0; 3] {
        for o in particles.origin {
            hasher.update(&o.to_le_bytes());
        }
    }
    let n = particles.len();
    let mut buffer = crate::particles::ChunkBuffer::default();
    let columns = if particles.weights.is_some() { 4 } else { 3 };
    progress.begin("hash", (columns * n) as u64);
    for k in 0..columns {
        for start in (0..n).step_by(STEP) {
            progress.check()?;
            let end = n.min(start + STEP);
            let chunk = particles.chunk(start..end, &mut buffer);
            let values = if k < 3 { chunk.position[k] } else { chunk.weight.unwrap_or(&[]) };
            // Little-endian hosts hash the memory as it lies.
            #[cfg(target_endian = "little")]
            hasher.update_rayon(bytemuck::cast_slice(values));
            #[cfg(target_endian = "big")]
            values.iter().for_each(|v| {
                hasher.update(&v.to_le_bytes());
            });
            progress.advance((end - start) as u64);
        }
    }
    progress.end();
    Ok(*hasher.finalize().as_bytes())
}

/// Metadata of a model of these particles.
pub fn describe(
    particles: &Particles,
    bounds: Bounds,
    radius: Option<f64>,
    opacity: Option<f64>,
    command: String,
    progress: &dyn Progress,
) -> Result<Metadata> {
    let meta = &particles.meta;
    let count = particles.len() as u64;
    Ok(Metadata {
        law: Law::OpticalDepth,
        count,
        mass: particles.total_mass(),
        weighted: particles.weights.is_some(),
        bounds,
        cell: meta.cell,
        default_radius: radius.unwrap_or_else(|| bounds.default_radius(count)),
        default_opacity: opacity.unwrap_or(DEFAULT_OPACITY),
        source: meta.name.clone(),
        source_hash: source_hash(particles, progress)?,
        length_unit: meta.length_unit.clone(),
        mass_unit: meta.mass_unit.clone(),
        particle_mass: meta.particle_mass,
        comoving: meta.comoving,
        scale_factor: meta.scale_factor,
        hubble: meta.hubble,
        time: meta.time,
        command,
        tool_version: env!("CARGO_PKG_VERSION").to_string(),
    })
}

/// ParaView users' usual opacity, and the published default.
pub const DEFAULT_OPACITY: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Column, Positions};
    use crate::progress::Silent;

    #[test]
    fn the_hash_does_not_depend_on_the_layout() {
        let columns = Particles::from_columns(vec![1.0, 4.0], vec![2.0, 5.0], vec![3.0, 6.0]);
        let mut triples = columns.clone();
        triples.positions = Positions::Triples(Column::owned(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        let a = source_hash(&columns, &Silent).unwrap();
        assert_eq!(a, source_hash(&triples, &Silent).unwrap());
        triples.weights = Some(Column::owned(vec![1.0, 2.0]));
        assert_ne!(a, source_hash(&triples, &Silent).unwrap());
    }
}
