//! Particles in compressed data, which can only be read in order.

use crate::affine::Affine;
use crate::numbers::StridedColumn;
use crate::pieces::{RowBuffer, origin_of};
use crate::stored_bytes::StoredBytes;
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_particles::{RUN, RunSink, SnapshotMeta, SnapshotReader};
use std::io::Read;
use std::ops::Range;

/// A column in a stored stretch: records of `lane.stride` bytes begin at byte `base` of its
/// content, and hold the number at byte `lane.offset`.
#[derive(Clone)]
pub struct StreamColumn {
    pub stored: usize,
    /// Byte of the first record.
    pub base: u64,
    pub lane: StridedColumn,
}

/// Columns of the same records: read by one pass.
struct RecordGroup {
    stored: usize,
    base: u64,
    stride: u64,
    /// Column (x, y, z, weight) and its place in the record.
    lanes: Vec<(usize, StridedColumn)>,
}

/// Reads columns of compressed stretches in lockstep, in memory of some megabytes.
pub struct StreamReader {
    meta: SnapshotMeta,
    place: String,
    stored: Vec<StoredBytes>,
    groups: Vec<RecordGroup>,
    count: u64,
    weighted: bool,
    world: Affine,
    origin: [f64; 3],
}

/// Bytes of records decoded at once.
const BLOCK: usize = 1 << 18;

impl StreamReader {
    pub fn new(
        meta: SnapshotMeta,
        place: &str,
        stored: Vec<StoredBytes>,
        columns: &[StreamColumn],
        count: u64,
        world: Affine,
    ) -> Result<Self> {
        let mut groups: Vec<RecordGroup> = Vec::new();
        for (which, column) in columns.iter().enumerate() {
            let lane = column.lane;
            let absolute = StridedColumn { offset: lane.offset.saturating_add(column.base), ..lane };
            let inside = lane.offset.checked_add(lane.kind.bytes()).is_some_and(|end| end <= lane.stride);
            if !inside || lane.stride > BLOCK as u64 || !absolute.fits(count, stored[column.stored].size() as usize) {
                return Err(Error::input(place, format!("the header says {count} particles, but the data end early")));
            }
            let same = |g: &&mut RecordGroup| (g.stored, g.base, g.stride) == (column.stored, column.base, lane.stride);
            match groups.iter_mut().find(same) {
                Some(group) => group.lanes.push((which, lane)),
                None => groups.push(RecordGroup {
                    stored: column.stored,
                    base: column.base,
                    stride: lane.stride,
                    lanes: vec![(which, lane)],
                }),
            }
        }
        let wide = columns.iter().take(3).any(|c| c.lane.kind.is_wide());
        let weighted = columns.len() > 3;
        let mut reader =
            StreamReader { meta, place: place.into(), stored, groups, count, weighted, world, origin: [0.0; 3] };
        if wide {
            let mut rows = RowBuffer::default();
            // The data can only be read in order: the first run stands for all.
            let n = count.min(RUN as u64);
            for mut cursor in reader.cursors(0)? {
                cursor.fill(n, &mut rows).map_err(|e| reader.broken(e))?;
            }
            reader.world.apply_rows(&mut rows, 0);
            reader.origin = [0, 1, 2].map(|k| origin_of(&rows.position[k]));
        }
        Ok(reader)
    }

    fn broken(&self, error: std::io::Error) -> Error {
        let hint = "the file is damaged or cut short: copy it again";
        Error::input_with(&self.place, format!("its compressed data cannot be read: {error}"), hint)
    }

    /// One cursor a group, at row `row`.
    fn cursors(&self, row: u64) -> Result<Vec<Cursor<'_>>> {
        let open = |group| -> std::io::Result<Cursor<'_>> {
            let group: &RecordGroup = group;
            let mut stream = self.stored[group.stored].open()?;
            let skip = group.base + row * group.stride;
            std::io::copy(&mut (&mut stream).take(skip), &mut std::io::sink())?;
            Ok(Cursor { stream, group, block: Vec::new() })
        };
        self.groups.iter().map(|g| open(g).map_err(|e| self.broken(e))).collect()
    }
}

struct Cursor<'a> {
    stream: Box<dyn Read + Send + 'a>,
    group: &'a RecordGroup,
    block: Vec<u8>,
}

impl Cursor<'_> {
    fn fill(&mut self, mut rows: u64, out: &mut RowBuffer) -> std::io::Result<()> {
        let stride = self.group.stride.max(1);
        while rows > 0 {
            // Whole records, and few enough that many wide columns take no more memory than narrow ones.
            let n = rows.min((BLOCK as u64 / stride).max(1));
            self.block.resize((n * stride) as usize, 0);
            self.stream.read_exact(&mut self.block)?;
            for (which, lane) in &self.group.lanes {
                lane.append(&self.block, 0..n, out.column(*which));
            }
            rows -= n;
        }
        Ok(())
    }

    /// Reads what is left, so that checksums are checked.
    fn finish(mut self) -> std::io::Result<()> {
        std::io::copy(&mut self.stream, &mut std::io::sink()).map(drop)
    }
}

impl SnapshotReader for StreamReader {
    fn meta(&self) -> &SnapshotMeta {
        &self.meta
    }

    fn count(&self) -> u64 {
        self.count
    }

    fn has_weights(&self) -> bool {
        self.weighted
    }

    fn origin(&self) -> [f64; 3] {
        self.origin
    }

    fn random_access(&self) -> bool {
        false
    }

    fn read(&self, runs: Range<u64>, context: &Context<'_>, sink: &RunSink<'_>) -> Result<()> {
        let mut columns = <[Vec<f32>; 4]>::default();
        self.rows(runs, &mut |run, rows| {
            context.check()?;
            sink(run, rows.chunk(self.origin, self.weighted, &mut columns))?;
            context.advance(rows.position[0].len() as u64);
            Ok(())
        })
    }

    fn read_wide(&self, runs: Range<u64>, sink: &mut dyn FnMut(u64, [&[f64]; 3]) -> Result<()>) -> Result<()> {
        self.rows(runs, &mut |run, rows| {
            let [x, y, z] = &rows.position;
            sink(run, [x, y, z])
        })
    }
}

impl StreamReader {
    /// Hands over the rows of every run of `runs`, in order.
    fn rows(&self, runs: Range<u64>, sink: &mut dyn FnMut(u64, &RowBuffer) -> Result<()>) -> Result<()> {
        if runs.is_empty() {
            return Ok(());
        }
        let mut cursors = self.cursors(runs.start * RUN as u64)?;
        let mut rows = RowBuffer::default();
        for run in runs.clone() {
            let start = run * RUN as u64;
            let n = self.count.min(start + RUN as u64) - start;
            rows.clear();
            for cursor in &mut cursors {
                cursor.fill(n, &mut rows).map_err(|e| self.broken(e))?;
            }
            self.world.apply_rows(&mut rows, 0);
            sink(run, &rows)?;
        }
        // A checksum covers all of the data: it can be compared at their end alone.
        if runs.end * RUN as u64 >= self.count {
            cursors.into_iter().try_for_each(|c| c.finish().map_err(|e| self.broken(e)))?;
        }
        Ok(())
    }
}
