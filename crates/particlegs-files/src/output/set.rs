//! Several files that one step makes: all of them appear, or none.

use super::place::Place;
use super::temporary::TemporaryFolder;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Files that are written to a folder of their own within their folder, and moved to their places
/// together.
pub struct FileSet {
    folder: PathBuf,
    staged: TemporaryFolder,
}

impl FileSet {
    /// Files for `folder`, which is there.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn in_folder(folder: &Path) -> Result<FileSet> {
        let staged = TemporaryFolder::within(folder).map_err(|e| Error::io(folder, e))?;
        Ok(FileSet { folder: folder.to_path_buf(), staged })
    }

    /// Where they are written.
    pub fn path(&self) -> &Path {
        self.staged.path()
    }

    /// The places of the files that have been written, in the order of their names.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn places(&self) -> Result<Vec<PathBuf>> {
        let fail = |e| Error::io(&self.folder, e);
        let entries = std::fs::read_dir(self.staged.path()).map_err(fail)?;
        let names = entries.map(|e| e.map(|e| self.folder.join(e.file_name())));
        let mut places = names.collect::<std::io::Result<Vec<_>>>().map_err(fail)?;
        places.sort();
        Ok(places)
    }

    /// Moves them to their places, over what is there; gives the places.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(self) -> Result<Vec<PathBuf>> {
        let places = self.places()?;
        for place in &places {
            let from = self.staged.path().join(place.file_name().unwrap_or_default());
            moved(&from, place)?;
        }
        Ok(places)
    }
}

fn moved(from: &Path, to: &Path) -> Result<()> {
    let fail = |e| Error::io(to, e);
    match Place::of(to)? {
        Place::File(target) => match std::fs::rename(from, &target) {
            // Behind a link to another disk.
            Err(e) if e.kind() == std::io::ErrorKind::CrossesDevices => {
                super::write_bytes(to, &std::fs::read(from).map_err(fail)?)
            }
            done => done.map_err(fail),
        },
        _ => super::write_bytes(to, &std::fs::read(from).map_err(fail)?),
    }
}
