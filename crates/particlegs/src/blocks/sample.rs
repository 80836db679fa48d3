//! Every so-manieth position of a snapshot, in order.

use crate::Result;
use crate::particles::{Chunk, RUN, SnapshotReader};
use crate::progress::Progress;
use std::sync::Mutex;

/// Positions sampled at most. Cuts through fewer particles are exact; the share of a block among
/// 8 is off by about 0.1 % then.
const MOST: u64 = 1 << 22;

/// Positions about the reader's origin: all particles where they are few, else every K-th.
#[derive(Default)]
pub struct Sample {
    /// x, y, z.
    pub position: [Vec<f32>; 3],
}

impl Sample {
    /// Of `count` particles, the first of every so many is taken.
    pub(super) fn every(count: u64) -> u64 {
        count.div_ceil(MOST).max(1)
    }

    /// What is taken of a run whose first particle is number `first`.
    pub(super) fn of_run(chunk: &Chunk<'_>, first: u64, every: u64) -> [Vec<f32>; 3] {
        let skip = (every - first % every) % every;
        chunk.position.map(|c| c.iter().skip(skip as usize).step_by(every as usize).copied().collect())
    }

    pub(super) fn append(&mut self, run: [Vec<f32>; 3]) {
        (0..3).for_each(|k| self.position[k].extend_from_slice(&run[k]));
    }
}

/// Takes the sample.
///
/// # Errors
/// Those of the reader; [`crate::Error::Cancelled`].
pub fn sample(reader: &dyn SnapshotReader, progress: &dyn Progress) -> Result<Sample> {
    let every = Sample::every(reader.count());
    let runs = reader.count().div_ceil(RUN as u64);
    let parts: Vec<Mutex<[Vec<f32>; 3]>> = (0..runs).map(|_| Mutex::default()).collect();
    reader.read(0..runs, progress, &|run, chunk| {
        if let Some(part) = parts.get(run as usize) {
            *part.lock().unwrap_or_else(|e| e.into_inner()) = Sample::of_run(&chunk, run * RUN as u64, every);
        }
        Ok(())
    })?;
    let mut sample = Sample::default();
    parts.into_iter().for_each(|part| sample.append(part.into_inner().unwrap_or_else(|e| e.into_inner())));
    Ok(sample)
}
