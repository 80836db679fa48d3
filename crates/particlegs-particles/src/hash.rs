//! The hash that binds a model to its snapshot.

use super::{Chunk, Particles};

/// BLAKE3 of a run of a layer: of its positions (the f32 bytes, little-endian, of x, then y, then z) and
/// of its weights where there are any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunHash {
    /// Of the positions.
    pub positions: [u8; 32],
    /// Of the weights.
    pub weights: Option<[u8; 32]>,
}

/// Hashes a run of at most [`super::RUN`] particles.
pub fn hash_run(chunk: &Chunk<'_>) -> RunHash {
    let mut hasher = blake3::Hasher::new();
    for axis in chunk.position {
        hasher.update(bytemuck::cast_slice(axis));
    }
    let weights = chunk.weight.map(|w| *blake3::hash(bytemuck::cast_slice(w)).as_bytes());
    RunHash { positions: *hasher.finalize().as_bytes(), weights }
}

/// The hash of a snapshot from those of its runs, layer after layer: BLAKE3 of the origin as f64 where
/// it is not zero, then of each run's hash of positions and, where it has one, of weights.
pub fn hash_of_runs<'a>(origin: [f64; 3], runs: impl Iterator<Item = &'a RunHash>) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    if origin != [0.0; 3] {
        origin.iter().for_each(|o| {
            hasher.update(&o.to_le_bytes());
        });
    }
    for run in runs {
        hasher.update(&run.positions);
        run.weights.iter().for_each(|w| {
            hasher.update(w);
        });
    }
    *hasher.finalize().as_bytes()
}

impl Particles {
    /// The hash that stands in a model's metadata: the BLAKE3 of the hashes of runs of 65 536 particles, each layer
    /// beginning a run, weights where a layer has them. Runs can be hashed wherever they are read.
    pub fn source_hash(&self) -> [u8; 32] {
        let mut hashes = Vec::new();
        for layer in self.layers() {
            let layer_particles = self.of_layer(layer);
            hashes.extend(layer_particles.par_chunks(|_, chunk| hash_run(&chunk)));
        }
        hash_of_runs(self.origin, hashes.iter())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ChunkBuffer, Column, Positions, RUN};
    use super::*;
    use particlegs_core::model::{Layer, Mass};

    #[test]
    fn columns_and_triples_hash_alike() {
        let columns = Particles::from_columns(vec![1.0, 4.0], vec![2.0, 5.0], vec![3.0, 6.0]);
        let mut triples = columns.clone();
        triples.positions = Positions::Triples(Column::owned(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!(columns.source_hash(), triples.source_hash());
        let bytes: Vec<u8> = [1f32, 4.0, 2.0, 5.0, 3.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(columns.source_hash(), *blake3::hash(blake3::hash(&bytes).as_bytes()).as_bytes());
    }

    #[test]
    fn hashes_are_of_the_runs_of_each_layer() {
        let n = RUN + 10;
        let p = Particles::from_columns(vec![1.0; n], vec![2.0; n], vec![3.0; n]);
        let whole = p.source_hash();
        let layer = |content| Layer { name: "a".into(), mass: Mass::Unknown, content };
        let p = p.with_layers(vec![layer(0..10), layer(10..n)]);
        assert_ne!(p.source_hash(), whole);
        let small = Particles::from_columns(vec![1.0; 10], vec![2.0; 10], vec![3.0; 10]);
        let large = Particles::from_columns(vec![1.0; RUN], vec![2.0; RUN], vec![3.0; RUN]);
        let runs = [small, large].map(|p| hash_run(&p.chunk(0..p.len(), &mut ChunkBuffer::default())));
        assert_eq!(hash_of_runs([0.0; 3], runs.iter()), p.source_hash());
    }
}
