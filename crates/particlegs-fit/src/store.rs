//! The particles, copied once for reordering.

use particlegs_core::math::each_axis;
use particlegs_core::parallel;
use particlegs_core::space::Bounds;
use particlegs_particles::{Chunk, ChunkBuffer, Particles};

/// Particles in one parallel step of the copy.
const STEP: usize = 1 << 16;

/// A snapshot's particles in an order of their own.
///
/// Coordinates are `(world - origin) * scale` with `scale` a power of two that brings the largest
/// coordinate to between 1/2 and 1: nothing is rounded, and boxes of 1e-30 and 1e30 behave as a box of 1.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticleStore {
    /// Positions in store units.
    pub xyz: Vec<[f32; 3]>,
    /// Weights (> 0), one a particle, where the snapshot has them.
    pub weight: Option<Vec<f32>>,
    /// World position of the store's origin.
    pub origin: [f64; 3],
    /// Store units for a world unit, a power of two.
    pub scale: f64,
}

impl ParticleStore {
    /// Copies a snapshot with bounds `local` about its origin: 12 bytes a particle (16 with weights).
    pub fn new(particles: &Particles, local: &Bounds) -> Self {
        let scale = power_of_two_scale(local);
        let weight = particles.weights().map(|w| vec![0.0; w.len()]);
        let mut store = ParticleStore { xyz: vec![[0.0; 3]; particles.len()], weight, origin: particles.origin, scale };
        store.copy_again(particles);
        store
    }

    /// Copies the same snapshot again, in its own order.
    pub(super) fn copy_again(&mut self, particles: &Particles) {
        let scale = self.scale;
        parallel::for_each_chunk_with(&mut self.xyz, STEP, ChunkBuffer::default, |buffer, c, out| {
            let start = c * STEP;
            copy_scaled(particles.chunk(start..start + out.len(), buffer), scale, out);
        });
        if let (Some(store_weight), Some(weights)) = (&mut self.weight, particles.weights()) {
            store_weight.copy_from_slice(weights);
        }
    }

    pub fn len(&self) -> usize {
        self.xyz.len()
    }

    pub fn is_empty(&self) -> bool {
        self.xyz.is_empty()
    }

    /// World position of a point in store units.
    pub fn to_world(&self, p: [f64; 3]) -> [f64; 3] {
        each_axis(|k| self.origin[k] + p[k] / self.scale)
    }
}

fn copy_scaled(chunk: Chunk<'_>, scale: f64, out: &mut [[f32; 3]]) {
    let [x, y, z] = chunk.position;
    for (i, p) in out.iter_mut().enumerate() {
        *p = [x[i], y[i], z[i]].map(|v| (f64::from(v) * scale) as f32);
    }
}

/// The power of two that brings the largest |local coordinate| into [1/2, 1]; 1 where all are 0.
fn power_of_two_scale(local: &Bounds) -> f64 {
    let largest = local.min.iter().map(|v| -v).chain(local.max).fold(0.0, f64::max);
    if largest > 0.0 { libm::exp2(-libm::log2(largest).ceil()) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaling_rounds_nothing() {
        for unit in [1e-30f32, 1.0, 3.7, 1e30, f32::from_bits(1), f32::MAX] {
            let x = vec![unit, unit * 0.5, -unit];
            let p = Particles::from_columns(x.clone(), vec![0.0; 3], vec![unit; 3]);
            let s = ParticleStore::new(&p, &p.local_bounds());
            assert!(s.scale.log2().fract() == 0.0);
            for i in 0..3 {
                assert_eq!(s.to_world(s.xyz[i].map(f64::from))[0], f64::from(x[i]));
                assert!(s.xyz[i].iter().all(|v| v.abs() <= 1.0));
            }
            assert!(s.xyz[0][0] >= 0.5);
        }
    }
}
