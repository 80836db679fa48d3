//! Where an array's numbers are found, and how any rows of them are read.

use super::base64::Base64Text;
use super::blocks::CompressedBlocks;
use crate::ascii::Ascii;
use crate::strided::{Bytes, NumberType, StridedColumn};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Bytes in a file: as they are, or as base64.
#[derive(Clone, Debug)]
pub enum Stream {
    /// From this byte on.
    Raw(u64),
    /// From a byte of what a text decodes to.
    Base64 {
        /// The text.
        text: Base64Text,
        /// Its character that the stream begins with.
        base: u64,
        /// Decoded bytes before the first.
        skip: u64,
    },
}

impl Stream {
    /// Bytes `range` of it.
    pub fn get<'a>(&self, bytes: &'a [u8], range: Range<u64>) -> Result<Cow<'a, [u8]>, String> {
        match self {
            Stream::Raw(start) => {
                let at = |n: u64| start.checked_add(n).and_then(|n| usize::try_from(n).ok());
                let found = at(range.start).zip(at(range.end)).and_then(|(a, b)| bytes.get(a..b));
                found.map(Cow::Borrowed).ok_or_else(|| format!("it ends beyond the file's {} bytes", bytes.len()))
            }
            Stream::Base64 { text, base, skip } => {
                let shifted = range.start.checked_add(*skip).zip(range.end.checked_add(*skip));
                let (start, end) = shifted.ok_or("it ends beyond the file")?;
                // No more is decoded than the file can hold.
                if end - start > bytes.len() as u64 {
                    return Err(format!("it ends beyond the file's {} bytes", bytes.len()));
                }
                text.decode(bytes, *base, start..end).map(Cow::Owned)
            }
        }
    }

    /// The stream behind its first `n` bytes, which may have been encoded on their own.
    pub fn after(self, bytes: &[u8], n: u64) -> Stream {
        match self {
            Stream::Raw(start) => Stream::Raw(start.saturating_add(n)),
            Stream::Base64 { text, base, skip } => {
                let characters = 4 * n.div_ceil(3);
                if n.is_multiple_of(3) || text.pads(bytes, base + characters - 1) {
                    Stream::Base64 { base: base + characters, skip, text }
                } else {
                    Stream::Base64 { text, base, skip: skip + n }
                }
            }
        }
    }
}

/// How an array is stored.
pub enum ArraySource {
    /// Number after number.
    Plain(Stream),
    /// In compressed blocks.
    Blocks(CompressedBlocks),
    /// As text.
    Ascii(Arc<Ascii>),
}

/// An array of a piece.
pub struct VtkArray {
    /// Its name.
    pub name: String,
    /// Type of its numbers.
    pub kind: NumberType,
    /// Numbers a row.
    pub components: u32,
    /// Their byte order.
    pub big_endian: bool,
    /// Where they are.
    pub source: ArraySource,
}

impl VtkArray {
    /// Where component `component` lies, where the numbers lie in the file as they are.
    pub fn lane(&self, component: u32) -> Option<StridedColumn> {
        let ArraySource::Plain(Stream::Raw(start)) = self.source else { return None };
        let size = self.kind.bytes();
        let offset = start + u64::from(component) * size;
        Some(StridedColumn {
            offset,
            stride: size * u64::from(self.components),
            kind: self.kind,
            big_endian: self.big_endian,
        })
    }

    /// Appends rows `rows`, all components of each.
    pub fn append(&self, bytes: &Bytes, rows: Range<u64>, out: &mut Vec<f64>) -> Result<(), String> {
        let wide = u64::from(self.components);
        let numbers = rows.start * wide..rows.end * wide;
        let size = self.kind.bytes();
        let range = numbers.start * size..numbers.end * size;
        let mut push = |raw: &[u8]| {
            let lane = StridedColumn { offset: 0, stride: size, kind: self.kind, big_endian: self.big_endian };
            lane.append(raw, 0..raw.len() as u64 / size, out);
        };
        match &self.source {
            ArraySource::Plain(stream) => push(&stream.get(bytes, range)?),
            ArraySource::Blocks(blocks) => push(&blocks.get(bytes, range)?),
            ArraySource::Ascii(ascii) => ascii.append(bytes, numbers, self.kind, out)?,
        }
        Ok(())
    }
}
