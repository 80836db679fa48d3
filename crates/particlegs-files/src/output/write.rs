//! Single files, written whole or not at all: bytes, JSON, and the head of a NumPy array.

use super::place::{OutputTarget, folder_of};
use super::state::{CHANGED, PlannedOutput};
use super::temporary::{BUFFER, TemporaryFile};
use crate::{Error, Result};
use particlegs_core::text::printable_json;
use serde::Serialize;
use std::borrow::Cow;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes `path`: a regular file is written beside its place, synced, then moved there; a device or a
/// pipe is written through.
pub fn write_atomic(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let fail = |e| Error::io(path, e);
    match OutputTarget::new(path)? {
        OutputTarget::File(target) => {
            let temporary = TemporaryFile::beside(&target).map_err(fail)?;
            filled(&mut temporary.file(), fill).map_err(fail)?;
            temporary.file().sync_all().map_err(fail)?;
            temporary.place(path, &target)
        }
        stream => filled(&mut *stream.open().map_err(fail)?, fill).map_err(fail),
    }
}

fn filled(to: &mut dyn Write, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> std::io::Result<()> {
    let mut writer = BufWriter::with_capacity(BUFFER, to);
    fill(&mut writer)?;
    writer.flush()
}

/// [`write_atomic`] of bytes at hand.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomic(path, |w| w.write_all(bytes))
}

/// A record as text, with what would act on a terminal escaped.
pub fn json_text(record: &impl Serialize) -> String {
    let text = serde_json::to_string_pretty(record).expect("records are plain data") + "\n";
    match printable_json(&text) {
        Cow::Owned(escaped) => escaped,
        Cow::Borrowed(_) => text,
    }
}

/// [`write_bytes`] of a record as JSON.
pub fn write_json(path: &Path, record: &impl Serialize) -> Result<()> {
    write_bytes(path, json_text(record).as_bytes())
}

/// Says early, before long work, whether `path` can be created in its folder.
pub fn check_writable(path: &Path) -> Result<()> {
    match OutputTarget::new(path)? {
        OutputTarget::File(target) if target.is_dir() => {
            Err(Error::output(path, "is a folder, but a file must be written", "name a file"))
        }
        OutputTarget::File(target) => check_folder(folder_of(&target)).map_err(|e| Error::io(path, e)),
        _ => Ok(()),
    }
}

/// Whether `path` is a device, a pipe or standard output, which nothing can lie beside.
pub fn is_stream(path: &Path) -> Result<bool> {
    Ok(!matches!(OutputTarget::new(path)?, OutputTarget::File(_)))
}

/// The folder for files that an output needs on the way: its own, or the system's for temporary files
/// where the output is a stream.
pub fn scratch_folder(path: &Path) -> PathBuf {
    match OutputTarget::new(path) {
        Ok(OutputTarget::File(target)) => folder_of(&target).to_path_buf(),
        _ => std::env::temp_dir(),
    }
}

/// Opens a file that grows line by line, at its end or anew; a device or a pipe is written through.
pub fn open_log(path: &Path, append: bool) -> Result<Box<dyn Write + Send>> {
    let fail = |e| Error::io(path, e);
    match OutputTarget::new(path)? {
        OutputTarget::File(target) => {
            // Opened as it is: what has come there meanwhile is noticed before it is cut.
            let file = std::fs::File::options().append(true).create(true).open(&target).map_err(fail)?;
            if !append {
                if let Some(planned) = PlannedOutput::find(path)
                    && planned.replaceable(&target).map_err(fail)?.is_none()
                {
                    return Err(Error::output(path, CHANGED, "name another file"));
                }
                file.set_len(0).map_err(fail)?;
            }
            Ok(Box::new(file))
        }
        stream => stream.open().map_err(fail),
    }
}

pub(super) fn check_folder(folder: &Path) -> std::io::Result<()> {
    // Permissions alone do not tell: the disk may be read-only or over its quota.
    tempfile::tempfile_in(folder).map(drop)
}

/// The head of a NumPy array of this element type (`<f4`, `<f8`, `<U7`, ...) and shape, in C order: what
/// stands before its elements. Its length is a multiple of 64 bytes. No sides are a single value.
///
/// Source: NEP 1, version 1.0 of the format, which holds heads of less than 65 536 bytes.
pub fn npy_header(element: &str, shape: &[u64]) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(u64::to_string).collect();
    // Python writes a tuple of one with a comma.
    let comma = if sides.len() == 1 { "," } else { "" };
    let sides = format!("({}{comma})", sides.join(", "));
    let mut text = format!("{{'descr': '{element}', 'fortran_order': False, 'shape': {sides}, }}");
    // Ten bytes stand before the text, and a line break behind it.
    while (10 + text.len() + 1) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.as_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_pythons() {
        for (shape, words) in [(&[][..], "()"), (&[7], "(7,)"), (&[7, 3], "(7, 3)"), (&[2, 3, 4], "(2, 3, 4)")] {
            let header = npy_header("<f4", shape);
            let text = String::from_utf8_lossy(&header[10..]).into_owned();
            assert!(header.len().is_multiple_of(64) && text.ends_with('\n'));
            assert_eq!(usize::from(u16::from_le_bytes([header[8], header[9]])), header.len() - 10);
            assert!(text.contains(&format!("'descr': '<f4', 'fortran_order': False, 'shape': {words}, }}")), "{text}");
        }
    }
}
