//! Vertices whose lengths differ: lines of text, and binary ones with lists. Their places are
//! found when they are first read, and every 4096th is kept.

use super::header::{Element, Encoding, Property};
use crate::pieces::{Piece, Rows};
use crate::strided::Bytes;
use particlegs::{Error, Result};
use std::ops::Range;
use std::sync::OnceLock;

/// Rows from one kept place to the next.
const STEP: u64 = 4096;

type InWords<T> = std::result::Result<T, String>;

/// Vertices of a file, read through an index.
pub struct WalkedRows {
    bytes: Bytes,
    place: String,
    format: RowFormat,
    /// Byte behind the header, or of the first vertex in a binary file.
    start: u64,
    /// Lines before the first vertex, in a file of text.
    lines_before: u64,
    count: u64,
    /// Properties that are x, y, z and perhaps weights.
    columns: Vec<usize>,
    index: OnceLock<InWords<Vec<u64>>>,
}

/// How a vertex is written.
pub struct RowFormat {
    encoding: Encoding,
    properties: Vec<Property>,
}

impl RowFormat {
    /// Of an element.
    pub fn new(encoding: Encoding, element: &Element) -> Self {
        RowFormat { encoding, properties: element.properties.clone() }
    }

    /// Bytes that one has at least.
    pub fn least_bytes(&self) -> u64 {
        match self.encoding {
            // A digit and a blank or the line's end.
            Encoding::Ascii => 2 * self.properties.len() as u64,
            _ => self.properties.iter().map(|p| p.list.unwrap_or(p.kind).bytes()).sum(),
        }
    }

    /// Where the row at byte `at` begins, behind blank lines, and where it ends.
    pub fn row(&self, bytes: &[u8], at: u64) -> InWords<Range<u64>> {
        match self.encoding {
            Encoding::Ascii => line(bytes, at),
            _ => Ok(at..self.binary(bytes, at, &[], &mut [])?),
        }
    }

    /// Values of properties `columns` of the row in `range`.
    fn values(&self, bytes: &[u8], range: Range<u64>, columns: &[usize], out: &mut [f64]) -> InWords<()> {
        match self.encoding {
            Encoding::Ascii => self.text(&bytes[range.start as usize..range.end as usize], columns, out),
            _ => self.binary(bytes, range.start, columns, out).map(drop),
        }
    }

    /// Walks a binary row; gives its end.
    fn binary(&self, bytes: &[u8], mut at: u64, columns: &[usize], out: &mut [f64]) -> InWords<u64> {
        let big = self.encoding == Encoding::Big;
        let number = |at: u64, kind: crate::strided::Kind| {
            let slice = usize::try_from(at).ok().and_then(|at| bytes.get(at..));
            let slice = slice.filter(|s| s.len() as u64 >= kind.bytes()).ok_or("the file ends too early")?;
            Ok::<f64, String>(kind.get(slice, big))
        };
        for (i, property) in self.properties.iter().enumerate() {
            let Some(length) = property.list else {
                let value = number(at, property.kind)?;
                columns.iter().zip(&mut *out).filter(|(c, _)| **c == i).for_each(|(_, out)| *out = value);
                at += property.kind.bytes();
                continue;
            };
            let items = number(at, length)?;
            if !(items >= 0.0 && items.fract() == 0.0) {
                return Err(format!("list `{}` has {items} items", property.name.escape_debug()));
            }
            let left = (bytes.len() as u64 - at - length.bytes()) / property.kind.bytes();
            if items > left as f64 {
                return Err(format!("list `{}` has {items} items, and the file ends", property.name.escape_debug()));
            }
            at += length.bytes() + items as u64 * property.kind.bytes();
        }
        Ok(at)
    }

