//! Arrays in compressed blocks.

use super::stream::Stream;
use crate::cache::ChunkCache;
use crate::codecs;
use particlegs_core::Error;
use std::ops::Range;
use std::sync::Arc;

/// More blocks than an array has: 32 KiB each, that is 128 GiB.
const MOST_BLOCKS: u64 = 4 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compressor {
    Zlib,
    Lz4,
    Lzma,
}

impl Compressor {
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "vtkZLibDataCompressor" => Some(Compressor::Zlib),
            "vtkLZ4DataCompressor" => Some(Compressor::Lz4),
            "vtkLZMADataCompressor" => Some(Compressor::Lzma),
            _ => None,
        }
    }
}

/// The form of the integers before an array's numbers.
#[derive(Clone, Copy)]
pub struct Integers {
    /// Bytes of one, at most eight.
    pub size: u64,
    pub big_endian: bool,
}

impl Integers {
    pub fn get(self, bytes: &[u8], index: usize) -> u64 {
        let size = self.size as usize;
        let mut raw = [0; 8];
        raw[..size].copy_from_slice(&bytes[index * size..][..size]);
        if self.big_endian {
            raw[..size].reverse();
        }
        u64::from_le_bytes(raw)
    }
}

pub struct CompressedBlocks {
    compressor: Compressor,
    data: Stream,
    /// Bytes of a block, decompressed, and of the last.
    block: u64,
    last: u64,
    /// First byte of each block in the compressed stream, and the end of the last.
    starts: Vec<u64>,
    cache: Arc<ChunkCache>,
    /// The first block's key in the cache.
    pub key: u64,
}

impl CompressedBlocks {
    /// Reads the header of an array of `length` bytes: number of blocks, bytes of a block and of a
    /// last shorter one, compressed bytes of each, as such integers.
    pub fn open(
        bytes: &[u8],
        stream: Stream,
        compressor: Compressor,
        integers: Integers,
        length: u64,
        cache: &Arc<ChunkCache>,
    ) -> Result<CompressedBlocks, String> {
        let head = stream.get(bytes, 0..3 * integers.size)?;
        let [count, block, last] = [0, 1, 2].map(|i| integers.get(&head, i));
        if count == 0 || count > MOST_BLOCKS || count > bytes.len() as u64 || block == 0 {
            return Err(format!("{count} compressed blocks of {block} bytes exceed the file"));
        }
        let last = if last == 0 { block } else { last };
        let whole = (count - 1).checked_mul(block).and_then(|n| n.checked_add(last));
        if whole != Some(length) || last > block {
            return Err(format!("the compressed blocks hold {} bytes instead of {length}", whole.unwrap_or(u64::MAX)));
        }
        if block.min(length) > codecs::MOST_BYTES as u64 {
            return Err(format!("compressed blocks of {block} bytes exceed {}", codecs::MOST_BYTES));
        }
        let header = (3 + count) * integers.size;
        let sizes = stream.get(bytes, 3 * integers.size..header)?;
        let mut starts = Vec::with_capacity(count as usize + 1);
        starts.push(0u64);
        for i in 0..count as usize {
            let end = starts[i].checked_add(integers.get(&sizes, i));
            starts.push(end.filter(|&e| e <= bytes.len() as u64).ok_or("the compressed blocks end beyond the file")?);
        }
        drop(sizes);
        let data = stream.after(bytes, header);
        // The last byte must be there.
        let end = starts[count as usize];
        data.get(bytes, end.saturating_sub(1)..end)?;
        Ok(CompressedBlocks { compressor, data, block, last, starts, cache: cache.clone(), key: 0 })
    }

    pub fn count(&self) -> u64 {
        self.starts.len() as u64 - 1
    }

    fn decode(&self, bytes: &[u8], index: u64) -> Result<Vec<u8>, String> {
        let range = self.starts[index as usize]..self.starts[index as usize + 1];
        // A compressor makes what it cannot shorten a little longer, and no more.
        if range.end - range.start > codecs::MOST_BYTES as u64 * 9 / 8 {
            return Err("a compressed block is larger than its content".into());
        }
        let packed = self.data.get(bytes, range)?;
        let length = if index + 1 == self.count() { self.last } else { self.block } as usize;
        match self.compressor {
            Compressor::Zlib => codecs::zlib(&packed, length),
            Compressor::Lz4 => codecs::lz4(&packed, length),
            Compressor::Lzma => codecs::xz(&packed, length),
        }
    }

    /// A block, from the cache where it is there.
    fn kept(&self, bytes: &[u8], index: u64) -> Result<Arc<Vec<u8>>, String> {
        // The cache speaks the library's errors; their words are what counts here.
        let decode = || self.decode(bytes, index).map_err(|e| Error::input("", e));
        self.cache.get(self.key + index, decode).map_err(|e| match e {
            Error::Input { what, .. } => what,
            other => other.to_string(),
        })
    }

    pub fn get(&self, bytes: &[u8], range: Range<u64>) -> Result<Vec<u8>, String> {
        let mut out = Vec::with_capacity((range.end - range.start) as usize);
        let mut at = range.start;
        while at < range.end {
            let index = at / self.block;
            if index >= self.count() {
                return Err("the blocks hold too few bytes".into());
            }
            let start = index * self.block;
            let whole = at == start && range.end - start >= self.block;
            // Neighbouring runs share the blocks at their ends; the others are decoded only once.
            let decoded = if whole { Arc::new(self.decode(bytes, index)?) } else { self.kept(bytes, index)? };
            let part = decoded.get((at - start) as usize..((range.end - start) as usize).min(decoded.len()));
            let part = part.filter(|p| !p.is_empty()).ok_or("the blocks hold too few bytes")?;
            out.extend_from_slice(part);
            at += part.len() as u64;
        }
        Ok(out)
    }
}
