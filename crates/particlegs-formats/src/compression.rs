//! Text files that come compressed: gzip, bzip2, zstd, read as streams.

use particlegs_core::{Error, Result};
use particlegs_files::input::open_file;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

particlegs_core::named_values! {
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum FileCompression {
        /// RFC 1952, members one after the other.
        Gzip = "gzip",
        Bzip2 = "bzip2",
        Zstd = "zstd",
    }
}

impl FileCompression {
    pub fn from_magic(head: &[u8]) -> Option<Self> {
        match head {
            [0x1f, 0x8b, 8, ..] => Some(FileCompression::Gzip),
            // Pi's first digits mark a block of bzip2: `BZh9` alone may begin a text.
            [b'B', b'Z', b'h', b'1'..=b'9', 0x31, 0x41, 0x59, ..] => Some(FileCompression::Bzip2),
            [0x28, 0xb5, 0x2f, 0xfd, ..] => Some(FileCompression::Zstd),
            _ => None,
        }
    }
    /// Decompresses `source` as it is read. A stream that is cut off or fails its checksum gives an
    /// error, never a silent end.
    pub fn decoder(self, source: impl Read + Send + 'static) -> std::io::Result<Box<dyn Read + Send>> {
        Ok(match self {
            FileCompression::Gzip => Box::new(flate2::read::MultiGzDecoder::new(source)),
            FileCompression::Bzip2 => Box::new(bzip2::read::MultiBzDecoder::new(source)),
            FileCompression::Zstd => Box::new(ZstdFrames::new(source)),
        })
    }

    /// The error for a stream in the file `path` that `cause` ended after `bytes` of content.
    pub fn broken(self, path: &Path, bytes: u64, cause: &std::io::Error) -> Error {
        let message = match cause.kind() {
            ErrorKind::UnexpectedEof => format!("the {} data end early, after {bytes} decompressed bytes", self.name()),
            _ => format!("the {} data are damaged after {bytes} decompressed bytes: {cause}", self.name()),
        };
        Error::input_with(path, message, "copy the file again from its source")
    }
}

/// The error for a compressed file of a format, `title`, that is read where it lies; nothing where it is not compressed.
pub fn refuse(path: &Path, title: &str) -> Result<()> {
    let (file, _) = open_file(path)?;
    let mut head = Vec::new();
    file.take(16).read_to_end(&mut head).map_err(|e| Error::io(path, e))?;
    match FileCompression::from_magic(&head) {
        None => Ok(()),
        Some(compression) => {
            let message = format!("a {title} compressed with {}, which this program does not read", compression.name());
            Err(Error::input_with(path, message, "unpack it first"))
        }
    }
}

/// A file's content as a stream, decompressed where it is compressed.
pub fn open_stream(path: &Path, compression: Option<FileCompression>) -> Result<Box<dyn Read + Send>> {
    let (file, _) = open_file(path)?;
    match compression {
        None => Ok(Box::new(file)),
        Some(c) => c.decoder(BufReader::with_capacity(1 << 17, file)).map_err(|e| Error::io(path, e)),
    }
}

/// Zstandard frames one after the other, with skippable ones between, checksums compared.
struct ZstdFrames<R> {
    source: BufReader<R>,
    decoder: FrameDecoder,
    /// Whether a frame is begun and not read to its end.
    open: bool,
}

/// Largest window accepted. Streams made with `--ultra` or `--long` may have larger ones.
const ZSTD_WINDOW: u64 = 32 << 20;

impl<R: Read> ZstdFrames<R> {
    fn new(source: R) -> Self {
        let mut decoder = FrameDecoder::new();
        decoder.set_max_window_size(ZSTD_WINDOW);
        ZstdFrames { source: BufReader::with_capacity(1 << 17, source), decoder, open: false }
    }

    /// Begins the next frame; false at the end of the source.
    fn begin(&mut self) -> std::io::Result<bool> {
        loop {
            if self.source.fill_buf()?.is_empty() {
                return Ok(false);
            }
            match self.decoder.reset(&mut self.source) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame { length, .. })) => {
                    let skipped = std::io::copy(&mut (&mut self.source).take(length.into()), &mut std::io::sink())?;
                    if skipped < u64::from(length) {
                        return Err(ErrorKind::UnexpectedEof.into());
                    }
                }
                Err(e) => return Err(io_error(e)),
            }
        }
    }
}

/// The error kind distinguishes cut streams from damaged ones.
fn io_error(error: FrameDecoderError) -> std::io::Error {
    let mut source: Option<&(dyn std::error::Error + 'static)> = Some(&error);
    while let Some(e) = source {
        if e.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == ErrorKind::UnexpectedEof) {
            return ErrorKind::UnexpectedEof.into();
        }
        source = e.source();
    }
    std::io::Error::new(ErrorKind::InvalidData, error.to_string())
}

impl<R: Read> Read for ZstdFrames<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            if buffer.is_empty() || (!self.open && !self.begin()?) {
                return Ok(0);
            }
            self.open = true;
            // One block at a time, so that no more than the window and a block is in memory.
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                self.decoder.decode_blocks(&mut self.source, BlockDecodingStrategy::UptoBlocks(1)).map_err(io_error)?;
            }
            let read = self.decoder.read(buffer)?;
            if read > 0 {
                return Ok(read);
            }
            // Nothing of this frame is left: its sum is complete.
            self.open = false;
            let stated = self.decoder.get_checksum_from_data();
            if stated.is_some() && stated != self.decoder.get_calculated_checksum() {
                return Err(std::io::Error::new(ErrorKind::InvalidData, "the checksum is wrong"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: &[u8] =
        &[0x28, 0xb5, 0x2f, 0xfd, 0x04, 0x58, 0x31, 0x00, 0x00, b'x', b' ', b'1', b' ', b'2', b'\n', 0, 0, 0, 0];

    fn decode(bytes: Vec<u8>) -> std::io::Result<Vec<u8>> {
        let mut out = Vec::new();
        FileCompression::Zstd.decoder(std::io::Cursor::new(bytes))?.read_to_end(&mut out)?;
        Ok(out)
    }

    /// A frame with the checksum that its content has.
    fn frame() -> Vec<u8> {
        let mut frame = FRAME.to_vec();
        let mut decoder = FrameDecoder::new();
        decoder.reset(&frame[..]).unwrap();
        decoder.decode_blocks(&frame[6..], BlockDecodingStrategy::All).unwrap();
        let mut sink = [0; 16];
        let _ = decoder.read(&mut sink).unwrap();
        let n = frame.len();
        frame[n - 4..].copy_from_slice(&decoder.get_calculated_checksum().unwrap().to_le_bytes());
        frame
    }

    #[test]
    fn zstd_frames_follow_each_other_and_checksums_count() {
        let one = frame();
        assert_eq!(decode(one.clone()).unwrap(), b"x 1 2\n");
        let mut two = one.clone();
        two.extend([0x50, 0x2a, 0x4d, 0x18, 2, 0, 0, 0, 9, 9]);
        two.extend(&one);
        assert_eq!(decode(two.clone()).unwrap(), b"x 1 2\nx 1 2\n");
        for cut in 1..two.len() {
            if cut != one.len() && cut != one.len() + 10 {
                assert_eq!(decode(two[..cut].to_vec()).unwrap_err().kind(), ErrorKind::UnexpectedEof, "{cut}");
            }
        }
        let mut wrong = one;
        *wrong.last_mut().unwrap() ^= 1;
        assert!(decode(wrong).unwrap_err().to_string().contains("checksum"));
    }
}
