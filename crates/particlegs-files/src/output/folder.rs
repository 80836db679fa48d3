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
    way: Way,
}

/// How a folder comes to its place.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// By its name, where nothing but an empty folder is.
    Rename,
    /// In exchange for the folder that is there.
    Exchange,
    /// File by file, into the empty folder around it.
    Inside,
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
    /// As [`WholeFolder::check`]; [`Error::Output`] for the working folder, where it is not empty: whoever
    /// works in it would be left in one that is gone.
    pub fn create(out: &Path, own: &[&str]) -> Result<WholeFolder> {
        let filled = WholeFolder::check(out, own)?;
        let Place::File(target) = Place::of(out)? else { return Err(no_folder(out)) };
        let fail = |e| Error::io(out, e);
        // The name itself, also of `.` and `a/..`: what it lies in is where it is made.
        let target = std::fs::canonicalize(&target).unwrap_or(target);
        let is_there = target.is_dir();
        let here = is_there && Identity::of(&target) == Identity::of(Path::new("."));
        if here && filled {
            let what = "is the working folder, and would be replaced as a whole";
            return Err(Error::output(out, what, "run the command in another folder"));
        }
        let beside = TemporaryFolder::within(folder_of(&target));
        let (staged, way) = match beside {
            Ok(staged) if !here && (!is_there || same_disk(staged.path(), &target)) => {
                (staged, if filled { Way::Exchange } else { Way::Rename })
            }
            Err(e) if !is_there || filled => return Err(fail(e)),
            _ if filled => return Err(fail(std::io::ErrorKind::CrossesDevices.into())),
            _ => (TemporaryFolder::within(&target).map_err(fail)?, Way::Inside),
        };
        Ok(WholeFolder { out: out.to_path_buf(), target, staged, way })
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
        if let Ok(there) = self.target.metadata() {
            // Who may use the folder stays as it is; where that cannot be, it is as any new folder.
            let _ = std::fs::set_permissions(self.staged.path(), there.permissions());
        }
        let done = match self.way {
            Way::Inside => self.move_files(),
            Way::Exchange => self.exchange(),
            // It fails where another process has filled the folder meanwhile.
            Way::Rename => std::fs::rename(self.staged.path(), &self.target).map(|()| self.staged.moved()),
        };
        done.map_err(|e| Error::io(&self.out, e))
    }

    /// Takes the place of the folder that is there; what it held goes.
    fn exchange(&mut self) -> std::io::Result<()> {
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
