//! Snapshots that are one file, of which nothing but its name may be known.

use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotMeta;
use std::path::{Path, PathBuf};

/// Metadata of a file that says nothing but its name.
pub(crate) fn named(path: &Path) -> SnapshotMeta {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    SnapshotMeta { name, ..SnapshotMeta::default() }
}

/// The one file of a format in single files.
pub(crate) fn only(paths: &[PathBuf]) -> Result<&PathBuf> {
    match paths {
        [one] => Ok(one),
        [] => Err(Error::argument("no file was named")),
        [first, ..] => {
            let message = format!("{} files were named, but this format uses one file per snapshot", paths.len());
            Err(Error::input(first, message))
        }
    }
}
