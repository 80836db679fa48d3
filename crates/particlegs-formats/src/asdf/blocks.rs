//! The binary blocks of an ASDF file: as they are, or compressed in chunks that are decompressed one by one, or as one
//! stream. Their checksums (MD5) are not looked at.

use crate::TextResult;
use crate::blosc::BloscHeader;
use crate::cache::{ChunkCache, DEFAULT_BYTES};
use crate::codecs::{self, MOST_BYTES};
use crate::numbers::Bytes;
use particlegs_core::{Error, Result};
use particlegs_files::memory;
use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

const MAGIC: [u8; 4] = [0xd3, b'B', b'L', b'K'];
/// Bytes of a header behind the magic and its own length.
const HEADER: usize = 48;
/// More than files have.
const MOST_BLOCKS: usize = 1 << 16;
const MOST_CHUNKS: usize = 1 << 20;
/// Blocks of a chunk that the keys of the cache can tell apart: a chunk has less than 4 GiB.
const MOST_PARTS: u64 = 1 << 32;

const HINT: &str = "the file is damaged or cut short: copy it again";

/// A block as its header describes it, within its file.
#[derive(Clone, Debug, PartialEq)]
pub struct AsdfBlockHeader {
    compression: [u8; 4],
    packed: Range<usize>,
    /// Bytes of its content.
    pub size: u64,
}

/// The headers of all blocks behind the tree, which ends at byte `at`.
pub fn headers(bytes: &[u8], mut at: usize) -> TextResult<Vec<AsdfBlockHeader>> {
    let mut all = Vec::new();
    // The standard allows padding between the tree and the first block.
    at += memchr::memmem::find(&bytes[at..], &MAGIC).unwrap_or(bytes.len() - at);
    while bytes[at..].starts_with(&MAGIC) {
        let number = all.len();
        let cut = || format!("block {number} is cut short");
        let head = bytes.get(at + 6..at + 6 + HEADER).ok_or_else(cut)?;
        let word = |k: usize| head[k..k + 8].iter().fold(0u64, |v, &b| v << 8 | u64::from(b));
        let (start, [allocated, used, size]) =
            (at + 6 + usize::from(u16::from_be_bytes([bytes[at + 4], bytes[at + 5]])), [8, 16, 24].map(word));
        if head[3] & 1 == 1 {
            return Err(format!("block {number} is streamed, which this program does not read"));
        }
        let within = |length: u64| start.checked_add(usize::try_from(length).ok()?).filter(|&end| end <= bytes.len());
        let (Some(end), Some(next)) = (within(used), within(allocated)) else { return Err(cut()) };
        let compression = [head[4], head[5], head[6], head[7]];
        if used > allocated || start < at + 6 + HEADER || (compression == [0; 4] && size != used) {
            return Err(format!("the header of block {number} is damaged"));
        }
        if number == MOST_BLOCKS {
            return Err(format!("it has more than {MOST_BLOCKS} blocks"));
        }
        all.push(AsdfBlockHeader { compression, packed: start..end, size });
        at = next;
    }
    Ok(all)
}

/// A part of a block that is decompressed apart from the others.
struct PackedChunk {
    packed: Range<usize>,
    /// First byte of the content, and bytes of it.
    first: u64,
    length: u64,
    /// `None`: LZ4.
    blosc: Option<BloscHeader>,
}

/// A block whose content can be read from any place.
pub struct AsdfBlock {
    place: String,
    bytes: Bytes,
    /// First byte of the content in `bytes`, where there are no chunks.
    start: usize,
    size: u64,
    chunks: Vec<PackedChunk>,
    cache: ChunkCache,
}

