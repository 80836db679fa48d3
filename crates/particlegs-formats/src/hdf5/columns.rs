//! Particles of one file, read from its data sets whatever their layout.

use super::storage::{Chunks, DataSetStorage, NumberTable};
use crate::cache::ChunkCache;
use crate::numbers::{Bytes, StridedColumn, StridedParticles};
use crate::pieces::{ParticlePiece, RowBuffer};
use particlegs_core::{Error, Result};
use particlegs_files::input::MappedFile;
use particlegs_particles::InPlace;
use std::ops::Range;
use std::sync::Arc;

/// A column of a table and where it goes.
#[derive(Clone, Copy)]
pub struct ColumnTarget {
    pub component: u64,
    /// 0, 1, 2 for x, y, z; 3 for weights.
    pub target: usize,
}

/// Columns of rows of one data set.
#[derive(Clone)]
pub struct DataSetPart {
    pub map: Arc<MappedFile>,
    pub rows: Range<u64>,
    pub table: Arc<NumberTable>,
    pub wants: Vec<ColumnTarget>,
    pub place: String,
    /// Its number, different from those of others that share the cache.
    pub key: u64,
}

impl DataSetPart {
    pub fn count(&self) -> u64 {
        self.rows.end - self.rows.start
    }
}

/// Chunks of a part that a key holds.
const KEY_BITS: u32 = 40;

pub struct DataSetColumns {
    rows: u64,
    parts: Vec<DataSetPart>,
    cache: Arc<ChunkCache>,
    sampled: bool,
    /// The same in one stretch each, where they lie so.
    flat: Option<StridedParticles>,
}

impl DataSetColumns {
    /// Particles in `parts`, which have the same number of rows. `sampled`: the reader may look here for the
    /// range of f64 positions.
    pub fn new(parts: Vec<DataSetPart>, cache: Arc<ChunkCache>, sampled: bool) -> Self {
        let rows = parts.first().map_or(0, DataSetPart::count);
        let flat = strided(&parts, rows);
        DataSetColumns { rows, parts, cache, sampled, flat }
    }
}

/// Rows of a row of chunks of a file's parts, and bytes of them decoded; `None` without chunks.
pub fn chunk_bytes(parts: &[DataSetPart]) -> Option<(u64, u64)> {
    let chunked = parts.iter().filter_map(|p| match &p.table.storage {
        DataSetStorage::Chunked(c) if !c.pipeline.is_plain(0) => {
            Some((c.rows.min(p.table.rows), c.bytes as u64 * c.across))
        }
        _ => None,
    });
    // Parts are decoded side by side: their bytes add up, their rows do not.
    chunked.reduce(|a, b| (a.0.max(b.0), a.1 + b.1))
}

/// All parts as lanes of the mapped file.
fn strided(parts: &[DataSetPart], rows: u64) -> Option<StridedParticles> {
    let map = &parts.first()?.map;
    let mut lanes: [Option<StridedColumn>; 4] = [None; 4];
    for part in parts {
        let DataSetStorage::Flat(offset) = part.table.storage else { return None };
        if part.table.packed.is_some() || !Arc::ptr_eq(map, &part.map) {
            return None;
        }
        let first = offset + part.rows.start * part.table.components * part.table.kind.bytes();
        for want in &part.wants {
            lanes[want.target] = Some(lane(&part.table, first, part.table.components, want.component));
        }
    }
    let [Some(x), Some(y), Some(z), weight] = lanes else { return None };
    let lanes: Vec<StridedColumn> = [x, y, z].into_iter().chain(weight).collect();
    StridedParticles::new("", Bytes::Mapped(map.clone()), rows, &lanes).ok()
}

/// Column `component` of rows of `components` numbers from byte `offset`.
fn lane(table: &NumberTable, offset: u64, components: u64, component: u64) -> StridedColumn {
    let bytes = table.kind.bytes();
    StridedColumn {
        offset: offset + component * bytes,
        stride: components * bytes,
        kind: table.kind,
        big_endian: table.big_endian,
    }
}

/// Appends rows `rows` of column `component` of rows of `components` numbers from byte `offset`.
fn append(
    table: &NumberTable,
    bytes: &[u8],
    [offset, components, component]: [u64; 3],
    rows: Range<u64>,
    out: &mut Vec<f64>,
) {
    let lane = lane(table, offset, components, component);
    match table.packed {
        None => lane.append(bytes, rows, out),
        Some(packed) => {
            let size = table.kind.bytes() as usize;
            out.extend(rows.map(|i| packed.get(&bytes[(lane.offset + i * lane.stride) as usize..][..size])));
        }
    }
}

