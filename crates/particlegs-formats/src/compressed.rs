//! Text files that come compressed: gzip, bzip2, zstd, read as streams.

use particlegs::{Error, Result};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// How a file is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// RFC 1952, members one after the other.
    Gzip,
    /// bzip2, streams one after the other.
    Bzip2,
    /// Zstandard frames.
    Zstd,
}

impl Compression {
    /// By a file's first bytes.
    pub fn of(head: &[u8]) -> Option<Self> {
        match head {
            [0x1f, 0x8b, 8, ..] => Some(Compression::Gzip),
            [b'B', b'Z', b'h', b'1'..=b'9', 0x31, 0x41, 0x59, ..] => Some(Compression::Bzip2),
            [0x28, 0xb5, 0x2f, 0xfd, ..] => Some(Compression::Zstd),
            _ => None,
        }
    }

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Compression::Gzip => "gzip",
            Compression::Bzip2 => "bzip2",
            Compression::Zstd => "zstd",
        }
    }

    /// Decompresses `source` as it is read.
    pub fn decoder(self, source: impl Read + Send + 'static) -> std::io::Result<Box<dyn Read + Send>> {
        Ok(match self {
            Compression::Gzip => Box::new(flate2::read::MultiGzDecoder::new(source)),
            Compression::Bzip2 => Box::new(bzip2::read::MultiBzDecoder::new(source)),
            Compression::Zstd => {
                Box::new(ruzstd::decoding::StreamingDecoder::new(source).map_err(std::io::Error::other)?)
            }
        })
    }
}

/// A file's content as a stream, decompressed where it is compressed.
///
/// # Errors
/// [`Error::Io`] where it cannot be read.
pub fn open_stream(path: &Path, compression: Option<Compression>) -> Result<Box<dyn Read + Send>> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    match compression {
        None => Ok(Box::new(file)),
        Some(c) => c.decoder(BufReader::with_capacity(1 << 17, file)).map_err(|e| Error::io(path, e)),
    }
}
