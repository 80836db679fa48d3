//! A block's particles, from buckets or from the snapshot where it lies.

use super::fields::FieldBits;
use super::manifest::JobFolder;
use super::scatter::Buckets;
use particlegs_core::context::Context;
use particlegs_core::model::Layer;
use particlegs_core::{Error, Result};
use particlegs_particles::{Chunk, ColumnBuffer, LayeredParticles, Particles, SnapshotMeta, Storage};
use std::ops::Range;
use std::sync::Mutex;

impl JobFolder {
    /// The particles of block `block`, with their fields; `source` opens the snapshot where that is needed.
    pub(super) fn gather(
        &self,
        block: u32,
        source: impl FnOnce() -> Result<LayeredParticles>,
        context: &Context<'_>,
    ) -> Result<(Particles, FieldBits)> {
        match self.manifest.chunks {
            0 => self.gather_in_place(block, &self.as_planned(source()?)?, context),
            chunks => self.gather_buckets(block, chunks, context),
        }
    }

    /// From the buckets of all chunks.
    fn gather_buckets(&self, block: u32, chunks: u64, context: &Context<'_>) -> Result<(Particles, FieldBits)> {
        let layers = self.manifest.plan.layers.len();
        // One file open at a time: there may be more chunks than a process may have files.
        let entries = (0..chunks).map(|c| Buckets::open(self, c)?.entry(block)).collect::<Result<Vec<_>>>()?;
        let mut counts = vec![0u64; layers];
        let add = |(n, c): (&mut u64, &u64)| *n = n.saturating_add(*c);
        entries.iter().for_each(|e| counts.iter_mut().zip(&e.counts).for_each(add));
        if counts.iter().zip(&self.manifest.plan.layers).any(|(n, l)| *n > l.content) {
            let message =
                format!("the sorted chunks contain more particles of block {block} than the plan has in total");
            return Err(Error::input_with(&self.folder, message, "run `plan` again, in another folder"));
        }
        let mut particles = BlockGatherer::new(self, &counts)?;
        for (chunk, entry) in (0..chunks).zip(&entries) {
            context.check()?;
            if entry.counts.iter().all(|n| *n == 0) {
                continue;
            }
            let values = Buckets::open(self, chunk)?.read(entry)?;
            let mut rest = &values[..];
            for (layer, &n) in entry.counts.iter().enumerate() {
                let (layer_values, after) = rest.split_at(self.columns(layer) * n as usize);
                particles.push(layer, layer_values);
                rest = after;
            }
        }
        particles.finish()
    }

    /// From the runs that reach into the block.
    fn gather_in_place(
        &self,
        block: u32,
        source: &LayeredParticles,
        context: &Context<'_>,
    ) -> Result<(Particles, FieldBits)> {
        let (starts, tree) = (&self.starts, &self.manifest.plan.tree);
        let inside = |run: &u64| {
            let r = &self.runs[*run as usize];
            tree.blocks_in(r.min, r.max).contains(&block)
        };
        let mut layers = Vec::new();
        for (index, layer) in source.layers.iter().enumerate() {
            let runs: Vec<u64> = (starts[index]..starts[index + 1]).filter(inside).map(|r| r - starts[index]).collect();
            // Runs arrive in any order: each has its place, so that particles keep theirs.
            let run_values: Vec<Mutex<Vec<f32>>> = runs.iter().map(|_| Mutex::default()).collect();
            for run_range in stretches(&runs) {
                layer.read(source.origin, run_range, context, &|run, chunk| {
                    self.check_run(index, run, &chunk)?;
                    if let Ok(place) = runs.binary_search(&run) {
                        *run_values[place].lock().unwrap_or_else(|e| e.into_inner()) =
                            self.pick(block, source, (index, run), &chunk)?;
                    }
                    Ok(())
                })?;
            }
            layers.push(
                run_values.into_iter().map(|f| f.into_inner().unwrap_or_else(|e| e.into_inner())).collect::<Vec<_>>(),
            );
        }
        let count = |(l, runs): (usize, &Vec<Vec<f32>>)| runs.iter().map(|r| (r.len() / self.columns(l)) as u64).sum();
        let counts: Vec<u64> = layers.iter().enumerate().map(count).collect();
        let mut particles = BlockGatherer::new(self, &counts)?;
        for (layer, runs) in layers.into_iter().enumerate() {
            runs.iter().for_each(|run_values| particles.push(layer, run_values));
        }
        particles.finish()
    }

