//! What a fit takes.

use crate::particles::Particles;

/// Bytes of memory that a fit takes beside the mapped file: the store that is reordered, and a
/// margin for the Gaussians and their neighbourhoods.
pub fn memory_needed(particles: &Particles) -> u64 {
    particles.len() as u64 * if particles.weights().is_some() { 20 } else { 16 }
}
