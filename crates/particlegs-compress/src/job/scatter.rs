//! Chunks of the snapshot into buckets, one for each block.

use super::bucket::{self, Buckets, SortedRun};
use super::manifest::JobFolder;
use super::no_part;
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_files::output;
use particlegs_particles::blocks::RunScan;
use particlegs_particles::{Chunk, LayeredParticles, hash_run};
use std::sync::Mutex;

impl JobFolder {
    /// Buckets chunk `chunk` of the snapshot; nothing where that is done. Gives whether there was
    /// anything to do.
    pub fn scatter(
        &self,
        source: impl FnOnce() -> Result<LayeredParticles>,
        chunk: u64,
        context: &Context<'_>,
    ) -> Result<bool> {
        let chunks = self.manifest.chunks;
        if chunk >= chunks {
            return Err(no_part("chunk", chunk, chunks));
        }
        if self.chunk_path(chunk).is_file() {
            // Half-written or foreign files are named, not taken for done.
            Buckets::open(self, chunk)?;
            return Ok(false);
        }
        self.bucket(&self.as_planned(source()?)?, chunk, context)?;
        Ok(true)
    }

    pub(super) fn bucket(&self, source: &LayeredParticles, chunk: u64, context: &Context<'_>) -> Result<()> {
        let first = chunk * self.manifest.chunk_runs;
        let end = (first + self.manifest.chunk_runs).min(self.runs.len() as u64);
        let sorted: Vec<Mutex<SortedRun>> = (first..end).map(|_| Mutex::default()).collect();
        for (layer, runs) in self.by_layer(first..end) {
            source.layers[layer].read(source.origin, runs, context, &|run, chunk| {
                self.check_run(layer, run, &chunk)?;
                let place = &sorted[(self.starts[layer] + run - first) as usize];
                *place.lock().unwrap_or_else(|e| e.into_inner()) = self.sort(source, (layer, run), &chunk)?;
                Ok(())
            })?;
        }
        context.check()?;
        let sorted: Vec<SortedRun> =
            sorted.into_iter().map(|s| s.into_inner().unwrap_or_else(|e| e.into_inner())).collect();
        let path = self.chunk_path(chunk);
        output::write_atomic(&path, |to| bucket::write(self, chunk, &sorted, to))
    }

    /// Run `run` of a layer is what it was when the job was planned, else an error.
    pub(super) fn check_run(&self, layer: usize, run: u64, chunk: &Chunk<'_>) -> Result<()> {
        let planned: &RunScan = &self.runs[(self.starts[layer] + run) as usize];
        if hash_run(chunk) == planned.hash {
            return Ok(());
        }
        let name = &self.manifest.plan.layers[layer].name;
        let first = run * particlegs_particles::RUN as u64;
        let last = first + chunk.len() as u64 - 1;
        Err(self.changed(&format!("particles {first} to {last} of layer `{name}` are different")))
    }

    /// A run's particles sorted by block; order is kept within.
    fn sort(&self, source: &LayeredParticles, (layer, run): (usize, u64), chunk: &Chunk<'_>) -> Result<SortedRun> {
        let blocks: Vec<u32> = self.manifest.plan.tree.blocks_of(chunk).collect();
        let mut order: Vec<u32> = (0..blocks.len() as u32).collect();
        order.sort_by_key(|&i| blocks[i as usize]);
        let pick = |c: &[f32]| order.iter().map(|&i| c[i as usize]).collect::<Vec<f32>>();
        let mut columns: Vec<Vec<f32>> = chunk.position.into_iter().chain(chunk.weight).map(pick).collect();
        columns.extend(self.field_bits(source, layer, run, &order)?);
        let same = order.chunk_by(|&a, &b| blocks[a as usize] == blocks[b as usize]);
        let counts = same.map(|run| (blocks[run[0] as usize], run.len() as u32)).collect();
        Ok(SortedRun { layer, blocks: counts, columns })
    }
}
