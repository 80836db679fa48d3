//! One file of a snapshot: its header and where each block lies.

use super::header::{GadgetHeader, GadgetRecord, HEADER, Records, TYPES};
use super::order;
use crate::numbers::{Bytes, NumberType, StridedColumn};
use particlegs_core::{Error, Result};
use std::path::{Path, PathBuf};

/// Numbers of some types of particles, one type after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct GadgetBlock {
    /// Name, without trailing blanks.
    pub name: String,
    pub offset: u64,
    pub kind: NumberType,
    pub components: u32,
    pub types: [bool; TYPES],
}

pub struct GadgetFile {
    pub path: PathBuf,
    pub bytes: Bytes,
    pub big_endian: bool,
    /// Whether blocks have names (format 2).
    pub named: bool,
    pub header: GadgetHeader,
    pub blocks: Vec<GadgetBlock>,
    /// Blocks whose length tells no layout, by name.
    pub unknown: Vec<String>,
    /// Names of the blocks of format 1 in order, where they were told by what they hold.
    pub order: Vec<String>,
}

/// More blocks than any code writes; stops before a file of zeros fills the memory.
const MOST_BLOCKS: usize = 1024;

/// Byte order and format by the first record; `None` for no Gadget file. A file that is cut before
/// the record's end passes, so that the fault can be named.
pub fn signature(bytes: &[u8]) -> Option<(bool, bool)> {
    for big_endian in [false, true] {
        let records = Records { bytes, big_endian };
        let closes = |mark, at| records.mark(at).is_none_or(|m| m == mark);
        match records.mark(0)? {
            8 if closes(8, 12) && b"HEAD".starts_with(&bytes[4..bytes.len().min(8)]) => {
                return Some((big_endian, true));
            }
            256 if closes(256, 260) => return Some((big_endian, false)),
            _ => {}
        }
    }
    None
}

impl GadgetFile {
    /// Maps a file and finds its blocks; those of format 1 are called as `stated`, where anything is.
    pub fn open(path: &Path, stated: &[String]) -> Result<GadgetFile> {
        let bytes = Bytes::from_file(path)?;
        let (big_endian, named) = signature(&bytes).ok_or_else(|| {
            let hint = "a Gadget file begins with the record length 256 (format 1) or 8 (format 2)";
            Error::input_with(path, "not a Gadget binary snapshot", hint)
        })?;
        let records = Records { bytes: &bytes, big_endian };
        let mut block_records = named_records(path, &records, named)?.into_iter();
        let head = block_records.next().filter(|(name, r)| name == "HEAD" && r.length == HEADER as u64);
        let (_, head) = head.ok_or_else(|| Error::input(path, "the first record is not a 256-byte Gadget header"))?;
        let header = GadgetHeader::parse(path, &bytes[head.offset as usize..][..HEADER], big_endian)?;
        let (path, blocks, unknown) = (path.to_path_buf(), vec![], vec![]);
        let mut part = GadgetFile { path, bytes, big_endian, named, header, blocks, unknown, order: vec![] };
        match named {
            true if !stated.is_empty() => {
                return Err(Error::input(&part.path, "format 2 names its own blocks: give no names"));
            }
            true => part.place_named(block_records)?,
            false => part.place_plain(&block_records.map(|(_, record)| record).collect::<Vec<_>>(), stated)?,
        }
        if part.header.particles() > 0 && part.block("POS").is_none() {
            return Err(part.cut("there is no block POS"));
        }
        Ok(part)
    }

    pub fn block(&self, name: &str) -> Option<&GadgetBlock> {
        self.blocks.iter().find(|b| b.name == name)
    }

    /// The place of component `component` of a block's particles of type `t`.
    pub fn lane(&self, block: &GadgetBlock, t: usize, component: u32) -> StridedColumn {
        let size = block.kind.bytes();
        let row = size * u64::from(block.components);
        let before: u64 = (0..t).filter(|&u| block.types[u]).map(|u| u64::from(self.header.count[u])).sum();
        let offset = block.offset + before * row + size * u64::from(component);
        StridedColumn { offset, stride: row, kind: block.kind, big_endian: self.big_endian }
    }

    fn cut(&self, message: impl Into<String>) -> Error {
        Error::input_with(&self.path, message, CUT)
    }

    fn place_named(&mut self, records: impl Iterator<Item = (String, GadgetRecord)>) -> Result<()> {
        for (name, record) in records {
            match self.place(&name, record)? {
                Some(block) => self.blocks.push(block),
                None => self.unknown.push(name),
            }
        }
        Ok(())
    }

