//! Files that a long run keeps beside its output until that is whole.

use super::names::is_temporary;
use super::place::OutputTarget;
use super::temporary::TemporaryFile;
use crate::{Error, Result};
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

const LOCK: &str = "lock";

/// The folder `OUTPUT.work`: files of one run's names, and no others. It is locked while it lives, follows no links,
/// and takes away nothing but its own names.
#[derive(Debug)]
pub struct WorkFolder {
    path: PathBuf,
    lock: Option<File>,
    is_own: fn(&str) -> bool,
    /// Made by this run or by an earlier one, and not an empty folder of somebody's.
    is_ours: bool,
}

impl WorkFolder {
    /// Opens or makes the folder of an `output`, whose files have names that are `is_own`; none where the output is a
    /// device, a pipe or standard output.
    ///
    /// # Errors
    /// [`Error::Output`]: it is no folder, another run uses it, or it holds links, folders or names of others.
    pub fn beside(output: &Path, is_own: fn(&str) -> bool) -> Result<Option<WorkFolder>> {
        let OutputTarget::File(target) = OutputTarget::new(output)? else { return Ok(None) };
        let mut name = target.into_os_string();
        name.push(".work");
        let path = PathBuf::from(name);
        let fail = |e| Error::io(&path, e);
        let is_new = match std::fs::create_dir(&path) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => false,
            done => done.map(|()| true).map_err(fail)?,
        };
        if !std::fs::symlink_metadata(&path).map_err(fail)?.is_dir() {
            return Err(refused(&path, "is in the way: unfinished work is kept in a folder of this name".into()));
        }
        let mut folder = WorkFolder { path: path.clone(), lock: None, is_own, is_ours: is_new };
        folder.is_ours |= folder.own_names()?.iter().any(|name| name != LOCK);
        let lock = open_unlinked(&path.join(LOCK)).map_err(fail)?;
        match lock.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(in_use(&path)),
            // A disk without locks: two runs at one output are the user's to avoid.
            Err(TryLockError::Error(e)) if e.kind() != ErrorKind::Unsupported => return Err(fail(e)),
            // The run before has ended meanwhile, and taken the lock with it.
            _ if !is_at(&lock, &path.join(LOCK)) => return Err(in_use(&path)),
            _ => {}
        }
        folder.lock = Some(lock);
        Ok(Some(folder))
    }

    /// The path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The names inside that this run may have written.
    fn own_names(&self) -> Result<Vec<String>> {
        let fail = |e| Error::io(&self.path, e);
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&self.path).map_err(fail)? {
            let entry = entry.map_err(fail)?;
            let name = entry.file_name();
            if is_temporary(&name) {
                continue;
            }
            let shown = name.to_string_lossy().into_owned();
            if !(shown == LOCK || (self.is_own)(&shown)) {
                return Err(refused(&self.path, format!("contains `{shown}`, which this command does not write")));
            }
            if !entry.file_type().map_err(fail)?.is_file() {
                return Err(refused(&self.path, format!("contains `{shown}`, which is no regular file")));
            }
            names.push(shown);
        }
        Ok(names)
    }

    /// The bytes of a file; none where it is missing or cannot be read.
    pub fn read(&self, name: &str) -> Option<Vec<u8>> {
        let path = self.path.join(name);
        let is_file = std::fs::symlink_metadata(&path).is_ok_and(|m| m.is_file());
        let mut bytes = Vec::new();
        is_file.then(|| File::open(&path)?.read_to_end(&mut bytes)).and_then(|read| read.ok())?;
        Some(bytes)
    }

    /// Writes a file, whole or not at all, over one of its name.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.path.join(name);
        let fail = |e| Error::io(&path, e);
        let temporary = TemporaryFile::beside(&path).map_err(fail)?;
        temporary.file().write_all(bytes).and_then(|()| temporary.file().sync_all()).map_err(fail)?;
        temporary.replace(&path).map_err(fail)
    }

    /// Removes its files. Those that others have put there stay.
    ///
    /// # Errors
    /// As of [`WorkFolder::beside`]: nothing is removed then.
    pub fn clear(&self) -> Result<()> {
        for name in self.own_names()?.iter().filter(|name| *name != LOCK) {
            std::fs::remove_file(self.path.join(name)).map_err(|e| Error::io(&self.path, e))?;
        }
        Ok(())
    }

    /// Removes its files and, where nothing else is in it, the folder; otherwise gives the reason.
    pub fn remove(self) -> Result<()> {
        let cleared = self.clear();
        let _ = std::fs::remove_file(self.path.join(LOCK));
        // It fails, as it should, where something is in it.
        let _ = self.is_ours.then(|| std::fs::remove_dir(&self.path));
        cleared
    }
}

