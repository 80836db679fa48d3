//! A format, and the start of a file, from which its format is detected.

use crate::compression::FileCompression;
use crate::text::lines::without_end;
use crate::text::split::{Separator, number, tokens};
use crate::{Choice, Snapshot};
use particlegs_core::{Error, Result};
use particlegs_files::input::open_file;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A format that is read.
pub struct Format {
    /// Name for `--format`.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// Whether a file that begins so has it.
    pub(crate) detect: fn(&FileHead) -> bool,
    /// Opens files, the first of which has it.
    pub(crate) open: fn(&[PathBuf], &Choice) -> Result<Box<dyn Snapshot>>,
}

/// The beginning of a file.
pub(crate) struct FileHead {
    pub path: PathBuf,
    pub length: u64,
    pub compression: Option<FileCompression>,
    /// Its first bytes as they are, at most 64 KiB.
    pub bytes: Vec<u8>,
    /// Its first bytes, decompressed where it is compressed, at most 64 KiB.
    pub content: Vec<u8>,
}

/// Bytes that detection looks at.
const HEAD: usize = 1 << 16;
/// Bytes of a compressed file that detection reads: a block of bzip2 is whole in fewer.
pub(crate) const LOOKED_AT: usize = 2 << 20;

impl FileHead {
    pub fn read(path: &Path) -> Result<FileHead> {
        let fail = |e| Error::io(path, e);
        let (mut file, length) = open_file(path)?;
        let mut bytes = Vec::new();
        (&mut file).take(HEAD as u64).read_to_end(&mut bytes).map_err(fail)?;
        if FileCompression::from_magic(&bytes).is_some() {
            file.take((LOOKED_AT - HEAD) as u64).read_to_end(&mut bytes).map_err(fail)?;
        }
        FileHead::from_bytes(path, length, bytes)
    }

    /// Of a file's first bytes, at most 2 MiB; `path` is how messages name it.
    pub fn from_bytes(path: &Path, length: u64, mut bytes: Vec<u8>) -> Result<FileHead> {
        if bytes.is_empty() {
            return Err(Error::input(path, "the file is empty"));
        }
        let compression = FileCompression::from_magic(&bytes);
        let content = compression.map(|c| decompressed(&bytes, c));
        bytes.truncate(HEAD);
        let content = content.unwrap_or_else(|| bytes.clone());
        Ok(FileHead { path: path.to_path_buf(), length, compression, bytes, content })
    }
}

/// Lines and words of the first bytes, decompressed.
impl FileHead {
    pub fn begins(&self, signatures: &[&[u8]]) -> bool {
        signatures.iter().any(|s| self.content.starts_with(s))
    }

    /// Whether the first `within` bytes hold `text`.
    pub fn names(&self, text: &[u8], within: usize) -> bool {
        memchr::memmem::find(&self.content[..within.min(self.content.len())], text).is_some()
    }

    /// Lines of text; none where it is not text.
    pub fn lines(&self) -> impl Iterator<Item = &[u8]> {
        // Binary files have a zero byte near their beginning, text has none.
        let is_text = !self.content[..self.content.len().min(512)].contains(&0);
        let bytes = if is_text { &self.content[..] } else { &[] };
        bytes.split(|&b| b == b'\n').map(without_end)
    }

    pub fn words(&self, index: usize) -> Vec<&[u8]> {
        self.lines().nth(index).map_or(Vec::new(), |l| tokens(l, Separator::Blanks))
    }

    /// The numbers of line `index`, where it holds nothing else.
    pub fn numbers(&self, index: usize) -> Option<Vec<f64>> {
        self.words(index).into_iter().map(number).collect()
    }

    pub fn are_numbers(&self, mut lines: std::ops::Range<usize>, count: usize) -> bool {
        lines.all(|i| self.numbers(i).is_some_and(|n| n.len() == count))
    }
}

/// Whether it is digits and nothing else.
pub(crate) fn is_whole(word: &[u8]) -> bool {
    !word.is_empty() && word.iter().all(u8::is_ascii_digit)
}

/// As much as the first bytes give; a broken stream is found when it is read.
fn decompressed(bytes: &[u8], compression: FileCompression) -> Vec<u8> {
    let mut content = Vec::new();
    if let Ok(decoder) = compression.decoder(std::io::Cursor::new(bytes.to_vec())) {
        let _ = decoder.take(HEAD as u64).read_to_end(&mut content);
    }
    content
}
