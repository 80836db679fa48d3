//! Model files, read whole within the bounds that they state.

use crate::input::{self, Source};
use crate::{memory, output};
use particlegs_core::codec::{HEAD_BYTES, blocks_hash, coded_layers, other_length, promised_length};
use particlegs_core::context::Context;
use particlegs_core::model::Metadata;
use particlegs_core::{Error, Result};
use std::path::Path;

/// Refuses a model file's name that means another type of file.
pub fn check_name(out: &Path) -> Result<()> {
    output::ending(out, &["pgs"]).map(drop)
}

/// Whether a file is merged from several snapshots. Its hash is that of its blocks then, so no snapshot has it.
pub fn is_of_several(bytes: &[u8], metadata: &Metadata, place: &str) -> Result<bool> {
    Ok(metadata.source_hash == blocks_hash(&coded_layers(bytes, place)?))
}

/// Reads a model file: its head first, and no further than the head says that the file goes (an open file to its end).
/// `-` is standard input.
pub fn read_file(path: &Path, context: &Context<'_>) -> Result<Vec<u8>> {
    read_source(Source::open(path, context)?, &input::name_of(path))
}

/// A model file that is open: its head first, and no further than the head says that the file goes.
pub fn read_source(mut source: Source<'_>, place: &str) -> Result<Vec<u8>> {
    let Some(length) = promised_length(source.peek(HEAD_BYTES)?, place)? else {
        // An open file goes to its end; one byte more tells whether there was room for it.
        let most = source.length().or_else(memory::available_bytes).unwrap_or(u64::MAX);
        memory::require("a model file", source.length().unwrap_or(0))?;
        let bytes = source.read(most.saturating_add(1))?;
        return match bytes.len() as u64 > most {
            true => Err(Error::input(place, "it does not end, or grew while it was read")),
            false => Ok(bytes),
        };
    };
    if let Some(actual_length) = source.length().filter(|n| *n != length) {
        return Err(Error::corrupt(place, other_length(actual_length, length)));
    }
    memory::require("a model file", length.min(source.length().unwrap_or(0)))?;
    let bytes = source.read(length.saturating_add(1))?;
    match bytes.len() as u64 > length {
        true => Err(Error::corrupt(place, format!("more bytes follow its end at byte {length}"))),
        false => Ok(bytes),
    }
}
