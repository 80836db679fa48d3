//! Every so-manieth position of a snapshot, in order.

use crate::Result;
use crate::particles::{RUN, SnapshotReader};
use crate::progress::Progress;
use std::sync::Mutex;

/// Positions sampled at most. Cuts through fewer particles are exact; the share of a block among
/// 8 is off by about 0.1 % then.
const MOST: u64 = 1 << 22;

/// Positions about the reader's origin.
pub struct Sample {
    /// x, y, z.
    pub position: [Vec<f32>; 3],
}

/// Takes the sample: all particles where they are few, else every K-th.
///
/// # Errors
/// Those of the reader; [`crate::Error::Cancelled`].
pub fn sample(reader: &dyn SnapshotReader, progress: &dyn Progress) -> Result<Sample> {
    let (count, run) = (reader.count(), RUN as u64);
    let every = count.div_ceil(MOST).max(1);
    let runs = count.div_ceil(run);
    let parts: Vec<Mutex<[Vec<f32>; 3]>> = (0..runs).map(|_| Mutex::default()).collect();
    reader.read(0..runs, progress, &|id, chunk| {
        let first = (every - id * run % every) % every;
        let pick = |c: &[f32]| c.iter().skip(first as usize).step_by(every as usize).copied().collect();
        if let Some(part) = parts.get(id as usize) {
            *part.lock().unwrap_or_else(|e| e.into_inner()) = chunk.position.map(pick);
        }
        Ok(())
    })?;
    let mut position: [Vec<f32>; 3] = Default::default();
    for part in parts {
        let part = part.into_inner().unwrap_or_else(|e| e.into_inner());
        (0..3).for_each(|k| position[k].extend_from_slice(&part[k]));
    }
    Ok(Sample { position })
}
