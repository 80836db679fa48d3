//! Every so-manieth position of a snapshot, in order.

use crate::Chunk;

/// Positions sampled at most. Cuts through fewer particles are exact; the share of a block among
/// 8 is off by about 0.1 % then.
const MOST: u64 = 1 << 22;

/// Positions about the reader's origin: all particles where they are few, else every K-th.
#[derive(Default)]
pub struct PositionSample {
    /// x, y, z.
    pub position: [Vec<f32>; 3],
}

impl PositionSample {
    /// Of `count` particles, the first of every so many is taken.
    pub(super) fn every(count: u64) -> u64 {
        count.div_ceil(MOST).max(1)
    }

    /// The sample of a run whose first particle is number `first`: one of `every` particles, none for 0.
    pub(super) fn of_run(chunk: &Chunk<'_>, first: u64, every: u64) -> [Vec<f32>; 3] {
        if every == 0 {
            return Default::default();
        }
        let skip = (every - first % every) % every;
        chunk.position.map(|c| c.iter().skip(skip as usize).step_by(every as usize).copied().collect())
    }

    pub(super) fn append(&mut self, run: [Vec<f32>; 3]) {
        (0..3).for_each(|k| self.position[k].extend_from_slice(&run[k]));
    }
}
