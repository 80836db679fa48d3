//! The sections of a legacy VTK file, one after the other: where points and their data lie.

use crate::ascii::{Ascii, shown};
use crate::numbers::NumberType;
use particlegs_core::{Error, Result};
use std::path::Path;
use std::sync::Arc;

#[derive(Clone)]
pub enum ArrayData {
    /// Big-endian, from this byte on.
    Binary(u64),
    Text(Arc<Ascii>),
}

#[derive(Clone)]
pub struct LegacyArray {
    pub name: String,
    pub kind: NumberType,
    pub components: u32,
    pub data: ArrayData,
}

#[derive(Default)]
pub struct LegacyContents {
    pub dataset: String,
    pub ascii: bool,
    pub version: String,
    pub points: u64,
    /// Positions, then the points' arrays.
    pub arrays: Vec<LegacyArray>,
    /// The field TIME, as some codes write it.
    pub time: Option<f64>,
    /// The reason why the rest was not looked at.
    pub note: Option<String>,
}

/// Longest line that is not a number.
const MOST_LINE: usize = 4096;
/// More arrays than a file has.
const MOST_ARRAYS: usize = 1024;

const TABLE: &[u8] = b"LOOKUP_TABLE";

const HINT: &str = "the file is cut short or damaged: copy it again from its source";

#[derive(Clone, Copy, PartialEq)]
enum AttributeOwner {
    Dataset,
    Points,
    Cells,
}

struct LegacyScan<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    out: LegacyContents,
    of: AttributeOwner,
    /// Rows of the attributes that follow.
    rows: u64,
    /// Whether cells are written as offsets and connectivity.
    modern: bool,
}

/// Reads headers, skipping numbers.
pub fn scan(path: &Path, bytes: &[u8]) -> Result<LegacyContents> {
    let (out, owner) = (LegacyContents::default(), AttributeOwner::Dataset);
    let mut scan = LegacyScan { path, bytes, at: 0, out, of: owner, rows: 0, modern: false };
    scan.head()?;
    while let Some(line) = scan.line()? {
        if !scan.section(&line)? {
            let line = shown(&line);
            scan.out.note = Some(format!("skipped everything after `{line}`, which ends at byte {}", scan.at));
            break;
        }
    }
    if scan.out.arrays.is_empty() {
        let message = scan.out.note.take().unwrap_or_else(|| "there is no POINTS section".into());
        return Err(scan.fault(message));
    }
    Ok(scan.out)
}

