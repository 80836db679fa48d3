//! Pictures as files.

use crate::{Gray8, Result};
use particlegs_files::png::write_png;
use std::path::Path;

/// Writes a picture as PNG, whole or not at all.
pub trait SavePng {
    /// Writes it to `path`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()>;
}

impl SavePng for Gray8 {
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()> {
        write_png(path.as_ref(), self.size, &self.data)
    }
}
