//! The header of a GenericIO file: variables, ranks, and where each rank's columns lie.

use crate::codecs::crc64;
use crate::numbers::{Bytes, NumberType};
use particlegs_core::{Error, Result};
use std::path::{Path, PathBuf};

/// Bytes of a checksum behind the header and behind every column.
pub const CRC: u64 = 8;

/// A column of every rank.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    pub name: String,
    /// Type of its numbers; `None` for one that is not known.
    pub kind: Option<NumberType>,
    pub size: u64,
    /// The axis of the positions that it is, if it is one.
    pub axis: Option<usize>,
}

/// A rank: the particles of one process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rank {
    pub count: u64,
    pub start: u64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct RankColumn {
    pub start: u64,
    /// Bytes, without the checksum.
    pub size: u64,
    /// Whether it is compressed by blosc, behind 8 bytes with the checksum of what was compressed.
    pub blosc: bool,
}

/// A file, mapped, its header checked.
pub struct GenericIoFile {
    pub path: PathBuf,
    pub bytes: Bytes,
    pub big_endian: bool,
    pub variables: Vec<Variable>,
    pub ranks: Vec<Rank>,
    /// Lowest corner of the box.
    pub origin: [f64; 3],
    /// Edges of the box; 0 where the file does not say.
    pub scale: [f64; 3],
    /// First byte and size of the headers of blocks, where there are some.
    blocks: Option<(u64, u64)>,
    /// Bytes a particle of the variables before each.
    before: Vec<u64>,
}

pub fn signature(bytes: &[u8]) -> Option<bool> {
    match bytes.get(..7)? {
        b"HACC01L" => Some(false),
        b"HACC01B" => Some(true),
        _ => None,
    }
}

/// More than files have: beyond, their tables would fill the memory.
const MOST_VARIABLES: u64 = 1024;
const MOST_RANKS: u64 = 1 << 21;

const HINT: &str = "the file is cut short or damaged: copy it again from its source";

impl GenericIoFile {
    pub fn open(path: &Path) -> Result<GenericIoFile> {
        let bytes = Bytes::from_file(path)?;
        let big_endian = signature(&bytes).ok_or_else(|| {
            Error::input_with(path, "not a GenericIO file", "GenericIO files begin with HACC01L or HACC01B")
        })?;
        let header = checked_header(path, &bytes, big_endian)?;
        let field = |at: u64| header.int(at);
        // Bytes of the global header, which grew with the versions of the format.
        let global = field(96)?;
        let three =
            |at: u64| -> Result<[f64; 3]> { Ok([header.real(at)?, header.real(at + 8)?, header.real(at + 16)?]) };
        // Older files have no box, then no blocks.
        let origin = if global >= 128 { three(104)? } else { [0.0; 3] };
        let scale = if global >= 152 { three(128)? } else { [0.0; 3] };
        let blocks = if global >= 168 { Some((field(160)?, field(152)?)).filter(|b| b.1 > 0) } else { None };
        let variables = header.variables()?;
        let ranks = header.ranks()?;
        if let Some((start, size)) = blocks {
            header.table(
                "block headers",
                start,
                size,
                48,
                (ranks.len() as u64).saturating_mul(variables.len() as u64),
            )?;
        }
        let total = ranks.iter().try_fold(0u64, |sum, r| sum.checked_add(r.count));
        if total != Some(field(16)?) {
            return Err(header.fault("the ranks' counts do not add up to the number of elements"));
        }
        let mut before = vec![0u64];
        for variable in &variables {
            let bytes = before[before.len() - 1].checked_add(variable.size);
            before.push(bytes.ok_or_else(|| header.fault("the variables are too large"))?);
        }
        Ok(GenericIoFile { path: path.into(), bytes, big_endian, variables, ranks, origin, scale, blocks, before })
    }

    pub fn variable(&self, name: &str) -> Option<usize> {
        self.variables.iter().position(|v| v.name == name)
    }

    /// The place of variable `variable` of rank `rank`: within the file, with its checksum behind it.
    pub fn column(&self, rank: usize, variable: usize) -> Result<RankColumn> {
        let Rank { count, start } = self.ranks[rank];
        let length = count.checked_mul(self.variables[variable].size);
        let column = match self.blocks {
            None => {
                // A rank's columns follow each other, each with its checksum behind it.
                let skipped = count.checked_mul(self.before[variable]);
                let start =
                    skipped.and_then(|n| n.checked_add(CRC * variable as u64)).and_then(|n| n.checked_add(start));
                start.zip(length).map(|(start, size)| RankColumn { start, size, blosc: false })
            }
            Some((start, size)) => {
                let index = (rank * self.variables.len() + variable) as u64;
                Some(self.block(rank, variable, start + index * size)?)
            }
        };
        let end = |c: &RankColumn| c.start.checked_add(c.size).and_then(|e| e.checked_add(CRC));
        let whole = |c: &RankColumn| c.blosc || length == Some(c.size);
        column.filter(|c| end(c).is_some_and(|e| e <= self.bytes.len() as u64) && whole(c)).ok_or_else(|| {
            let name = &self.variables[variable].name;
            let message = format!("variable {name} of rank {rank} ends beyond the file's {} bytes", self.bytes.len());
            Error::input_with(&self.path, message, HINT)
        })
    }

