//! Model files, read whole within the bounds that they state.

use super::{HEAD_BYTES, other_length, promised_length};
use crate::progress::Progress;
use crate::{Error, Result};
use particlegs_files::input::{self, Source};
use particlegs_files::memory;
use std::path::Path;

/// Reads a model file: its head first, and no further than the head says that the file goes. `-` is
/// standard input.
///
/// # Errors
/// [`Error::Corrupt`] for what is no model file, is cut short or goes on after its end;
/// [`Error::Compatibility`]; [`Error::Memory`] before it is read; [`Error::Io`]; [`Error::Cancelled`].
pub(crate) fn read_file(path: &Path, progress: &dyn Progress) -> Result<Vec<u8>> {
    read_source(Source::open(path, progress)?, &input::name_of(path))
}

/// A model file that is open: its head first, and no further than the head says that the file goes.
///
/// # Errors
/// [`Error::Corrupt`] for what is no model file, is cut short or goes on after its end;
/// [`Error::Compatibility`]; [`Error::Memory`] before it is read; [`Error::Io`]; [`Error::Cancelled`].
pub fn read_source(mut source: Source<'_>, place: &str) -> Result<Vec<u8>> {
    let length = promised_length(source.peek(HEAD_BYTES)?, place)?;
    if let Some(there) = source.length().filter(|n| *n != length) {
        return Err(Error::corrupt(place, other_length(there, length)));
    }
    memory::require("a model file", length.min(source.length().unwrap_or(0)))?;
    let bytes = source.read(length.saturating_add(1))?;
    match bytes.len() as u64 > length {
        true => Err(Error::corrupt(place, format!("more bytes follow its end at byte {length}"))),
        false => Ok(bytes),
    }
}