    fn text(&self, line: &[u8], columns: &[usize], out: &mut [f64]) -> InWords<()> {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        let number = |word: Option<&[u8]>| {
            let word = word.ok_or("it has too few values")?;
            let value = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok());
            value.ok_or_else(|| format!("`{}` is no number", word[..word.len().min(40)].escape_ascii()))
        };
        for (i, property) in self.properties.iter().enumerate() {
            let word = words.next();
            if property.list.is_some() {
                let items = number(word)?;
                // A line has fewer items than bytes.
                for _ in 0..(items.max(0.0) as u64).min(line.len() as u64) {
                    words.next().ok_or("it has too few values")?;
                }
            } else if columns.contains(&i) {
                let value = number(word)?;
                columns.iter().zip(&mut *out).filter(|(c, _)| **c == i).for_each(|(_, out)| *out = value);
            } else if word.is_none() {
                return Err("it has too few values".into());
            }
        }
        if words.next().is_some() { Err("it has too many values".into()) } else { Ok(()) }
    }
}

/// The next line that is not blank, without its end.
fn line(bytes: &[u8], mut at: u64) -> InWords<Range<u64>> {
    loop {
        let rest = usize::try_from(at).ok().and_then(|at| bytes.get(at..)).filter(|r| !r.is_empty());
        let rest = rest.ok_or("the file ends too early")?;
        let length = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
        if !rest[..length].trim_ascii().is_empty() {
            return Ok(at..at + length as u64);
        }
        at += length as u64 + 1;
    }
}

impl WalkedRows {
    /// `count` vertices from byte `start`, `lines_before` lines (of text) behind it.
    pub fn new(
        bytes: Bytes,
        place: &str,
        format: RowFormat,
        (start, lines_before): (u64, u64),
        count: u64,
        columns: Vec<usize>,
    ) -> Self {
        WalkedRows { bytes, place: place.into(), format, start, lines_before, count, columns, index: OnceLock::new() }
    }

    fn wrong(&self, row: u64, what: &str) -> Error {
        let hint = "the file is cut short or damaged: copy it again";
        Error::input_hint(&self.place, format!("vertex {row}: {what}"), hint)
    }

    /// Where rows 0, STEP, 2 STEP, ... begin.
    fn index(&self) -> Result<&[u64]> {
        let find = || {
            let mut at = self.start;
            for before in 0..self.lines_before {
                at = line(&self.bytes, at).map_err(|e| format!("element {before} before the vertices: {e}"))?.end;
            }
            let mut index = Vec::new();
            for row in 0..self.count {
                if row.is_multiple_of(STEP) {
                    index.push(at);
                }
                at = self.format.row(&self.bytes, at).map_err(|e| format!("vertex {row} of {}: {e}", self.count))?.end;
            }
            Ok(index)
        };
        let hint = "the file is cut short or damaged: copy it again";
        self.index.get_or_init(find).as_deref().map_err(|what| Error::input_hint(&self.place, what, hint))
    }
}

impl Piece for WalkedRows {
    fn rows(&self) -> u64 {
        self.count
    }

    fn is_wide(&self) -> bool {
        self.columns.iter().take(3).any(|&c| self.format.properties[c].kind.is_wide())
    }

    fn read(&self, rows: Range<u64>, out: &mut Rows) -> Result<()> {
        let index = self.index()?;
        let first = rows.start / STEP;
        let mut at = *index.get(first as usize).ok_or_else(|| self.wrong(rows.start, "there is none"))?;
        let mut values = [0.0; 4];
        for row in first * STEP..rows.end {
            let range = self.format.row(&self.bytes, at).map_err(|e| self.wrong(row, &e))?;
            at = range.end;
            if row < rows.start {
                continue;
            }
            let read = self.format.values(&self.bytes, range, &self.columns, &mut values);
            read.map_err(|e| self.wrong(row, &e))?;
            for k in 0..3 {
                out.position[k].push(values[k]);
            }
            if self.columns.len() > 3 {
                out.weight.push(values[3]);
            }
        }
        Ok(())
    }
}
