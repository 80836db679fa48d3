//! From files to an open snapshot: in the format that is named, or that their content has.

use crate::foreign::foreign_of;
use crate::format::{FileHead, Format, LOOKED_AT};
use crate::registry::{named, names};
use crate::{Choice, PathKind, Snapshot, topology};
use particlegs_core::{Error, Hint, Result};
use particlegs_files::input::{Source, SpoolFile};
use std::path::{Path, PathBuf};

impl Choice {
    /// Opens the files of one snapshot. Formats in several files need the first alone and find the rest.
    pub fn open(&self, paths: &[PathBuf]) -> Result<Box<dyn Snapshot>> {
        let first = paths.first().ok_or_else(|| Error::argument("no file was named"))?;
        let format = match &self.format {
            None => detect(first)?,
            Some(name) => named(name)?,
        };
        self.fits(format.name, &first.display().to_string())?;
        let snapshot = (format.open)(paths, self)?;
        if self.by_atoms() { topology::snapshot::named(snapshot, format.name, first, self) } else { Ok(snapshot) }
    }

    /// Rejects choices that have no meaning in a format.
    pub(crate) fn fits(&self, format: &str, place: &str) -> Result<()> {
        if self.by_atoms() && format == "raw" {
            return Err(Error::input(place, "raw columns have no atoms that can be named"));
        }
        if !self.blocks.is_empty() && format != crate::gadget::FORMAT.name {
            return Err(Error::input(place, "block names can only be given for Gadget files of format 1"));
        }
        Ok(())
    }
}

/// Keeps what a pipe or device gives, once its first bytes are those of a snapshot.
pub(crate) fn spool(mut source: Source<'_>, options: &Choice) -> Result<SpoolFile> {
    let bytes = source.peek(LOOKED_AT)?.to_vec();
    let head = FileHead::from_bytes(Path::new(source.place()), u64::MAX, bytes)?;
    match &options.format {
        None => known(&head).map(drop)?,
        // Not all of an endless device for a format that it is not in; a table may begin with anything.
        Some(name) if head.content.contains(&0) && !(named(name)?.detect)(&head) => {
            return Err(Error::input(source.place(), format!("the first bytes are not those of the format `{name}`")));
        }
        Some(_) => {}
    }
    SpoolFile::new(source)
}

/// The format of a file, by its content.
pub(crate) fn detect(path: &Path) -> Result<&'static Format> {
    known(&FileHead::read(path)?)
}

fn known(head: &FileHead) -> Result<&'static Format> {
    let path = &head.path;
    match PathKind::from_head(head) {
        PathKind::Snapshot(format) => Ok(format),
        PathKind::Unknown => Err(match foreign_of(head) {
            Some(foreign) => Error::input_with(
                path,
                format!("{}, which this program does not read", foreign.title),
                foreign.hint(path),
            ),
            None => {
                let hint =
                    Hint::default().option("format", "").words(format!(" sets the format; known formats: {}", names()));
                Error::input_with(path, "the file format is unknown", hint)
            }
        }),
        other => {
            let message = format!("{}, not a snapshot", other.describe().unwrap_or_default());
            Err(Error::input_with(path, message, other.to_a_snapshot()))
        }
    }
}
