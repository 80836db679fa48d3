//! Chunks of the snapshot into buckets, one for each block: `scatter/00000.bin` has those of a chunk.
//!
//! Little-endian: a head (magic, the plan's id, u64 chunk, u64 length of the file, CRC-32 of these); for
//! each block an entry (u64 offset of its particles, for each layer u64 particles, u32 CRC-32 of their
//! bytes, CRC-32 of the entry); then the particles, block after block, layer after layer: x, y, z, and
//! where the layer has them weights and fields, as f32 columns. One block is read without the others.

use super::manifest::JobFolder;
use super::no_part;
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_files::input::open_file;
use particlegs_files::output;
use particlegs_particles::blocks::RunScan;
use particlegs_particles::{Chunk, LayeredParticles, hash_run};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
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
        output::write_atomic(&path, |to| write(self, chunk, &sorted, to))
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

const MAGIC: &[u8; 8] = b"PGSCHNK1";
const HEAD: usize = 8 + 32 + 8 + 8 + 4;

fn entry_bytes(job: &JobFolder) -> usize {
    8 + 8 * job.manifest.plan.layers.len() + 4 + 4
}

/// Bytes of particles, by layer.
fn particle_bytes(job: &JobFolder, counts: &[u64]) -> Option<u64> {
    let mut layers = counts.iter().enumerate();
    layers.try_fold(0u64, |n, (l, c)| c.checked_mul(4 * job.columns(l) as u64)?.checked_add(n))
}

/// A run's particles sorted by block.
#[derive(Default)]
struct SortedRun {
    layer: usize,
    /// Blocks that have particles here, rising, and how many.
    blocks: Vec<(u32, u32)>,
    /// x, y, z, weights, fields.
    columns: Vec<Vec<f32>>,
}

/// The chunk's bucket file, from its runs in order.
fn write(job: &JobFolder, chunk: u64, runs: &[SortedRun], to: &mut dyn Write) -> std::io::Result<()> {
    let (blocks, layers) = (job.manifest.plan.recipe().blocks, job.manifest.plan.layers.len());
    let mut offset = (HEAD + blocks as usize * entry_bytes(job)) as u64;
    let mut entries = Vec::with_capacity(offset as usize - HEAD);
    let mut cursor = RunCursor::new(runs);
    // The entries hold offsets and checksums and stand before the particles, which are therefore passed over twice.
    for block in 0..blocks {
        let mut entry = offset.to_le_bytes().to_vec();
        let mut crc = crc32fast::Hasher::new();
        for pieces in cursor.of_block(block, layers) {
            entry.extend(pieces.iter().map(|p| p.len() as u64).sum::<u64>().to_le_bytes());
            columns(runs, &pieces, |bytes| {
                offset += bytes.len() as u64;
                crc.update(bytes);
                Ok(())
            })?;
        }
        entry.extend(crc.finalize().to_le_bytes());
        entry.extend(crc32fast::hash(&entry).to_le_bytes());
        entries.extend(entry);
    }
    let mut head = [&MAGIC[..], &job.id, &chunk.to_le_bytes(), &offset.to_le_bytes()].concat();
    head.extend(crc32fast::hash(&head).to_le_bytes());
    to.write_all(&head)?;
    to.write_all(&entries)?;
    let mut cursor = RunCursor::new(runs);
    for block in 0..blocks {
        for pieces in cursor.of_block(block, layers) {
            columns(runs, &pieces, |bytes| to.write_all(bytes))?;
        }
    }
    Ok(())
}

struct RunPiece {
    run: usize,
    start: usize,
    end: usize,
}

impl RunPiece {
    fn len(&self) -> usize {
        self.end - self.start
    }
}

/// The place in each run while blocks are taken in rising order.
struct RunCursor<'a> {
    runs: &'a [SortedRun],
    /// The next of the run's blocks, and the beginning of its particles.
    at: Vec<(usize, usize)>,
}

impl<'a> RunCursor<'a> {
    fn new(runs: &'a [SortedRun]) -> Self {
        RunCursor { runs, at: vec![(0, 0); runs.len()] }
    }

    /// The parts that lie in `block`, by layer.
    fn of_block(&mut self, block: u32, layers: usize) -> Vec<Vec<RunPiece>> {
        let mut layer_pieces: Vec<Vec<RunPiece>> = (0..layers).map(|_| Vec::new()).collect();
        for (run, (next, start)) in self.at.iter_mut().enumerate() {
            let sorted = &self.runs[run];
            if let Some(&(b, n)) = sorted.blocks.get(*next)
                && b == block
            {
                layer_pieces[sorted.layer].push(RunPiece { run, start: *start, end: *start + n as usize });
                (*next, *start) = (*next + 1, *start + n as usize);
            }
        }
        layer_pieces
    }
}