impl AsdfBlock {
    /// Block `number` of a file, whose arrays need the first `needed` bytes; of `sharers` files each keeps its part of what is
    /// decompressed.
    pub fn open(
        path: &Path,
        file: &Bytes,
        (number, needed): (usize, u64),
        header: &AsdfBlockHeader,
        sharers: usize,
    ) -> Result<AsdfBlock> {
        let place = format!("{}: block {number}", path.display());
        let fault = |message: String| Error::input_with(&place, message, HINT);
        let AsdfBlockHeader { compression, packed, size } = header;
        let (mut bytes, mut start, mut size, mut all) = (file.clone(), packed.start, *size, Vec::new());
        match compression {
            [0, 0, 0, 0] => {}
            b"blsc" | b"lz4\0" => all = chunks(file, packed, size, compression == b"blsc").map_err(fault)?,
            b"zlib" | b"bzp2" => {
                let expected = if is_usual(size, packed.len() as u64) { size } else { needed };
                memory::require(&format!("{place}, decompressed,"), expected)?;
                let packed = &file[packed.clone()];
                let stream = || -> Box<dyn Read + '_> {
                    match compression {
                        b"zlib" => Box::new(flate2::bufread::ZlibDecoder::new(packed)),
                        _ => Box::new(bzip2::bufread::BzDecoder::new(packed)),
                    }
                };
                let content = first(&stream, packed.len() as u64, [size, needed]);
                size = needed;
                (bytes, start) = (Bytes::Owned(Arc::new(content.map_err(fault)?)), 0);
            }
            other => {
                let name = String::from_utf8_lossy(other).replace(char::is_control, "");
                let message = format!("it is compressed with `{name}`, which this program does not read");
                return Err(Error::input_with(&place, message, "write the file with zlib, bzp2, lz4 or blsc"));
            }
        }
        let cache = ChunkCache::new(DEFAULT_BYTES / sharers);
        Ok(AsdfBlock { place, bytes, start, size, chunks: all, cache })
    }

    /// The bytes that hold the content uncompressed, and its first one.
    pub fn plain(&self) -> Option<(&Bytes, u64)> {
        self.chunks.is_empty().then_some((&self.bytes, self.start as u64))
    }

    /// Bytes `range` of the content.
    pub fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>> {
        if range.start > range.end || range.end > self.size {
            return Err(self.fault(format!("it ends before byte {}", range.end)));
        }
        if let Some((bytes, start)) = self.plain() {
            return Ok(Cow::Borrowed(&bytes[(start + range.start) as usize..(start + range.end) as usize]));
        }
        let mut out = Vec::with_capacity((range.end - range.start) as usize);
        let mut index = self.chunks.partition_point(|c| c.first <= range.start).saturating_sub(1);
        let mut at = range.start;
        while at < range.end {
            let chunk = &self.chunks[index];
            // An LZ4 chunk is one part, one of Blosc has several.
            let each = chunk.blosc.map_or(chunk.length, |b| b.block as u64).max(1);
            let part = (at - chunk.first) / each;
            let key = index as u64 * MOST_PARTS + part;
            let content = self.cache.get(key, || self.decode(chunk, part as usize))?;
            let start = chunk.first + part * each;
            let end = range.end.min(start + content.len() as u64);
            out.extend(&content[(at - start) as usize..(end - start) as usize]);
            at = end;
            index += usize::from(at >= chunk.first + chunk.length);
        }
        Ok(Cow::Owned(out))
    }

    fn decode(&self, chunk: &PackedChunk, part: usize) -> Result<Vec<u8>> {
        let packed = &self.bytes[chunk.packed.clone()];
        let content = match &chunk.blosc {
            Some(blosc) => blosc.decode(packed, part),
            None => codecs::lz4(packed, chunk.length as usize),
        };
        content.map_err(|message| self.fault(message))
    }

    pub fn fault(&self, message: String) -> Error {
        Error::input_with(&self.place, message, HINT)
    }
}

/// The chunks of a block, each behind its length: Blosc's, or an LZ4 block behind the length of its content.
fn chunks(bytes: &[u8], packed: &Range<usize>, size: u64, blosc: bool) -> TextResult<Vec<PackedChunk>> {
    let cut = "a chunk is cut short";
    let (mut at, mut first, mut all) = (packed.start, 0, Vec::new());
    while at < packed.end {
        let four = |at: usize| bytes[..packed.end].get(at..at + 4).and_then(|b| <[u8; 4]>::try_from(b).ok()).ok_or(cut);
        let length = u32::from_be_bytes(four(at)?);
        let end = (at + 4).checked_add(length as usize).filter(|&end| end <= packed.end).ok_or(cut)?;
        let chunk = if blosc {
            let header = BloscHeader::parse(&bytes[at + 4..end])?;
            PackedChunk { packed: at + 4..end, first, length: header.length as u64, blosc: Some(header) }
        } else {
            if length < 4 {
                return Err(cut.into());
            }
            let length = u32::from_le_bytes(four(at + 4)?).into();
            PackedChunk { packed: at + 8..end, first, length, blosc: None }
        };
        if chunk.length == 0 || all.len() == MOST_CHUNKS {
            return Err(format!("chunk {} is empty, or there are more than {MOST_CHUNKS}", all.len()));
        }
        first += chunk.length;
        all.push(chunk);
        at = end;
    }
    if first != size {
        return Err(format!("its chunks hold {first} bytes, its header says {size}"));
    }
    Ok(all)
}

/// A stream that is said to become longer by this is looked at before memory is taken for it.
const USUAL_EXPANSION: u64 = 8;

fn is_usual(size: u64, packed: u64) -> bool {
    size / USUAL_EXPANSION <= packed
}

/// The first `needed` bytes of a stream of `packed` ones that is to have `size`.
fn first<'a>(stream: &dyn Fn() -> Box<dyn Read + 'a>, packed: u64, [size, needed]: [u64; 2]) -> TextResult<Vec<u8>> {
    let damaged = |e: std::io::Error| format!("its data are damaged: {e}");
    let other = || format!("its header says {size} bytes, the data hold others");
    let is_usual = is_usual(size, packed);
    // One byte more than the header says shows a stream that is too long.
    let all = || stream().take(size.saturating_add(1));
    if !is_usual && std::io::copy(&mut all(), &mut std::io::sink()).map_err(damaged)? != size {
        return Err(other());
    }
    let mut out = Vec::with_capacity(if is_usual { size } else { needed } as usize);
    match is_usual {
        true => all().read_to_end(&mut out),
        false => stream().take(needed).read_to_end(&mut out),
    }
    .map_err(damaged)?;
    if out.len() as u64 == if is_usual { size } else { needed } { Ok(out) } else { Err(other()) }
}

/// Rows of `stride` bytes that are read at once: few enough for the memory that a reader may take.
pub fn rows_at_once(stride: u64) -> u64 {
    (MOST_BYTES as u64 / stride.max(1)).max(1)
}
