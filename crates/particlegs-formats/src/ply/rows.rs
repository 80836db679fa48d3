//! Vertices whose lengths differ: lines of text, and binary ones with lists. Their places are
//! found when they are first read, and every 4096th is kept.

use super::header::{Encoding, PlyElement, Property};
use crate::TextResult;
use crate::numbers::Bytes;
use crate::pieces::{ParticlePiece, RowBuffer};
use crate::text::number::number_at;
use crate::text::split::shown;
use particlegs_core::{Error, Result};
use std::ops::Range;
use std::sync::OnceLock;

/// Rows from one kept place to the next.
const STEP: u64 = 4096;

/// Vertices of a file, read through an index.
pub struct VariableLengthRows {
    bytes: Bytes,
    place: String,
    format: RowFormat,
    start: VertexStart,
    count: u64,
    /// Properties that are x, y, z and perhaps weights.
    columns: Vec<usize>,
    /// For each property the columns that it is, a bit each.
    wanted: Vec<u8>,
    index: OnceLock<TextResult<Vec<u64>>>,
}

#[derive(Clone, Copy)]
pub struct VertexStart {
    /// The byte behind the header, or of the first vertex in a binary file.
    pub byte: u64,
    /// Lines from there to the first vertex, in a file of text.
    pub lines: u64,
}

pub struct RowFormat {
    encoding: Encoding,
    properties: Vec<Property>,
}

impl RowFormat {
    pub fn new(encoding: Encoding, element: &PlyElement) -> Self {
        RowFormat { encoding, properties: element.properties.clone() }
    }

    pub fn least_bytes(&self) -> u64 {
        match self.encoding {
            // A digit and a blank or the line's end.
            Encoding::Ascii => 2 * self.properties.len() as u64,
            _ => self.properties.iter().map(|p| p.list.unwrap_or(p.kind).bytes()).sum(),
        }
    }

    /// The bytes of the row at byte `at`, behind blank lines.
    pub fn row(&self, bytes: &[u8], at: u64) -> TextResult<Range<u64>> {
        match self.encoding {
            Encoding::Ascii => line(bytes, at),
            _ => Ok(at..self.binary(bytes, at, &[], &mut [0.0; 4])?),
        }
    }

    /// Values of the row in `range`: of each property for the columns that want it.
    fn values(&self, bytes: &[u8], range: Range<u64>, wanted: &[u8], out: &mut [f64; 4]) -> TextResult<()> {
        match self.encoding {
            Encoding::Ascii => self.text(&bytes[range.start as usize..range.end as usize], wanted, out),
            _ => self.binary(bytes, range.start, wanted, out).map(drop),
        }
    }

    /// Walks a binary row; gives its end.
    fn binary(&self, bytes: &[u8], mut at: u64, wanted: &[u8], out: &mut [f64; 4]) -> TextResult<u64> {
        let big = self.encoding == Encoding::Big;
        let number = |at: u64, kind: crate::numbers::NumberType| {
            let slice = usize::try_from(at).ok().and_then(|at| bytes.get(at..));
            let slice = slice.filter(|s| s.len() as u64 >= kind.bytes()).ok_or("the file ends too early")?;
            Ok::<f64, String>(kind.get(slice, big))
        };
        for (i, property) in self.properties.iter().enumerate() {
            let Some(length) = property.list else {
                take(wanted.get(i).copied().unwrap_or(0), number(at, property.kind)?, out);
                at += property.kind.bytes();
                continue;
            };
            let items = number(at, length)?;
            if !(items >= 0.0 && items.fract() == 0.0) {
                return Err(format!("list `{}` has {items} items", property.name.escape_debug()));
            }
            // This cannot be negative: `number` has read the length just now.
            let left = (bytes.len() as u64 - at - length.bytes()) / property.kind.bytes();
            if items > left as f64 {
                return Err(format!("list `{}` of {items} items is cut short", property.name.escape_debug()));
            }
            at += length.bytes() + items as u64 * property.kind.bytes();
        }
        Ok(at)
    }

