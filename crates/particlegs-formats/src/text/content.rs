//! The content of a file of text, decompressed where it is compressed.

use crate::compression::{FileCompression, open_stream};
use particlegs_core::{Error, Result};
use particlegs_files::input::open_file;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, sync_channel};

/// A place in the content: a line's beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextPosition {
    /// Bytes of content before it.
    pub offset: u64,
    /// Its number, from 1.
    pub line: u64,
}

impl TextPosition {
    /// The content's beginning.
    pub const START: TextPosition = TextPosition { offset: 0, line: 1 };
}

#[derive(Clone, Debug)]
pub struct TextContent {
    path: PathBuf,
    compression: Option<FileCompression>,
}

impl TextContent {
    pub fn open(path: &Path) -> Result<Self> {
        let fail = |e| Error::io(path, e);
        let (file, _) = open_file(path)?;
        let mut head = Vec::new();
        file.take(16).read_to_end(&mut head).map_err(fail)?;
        if head.is_empty() {
            return Err(Error::input(path, "the file is empty"));
        }
        Ok(TextContent { path: path.to_path_buf(), compression: FileCompression::from_magic(&head) })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it can be read from any place.
    pub fn is_seekable(&self) -> bool {
        self.compression.is_none()
    }

    /// `format`, and how the file is compressed.
    pub fn title(&self, format: &str) -> String {
        match self.compression {
            None => format.to_string(),
            Some(c) => format!("{format}, {}", c.name()),
        }
    }

    /// The content from `start` on, to `end` where it is given. Compressed content is decompressed by a
    /// thread of its own, from its beginning on.
    pub fn stream(&self, start: u64, end: Option<u64>) -> Result<Box<dyn Read>> {
        let fail = |e| Error::io(&self.path, e);
        let length = end.map_or(u64::MAX, |end| end.saturating_sub(start));
        if self.is_seekable() {
            let (mut file, _) = open_file(&self.path)?;
            file.seek(SeekFrom::Start(start)).map_err(fail)?;
            return Ok(Box::new(file.take(length)));
        }
        let mut source = ReadAheadStream::begin(open_stream(&self.path, self.compression)?);
        let passed = std::io::copy(&mut (&mut source).take(start), &mut std::io::sink());
        if passed.map_err(|e| self.error(0, e))? < start {
            return Err(Error::input(&self.path, "the file was shortened while it was being read"));
        }
        Ok(Box::new(source.take(length)))
    }

    /// The error for a read that failed after `bytes` of content.
    pub fn error(&self, bytes: u64, cause: std::io::Error) -> Error {
        match self.compression {
            None => Error::io(&self.path, cause),
            Some(c) => c.broken(&self.path, bytes, &cause),
        }
    }
}

/// Bytes that a thread reads ahead at once, and how many such pieces wait.
const PIECE: usize = 1 << 18;
const WAITING: usize = 8;

/// A stream that a thread of its own reads ahead.
struct ReadAheadStream {
    pieces: Receiver<std::io::Result<Vec<u8>>>,
    piece: Vec<u8>,
    used: usize,
}

impl ReadAheadStream {
    fn begin(mut source: Box<dyn Read + Send>) -> ReadAheadStream {
        let (sender, pieces) = sync_channel(WAITING);
        // It ends with the stream or when the receiver is gone.
        std::thread::spawn(move || {
            loop {
                let mut piece = Vec::with_capacity(PIECE);
                let read = (&mut source).take(PIECE as u64).read_to_end(&mut piece);
                let last = piece.is_empty() || read.is_err();
                if !piece.is_empty() && sender.send(Ok(piece)).is_err() {
                    return;
                }
                if let Err(e) = read {
                    let _ = sender.send(Err(e));
                }
                if last {
                    let _ = sender.send(Ok(Vec::new()));
                    return;
                }
            }
        });
        ReadAheadStream { pieces, piece: Vec::new(), used: 0 }
    }
}

impl Read for ReadAheadStream {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.used == self.piece.len() {
            // The thread says when the stream ends: one that went away has panicked.
            let gone = |_| std::io::Error::other("the decoder failed");
            self.piece = self.pieces.recv().map_err(gone)??;
            self.used = 0;
        }
        let n = buffer.len().min(self.piece.len() - self.used);
        buffer[..n].copy_from_slice(&self.piece[self.used..self.used + n]);
        self.used += n;
        Ok(n)
    }
}