    /// Format 1 has no names: the user's, else what lengths and values tell.
    fn place_plain(&mut self, records: &[GadgetRecord], stated: &[String]) -> Result<()> {
        if stated.len() > records.len() {
            let message =
                format!("{} block names were given, but {} blocks follow the header", stated.len(), records.len());
            return Err(Error::input(&self.path, message));
        }
        if stated.is_empty() {
            self.order = order::names(
                &self.path,
                &self.header,
                Records { bytes: &self.bytes, big_endian: self.big_endian },
                records,
            )?;
        }
        let names = if stated.is_empty() { self.order.clone() } else { stated.to_vec() };
        let passed_over = std::iter::repeat_n(order::NONE.to_string(), records.len() - names.len());
        for (name, &record) in names.into_iter().chain(passed_over).zip(records) {
            let block = if name == order::NONE { None } else { self.place(&name, record)? };
            match block {
                Some(block) => self.blocks.push(block),
                None if stated.contains(&name) && name != order::NONE => {
                    let message = format!("block {name} at byte {} has {} bytes", record.offset, record.length);
                    return Err(Error::input_with(&self.path, message, "the counts in the header need another size"));
                }
                None => self.unknown.push(format!("at byte {}", record.offset)),
            }
        }
        Ok(())
    }

    /// The types that a block holds and its layout: by what codes write under its name, and by its length.
    fn place(&self, name: &str, record: GadgetRecord) -> Result<Option<GadgetBlock>> {
        let count = |types: &[bool; TYPES]| -> u64 {
            (0..TYPES).filter(|&t| types[t]).map(|t| u64::from(self.header.count[t])).sum()
        };
        // Codes write all real numbers in the precision of the positions: that is tried first.
        let real = self.block("POS").map_or(NumberType::F32, |b| b.kind);
        let reals = [real, if real == NumberType::F32 { NumberType::F64 } else { NumberType::F32 }];
        let (all, gas) = ([true; TYPES], [true, false, false, false, false, false]);
        let without_table = self.header.mass.map(|m| m == 0.0);
        let (stars, gas_stars) = ([false, false, false, false, true, false], [true, false, false, false, true, false]);
        // The first layout whose length fits is taken, the most usual one first.
        let (sets, components, kinds): (&[[bool; TYPES]], &[u32], [NumberType; 2]) = match name {
            "POS" | "VEL" | "ACCE" => (&[all], &[3], reals),
            name if name.starts_with("ID") => (&[all], &[1], [NumberType::U32, NumberType::U64]),
            "MASS" => (&[without_table, all], &[1], reals),
            "POT" | "TSTP" | "ENDT" => (&[all], &[1], reals),
            "AGE" => (&[stars], &[1], reals),
            "Z" => (&[gas_stars, gas], &[1], reals),
            _ => (&[gas, all, gas_stars, stars], &[1, 3], reals),
        };
        for kind in kinds {
            for &components in components {
                for &types in sets {
                    let rows = count(&types);
                    if rows > 0 && rows.checked_mul(kind.bytes() * u64::from(components)) == Some(record.length) {
                        let name = name.to_string();
                        return Ok(Some(GadgetBlock { name, offset: record.offset, kind, components, types }));
                    }
                }
            }
        }
        // Positions and masses are read: they must be what the header says.
        let needed = match name {
            "POS" => 3 * count(&all),
            "MASS" => count(&without_table),
            _ => return Ok(None),
        };
        if needed == 0 && record.length == 0 {
            return Ok(None);
        }
        let (length, at) = (record.length, record.offset);
        let message =
            format!("block {name} at byte {at} has {length} bytes, but the header's counts need {needed} numbers");
        Err(self.cut(message))
    }
}

const CUT: &str = "the file is cut short or damaged: copy it again from its source";

/// Records by name. Those of format 2 have one of 8 bytes with the name before each, those of format 1 none but the
/// header's.
fn named_records(path: &Path, records: &Records<'_>, named: bool) -> Result<Vec<(String, GadgetRecord)>> {
    let fault = |e: String| Error::input_with(path, e, CUT);
    let (mut out, mut at) = (Vec::new(), 0);
    while at < records.bytes.len() as u64 {
        let mut record = records.at(at).map_err(fault)?;
        let mut name = if out.is_empty() { "HEAD".to_string() } else { String::new() };
        if named {
            if record.length != 8 || out.len() == MOST_BLOCKS {
                let length = record.length;
                return Err(fault(format!("the record at byte {at} should hold a block name, but has {length} bytes")));
            }
            let label = &records.bytes[record.offset as usize..][..4];
            name = String::from_utf8_lossy(label).trim_end_matches([' ', '\0']).to_string();
            record = records.at(record.end()).map_err(|e| fault(format!("block {name}: {e}")))?;
        } else if out.len() == MOST_BLOCKS {
            return Err(Error::input(path, format!("more than {MOST_BLOCKS} blocks")));
        }
        at = record.end();
        out.push((name, record));
    }
    Ok(out)
}
