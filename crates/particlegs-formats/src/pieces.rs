//! One reader for all formats whose rows can be read from any place.

use particlegs_core::context::Context;
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{Chunk, InPlace, RUN, RunSink, SnapshotMeta, SnapshotReader};
use std::ops::Range;

/// Rows as numbers, before they become f32 about an origin; the reader owns and reuses them.
#[derive(Default)]
pub struct RowBuffer {
    /// x, y, z, world units.
    pub position: [Vec<f64>; 3],
    /// Weights; empty without.
    pub weight: Vec<f64>,
}

impl RowBuffer {
    pub(crate) fn clear(&mut self) {
        self.position.iter_mut().for_each(Vec::clear);
        self.weight.clear();
    }

    /// x, y, z for 0, 1, 2; weights for 3.
    pub(crate) fn column(&mut self, which: usize) -> &mut Vec<f64> {
        self.position.get_mut(which).unwrap_or(&mut self.weight)
    }

    /// The rows as f32 about `origin`, in `columns`.
    pub(crate) fn chunk<'c>(&self, origin: [f64; 3], weighted: bool, columns: &'c mut [Vec<f32>; 4]) -> Chunk<'c> {
        columns.iter_mut().for_each(Vec::clear);
        for k in 0..3 {
            columns[k].extend(self.position[k].iter().map(|&v| (v - origin[k]) as f32));
        }
        columns[3].extend(self.weight.iter().map(|&v| v as f32));
        let [x, y, z, w] = &*columns;
        Chunk { position: [x, y, z], weight: weighted.then_some(w) }
    }
}

/// A stretch of particles in a file: one file of several, one rank, one array.
pub trait ParticlePiece: Send + Sync {
    fn rows(&self) -> u64;
    /// Whether positions are stored with more digits than f32 has.
    fn is_wide(&self) -> bool;
    /// Appends particles `rows` (within the piece's own) to every column of `out`.
    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()>;
    /// The particles where they lie as f32 columns or triples in a mapped file.
    fn in_place(&self) -> Option<InPlace> {
        None
    }
}

/// Pieces one after the other, read as one snapshot.
pub struct PieceReader {
    meta: SnapshotMeta,
    pieces: Vec<Box<dyn ParticlePiece>>,
    /// Particles before each piece, and in all.
    starts: Vec<u64>,
    weighted: bool,
    origin: [f64; 3],
    /// Runs that are read side by side at most.
    stretch: u64,
}

impl PieceReader {
    /// A snapshot of `pieces`, all with weights or none (`weighted`). Positions of more digits
    /// than f32 has are taken about an origin near the data where they lie far from 0.
    pub fn new(meta: SnapshotMeta, pieces: Vec<Box<dyn ParticlePiece>>, weighted: bool) -> Result<Self> {
        let mut starts = vec![0u64];
        for piece in &pieces {
            let before = starts[starts.len() - 1];
            // So few that an i64 counts the bytes of four f32 each.
            let after = before.checked_add(piece.rows()).filter(|&n| n <= i64::MAX as u64 / 16);
            starts.push(after.ok_or_else(|| Error::input(&meta.name, "too many particles to count"))?);
        }
        let mut sample = RowBuffer::default();
        for piece in pieces.iter().filter(|p| p.is_wide() && p.rows() > 0) {
            // From four places: files are often sorted in space.
            const SAMPLE: u64 = 1024;
            for place in 0..4 {
                let start = piece.rows().saturating_sub(SAMPLE) / 3 * place;
                piece.read(start..piece.rows().min(start + SAMPLE), &mut sample)?;
            }
            // A snapshot may have thousands of files; a million positions are enough to find the origin.
            if sample.position[0].len() > 1 << 20 {
                break;
            }
        }
        let origin = [0, 1, 2].map(|k| origin_of(&sample.position[k]));
        Ok(PieceReader { meta, pieces, starts, weighted, origin, stretch: u64::MAX })
    }

    /// Reads stretches of so many runs one after the other, so that few large chunks are in use at a time.
    pub fn by_stretches(self, stretch: u64) -> Self {
        PieceReader { stretch, ..self }
    }

    /// Appends particles `rows` to `out`, whatever the pieces.
    fn gather(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        // A run may begin in one piece and end in another.
        let mut index = self.starts.partition_point(|&s| s <= rows.start).saturating_sub(1);
        while index < self.pieces.len() && self.starts[index] < rows.end {
            let (start, end) = (self.starts[index], self.starts[index + 1]);
            let part = rows.start.max(start) - start..rows.end.min(end) - start;
            if !part.is_empty() {
                self.pieces[index].read(part, out)?;
            }
            index += 1;
        }
        let n = (rows.end - rows.start) as usize;
        let whole = out.position.iter().all(|c| c.len() == n) && out.weight.len() == if self.weighted { n } else { 0 };
        if whole { Ok(()) } else { Err(Error::input(&self.meta.name, "the columns have different lengths")) }
    }
}

impl SnapshotReader for PieceReader {
    fn meta(&self) -> &SnapshotMeta {
        &self.meta
    }

    fn count(&self) -> u64 {
        self.starts[self.starts.len() - 1]
    }

    fn has_weights(&self) -> bool {
        self.weighted
    }

    fn origin(&self) -> [f64; 3] {
        self.origin
    }

    fn read(&self, runs: Range<u64>, context: &Context<'_>, sink: &RunSink<'_>) -> Result<()> {
        let scratch = parallel::Scratch::<(RowBuffer, [Vec<f32>; 4])>::default();
        let read = |run: u64, (rows, columns): &mut (RowBuffer, [Vec<f32>; 4])| {
            context.check()?;
            let start = run * RUN as u64;
            let end = self.count().min(start + RUN as u64);
            rows.clear();
            self.gather(start..end, rows)?;
            sink(run, rows.chunk(self.origin, self.weighted, columns))?;
            context.advance(end - start);
            Ok(())
        };
        let mut start = runs.start;
        while start < runs.end {
            // Stretches begin at multiples of their length, wherever reading begins, as rows of chunks do.
            let end = runs.end.min((start / self.stretch + 1) * self.stretch);
            parallel::try_for_each(start..end, |run| scratch.with(|space| read(run, space)))?;
            start = end;
        }
        Ok(())
    }

    fn read_wide(&self, runs: Range<u64>, sink: &mut dyn FnMut(u64, [&[f64]; 3]) -> Result<()>) -> Result<()> {
        let mut rows = RowBuffer::default();
        for run in runs {
            rows.clear();
            let start = run * RUN as u64;
            self.gather(start..self.count().min(start + RUN as u64), &mut rows)?;
            let [x, y, z] = &rows.position;
            sink(run, [x, y, z])?;
        }
        Ok(())
    }

    fn in_place(&self) -> Option<InPlace> {
        match &self.pieces[..] {
            [one] => one.in_place(),
            _ => None,
        }
    }
}

/// The origin that f32 positions of a column are best relative to: 0 where 0 lies well inside the sample, so
/// that such data stay as they are, else the middle of the sample.
pub fn origin_of(sample: &[f64]) -> f64 {
    let finite = sample.iter().filter(|v| v.is_finite());
    let (lo, hi) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    // Halves first: the sum may overflow.
    let middle = 0.5 * lo + 0.5 * hi;
    if !middle.is_finite() || middle.abs() <= 2.0 * (hi - lo) { 0.0 } else { middle }
}
