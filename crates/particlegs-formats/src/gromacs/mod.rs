//! Trajectories of GROMACS: XTC (compressed positions) and TRR (positions, velocities, forces), big-endian numbers in XDR.
//! Frames are found by their headers alone.

mod coding;
pub mod trr;
pub mod xtc;

use crate::atoms::widened;
use particlegs_core::model::{Dimension, Unit, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_files::input::open_file;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// A file that is read here and there.
struct XdrFile {
    path: PathBuf,
    file: File,
    length: u64,
    /// Bytes that were read last, and where they begin.
    window: Vec<u8>,
    start: u64,
}

/// Bytes that are read at once where frames are small.
const WINDOW: u64 = 1 << 16;

impl XdrFile {
    fn open(path: &Path) -> Result<XdrFile> {
        let (file, length) = open_file(path)?;
        Ok(XdrFile { path: path.to_path_buf(), file, length, window: Vec::new(), start: 0 })
    }

    /// Bytes from `at` on, fewer at the end of the file.
    fn bytes(&mut self, at: u64, count: u64) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let read =
            self.file.seek(SeekFrom::Start(at)).and_then(|_| (&mut self.file).take(count).read_to_end(&mut bytes));
        read.map(|_| bytes).map_err(|e| Error::io(&self.path, e))
    }

    /// The same of a header.
    fn head(&mut self, at: u64, count: u64) -> Result<&[u8]> {
        let end = self.start + self.window.len() as u64;
        if at < self.start || (at + count).min(self.length) > end {
            let is_near = at.checked_sub(self.start).is_some_and(|ahead| ahead <= WINDOW);
            self.window = self.bytes(at, if is_near { WINDOW } else { count })?;
            self.start = at;
        }
        let from = (at - self.start) as usize;
        Ok(&self.window[from.min(self.window.len())..self.window.len().min(from + count as usize)])
    }

    /// The error for frame `number`, which begins at byte `at`.
    fn error(&self, number: u64, at: u64, reason: &str) -> Error {
        let message = format!("frame {number}, at byte {at}: {reason}");
        Error::input_with(&self.path, message, "the file is damaged or cut short: copy it again")
    }

    /// Checks that a frame of `size` bytes ends within the file, and gives its end.
    fn end(&self, number: u64, at: u64, size: u64) -> Result<u64> {
        let end = at.checked_add(size).filter(|&end| end <= self.length);
        end.ok_or_else(|| self.error(number, at, &format!("it needs {size} bytes, but {} are left", self.length - at)))
    }
}

/// Big-endian numbers of a header, one after the other.
struct XdrNumbers<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl XdrNumbers<'_> {
    fn word(&mut self) -> Option<[u8; 4]> {
        let word = self.bytes.get(self.at..self.at + 4)?.try_into().ok()?;
        self.at += 4;
        Some(word)
    }

    fn int(&mut self) -> Option<i32> {
        self.word().map(i32::from_be_bytes)
    }

    /// A number that must not be negative.
    fn count(&mut self) -> Option<u64> {
        self.int().and_then(|n| u64::try_from(n).ok())
    }

    fn float(&mut self) -> Option<f64> {
        self.word().map(|w| widened(f32::from_be_bytes(w)))
    }

    fn double(&mut self) -> Option<f64> {
        let (high, low) = (self.word()?, self.word()?);
        Some(f64::from_bits(u64::from(u32::from_be_bytes(high)) << 32 | u64::from(u32::from_be_bytes(low))))
    }

    /// Three vectors of numbers of `bytes` bytes.
    fn cell(&mut self, bytes: u64) -> Option<[[f64; 3]; 3]> {
        let mut vectors = [[0.0; 3]; 3];
        for value in vectors.iter_mut().flatten() {
            *value = if bytes == 8 { self.double()? } else { self.float()? };
        }
        Some(vectors)
    }
}

fn periodic(vectors: [[f64; 3]; 3]) -> Option<Cell> {
    Cell::stated([0.0; 3], vectors, [true; 3])
}

fn units() -> Units {
    Units { time: Some(Unit::parse("ps", Dimension::Time)), ..Units::new(Some("nm"), None, None) }
}

#[cfg(test)]
mod tests;