impl LegacyScan<'_> {
    fn fault(&self, message: impl Into<String>) -> Error {
        Error::input_with(self.path, message, HINT)
    }

    /// The next line as it is; `None` at the end.
    fn raw_line(&mut self) -> Result<Option<String>> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return Ok(None);
        }
        let end = rest.iter().take(MOST_LINE).position(|&b| b == b'\n');
        if end.is_none() && rest.len() >= MOST_LINE {
            return Err(self.fault(format!("the line at byte {} is longer than {MOST_LINE} bytes", self.at)));
        }
        let line = String::from_utf8_lossy(&rest[..end.unwrap_or(rest.len())]).trim().to_string();
        self.at += end.map_or(rest.len(), |e| e + 1);
        Ok(Some(line))
    }

    fn line(&mut self) -> Result<Option<String>> {
        let mut line = self.raw_line()?;
        while line.as_deref() == Some("") {
            line = self.raw_line()?;
        }
        Ok(line)
    }

    fn head(&mut self) -> Result<()> {
        let first = self.raw_line()?.unwrap_or_default();
        let version = first.strip_prefix("# vtk DataFile Version").map(str::trim);
        let Some(version) = version else {
            return Err(Error::input(
                self.path,
                "not a legacy VTK file: its first line is not `# vtk DataFile Version`",
            ));
        };
        self.modern = version.split('.').next().and_then(|v| v.parse::<u32>().ok()).is_some_and(|v| v >= 5);
        self.out.version = shown(version);
        self.raw_line()?;
        let coding = self.line()?.unwrap_or_default();
        self.out.ascii = match &coding.to_ascii_uppercase()[..] {
            "ASCII" => true,
            "BINARY" => false,
            _ => return Err(self.fault("the third line is neither ASCII nor BINARY")),
        };
        Ok(())
    }

    /// Reads the section that `line` begins; false for one that is not known.
    fn section(&mut self, line: &str) -> Result<bool> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let keyword = words[0].to_ascii_uppercase();
        match (&keyword[..], &words[1..]) {
            ("DATASET", [kind]) => {
                self.out.dataset = kind.to_ascii_uppercase();
                if !["POLYDATA", "UNSTRUCTURED_GRID", "STRUCTURED_GRID"].contains(&&self.out.dataset[..]) {
                    let message = format!("data of type `{}` have no explicit points", shown(kind));
                    return Err(Error::input_with(self.path, message, "save them as POLYDATA"));
                }
            }
            ("DIMENSIONS", [_, _, _]) => {}
            ("POINTS", [count, kind]) => {
                let count = self.count(count)?;
                let Some(kind) = kind_of(kind) else { return Ok(false) };
                let data = self.numbers("POINTS", count, 3, kind)?;
                self.out.points = count;
                self.out.arrays.insert(0, LegacyArray { name: "POINTS".into(), kind, components: 3, data });
            }
            ("VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" | "CELLS", [offsets, size]) => {
                return self.cells(&keyword, offsets, size);
            }
            ("CELL_TYPES", [count]) => {
                let count = self.count(count)?;
                self.numbers("CELL_TYPES", count, 1, NumberType::I32)?;
            }
            ("POINT_DATA", [count]) => (self.of, self.rows) = (AttributeOwner::Points, self.count(count)?),
            ("CELL_DATA", [count]) => (self.of, self.rows) = (AttributeOwner::Cells, self.count(count)?),
            // Metadata end with an empty line.
            ("METADATA", []) => while self.raw_line()?.is_some_and(|l| !l.is_empty()) {},
            ("FIELD", [_, count]) => return self.field(count),
            _ => return self.attribute(&keyword, &words[1..]),
        }
        Ok(true)
    }

    fn count(&self, word: &str) -> Result<u64> {
        word.parse().map_err(|_| self.fault(format!("`{}` before byte {} is not a count", shown(word), self.at)))
    }

    /// Skips `rows` rows of numbers and returns where they are.
    fn numbers(&mut self, name: &str, rows: u64, components: u32, kind: NumberType) -> Result<ArrayData> {
        let at = self.at as u64;
        let count = rows.saturating_mul(u64::from(components));
        if self.out.ascii {
            let ascii = Ascii::find(self.bytes, at, count).map_err(|e| self.fault(format!("{name}: {e}")))?;
            self.at = ascii.end() as usize;
            return Ok(ArrayData::Text(Arc::new(ascii)));
        }
        let end = count.checked_mul(kind.bytes()).and_then(|n| n.checked_add(at));
        match end.filter(|&e| e <= self.bytes.len() as u64) {
            Some(end) => self.at = end as usize,
            None => {
                let message = format!(
                    "{name} at byte {at} needs {count} numbers, but the file ends at byte {}",
                    self.bytes.len()
                );
                return Err(self.fault(message));
            }
        }
        Ok(ArrayData::Binary(at))
    }

    /// Cells: integers in one run, or, from version 5 on, two arrays.
    fn cells(&mut self, keyword: &str, offsets: &str, size: &str) -> Result<bool> {
        let (offsets, size) = (self.count(offsets)?, self.count(size)?);
        if !self.modern {
            self.numbers(keyword, size, 1, NumberType::I32)?;
            return Ok(true);
        }
        for (name, count) in [("OFFSETS", offsets), ("CONNECTIVITY", size)] {
            let line = self.line()?.unwrap_or_default();
            let kind = line.strip_prefix(name).and_then(|k| kind_of(k.trim()));
            let Some(kind) = kind else { return Ok(false) };
            self.numbers(name, count, 1, kind)?;
        }
        Ok(true)
    }

    /// `name components rows type`, as often as it says.
    fn field(&mut self, count: &str) -> Result<bool> {
        for _ in 0..self.count(count)? {
            let mut line = self.line()?.ok_or_else(|| self.fault("the file ends inside a FIELD section"))?;
            if line == "METADATA" {
                self.section("METADATA")?;
                line = self.line()?.ok_or_else(|| self.fault("the file ends inside a FIELD section"))?;
            }
            let words: Vec<&str> = line.split_whitespace().collect();
            let [name, components, rows, kind] = words[..] else { return Ok(false) };
            let Some(kind) = kind_of(kind) else { return Ok(false) };
            let Ok(components) = u32::try_from(self.count(components)?) else { return Ok(false) };
            let rows = self.count(rows)?;
            let data = self.numbers(name, rows, components, kind)?;
            if self.of == AttributeOwner::Dataset && name.eq_ignore_ascii_case("TIME") && rows == 1 && components == 1 {
                self.out.time = self.first(&data, kind);
            }
            self.keep(name, rows, components, kind, data);
        }
        Ok(true)
    }

    fn first(&self, data: &ArrayData, kind: NumberType) -> Option<f64> {
        let mut out = Vec::new();
        match data {
            ArrayData::Binary(at) => out.push(kind.get(&self.bytes[*at as usize..], true)),
            ArrayData::Text(text) => text.append(self.bytes, 0..1, kind, &mut out).ok()?,
        }
        out.first().copied().filter(|t| t.is_finite())
    }

    /// Attributes with one array each; false for what is not known.
    fn attribute(&mut self, keyword: &str, words: &[&str]) -> Result<bool> {
        let (name, components, kind) = match (keyword, words) {
            ("SCALARS", [name, kind]) => (*name, 1, kind_of(kind)),
            ("SCALARS", [name, kind, n]) => (*name, self.count(n)?, kind_of(kind)),
            ("VECTORS" | "NORMALS", [name, kind]) => (*name, 3, kind_of(kind)),
            ("TENSORS", [name, kind]) => (*name, 9, kind_of(kind)),
            ("TENSORS6", [name, kind]) => (*name, 6, kind_of(kind)),
            ("GLOBAL_IDS" | "PEDIGREE_IDS", [name, kind]) => (*name, 1, kind_of(kind)),
            ("TEXTURE_COORDINATES", [name, n, kind]) => (*name, self.count(n)?, kind_of(kind)),
            ("COLOR_SCALARS", [name, n]) => {
                // Colours are numbers from 0 to 1 in text, and bytes in binary files.
                (*name, self.count(n)?, Some(if self.out.ascii { NumberType::F32 } else { NumberType::U8 }))
            }
            ("LOOKUP_TABLE", [_, count]) => {
                let (count, kind) = (self.count(count)?, if self.out.ascii { NumberType::F32 } else { NumberType::U8 });
                self.numbers("LOOKUP_TABLE", count, 4, kind)?;
                return Ok(true);
            }
            _ => return Ok(false),
        };
        let (Some(kind), Ok(components)) = (kind, u32::try_from(components)) else { return Ok(false) };
        if keyword == "SCALARS" {
            // The name of a table of colours stands before the numbers; some writers leave it out.
            let next = self.bytes[self.at..].trim_ascii_start().get(..TABLE.len());
            if next.is_some_and(|n| n.eq_ignore_ascii_case(TABLE)) {
                self.line()?;
            }
        }
        let rows = self.rows;
        let data = self.numbers(name, rows, components, kind)?;
        self.keep(name, rows, components, kind, data);
        Ok(true)
    }

    /// An array of the points, where it is one.
    fn keep(&mut self, name: &str, rows: u64, components: u32, kind: NumberType, data: ArrayData) {
        let taken = self.of == AttributeOwner::Points && rows == self.out.points && self.out.arrays.len() < MOST_ARRAYS;
        if !taken {
            return;
        }
        let name = decoded(name);
        if !self.out.arrays.iter().any(|a| a.name == name) {
            self.out.arrays.push(LegacyArray { name, kind, components, data });
        }
    }
}