fn refused(path: &Path, why: String) -> Error {
    Error::output(path, why, "move it away, or name another output")
}

fn in_use(path: &Path) -> Error {
    let hint = "wait until that has ended, or name another output";
    Error::output(path, "another run of this command is making the same output", hint)
}

/// Whether an open file is the one that has this name.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |m: std::fs::Metadata| (m.dev(), m.ino());
    let named = std::fs::symlink_metadata(path).ok().map(identity);
    named.is_some() && file.metadata().ok().map(identity) == named
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// Opens a file to lock it, made where it is missing; not through a link.
fn open_unlinked(path: &Path) -> std::io::Result<File> {
    let mut options = File::options();
    options.read(true).write(true).create(true).truncate(false);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, rustix::fs::OFlags::NOFOLLOW.bits() as i32);
    options.open(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(folder: &Path) -> Result<WorkFolder> {
        WorkFolder::beside(&folder.join("run"), |name| name.starts_with("part-")).map(Option::unwrap)
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn files_are_kept_from_run_to_run_and_go_with_the_folder() {
        let dir = tempfile::tempdir().unwrap();
        let work = open(dir.path()).unwrap();
        work.write("part-1", b"first").unwrap();
        work.write("part-1", b"second").unwrap();
        assert_eq!(open(dir.path()).unwrap_err().to_string().matches("another run").count(), 1);
        drop(work);
        let work = open(dir.path()).unwrap();
        assert_eq!((work.read("part-1").as_deref(), work.read("part-2")), (Some(&b"second"[..]), None));
        work.remove().unwrap();
        assert_eq!(names(dir.path()), [""; 0]);
    }

    #[test]
    fn what_others_put_there_is_refused_and_stays() {
        let dir = tempfile::tempdir().unwrap();
        let place = dir.path().join("run.work");
        std::fs::write(&place, "a file").unwrap();
        assert!(open(dir.path()).unwrap_err().to_string().contains("is in the way"));
        std::fs::remove_file(&place).unwrap();
        std::fs::create_dir(&place).unwrap();
        std::fs::write(place.join("notes"), "mine").unwrap();
        assert!(open(dir.path()).unwrap_err().to_string().contains("`notes`"));
        std::fs::remove_file(place.join("notes")).unwrap();
        // An empty folder of somebody's stays.
        open(dir.path()).unwrap().remove().unwrap();
        assert_eq!(names(dir.path()), ["run.work"]);
        // So does what comes into it while it is used, and what the run has written then.
        let work = open(dir.path()).unwrap();
        work.write("part-1", b"x").unwrap();
        std::fs::create_dir(place.join("part-2")).unwrap();
        assert!(work.remove().is_err());
        assert_eq!(names(&place), ["part-1", "part-2"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_neither_followed_nor_replaced_unseen() {
        let dir = tempfile::tempdir().unwrap();
        let (place, other) = (dir.path().join("run.work"), dir.path().join("other"));
        std::fs::write(&other, "another's").unwrap();
        std::fs::create_dir(dir.path().join("elsewhere")).unwrap();
        std::os::unix::fs::symlink("elsewhere", &place).unwrap();
        assert!(open(dir.path()).is_err());
        std::fs::remove_file(&place).unwrap();
        std::fs::create_dir(&place).unwrap();
        for name in ["part-1", LOCK] {
            std::os::unix::fs::symlink(&other, place.join(name)).unwrap();
            assert!(open(dir.path()).unwrap_err().to_string().contains("no regular file"));
            std::fs::remove_file(place.join(name)).unwrap();
        }
        // One that comes later is replaced, and what it leads to stays as it is.
        let work = open(dir.path()).unwrap();
        std::os::unix::fs::symlink(&other, place.join("part-1")).unwrap();
        assert_eq!(work.read("part-1"), None);
        work.write("part-1", b"ours").unwrap();
        assert_eq!(std::fs::read_to_string(&other).unwrap(), "another's");
        assert_eq!(work.read("part-1").as_deref(), Some(&b"ours"[..]));
    }
}