    /// Whether every column lies within the file.
    pub fn check(&self) -> Result<()> {
        for rank in 0..self.ranks.len() {
            // Without headers of blocks, columns follow each other: the last ends last.
            let first = if self.blocks.is_some() { 0 } else { self.variables.len().saturating_sub(1) };
            (first..self.variables.len()).try_for_each(|v| self.column(rank, v).map(drop))?;
        }
        Ok(())
    }

    /// From the header of a block, within the header.
    fn block(&self, rank: usize, variable: usize, at: u64) -> Result<RankColumn> {
        let header = HeaderBytes { path: &self.path, bytes: &self.bytes, big_endian: self.big_endian };
        let filter = header.name(at, 8)?;
        let blosc = match &filter[..] {
            "" => false,
            "BLOSC" if header.name(at + 8, 8)?.is_empty() => true,
            other => {
                let name = &self.variables[variable].name;
                let message = format!("variable {name} of rank {rank} uses the unknown filter `{other}`");
                return Err(Error::input_with(&self.path, message, "write the file without this filter"));
            }
        };
        Ok(RankColumn { start: header.int(at + 32)?, size: header.int(at + 40)?, blosc })
    }
}

struct HeaderBytes<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    big_endian: bool,
}

/// The header, cut out of the file, its checksum checked.
fn checked_header<'a>(path: &'a Path, bytes: &'a [u8], big_endian: bool) -> Result<HeaderBytes<'a>> {
    let all = HeaderBytes { path, bytes, big_endian };
    let size = all.int(8)?;
    let end = size.checked_add(CRC).filter(|&e| size >= 104 && e <= bytes.len() as u64);
    if end.is_none() {
        let message = format!("the header says that it has {size} bytes, but the file has only {}", bytes.len());
        return Err(Error::input_with(path, message, HINT));
    }
    let (header, rest) = bytes.split_at(size as usize);
    // The sum is stored inverted, little-endian in either byte order.
    if (!crc64(header)).to_le_bytes() != rest[..CRC as usize] {
        return Err(Error::input_with(path, "the checksum (CRC64) of the header is wrong", HINT));
    }
    Ok(HeaderBytes { path, bytes: header, big_endian })
}

impl HeaderBytes<'_> {
    fn fault(&self, message: &str) -> Error {
        Error::input_with(self.path, format!("damaged GenericIO header: {message}"), HINT)
    }

    fn slice(&self, at: u64, n: usize) -> Result<&[u8]> {
        let at = usize::try_from(at).ok();
        at.and_then(|at| self.bytes.get(at..at.checked_add(n)?)).ok_or_else(|| self.fault("it is cut short"))
    }

    fn int(&self, at: u64) -> Result<u64> {
        let eight: [u8; 8] = self.slice(at, 8)?.try_into().expect("eight bytes");
        Ok(if self.big_endian { u64::from_be_bytes(eight) } else { u64::from_le_bytes(eight) })
    }

    fn real(&self, at: u64) -> Result<f64> {
        let value = f64::from_bits(self.int(at)?);
        if value.is_finite() { Ok(value) } else { Err(self.fault("the box is not finite")) }
    }

    /// Text up to the first 0.
    fn name(&self, at: u64, n: usize) -> Result<String> {
        let bytes = self.slice(at, n)?;
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(n);
        Ok(String::from_utf8_lossy(&bytes[..end]).replace(char::is_control, "?"))
    }

    /// A table of `count` entries of `size` bytes, each at least `least`, within the header.
    fn table(&self, table_name: &str, start: u64, size: u64, least: u64, count: u64) -> Result<()> {
        let most = match table_name {
            "variables" => MOST_VARIABLES,
            "ranks" => MOST_RANKS,
            _ => u64::MAX,
        };
        if count > most {
            return Err(self.fault(&format!("{count} {table_name}, at most {most} are supported")));
        }
        let end = count.checked_mul(size).and_then(|n| n.checked_add(start));
        if size < least || end.is_none_or(|e| e > self.bytes.len() as u64) {
            return Err(self.fault(&format!("the {count} {table_name} end beyond the file")));
        }
        Ok(())
    }

    fn variables(&self) -> Result<Vec<Variable>> {
        let (count, size, start) = (self.int(48)?, self.int(56)?, self.int(64)?);
        self.table("variables", start, size, 272, count)?;
        let variable = |i: u64| {
            let at = start + i * size;
            let (flags, bytes) = (self.int(at + 256)?, self.int(at + 264)?);
            // Bits of the flags: 1 for real numbers, 2 for signed ones, then one each for x, y and z.
            let kind = match flags & 1 {
                1 => NumberType::float(bytes),
                _ => NumberType::integer(bytes, flags & 2 != 0),
            };
            let axis = (0..3).find(|k| flags & (4 << k) != 0);
            Ok(Variable { name: self.name(at, 256)?, kind, size: bytes, axis })
        };
        (0..count).map(variable).collect()
    }

    fn ranks(&self) -> Result<Vec<Rank>> {
        let (count, size, start) = (self.int(72)?, self.int(80)?, self.int(88)?);
        self.table("ranks", start, size, 40, count)?;
        let rank = |i: u64| {
            let at = start + i * size;
            Ok(Rank { count: self.int(at + 24)?, start: self.int(at + 32)? })
        };
        (0..count).map(rank).collect()
    }
}
