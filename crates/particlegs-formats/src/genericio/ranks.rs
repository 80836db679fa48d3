//! The particles of a file's ranks: columns where they lie, or decompressed block by block.
//!
//! A rank's checksums are verified once, before its first number is handed over. Nothing is kept of
//! a rank but that: files of big runs have a million.

use super::header::{CRC, GenericIoFile, RankColumn};
use crate::blosc::BloscHeader;
use crate::cache::ChunkCache;
use crate::codecs::crc64;
use crate::numbers::{NumberType, StridedColumn, StridedParticles};
use crate::pieces::{ParticlePiece, RowBuffer};
use particlegs_core::{Error, Result};
use particlegs_particles::InPlace;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Blocks of a column of a rank that the keys of the cache can tell apart.
const MOST_BLOCKS: u64 = 1 << 24;

/// The columns that are read of a file: x, y, z and perhaps weights.
pub struct Ranks {
    file: Arc<GenericIoFile>,
    place: String,
    /// Indices of variables and types of their numbers.
    columns: Vec<(usize, NumberType)>,
    /// Particles before each rank, and in all.
    starts: Vec<u64>,
    /// Whether a rank's checksums were right, once they were checked.
    checked: Vec<OnceLock<bool>>,
    cache: ChunkCache,
}

impl Ranks {
    /// The variables `variables` (three or four indices) of `file`, decompressed blocks of about
    /// `cache` bytes kept, numbers as they are stored where `as_stored` is set.
    pub fn new(file: Arc<GenericIoFile>, variables: &[usize], cache: usize, as_stored: bool) -> Result<Ranks> {
        let place = file.path.display().to_string();
        let column = |&v: &usize| {
            let variable = &file.variables[v];
            let message = || {
                format!("variable {} has {} bytes per particle, which is not a number", variable.name, variable.size)
            };
            Ok((v, variable.kind.ok_or_else(|| Error::input(&place, message()))?.stored(as_stored)))
        };
        let columns = variables.iter().map(column).collect::<Result<_>>()?;
        let mut starts = Vec::with_capacity(file.ranks.len() + 1);
        starts.push(0);
        // The header's total is their sum, so that this does not overflow.
        starts.extend(file.ranks.iter().scan(0, |sum, r| {
            *sum += r.count;
            Some(*sum)
        }));
        let checked = file.ranks.iter().map(|_| OnceLock::new()).collect();
        Ok(Ranks { file, place, columns, starts, checked, cache: ChunkCache::new(cache) })
    }

    fn fault(&self, rank: usize, variable: usize, reason: &str) -> Error {
        let message = format!("variable {} of rank {rank}: {reason}", self.file.variables[variable].name);
        Error::input_with(&self.place, message, "the data are damaged: copy the file again from its source")
    }

    /// The checksums of a rank's columns, verified once.
    pub fn check(&self, rank: usize) -> Result<()> {
        // An error cannot be kept to be given again: a second look makes it anew.
        if *self.checked[rank].get_or_init(|| self.verify(rank).is_ok()) { Ok(()) } else { self.verify(rank) }
    }

    fn verify(&self, rank: usize) -> Result<()> {
        for &(variable, _) in &self.columns {
            let column = self.file.column(rank, variable)?;
            let (start, end) = (column.start as usize, (column.start + column.size) as usize);
            let sum = &self.file.bytes[end..end + CRC as usize];
            if (!crc64(&self.file.bytes[start..end])).to_le_bytes() != *sum {
                return Err(self.fault(rank, variable, "the checksum (CRC64) is wrong"));
            }
        }
        Ok(())
    }

    fn append(&self, rank: usize, index: usize, rows: Range<u64>, out: &mut Vec<f64>) -> Result<()> {
        let (variable, kind) = self.columns[index];
        let column = self.file.column(rank, variable)?;
        if column.blosc {
            return self.unpack(rank, index, &column, rows, out);
        }
        self.lane(&column, kind).append(&self.file.bytes, rows, out);
        Ok(())
    }