    fn text(&self, line: &[u8], wanted: &[u8], out: &mut [f64; 4]) -> TextResult<()> {
        let mut at = 0;
        for (property, &wanted) in self.properties.iter().zip(wanted) {
            if property.list.is_some() {
                let items = value(line, &mut at)?;
                // A line has fewer items than bytes.
                for _ in 0..(items.max(0.0) as u64).min(line.len() as u64) {
                    word(line, &mut at).ok_or(FEW)?;
                }
            } else if wanted != 0 {
                take(wanted, value(line, &mut at)?, out);
            } else {
                word(line, &mut at).ok_or(FEW)?;
            }
        }
        if word(line, &mut at).is_some() { Err("too many values".into()) } else { Ok(()) }
    }
}

const FEW: &str = "too few values";

/// Gives a value to every column that wants it: bit k for column k.
fn take(wanted: u8, value: f64, out: &mut [f64; 4]) {
    (0..4).filter(|k| wanted >> k & 1 == 1).for_each(|k| out[k] = value);
}

fn pass_blanks(line: &[u8], at: &mut usize) {
    while line.get(*at).is_some_and(u8::is_ascii_whitespace) {
        *at += 1;
    }
}

fn word<'a>(line: &'a [u8], at: &mut usize) -> Option<&'a [u8]> {
    pass_blanks(line, at);
    let start = *at;
    while line.get(*at).is_some_and(|b| !b.is_ascii_whitespace()) {
        *at += 1;
    }
    (*at > start).then(|| &line[start..*at])
}

fn value(line: &[u8], at: &mut usize) -> TextResult<f64> {
    pass_blanks(line, at);
    let start = *at;
    let value = number_at(line, at).filter(|_| line.get(*at).is_none_or(u8::is_ascii_whitespace));
    value.ok_or_else(|| {
        *at = start;
        word(line, at).map_or(FEW.into(), |w| format!("{} is not a number", shown(w)))
    })
}

/// The next line that is not blank, without its end.
fn line(bytes: &[u8], mut at: u64) -> TextResult<Range<u64>> {
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

impl VariableLengthRows {
    pub fn new(
        bytes: Bytes,
        place: &str,
        format: RowFormat,
        start: VertexStart,
        count: u64,
        columns: Vec<usize>,
    ) -> Self {
        let mut wanted = vec![0; format.properties.len()];
        columns.iter().enumerate().for_each(|(k, &property)| wanted[property] |= 1 << k);
        let (place, index) = (place.into(), OnceLock::new());
        VariableLengthRows { bytes, place, format, start, count, columns, wanted, index }
    }

    fn wrong(&self, row: u64, message: &str) -> Error {
        let hint = "the file is cut short or damaged: copy it again";
        Error::input_with(&self.place, format!("vertex {row}: {message}"), hint)
    }

    /// First bytes of rows 0, STEP, 2 STEP, ...
    fn index(&self) -> Result<&[u64]> {
        let find = || {
            let mut at = self.start.byte;
            for before in 0..self.start.lines {
                at = line(&self.bytes, at).map_err(|e| format!("element {before}, before the vertices: {e}"))?.end;
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
        self.index.get_or_init(find).as_deref().map_err(|message| Error::input_with(&self.place, message, hint))
    }
}

impl ParticlePiece for VariableLengthRows {
    fn rows(&self) -> u64 {
        self.count
    }

    fn is_wide(&self) -> bool {
        self.columns.iter().take(3).any(|&c| self.format.properties[c].kind.is_wide())
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        let index = self.index()?;
        let first = rows.start / STEP;
        let mut at = *index.get(first as usize).ok_or_else(|| self.wrong(rows.start, "it does not exist"))?;
        let mut values = [0.0; 4];
        for row in first * STEP..rows.end {
            let range = self.format.row(&self.bytes, at).map_err(|e| self.wrong(row, &e))?;
            at = range.end;
            if row < rows.start {
                continue;
            }
            let read = self.format.values(&self.bytes, range, &self.wanted, &mut values);
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
