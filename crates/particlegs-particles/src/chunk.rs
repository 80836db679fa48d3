//! Runs of particles as columns.

/// Columns that the caller owns and reuses.
#[derive(Default, Debug)]
pub struct ChunkBuffer {
    /// x, y, z relative to the origin, same length each.
    pub position: [Vec<f32>; 3],
}

/// A borrowed run of particles.
#[derive(Clone, Copy, Debug)]
pub struct Chunk<'a> {
    /// x, y, z relative to the origin, same length each.
    pub position: [&'a [f32]; 3],
    /// Weights, same length, where the source has them.
    pub weight: Option<&'a [f32]>,
}

impl Chunk<'_> {
    /// Number of particles.
    pub fn len(&self) -> usize {
        self.position[0].len()
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Particles that a reader hands over at once: a run. Fixed, so that nothing depends on threads.
pub const RUN: usize = 1 << 16;
