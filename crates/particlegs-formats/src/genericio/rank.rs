//! The particles of one rank: columns where they lie, or decompressed block by block. Checksums are
//! verified once, before a column's first number is handed over.

use super::blosc::Chunk;
use super::header::{CRC, Column, File};
use crate::cache::ChunkCache;
use crate::codecs::crc64;
use crate::pieces::{Piece, Rows};
use crate::strided::{Bytes, Kind, Lane, Strided};
use particlegs::particles::InPlace;
use particlegs::{Error, Result};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// A column of a rank.
struct Source {
    /// Its name.
    name: String,
    column: Column,
    kind: Kind,
    /// The chunk's header, where it is compressed.
    chunk: Option<Chunk>,
    /// The first key of its blocks in the cache.
    key: u64,
}

/// A rank's columns that are read: x, y, z and perhaps weights.
pub struct RankPiece {
    place: String,
    rank: usize,
    rows: u64,
    big_endian: bool,
    bytes: Bytes,
    sources: Vec<Source>,
    /// Where no column is compressed.
    plain: Option<Strided>,
    cache: Arc<ChunkCache>,
    checked: OnceLock<std::result::Result<(), (String, String)>>,
}

impl RankPiece {
    /// Rank `rank` of `file` with `variables` (three or four indices). `cache` is shared by all
    /// ranks, which count their blocks from `first_key`, set to what follows.
    ///
    /// # Errors
    /// [`Error::Input`] where a column ends beyond the file or a chunk's header is wrong.
    pub fn new(
        file: &File,
        rank: usize,
        variables: &[usize],
        cache: &Arc<ChunkCache>,
        first_key: &mut u64,
    ) -> Result<RankPiece> {
        let place = file.path.display().to_string();
        let rows = file.ranks[rank].count;
        let mut sources = Vec::new();
        for &v in variables {
            let variable = &file.variables[v];
            let kind = variable.kind.ok_or_else(|| {
                let what = format!("variable {} has {} bytes a particle: no number", variable.name, variable.size);
                Error::input(&place, what)
            })?;
            let column = file.column(rank, v)?;
            let name = variable.name.clone();
            let fault = |what: String| Error::input(&place, format!("variable {name} of rank {rank}: {what}"));
            let chunk = if column.blosc {
                let chunk = Chunk::parse(blosc_bytes(&file.bytes, &column).unwrap_or(&[])).map_err(fault)?;
                if rows.checked_mul(kind.bytes()) != Some(chunk.length as u64)
                    || !(chunk.block as u64).is_multiple_of(kind.bytes())
                {
                    return Err(fault(format!("{} bytes for {rows} particles", chunk.length)));
                }
                Some(chunk)
            } else {
                None
            };
            let key = *first_key;
            *first_key += chunk.map_or(0, |c| c.blocks() as u64);
            sources.push(Source { name: variable.name.clone(), column, kind, chunk, key });
        }
        let lane = |s: &Source| Lane {
            offset: s.column.start,
            stride: s.kind.bytes(),
            kind: s.kind,
            big_endian: file.big_endian,
        };
        let plain = if sources.iter().all(|s| s.chunk.is_none()) {
            let axes = [lane(&sources[0]), lane(&sources[1]), lane(&sources[2])];
            Some(Strided::new(&place, file.bytes.clone(), rows, axes, sources.get(3).map(lane))?)
        } else {
            None
        };
        let (bytes, cache) = (file.bytes.clone(), cache.clone());
        let big_endian = file.big_endian;
        Ok(RankPiece { place, rank, rows, big_endian, bytes, sources, plain, cache, checked: OnceLock::new() })
    }

    /// The checksums of its columns, verified once.
    ///
    /// # Errors
    /// [`Error::Input`] naming rank and variable of a wrong one.
    pub fn check(&self) -> Result<()> {
        let outcome = self.checked.get_or_init(|| {
            for source in &self.sources {
                let (start, size) = (source.column.start as usize, source.column.size as usize);
                let sum = &self.bytes[start + size..][..CRC as usize];
                if (!crc64(&self.bytes[start..start + size])).to_le_bytes() != *sum {
                    let what =
                        format!("the checksum (CRC64) of variable {} of rank {} is wrong", source.name, self.rank);
                    return Err((self.place.clone(), what));
                }
            }
            Ok(())
        });
        let hint = "the data are damaged: copy the file again from its source";
        outcome.clone().map_err(|(place, what)| Error::input_hint(place, what, hint))
    }

    /// Appends rows of a compressed column.
    fn append(&self, source: &Source, chunk: &Chunk, rows: Range<u64>, out: &mut Vec<f64>) -> Result<()> {
        let size = source.kind.bytes();
        let each = chunk.block as u64 / size;
        let packed = blosc_bytes(&self.bytes, &source.column).unwrap_or(&[]);
        let mut row = rows.start;
        while row < rows.end {
            let block = row / each;
            let bytes = self.cache.get(source.key + block, || {
                let fault =
                    |e| Error::input(&self.place, format!("variable {} of rank {}: {e}", source.name, self.rank));
                chunk.decode(packed, block as usize).map_err(fault)
            })?;
            let end = rows.end.min((block + 1) * each);
            let lane = Lane { offset: 0, stride: size, kind: source.kind, big_endian: self.big_endian };
            lane.append(&bytes, row - block * each..end - block * each, out);
            row = end;
        }
        Ok(())
    }
}

/// The chunk behind the checksum of what was compressed.
fn blosc_bytes<'a>(bytes: &'a Bytes, column: &Column) -> Option<&'a [u8]> {
    let start = column.start.checked_add(CRC)?;
    bytes.get(usize::try_from(start).ok()?..usize::try_from(column.start.checked_add(column.size)?).ok()?)
}

impl Piece for RankPiece {
    fn rows(&self) -> u64 {
        self.rows
    }

    fn is_wide(&self) -> bool {
        self.sources[..3].iter().any(|s| s.kind.is_wide())
    }

    fn read(&self, rows: Range<u64>, out: &mut Rows) -> Result<()> {
        self.check()?;
        if let Some(plain) = &self.plain {
            return plain.read(rows, out);
        }
        let columns = out.position.iter_mut().chain([&mut out.weight]);
        for (source, column) in self.sources.iter().zip(columns) {
            match &source.chunk {
                Some(chunk) => self.append(source, chunk, rows.clone(), column)?,
                None => Lane {
                    offset: source.column.start,
                    stride: source.kind.bytes(),
                    kind: source.kind,
                    big_endian: self.big_endian,
                }
                .append(&self.bytes, rows.clone(), column),
            }
        }
        Ok(())
    }

    fn in_place(&self) -> Option<InPlace> {
        self.check().ok()?;
        self.plain.as_ref()?.in_place()
    }
}