/// Names are written without blanks: `%20` stands for one.
fn decoded(name: &str) -> String {
    let mut out = Vec::new();
    let mut bytes = name.as_bytes();
    while let [first, rest @ ..] = bytes {
        let hex = |b: u8| (b as char).to_digit(16).map(|d| d as u8);
        match rest {
            [a, b, after @ ..] if *first == b'%' && hex(*a).is_some() && hex(*b).is_some() => {
                out.push(hex(*a).unwrap_or(0) << 4 | hex(*b).unwrap_or(0));
                bytes = after;
            }
            _ => {
                out.push(*first);
                bytes = rest;
            }
        }
    }
    String::from_utf8_lossy(&out).replace(char::is_control, "?")
}

fn kind_of(name: &str) -> Option<NumberType> {
    Some(match &name.to_ascii_lowercase()[..] {
        "float" => NumberType::F32,
        "double" => NumberType::F64,
        "char" | "signed_char" => NumberType::I8,
        "unsigned_char" => NumberType::U8,
        "short" => NumberType::I16,
        "unsigned_short" => NumberType::U16,
        // VTK writes its own indices as `int`.
        "int" | "vtkidtype" => NumberType::I32,
        "unsigned_int" => NumberType::U32,
        "long" | "vtktypeint64" => NumberType::I64,
        "unsigned_long" | "vtktypeuint64" => NumberType::U64,
        _ => return None,
    })
}
