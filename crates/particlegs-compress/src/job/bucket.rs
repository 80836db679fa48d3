//! `scatter/00000.bin`: the particles of a chunk of the snapshot, sorted by block.
//!
//! Little-endian: a head (magic, the plan's id, u64 chunk, u64 length of the file, CRC-32 of these); for
//! each block an entry (u64 offset of its particles, for each layer u64 particles, u32 CRC-32 of their
//! bytes, CRC-32 of the entry); then the particles, block after block, layer after layer: x, y, z, and
//! where the layer has them weights and fields, as f32 columns. One block is read without the others.

use super::manifest::JobFolder;
use particlegs_core::{Error, Result};
use particlegs_files::input::open_file;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

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
pub(super) struct SortedRun {
    pub layer: usize,
    /// Blocks that have particles here, rising, and how many.
    pub blocks: Vec<(u32, u32)>,
    /// x, y, z, weights, fields.
    pub columns: Vec<Vec<f32>>,
}

/// The chunk's bucket file, from its runs in order.
pub(super) fn write(job: &JobFolder, chunk: u64, runs: &[SortedRun], to: &mut dyn Write) -> std::io::Result<()> {
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
