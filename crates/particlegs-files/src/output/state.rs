//! The state of an output's place when its command begins: that alone may be replaced when it ends.

use super::names::is_temporary;
use crate::{Error, Result};
use std::collections::{BTreeMap, HashMap};
use std::ffi::OsString;
use std::fs::Metadata;
use std::io::ErrorKind::NotFound;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, MutexGuard};
use std::time::SystemTime;

/// State of a path, links not followed, by which a later change is noticed.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PathState {
    Missing,
    /// Its device and number, length and time.
    File([u64; 2], u64, Option<SystemTime>),
    /// By the names of what it holds.
    Folder(BTreeMap<OsString, PathState>),
}

impl PathState {
    pub fn at(path: &Path) -> std::io::Result<PathState> {
        let metadata = match std::fs::symlink_metadata(path) {
            Err(e) if e.kind() == NotFound => return Ok(PathState::Missing),
            metadata => metadata?,
        };
        if !metadata.is_dir() {
            return Ok(PathState::from_metadata(&metadata));
        }
        let state = |e: std::fs::DirEntry| Ok((e.file_name(), PathState::from_metadata(&e.metadata()?)));
        std::fs::read_dir(path)?.map(|e| e.and_then(state)).collect::<std::io::Result<_>>().map(PathState::Folder)
    }

    fn from_metadata(metadata: &Metadata) -> PathState {
        PathState::File(number(metadata), metadata.len(), metadata.modified().ok())
    }

    /// Removes from a folder what it held in this state, and the folder if nothing else is in it.
    pub fn remove(&self, folder: &Path) -> std::io::Result<()> {
        let PathState::Folder(entries) = self else { return Ok(()) };
        for name in entries.keys() {
            let path = folder.join(name);
            if is_temporary(name) && path.is_dir() {
                std::fs::remove_dir_all(path)
            } else {
                std::fs::remove_file(path)
            }?;
        }
        std::fs::remove_dir(folder)
    }
}

#[cfg(unix)]
fn number(metadata: &Metadata) -> [u64; 2] {
    use std::os::unix::fs::MetadataExt;
    [metadata.dev(), metadata.ino()]
}

#[cfg(not(unix))]
fn number(_: &Metadata) -> [u64; 2] {
    [0; 2]
}

/// An output of a running command: where it goes, links followed, and what was there.
#[derive(Clone, Debug)]
pub(super) struct PlannedOutput {
    pub target: PathBuf,
    pub state: PathState,
}

/// Outputs of the commands of this process, by the whole paths that they are called.
static PLANNED: LazyLock<Mutex<HashMap<PathBuf, PlannedOutput>>> = LazyLock::new(Mutex::default);

fn planned() -> MutexGuard<'static, HashMap<PathBuf, PlannedOutput>> {
    PLANNED.lock().unwrap_or_else(|e| e.into_inner())
}

fn whole(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}

impl PlannedOutput {
    /// Takes note of what is at `target`, which `path` stands for; gives the name to forget it by.
    pub fn note(path: &Path, target: &Path) -> Result<PathBuf> {
        let state = PathState::at(target).map_err(|e| Error::io(path, e))?;
        let name = whole(path);
        planned().insert(name.clone(), PlannedOutput { target: target.to_path_buf(), state });
        Ok(name)
    }

    /// The note of an output, if there is one.
    pub fn find(path: &Path) -> Option<PlannedOutput> {
        planned().get(&whole(path)).cloned()
    }

    pub fn forget(name: &Path) {
        planned().remove(name);
    }

    /// The state of `target` now, if a file may take its place: as it was before, missing, or an empty file.
    pub fn replaceable(&self, target: &Path) -> std::io::Result<Option<PathState>> {
        let now = PathState::at(target)?;
        let empty =
            now == PathState::Missing || std::fs::symlink_metadata(target).is_ok_and(|m| m.is_file() && m.len() == 0);
        Ok((whole(&self.target) == whole(target) && (empty || now == self.state)).then_some(now))
    }
}

/// A name beside `target` that is free as far as `takes` says: `m-1.pgs` for `m.pgs`.
pub(super) fn free_name(
    target: &Path,
    mut takes: impl FnMut(&Path) -> std::io::Result<()>,
) -> std::io::Result<PathBuf> {
    let stem = target.file_stem().unwrap_or_default();
    for number in 1u64.. {
        let mut name = stem.to_os_string();
        name.push(format!("-{number}"));
        if let Some(ending) = target.extension() {
            name.push(".");
            name.push(ending);
        }
        let path = target.with_file_name(name);
        match takes(&path) {
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
            done => return done.map(|()| path),
        }
    }
    Err(std::io::ErrorKind::AlreadyExists.into())
}

/// Said of an output that is not what it was.
pub(super) const CHANGED: &str = "was created or changed while this command ran; it is left unchanged";

/// The error for what has appeared or changed at an output's place; what was made is `aside`.
pub(super) fn changed(path: &Path, aside: &Path) -> Error {
    Error::output(path, CHANGED, format!("the output of this command is in {}", aside.display()))
}
