//! Stretches of a mapped file that hold something as it is, or compressed, and are read in order.

use crate::TextResult;
use crate::numbers::Bytes;
use flate2::Crc;
use std::io::{Error, ErrorKind, Read, Result};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamCoding {
    Plain,
    /// A bare deflate stream whose content has this CRC-32.
    Deflate {
        crc: u32,
    },
    Gzip,
    Zstd,
}

/// Memory that a Zstandard frame may ask for.
const MOST_WINDOW: u64 = 32 << 20;

impl StreamCoding {
    /// Content that a compressed byte can stand for at most: claims beyond it are lies.
    fn most_ratio(self) -> u64 {
        match self {
            StreamCoding::Plain => 1,
            StreamCoding::Deflate { .. } | StreamCoding::Gzip => 1032,
            StreamCoding::Zstd => 1 << 16,
        }
    }
}

#[derive(Clone)]
pub struct StoredBytes {
    bytes: Bytes,
    start: usize,
    packed: usize,
    size: u64,
    coding: StreamCoding,
}

impl StoredBytes {
    /// All of a file as it is.
    pub fn plain_file(bytes: Bytes) -> StoredBytes {
        let packed = bytes.len();
        StoredBytes { bytes, start: 0, packed, size: packed as u64, coding: StreamCoding::Plain }
    }

    /// `packed` bytes from byte `start` of `bytes`, which stand for `size`. Gzip's content may be
    /// longer than `size`.
    pub fn new(bytes: Bytes, start: u64, packed: u64, size: u64, coding: StreamCoding) -> TextResult<StoredBytes> {
        let end = start.checked_add(packed).filter(|&end| end <= bytes.len() as u64);
        if end.is_none() {
            return Err(format!("{packed} bytes at byte {start} end beyond the file's {} bytes", bytes.len()));
        }
        let most = packed.saturating_mul(coding.most_ratio());
        if coding == StreamCoding::Plain && size != packed || size > most.saturating_add(1024) {
            return Err(format!("{packed} compressed bytes cannot expand to {size}"));
        }
        Ok(StoredBytes { bytes, start: start as usize, packed: packed as usize, size, coding })
    }

    pub fn size(&self) -> u64 {
        self.size
    }

    /// The file, and where the content lies in it, where it is not compressed.
    pub fn plain(&self) -> Option<(&Bytes, u64)> {
        (self.coding == StreamCoding::Plain).then_some((&self.bytes, self.start as u64))
    }

    /// The content from its beginning. Reading ends with an error where the content is shorter
    /// than `size` or its checksum is wrong.
    pub fn open(&self) -> Result<Box<dyn Read + Send + '_>> {
        let packed = &self.bytes[self.start..self.start + self.packed];
        let (inner, crc): (Box<dyn Read + Send + '_>, _) = match self.coding {
            StreamCoding::Plain => return Ok(Box::new(packed)),
            StreamCoding::Deflate { crc } => (Box::new(flate2::bufread::DeflateDecoder::new(packed)), Some(crc)),
            StreamCoding::Gzip => (Box::new(flate2::bufread::MultiGzDecoder::new(packed)), None),
            StreamCoding::Zstd => {
                let inner = ruzstd::decoding::StreamingDecoder::new_with_max_window_size(packed, MOST_WINDOW);
                (Box::new(inner.map_err(Error::other)?), None)
            }
        };
        Ok(Box::new(CompleteReader { inner, left: self.size, crc, sum: Crc::new() }))
    }
}

/// A stream that must not end before its content is complete.
struct CompleteReader<'a> {
    inner: Box<dyn Read + Send + 'a>,
    left: u64,
    crc: Option<u32>,
    sum: Crc,
}

impl Read for CompleteReader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let n = self.inner.read(buffer)?;
        if n == 0 && self.left > 0 {
            return Err(Error::new(ErrorKind::UnexpectedEof, "the compressed data end early"));
        }
        // Without a sum only the beginning of the content may be wanted: it may go on.
        let Some(crc) = self.crc else {
            self.left = self.left.saturating_sub(n as u64);
            return Ok(n);
        };
        self.sum.update(&buffer[..n]);
        if n as u64 > self.left {
            return Err(Error::new(ErrorKind::InvalidData, "the compressed data are longer than expected"));
        }
        self.left -= n as u64;
        if n == 0 && self.sum.sum() != crc {
            return Err(Error::new(ErrorKind::InvalidData, "the checksum is wrong"));
        }
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn content_is_read_and_lies_are_found() {
        let content = b"some words, some words, some words".repeat(40);
        let (packed, sum) = crate::testing::deflate(&content);
        let bytes = Bytes::Owned(Arc::new(packed.clone()));
        let read = |size: u64, crc| {
            let stored =
                StoredBytes::new(bytes.clone(), 0, packed.len() as u64, size, StreamCoding::Deflate { crc }).unwrap();
            let mut out = Vec::new();
            stored.open().and_then(|mut s| s.read_to_end(&mut out)).map(|_| out)
        };
        let size = content.len() as u64;
        assert_eq!(read(size, sum).unwrap(), content);
        assert!(read(size, 1).is_err());
        assert!(read(size + 1, sum).is_err());
        assert!(read(size - 1, sum).is_err());
        let coding = StreamCoding::Deflate { crc: 0 };
        assert!(StoredBytes::new(bytes.clone(), 0, packed.len() as u64 + 1, size, coding).is_err());
        assert!(StoredBytes::new(bytes.clone(), u64::MAX, 2, size, coding).is_err());
        assert!(StoredBytes::new(bytes, 0, 10, 1 << 20, coding).is_err());
    }
}
