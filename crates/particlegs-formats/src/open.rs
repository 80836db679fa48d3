//! From files to an open snapshot.

use crate::detect::detect;
use crate::registry::named;
use crate::{Choice, Snapshot, topology};
use particlegs_core::{Error, Result};
use std::path::PathBuf;

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