impl ParticlePiece for DataSetColumns {
    fn rows(&self) -> u64 {
        self.rows
    }

    fn is_wide(&self) -> bool {
        let positions = |p: &&DataSetPart| p.wants.iter().any(|w| w.target < 3);
        self.sampled && self.parts.iter().filter(positions).any(|p| p.table.kind.is_wide())
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        if rows.is_empty() {
            return Ok(());
        }
        if let Some(flat) = &self.flat {
            return flat.read(rows, out);
        }
        for part in &self.parts {
            let rows = rows.start + part.rows.start..rows.end + part.rows.start;
            let (bytes, offset) = match &part.table.storage {
                DataSetStorage::Flat(offset) => (&part.map[..], *offset),
                DataSetStorage::Compact(bytes) => (&bytes[..], 0),
                DataSetStorage::Chunked(chunks) => {
                    self.read_chunks(part, chunks, rows, out)?;
                    continue;
                }
            };
            for want in &part.wants {
                let at = [offset, part.table.components, want.component];
                append(&part.table, bytes, at, rows.clone(), out.column(want.target));
            }
        }
        Ok(())
    }

    fn in_place(&self) -> Option<InPlace> {
        self.flat.as_ref()?.in_place()
    }
}

impl DataSetColumns {
    fn read_chunks(&self, part: &DataSetPart, chunks: &Chunks, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        // Chunks are a grid over the table: `down` counts along its rows, `side` along the numbers of a row.
        let mut scratch = Vec::new();
        for down in rows.start / chunks.rows..rows.end.div_ceil(chunks.rows) {
            let begin = down * chunks.rows;
            let end = part.table.rows.min(begin + chunks.rows);
            let inside = rows.start.max(begin) - begin..rows.end.min(end) - begin;
            let whole = inside.end - inside.start == end - begin;
            for side in 0..chunks.across {
                let here = |w: &&ColumnTarget| w.component / chunks.columns == side;
                if !part.wants.iter().any(|w| here(&w)) {
                    continue;
                }
                let index = down * chunks.across + side;
                let shuffled = chunks.pipeline.leaves_shuffled(chunks.places[index as usize].mask);
                self.with_chunk(part, chunks, index, whole, |bytes, offset| {
                    // Rows that are put together first begin at 0.
                    let (bytes, rows) = if shuffled {
                        let numbers = [inside.start, inside.end].map(|r| (chunks.before + r * chunks.columns) as usize);
                        chunks.pipeline.numbers(bytes, numbers[0]..numbers[1], &mut scratch);
                        (&scratch[..], 0..inside.end - inside.start)
                    } else {
                        (bytes, inside.clone())
                    };
                    let offset = if shuffled { offset } else { offset + chunks.before * part.table.kind.bytes() };
                    for want in part.wants.iter().filter(here) {
                        let at = [offset, chunks.columns, want.component % chunks.columns];
                        append(&part.table, bytes, at, rows.clone(), out.column(want.target));
                    }
                })?;
            }
        }
        Ok(())
    }

    /// Shows chunk `index` to `look`: in the file where it is not encoded; decoded for this once where all of
    /// it is wanted; else by way of the cache.
    fn with_chunk(
        &self,
        part: &DataSetPart,
        chunks: &Chunks,
        index: u64,
        whole: bool,
        look: impl FnOnce(&[u8], u64),
    ) -> Result<()> {
        let at = &chunks.places[index as usize];
        if chunks.pipeline.is_plain(at.mask) {
            look(&part.map, at.offset);
            return Ok(());
        }
        let stored = &part.map[at.offset as usize..(at.offset + at.size) as usize];
        let broken = |why: String| {
            let place =
                format!("{}, chunk from row {}, byte {}", part.place, index / chunks.across * chunks.rows, at.offset);
            Error::input_with(place, format!("it cannot be decoded: {why}"), "the file is damaged: copy it again")
        };
        let decode = || chunks.pipeline.undo(stored, at.mask, chunks.bytes).map_err(broken);
        // A chunk that is wanted whole is not wanted again; others are shared with neighbouring runs.
        if whole {
            look(&decode()?, 0);
        } else {
            let bytes = self.cache.get(part.key << KEY_BITS | index, || decode().map(|b| b.into_owned()))?;
            look(&bytes, 0);
        }
        Ok(())
    }
}
