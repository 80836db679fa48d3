//! The reader trait: metadata first, then chunks into the caller's buffers.

use super::SnapshotMeta;
use crate::Result;

/// Columns that a reader fills; the caller owns and reuses them.
#[derive(Default, Debug)]
pub struct ChunkBuffer {
    /// x, y, z relative to the reader's origin, same length each.
    pub position: [Vec<f32>; 3],
    /// Weights (> 0), same length; empty where the source has none.
    pub weight: Vec<f32>,
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

    /// No particles?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A snapshot that can be read in chunks of any size, from any place, by several threads.
pub trait SnapshotReader: Send + Sync {
    /// What the snapshot says about itself.
    fn meta(&self) -> &SnapshotMeta;
    /// Number of particles.
    fn count(&self) -> u64;
    /// Are there weights?
    fn has_weights(&self) -> bool;
    /// The f64 point to which f32 positions are relative.
    fn origin(&self) -> [f64; 3];
    /// Fills `buffer` (cleared first) with particles `start .. start + count`.
    fn read(&self, start: u64, count: usize, buffer: &mut ChunkBuffer) -> Result<()>;
}