    fn lane(&self, column: &RankColumn, kind: NumberType) -> StridedColumn {
        StridedColumn { offset: column.start, stride: kind.bytes(), kind, big_endian: self.file.big_endian }
    }

    fn unpack(
        &self,
        rank: usize,
        index: usize,
        column: &RankColumn,
        rows: Range<u64>,
        out: &mut Vec<f64>,
    ) -> Result<()> {
        let (variable, kind) = self.columns[index];
        let fault = |message: String| self.fault(rank, variable, &message);
        let size = kind.bytes();
        // The chunk stands behind the checksum of what was compressed.
        let packed = self.file.bytes[column.start as usize..(column.start + column.size) as usize].get(CRC as usize..);
        let packed = packed.unwrap_or(&[]);
        let chunk = BloscHeader::parse(packed).map_err(fault)?;
        let count = self.file.ranks[rank].count;
        if count.checked_mul(size) != Some(chunk.length as u64) || !(chunk.block as u64).is_multiple_of(size) {
            return Err(fault(format!("{} bytes for {count} particles", chunk.length)));
        }
        if chunk.blocks() as u64 > MOST_BLOCKS {
            return Err(fault(format!("blocks of only {} bytes", chunk.block)));
        }
        // A rank has four columns at most: x, y, z and weights.
        let first_key = (4 * rank + index) as u64 * MOST_BLOCKS;
        let each = chunk.block as u64 / size;
        let lane = StridedColumn { offset: 0, stride: size, kind, big_endian: self.file.big_endian };
        let mut row = rows.start;
        while row < rows.end {
            let block = row / each;
            let decode = || chunk.decode(packed, block as usize).map_err(fault);
            let end = rows.end.min((block + 1) * each);
            // Neighbouring runs share the blocks at their ends; the others are decoded only once.
            let whole = end - row == each;
            let bytes = if whole { Arc::new(decode()?) } else { self.cache.get(first_key + block, decode)? };
            lane.append(&bytes, row - block * each..end - block * each, out);
            row = end;
        }
        Ok(())
    }

    /// The one rank with particles, where there is no other.
    fn only(&self) -> Option<usize> {
        let mut filled = (0..self.file.ranks.len()).filter(|&r| self.file.ranks[r].count > 0);
        filled.next().filter(|_| filled.next().is_none())
    }
}

impl ParticlePiece for Ranks {
    fn rows(&self) -> u64 {
        self.starts[self.starts.len() - 1]
    }

    fn is_wide(&self) -> bool {
        self.columns[..3].iter().any(|c| c.1.is_wide())
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        let mut rank = self.starts.partition_point(|&s| s <= rows.start).saturating_sub(1);
        while rank < self.checked.len() && self.starts[rank] < rows.end {
            let (start, end) = (self.starts[rank], self.starts[rank + 1]);
            let part = rows.start.max(start) - start..rows.end.min(end).max(start) - start;
            if !part.is_empty() {
                self.check(rank)?;
                for index in 0..self.columns.len() {
                    self.append(rank, index, part.clone(), out.column(index))?;
                }
            }
            rank += 1;
        }
        Ok(())
    }

    /// The columns in the file, if one rank has all, uncompressed, and its checksums are right.
    fn in_place(&self) -> Option<InPlace> {
        let rank = self.only()?;
        self.check(rank).ok()?;
        let lane = |&(variable, kind): &(usize, NumberType)| {
            let column = self.file.column(rank, variable).ok().filter(|c| !c.blosc)?;
            Some(self.lane(&column, kind))
        };
        let lanes: Vec<StridedColumn> = self.columns.iter().map(lane).collect::<Option<_>>()?;
        let plain = StridedParticles::new(&self.place, self.file.bytes.clone(), self.rows(), &lanes);
        plain.ok()?.in_place()
    }
}
