//! One file: its XML, and its arrays located and checked against the file's length.

use super::blocks::{CompressedBlocks, Compressor, Integers};
use super::document::{self, ArrayDeclaration, ArrayLocation, VtkDocument};
use super::points::{ArraySource, VtkArray};
use super::stream::{Base64Text, Stream};
use crate::TextResult;
use crate::ascii::Ascii;
use crate::cache::ChunkCache;
use crate::numbers::Bytes;
use particlegs_core::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub struct VtkXmlFile {
    pub path: PathBuf,
    pub bytes: Bytes,
    pub document: VtkDocument,
}

/// Longest text of a number that is a field: the time.
const FIELD_TEXT: u64 = 4096;

impl VtkXmlFile {
    pub fn open(path: &Path) -> Result<VtkXmlFile> {
        let bytes = Bytes::from_file(path)?;
        let document = document::parse(path, &bytes)?;
        let file = VtkXmlFile { path: path.into(), bytes, document };
        file.check()?;
        Ok(file)
    }

    /// Every array must lie within the file, whether it is read or not: else the file is damaged.
    fn check(&self) -> Result<()> {
        let cache = Arc::new(ChunkCache::new(0));
        for piece in self.document.pieces.iter().filter(|p| p.points > 0) {
            if piece.positions.is_none() && piece.source.is_none() {
                return Err(Error::input(&self.path, "a piece has points but no positions"));
            }
            for array in piece.positions.iter().chain(&piece.arrays) {
                self.binary(array, piece.points, &cache)?;
            }
        }
        Ok(())
    }

    /// An array of `rows` rows, ready to be read; `None` for what are no numbers.
    pub fn array(&self, declared: &ArrayDeclaration, rows: u64, cache: &Arc<ChunkCache>) -> Result<Option<VtkArray>> {
        let Some(kind) = declared.kind else { return Ok(None) };
        let source = match &declared.place {
            ArrayLocation::Ascii(range) => {
                let count = rows.checked_mul(u64::from(declared.components));
                let fault = || "too many numbers to count".to_string();
                let ascii = count
                    .ok_or_else(fault)
                    .and_then(|n| Ascii::find(&self.bytes[..range.end as usize], range.start, n));
                ArraySource::Ascii(Arc::new(ascii.map_err(|e| self.fault(declared, &e))?))
            }
            _ => match self.binary(declared, rows, cache)? {
                Some(source) => source,
                None => return Ok(None),
            },
        };
        let (name, components) = (declared.name.clone(), declared.components);
        Ok(Some(VtkArray { name, kind, components, big_endian: self.document.big_endian, source }))
    }

    /// The source of binary numbers; `None` for text and for what are no numbers.
    fn binary(&self, declared: &ArrayDeclaration, rows: u64, cache: &Arc<ChunkCache>) -> Result<Option<ArraySource>> {
        let Some(kind) = declared.kind else { return Ok(None) };
        let fault = |e: String| self.fault(declared, &e);
        let stream = match &declared.place {
            ArrayLocation::Ascii(range) => {
                // A digit and a blank for each number, but for the last blank.
                let least = rows.saturating_mul(u64::from(declared.components)).saturating_mul(2);
                if range.end - range.start < least.saturating_sub(1) {
                    return Err(fault(format!("the text is too short for {rows} rows")));
                }
                return Ok(None);
            }
            ArrayLocation::Inline(range) => {
                Stream::Base64 { text: Base64Text::find(&self.bytes, range.clone()), base: 0, skip: 0 }
            }
            ArrayLocation::Appended(offset) => self.appended(*offset).map_err(fault)?,
        };
        let length = rows.checked_mul(kind.bytes()).and_then(|n| n.checked_mul(u64::from(declared.components)));
        let length = length.ok_or_else(|| fault("too many numbers to count".into()))?;
        self.source(stream, self.document.compressor, length, cache).map(Some).map_err(fault)
    }

    fn appended(&self, offset: u64) -> TextResult<Stream> {
        let (start, base64) = self.document.appended.ok_or("the file has no appended data")?;
        let end = self.bytes.len() as u64;
        let at = start.checked_add(offset).filter(|&at| at < end);
        let at = at.ok_or_else(|| format!("offset {offset} is beyond the end of the file"))?;
        Ok(if base64 { Stream::Base64 { text: Base64Text::plain(at..end), base: 0, skip: 0 } } else { Stream::Raw(at) })
    }

    fn source(
        &self,
        stream: Stream,
        compressor: Option<Compressor>,
        length: u64,
        cache: &Arc<ChunkCache>,
    ) -> TextResult<ArraySource> {
        let size = self.document.header;
        let integers = Integers { size, big_endian: self.document.big_endian };
        if let Some(compressor) = compressor {
            let blocks = CompressedBlocks::open(&self.bytes, stream, compressor, integers, length, cache)?;
            return Ok(ArraySource::Blocks(blocks));
        }
        let said = integers.get(&stream.get(&self.bytes, 0..size)?, 0);
        // Lengths above 4 GiB wrap in small headers.
        if said != length && !(size == 4 && said == length & 0xffff_ffff) {
            return Err(format!("it has {said} bytes instead of {length}"));
        }
        let data = stream.after(&self.bytes, size);
        data.get(&self.bytes, length.saturating_sub(1)..length)?;
        Ok(ArraySource::Plain(data))
    }

    fn fault(&self, declared: &ArrayDeclaration, reason: &str) -> Error {
        let message = format!("array `{}`: {reason}", declared.name);
        Error::input_with(&self.path, message, "the file is cut short or damaged: copy it again from its source")
    }

    /// The time, where the file says it as ParaView does.
    pub fn time(&self) -> Option<f64> {
        let field = self.document.fields.iter().find(|f| f.name == "TimeValue" && f.components == 1)?;
        if let ArrayLocation::Ascii(range) | ArrayLocation::Inline(range) = &field.place
            && range.end - range.start > FIELD_TEXT
        {
            return None;
        }
        let array = self.array(field, 1, &Arc::new(ChunkCache::new(0))).ok()??;
        let mut out = Vec::new();
        array.append(&self.bytes, 0..1, &mut out).ok()?;
        out.first().copied().filter(|t| t.is_finite())
    }
}