    /// The particles of a chunk that lie in a block, column after column.
    fn pick(
        &self,
        block: u32,
        source: &LayeredParticles,
        (layer, run): (usize, u64),
        chunk: &Chunk<'_>,
    ) -> Result<Vec<f32>> {
        let blocks = self.manifest.plan.tree.blocks_of(chunk);
        let block_rows: Vec<u32> = (0..).zip(blocks).filter(|b| b.1 == block).map(|b| b.0).collect();
        let columns = chunk.position.into_iter().chain(chunk.weight);
        let mut values: Vec<f32> = columns.flat_map(|c| block_rows.iter().map(|&i| c[i as usize])).collect();
        values.extend(self.field_bits(source, layer, run, &block_rows)?.into_iter().flatten());
        Ok(values)
    }
}

/// Runs of consecutive numbers.
fn stretches(runs: &[u64]) -> Vec<Range<u64>> {
    let mut ranges: Vec<Range<u64>> = Vec::new();
    for &run in runs {
        match ranges.last_mut() {
            Some(last) if last.end == run => last.end += 1,
            _ => ranges.push(run..run + 1),
        }
    }
    ranges
}

/// A block's columns being filled, layer by layer.
struct BlockGatherer<'a> {
    job: &'a JobFolder,
    columns: Vec<ColumnBuffer>,
    /// The range of each layer; `filled` is the part of it that has its particles.
    layers: Vec<Layer<Range<usize>>>,
    filled: Vec<usize>,
    fields: FieldBits,
}

impl<'a> BlockGatherer<'a> {
    fn new(job: &'a JobFolder, counts: &[u64]) -> Result<Self> {
        let layers = &job.manifest.plan.layers;
        let total: u64 = counts.iter().fold(0, |n, c| n.saturating_add(*c));
        let total = usize::try_from(total).unwrap_or(usize::MAX);
        let width = layers.iter().map(|l| l.mass.columns()).max().unwrap_or(3);
        let columns = Storage::Memory.columns("the block's particles", width, total)?;
        let mut end = 0;
        let place = |(l, &n): (&Layer<u64>, &u64)| {
            end += n as usize;
            l.with(end - n as usize..end)
        };
        let layers: Vec<_> = layers.iter().zip(counts).map(place).collect();
        let fields = (0..layers.len()).map(|l| vec![Vec::new(); job.manifest.fields.columns(l)]).collect();
        Ok(BlockGatherer { job, columns, filled: vec![0; layers.len()], layers, fields })
    }

    /// Appends particles of a layer, column after column.
    fn push(&mut self, layer: usize, values: &[f32]) {
        let start = self.layers[layer].content.start + self.filled[layer];
        let particle_columns = self.job.manifest.plan.layers[layer].mass.columns();
        let n = values.len() / self.job.columns(layer);
        let (values, fields) = values.split_at(particle_columns * n);
        // Chunks of 0 values would panic where a run has no particle in the block.
        for (column, values) in self.fields[layer].iter_mut().zip(fields.chunks_exact(n.max(1))) {
            column.extend_from_slice(values);
        }
        for (column, values) in self.columns.iter_mut().zip(values.chunks_exact(n.max(1))) {
            column[start..start + n].copy_from_slice(values);
        }
        // Beside layers with weights, others weigh the mass of their particles.
        if let Some(weights) = self.columns.get_mut(particle_columns) {
            weights[start..start + n].fill(self.layers[layer].mass.unit_or_one() as f32);
        }
        self.filled[layer] += n;
    }

    fn finish(self) -> Result<(Particles, FieldBits)> {
        let meta = SnapshotMeta { name: self.job.manifest.plan.metadata.source.clone(), ..SnapshotMeta::default() };
        let particles = Particles::from_buffers(self.columns, self.job.manifest.origin, meta, self.layers)?;
        Ok((particles.checked(&self.job.folder.display().to_string(), None)?, self.fields))
    }
}
