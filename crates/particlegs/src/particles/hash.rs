//! What binds a model to its snapshot.

use super::{ChunkBuffer, Particles};

/// BLAKE3 of the particles: the f32 bytes (little-endian) of x, then y, z, then weights where there
/// are any; the same for columns and triples. An origin that is not zero comes first, as f64.
pub fn source_hash(particles: &Particles) -> [u8; 32] {
    const STEP: usize = 1 << 20;
    let n = particles.len();
    let mut hasher = blake3::Hasher::new();
    let mut buffer = ChunkBuffer::default();
    if particles.origin != [0.0; 3] {
        particles.origin.iter().for_each(|o| {
            hasher.update(&o.to_le_bytes());
        });
    }
    for axis in 0..3 {
        for start in (0..n).step_by(STEP) {
            let chunk = particles.chunk(start..n.min(start + STEP), &mut buffer);
            hasher.update_rayon(bytemuck::cast_slice(chunk.position[axis]));
        }
    }
    if let Some(weights) = &particles.weights {
        hasher.update_rayon(bytemuck::cast_slice(weights));
    }
    *hasher.finalize().as_bytes()
}

#[cfg(test)]
mod tests {
    use super::super::{Column, Positions};
    use super::*;

    #[test]
    fn columns_and_triples_hash_alike() {
        let columns = Particles::from_columns(vec![1.0, 4.0], vec![2.0, 5.0], vec![3.0, 6.0]);
        let mut triples = columns.clone();
        triples.positions = Positions::Triples(Column::owned(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!(source_hash(&columns), source_hash(&triples));
        let bytes: Vec<u8> = [1f32, 4.0, 2.0, 5.0, 3.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(source_hash(&columns), *blake3::hash(&bytes).as_bytes());
    }
}