/// The bytes of some parts of one layer, column after column.
fn columns(
    runs: &[SortedRun],
    pieces: &[RunPiece],
    mut to: impl FnMut(&[u8]) -> std::io::Result<()>,
) -> std::io::Result<()> {
    // All of one layer.
    let width = pieces.first().map_or(0, |p| runs[p.run].columns.len());
    for k in 0..width {
        for p in pieces {
            to(bytemuck::cast_slice(&runs[p.run].columns[k][p.start..p.end]))?;
        }
    }
    Ok(())
}

/// A chunk's file, opened.
pub(super) struct Buckets<'a> {
    job: &'a JobFolder,
    chunk: u64,
    file: File,
    length: u64,
    path: PathBuf,
}

pub(super) struct BucketEntry {
    pub counts: Vec<u64>,
    offset: u64,
    bytes: u64,
    crc: u32,
}

impl<'a> Buckets<'a> {
    /// Opens the buckets of a chunk: they are there, of this plan, and whole.
    pub(super) fn open(job: &'a JobFolder, chunk: u64) -> Result<Self> {
        let path = job.chunk_path(chunk);
        let (mut file, length) = open_file(&path).map_err(|e| match e {
            Error::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                Error::input_with(&path, "this chunk has not been sorted yet", job.run_again("scatter", chunk, false))
            }
            other => other,
        })?;
        let mut head = [0; HEAD];
        let read = file.read_exact(&mut head);
        let buckets = Buckets { job, chunk, file, length, path };
        read.map_err(|_| buckets.broken("the file is incomplete"))?;
        let (body, crc) = head.split_at(HEAD - 4);
        // The head states the length, so that a file cut short in a copy is known without reading it through.
        if &body[..8] != MAGIC || crc32fast::hash(body).to_le_bytes() != crc || body[48..56] != length.to_le_bytes() {
            return Err(buckets.broken("the file is incomplete or was changed"));
        }
        if body[8..40] != job.id || body[40..48] != chunk.to_le_bytes() {
            return Err(buckets.broken("the file belongs to another plan"));
        }
        Ok(buckets)
    }

    fn broken(&self, fault: &str) -> Error {
        Error::input_with(&self.path, fault, self.job.run_again("scatter", self.chunk, true))
    }

    pub(super) fn entry(&mut self, block: u32) -> Result<BucketEntry> {
        let mut bytes = vec![0; entry_bytes(self.job)];
        self.read_at((HEAD + block as usize * bytes.len()) as u64, &mut bytes)?;
        let (body, crc) = bytes.split_at(bytes.len() - 4);
        let u64_at = |at: usize| u64::from_le_bytes(std::array::from_fn(|b| body[at + b]));
        let counts: Vec<u64> = (0..self.job.manifest.plan.layers.len()).map(|l| u64_at(8 + 8 * l)).collect();
        let planned = counts.iter().zip(&self.job.manifest.plan.layers).all(|(n, l)| *n <= l.content);
        // Within the file, before memory is taken for them.
        let inside = |b: &u64| u64_at(0).checked_add(*b).is_some_and(|end| end <= self.length);
        let length = particle_bytes(self.job, &counts).filter(|b| planned && inside(b));
        match length {
            Some(bytes) if crc32fast::hash(body).to_le_bytes() == crc => {
                let crc = u32::from_le_bytes(std::array::from_fn(|b| body[body.len() - 4 + b]));
                Ok(BucketEntry { offset: u64_at(0), bytes, crc, counts })
            }
            _ => Err(self.broken("the file was changed")),
        }
    }

    /// The columns of a block's layers, one after the other, checked.
    pub(super) fn read(&mut self, entry: &BucketEntry) -> Result<Vec<f32>> {
        let mut values = vec![0f32; entry.bytes as usize / 4];
        self.read_at(entry.offset, bytemuck::cast_slice_mut(&mut values))?;
        if crc32fast::hash(bytemuck::cast_slice(&values)) != entry.crc {
            return Err(self.broken("the particles in the file were changed"));
        }
        Ok(values)
    }

    fn read_at(&mut self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        let read = self.file.seek(SeekFrom::Start(offset)).and_then(|_| self.file.read_exact(bytes));
        read.map_err(|e| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => self.broken("the file is incomplete"),
            _ => Error::io(&self.path, e),
        })
    }

    pub(super) fn check(&mut self) -> Result<()> {
        (0..self.job.manifest.plan.recipe().blocks).try_for_each(|b| {
            let entry = self.entry(b)?;
            self.read(&entry).map(drop)
        })
    }
}
