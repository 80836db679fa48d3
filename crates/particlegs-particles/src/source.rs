//! The reader trait: metadata first, then particles run by run.

use super::{Chunk, ChunkBuffer, Column, Particles, Positions, RUN, SnapshotMeta};
use particlegs_core::context::Context;
use particlegs_core::{Result, parallel};
use std::ops::Range;
use std::sync::Mutex;

/// Particles where they lie in a mapped file.
pub struct InPlace {
    /// Positions about 0.
    pub positions: Positions,
    /// Weights, where the source has them.
    pub weights: Option<Column>,
}

/// Takes runs of particles by their numbers, in any order and from any thread.
pub type RunSink<'a> = dyn Fn(u64, Chunk<'_>) -> Result<()> + Sync + 'a;

/// A snapshot that is read run by run in bounded memory: metadata first, then particles.
pub trait SnapshotReader: Send + Sync {
    /// Metadata of the snapshot.
    fn meta(&self) -> &SnapshotMeta;
    /// Number of particles.
    fn count(&self) -> u64;
    /// Whether there are weights.
    fn has_weights(&self) -> bool;
    /// The f64 point to which f32 positions are relative.
    fn origin(&self) -> [f64; 3];
    /// Hands over every run of `runs` once: run r holds particles `r * RUN` to `(r + 1) * RUN`, the
    /// last one what is left. Readers of streams pass over what comes before. Values are as the
    /// source has them: NaN and infinity are the caller's to find. Particles read are reported to
    /// `progress.advance`.
    fn read(&self, runs: Range<u64>, context: &Context<'_>, sink: &RunSink<'_>) -> Result<()>;
    /// Hands over the positions of every run of `runs` in order, as f64 about 0, to as many digits as the source has.
    fn read_wide(&self, runs: Range<u64>, sink: &mut dyn FnMut(u64, [&[f64]; 3]) -> Result<()>) -> Result<()> {
        let origin = self.origin();
        for run in runs {
            // A sink may be called from any thread, so the one run that it takes is behind a lock.
            let wide = Mutex::new(<[Vec<f64>; 3]>::default());
            self.read(run..run + 1, &Context::SILENT, &|_, chunk| {
                let position = |k: usize| chunk.position[k].iter().map(|&v| origin[k] + f64::from(v)).collect();
                *wide.lock().unwrap_or_else(|e| e.into_inner()) = [0, 1, 2].map(position);
                Ok(())
            })?;
            let [x, y, z] = wide.into_inner().unwrap_or_else(|e| e.into_inner());
            sink(run, [&x, &y, &z])?;
        }
        Ok(())
    }
    /// Whether runs can be read in any order at no more than their own cost. Those of streams cannot.
    fn random_access(&self) -> bool {
        true
    }
    /// All particles where they lie, if they lie so: origin 0, f32 columns or triples.
    fn in_place(&self) -> Option<InPlace> {
        None
    }
}

/// Particles in memory are read like any others.
impl SnapshotReader for Particles {
    fn meta(&self) -> &SnapshotMeta {
        &self.meta
    }

    fn count(&self) -> u64 {
        self.len() as u64
    }

    fn has_weights(&self) -> bool {
        self.weights().is_some()
    }

    fn origin(&self) -> [f64; 3] {
        self.origin
    }

    fn read(&self, runs: Range<u64>, context: &Context<'_>, sink: &RunSink<'_>) -> Result<()> {
        let buffers = parallel::Scratch::<ChunkBuffer>::default();
        parallel::try_for_each(runs, |run| {
            context.check()?;
            let start = run as usize * RUN;
            buffers.with(|buffer| {
                let chunk = self.chunk(start..self.len().min(start + RUN), buffer);
                context.advance(chunk.len() as u64);
                sink(run, chunk)
            })
        })
    }
}
