//! Several files that one step makes: all of them appear, or none.

use super::place::OutputTarget;
use super::state::{CHANGED, PlannedOutput};
use super::temporary::{TemporaryFile, TemporaryFolder, is_same};
use super::write::write_bytes;
use crate::{Error, Result};
use std::fs::File;
use std::path::{Path, PathBuf};

/// Files that are written to a folder of their own within their folder, and moved to their places
/// together.
pub struct FileSet {
    folder: PathBuf,
    staged: TemporaryFolder,
}

impl FileSet {
    /// Files for `folder`, which is there.
    pub fn in_folder(folder: &Path) -> Result<FileSet> {
        let staged = TemporaryFolder::within(folder).map_err(|e| Error::io(folder, e))?;
        Ok(FileSet { folder: folder.to_path_buf(), staged })
    }

    pub fn path(&self) -> &Path {
        self.staged.path()
    }

    /// The places of the files that have been written, in the order of their names.
    pub fn places(&self) -> Result<Vec<PathBuf>> {
        let fail = |e| Error::io(&self.folder, e);
        let entries = std::fs::read_dir(self.staged.path()).map_err(fail)?;
        let names = entries.map(|e| e.map(|e| self.folder.join(e.file_name())));
        let mut places = names.collect::<std::io::Result<Vec<_>>>().map_err(fail)?;
        places.sort();
        Ok(places)
    }

    /// Moves them to their places, over what is there; gives the places.
    pub fn finish(self) -> Result<Vec<PathBuf>> {
        let places = self.places()?;
        for place in &places {
            if let (Some(planned), OutputTarget::File(target)) = (PlannedOutput::find(place), OutputTarget::new(place)?)
                && planned.replaceable(&target).map_err(|e| Error::io(place, e))?.is_none()
                && !File::open(self.staged_at(place)).is_ok_and(|mut file| is_same(&mut file, &target))
            {
                return Err(Error::output(place, CHANGED, "run the command again, or name another place"));
            }
        }
        for place in &places {
            moved(self.staged_at(place), place)?;
        }
        Ok(places)
    }

    fn staged_at(&self, place: &Path) -> PathBuf {
        self.staged.path().join(place.file_name().unwrap_or_default())
    }
}

fn moved(from: PathBuf, to: &Path) -> Result<()> {
    let fail = |e| Error::io(to, e);
    let written = || write_bytes(to, &std::fs::read(&from).map_err(fail)?);
    match OutputTarget::new(to)? {
        OutputTarget::File(target) => match TemporaryFile::open(from.clone()).map_err(fail)?.place(to, &target) {
            // Behind a link to another disk.
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::CrossesDevices => written(),
            done => done,
        },
        _ => written(),
    }
}
