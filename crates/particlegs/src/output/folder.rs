//! A folder of files that belong together: whole or not at all.

use super::identity::Identity;
use super::place::{Place, folder_of};
use super::temporary::{TemporaryFolder, is_temporary};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// A folder that is filled beside its place and moved there whole, over one of the same kind.
pub struct WholeFolder {
    out: PathBuf,
    target: PathBuf,
    staged: TemporaryFolder,
    /// Is it filled within its place, because nothing can be made beside it?
    inside: bool,
}

impl WholeFolder {
    /// Tells whether `out` is a folder that holds files with the names `own`.
    ///
    /// # Errors
    /// [`Error::Output`] where it is a file or a stream, or holds anything else; [`Error::Io`] where it
    /// cannot be made or written.
    pub fn check(out: &Path, own: &[&str]) -> Result<bool> {
        let Place::File(target) = Place::of(out)? else { return Err(no_folder(out)) };
        if target.is_file() {
            return Err(no_folder(out));
        }
        if !target.is_dir() {
            return super::check_folder(folder_of(&target)).map(|()| false).map_err(|e| Error::io(out, e));
        }
        let mut filled = false;
        for entry in std::fs::read_dir(&target).map_err(|e| Error::io(out, e))? {
            let name = entry.map_err(|e| Error::io(out, e))?.file_name();
            if is_temporary(&name) {
                continue;
            }
            if !own.iter().any(|o| name == *o) {
                let what = format!("holds `{}`, which is none of the files to be written", name.to_string_lossy());
                return Err(Error::output(out, what, "name a folder of its own"));
            }
            filled = true;
        }
        Ok(filled)
    }

    /// Begins a folder for `out`, which may replace files with the names `own`.
    ///
    /// # Errors
    /// As [`WholeFolder::check`].
    pub fn create(out: &Path, own: &[&str]) -> Result<WholeFolder> {
        let filled = WholeFolder::check(out, own)?;
        let Place::File(target) = Place::of(out)? else { return Err(no_folder(out)) };
        let fail = |e| Error::io(out, e);
        // The name itself, also of `.` and `a/..`: what it lies in is where it is made.
        let target = std::fs::canonicalize(&target).unwrap_or(target);
        let empty = target.is_dir() && !filled;
        let beside = match TemporaryFolder::within(folder_of(&target)) {
            Ok(staged) if !empty || same_disk(staged.path(), &target) => Ok(staged),
            Ok(_) => Err(std::io::ErrorKind::CrossesDevices.into()),
            Err(e) => Err(e),
        };
        let (staged, inside) = match beside {
            Ok(staged) => (staged, false),
            Err(_) if empty => (TemporaryFolder::within(&target).map_err(fail)?, true),
            Err(e) => return Err(fail(e)),
        };
        Ok(WholeFolder { out: out.to_path_buf(), target, staged, inside })
    }

    /// Where its files are written.
    pub fn path(&self) -> &Path {
        self.staged.path()
    }

    /// Moves it to its place.
    ///
    /// # Errors
    /// [`Error::Io`]; what was there is untouched then.
    pub fn finish(mut self) -> Result<()> {
        let done = match (self.inside, self.target.is_dir()) {
            (true, _) => self.move_files(),
            (false, true) => self.exchange(),
            (false, false) => std::fs::rename(self.staged.path(), &self.target).map(|()| self.staged.moved()),
        };
        done.map_err(|e| Error::io(&self.out, e))
    }

    /// Takes the place of the folder that is there; what it held goes.
    fn exchange(&mut self) -> std::io::Result<()> {
        // An empty folder is replaced in one step on every system.
        if std::fs::rename(self.staged.path(), &self.target).is_ok() {
            self.staged.moved();
            return Ok(());
        }
        match swap(self.staged.path(), &self.target) {
            // The files of the old one go with the temporary folder that they are in now.
            Ok(()) => Ok(()),
            Err(e) if is_unsupported(&e) => self.put_aside(),
            Err(e) => Err(e),
        }
    }

    /// Where two folders cannot be exchanged in one step, the old one waits under a name that says what it is.
    fn put_aside(&mut self) -> std::io::Result<()> {
        let mut name = self.target.as_os_str().to_os_string();
        name.push(format!(".replaced-{}", std::process::id()));
        let old = PathBuf::from(name);
        std::fs::rename(&self.target, &old)?;
        match std::fs::rename(self.staged.path(), &self.target) {
            Ok(()) => {
                self.staged.moved();
                std::fs::remove_dir_all(&old)
            }
            Err(e) => std::fs::rename(&old, &self.target).and(Err(e)),
        }
    }

    /// Moves the files one by one into the empty folder around them; none stays where one fails.
    fn move_files(&mut self) -> std::io::Result<()> {
        let mut moved = Vec::new();
        for entry in std::fs::read_dir(self.staged.path())? {
            let entry = entry?;
            let to = self.target.join(entry.file_name());
            if let Err(e) = std::fs::rename(entry.path(), &to) {
                moved.iter().for_each(|m| drop(std::fs::remove_file(m)));
                return Err(e);
            }
            moved.push(to);
        }
        Ok(())
    }
}

fn no_folder(out: &Path) -> Error {
    Error::output(out, "is a file, not a folder", "name a folder")
}

/// Do two folders lie on one disk, so that one can be renamed to the other?
fn same_disk(a: &Path, b: &Path) -> bool {
    match (Identity::of(a), Identity::of(b)) {
        (Identity::There(a, _), Identity::There(b, _)) => a == b,
        _ => true,
    }
}

/// Exchanges two folders in one step.
#[cfg(target_os = "linux")]
fn swap(a: &Path, b: &Path) -> std::io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE)?)
}

#[cfg(not(target_os = "linux"))]
fn swap(_: &Path, _: &Path) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

/// Can this disk not exchange folders?
fn is_unsupported(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{InvalidInput, Unsupported};
    matches!(error.kind(), InvalidInput | Unsupported)
}
