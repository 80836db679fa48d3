//! Files and folders on their way to their place. Where the system can, a file has no name until it is whole.

use super::names::{new_name, sweep};
use super::place::folder_of;
use super::state::{PathState, PlannedOutput, changed, free_name};
use crate::{Error, Result};
use std::fs::File;
use std::io::{ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};

/// Bytes that are gathered before they are written.
pub(super) const BUFFER: usize = 1 << 20;

pub(super) struct TemporaryFile {
    file: File,
    /// Its path, if it has a name.
    name: Option<PathBuf>,
}

impl TemporaryFile {
    /// A new file in the folder of `target`, as readable as any new file.
    pub fn beside(target: &Path) -> std::io::Result<TemporaryFile> {
        let folder = folder_of(target);
        sweep(folder);
        match nameless(folder) {
            Some(file) => Ok(TemporaryFile { file, name: None }),
            None => TemporaryFile::named(folder),
        }
    }

    /// A file with a name, where the system has no nameless ones.
    fn named(folder: &Path) -> std::io::Result<TemporaryFile> {
        let path = new_name(folder);
        let file = std::fs::OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
        Ok(TemporaryFile { file, name: Some(path) })
    }

    pub fn file(&self) -> &File {
        &self.file
    }

    pub fn open(name: PathBuf) -> std::io::Result<TemporaryFile> {
        Ok(TemporaryFile { file: File::open(&name)?, name: Some(name) })
    }

    /// Moves it to `target`, which `out` stands for. Of an output that a command has planned nothing is replaced but
    /// what was there then: else the file goes beside it.
    pub fn place(mut self, out: &Path, target: &Path) -> Result<()> {
        let fail = |e| Error::io(out, e);
        let Some(planned) = PlannedOutput::find(out) else { return self.replace(target).map_err(fail) };
        let placed = match planned.replaceable(target).map_err(fail)? {
            Some(PathState::Missing) => self.place_new(target),
            Some(before) => self.exchange(target, &before),
            None => Ok(false),
        };
        // Another process that has written the same bytes does no harm.
        if !placed.map_err(fail)? && !is_same(&mut self.file, target) {
            let aside = free_name(target, |path| match self.place_new(path)? {
                true => Ok(()),
                false => Err(ErrorKind::AlreadyExists.into()),
            });
            return Err(changed(out, &aside.map_err(fail)?));
        }
        // What is there now is this command's own.
        PlannedOutput::note(out, target).map(drop)
    }

    /// Moves it to `target`, over what is there.
    pub fn replace(mut self, target: &Path) -> std::io::Result<()> {
        // A file without a name gets one only where none is; over another a rename is needed.
        if self.name.is_some() || !self.place_new(target)? {
            std::fs::rename(self.named_beside(target)?, target)?;
            self.name = None;
        }
        Ok(())
    }

    /// Moves it to `target`; not where anything is there.
    fn place_new(&mut self, target: &Path) -> std::io::Result<bool> {
        let done = match &self.name {
            None => link(&self.file, target),
            Some(name) => rename_new(name, target),
        };
        match done {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => Ok(false),
            done => {
                done?;
                self.name = None;
                Ok(true)
            }
        }
    }

    /// Takes the place of what is at `target`, if that is in this state.
    fn exchange(&mut self, target: &Path, before: &PathState) -> std::io::Result<bool> {
        let name = self.named_beside(target)?;
        let is_it = |path: &Path| PathState::at(path).is_ok_and(|now| now == *before);
        match swap(&name, target) {
            // The old file goes with the name that it has now.
            Ok(()) if is_it(&name) => Ok(true),
            Ok(()) => {
                let back = swap(&name, target);
                // Not a name to be removed while something else has it.
                self.name = self.name.take().filter(|_| back.is_ok());
                back.map(|()| false)
            }
            Err(e) if is_unsupported(&e) && is_it(target) => {
                std::fs::rename(&name, target)?;
                self.name = None;
                Ok(true)
            }
            Err(e) if is_unsupported(&e) => Ok(false),
            // The old file has gone meanwhile.
            Err(e) if e.kind() == ErrorKind::NotFound => self.place_new(target),
            Err(e) => Err(e),
        }
    }

    /// Its name; only a name can take another's place, and it is there for as long as that takes.
    fn named_beside(&mut self, target: &Path) -> std::io::Result<PathBuf> {
        match &self.name {
            Some(name) => Ok(name.clone()),
            None => {
                let name = new_name(folder_of(target));
                link(&self.file, &name)?;
                Ok(self.name.insert(name).clone())
            }
        }
    }
}

pub(super) fn is_same(file: &mut File, path: &Path) -> bool {
    let is_file = std::fs::symlink_metadata(path).is_ok_and(|m| m.is_file());
    is_file && File::open(path).and_then(|mut other| same_bytes(file, &mut other)).unwrap_or(false)
}

fn same_bytes(a: &mut File, b: &mut File) -> std::io::Result<bool> {
    if a.metadata()?.len() != b.metadata()?.len() {
        return Ok(false);
    }
    a.rewind()?;
    let (mut of_a, mut of_b) = (vec![0; BUFFER], vec![0; BUFFER]);
    loop {
        let n = a.read(&mut of_a)?;
        b.read_exact(&mut of_b[..n])?;
        if n == 0 || of_a[..n] != of_b[..n] {
            return Ok(n == 0);
        }
    }
}

/// Renames where nothing is in the way.
pub(super) fn rename_new(from: &Path, to: &Path) -> std::io::Result<()> {
    #[cfg(target_os = "linux")]
    {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE).map_err(std::io::Error::from) {
            Err(e) if is_unsupported(&e) => {}
            done => return done,
        }
    }
    // Without such a step: nearly so.
    match std::fs::symlink_metadata(to) {
        Ok(_) => Err(ErrorKind::AlreadyExists.into()),
        Err(_) => std::fs::rename(from, to),
    }
}

/// Exchanges two files or folders in one step.
#[cfg(target_os = "linux")]
pub(super) fn swap(a: &Path, b: &Path) -> std::io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE)?)
}

#[cfg(not(target_os = "linux"))]
pub(super) fn swap(_: &Path, _: &Path) -> std::io::Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// Whether this disk cannot do that.
pub(super) fn is_unsupported(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported)
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        if let Some(name) = &self.name {
            let _ = std::fs::remove_file(name);
        }
    }
}

/// A folder that goes away with what it holds unless it is moved to its place.
pub(super) struct TemporaryFolder {
    path: Option<PathBuf>,
}

impl TemporaryFolder {
    pub fn within(folder: &Path) -> std::io::Result<TemporaryFolder> {
        sweep(folder);
        let path = new_name(folder);
        std::fs::create_dir(&path)?;
        Ok(TemporaryFolder { path: Some(path) })
    }

    pub fn from_path(path: PathBuf) -> TemporaryFolder {
        TemporaryFolder { path: Some(path) }
    }

    pub fn path(&self) -> &Path {
        self.path.as_deref().unwrap_or(Path::new(""))
    }

    pub fn moved(&mut self) {
        self.path = None;
    }

    /// Keeps what is in it under a free name beside `target`.
    pub fn keep_beside(&mut self, target: &Path) -> std::io::Result<PathBuf> {
        let kept_path = free_name(target, |path| rename_new(self.path(), path))?;
        self.moved();
        Ok(kept_path)
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            let _ = std::fs::remove_dir_all(path);
        }
    }
}

/// A file without a name in `folder`, where system and disk have such files and can give them one.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    let file = File::from(rustix::fs::open(folder, flags, Mode::from_raw_mode(0o666)).ok()?);
    // Without /proc the file could not be given a name.
    std::fs::symlink_metadata(descriptor(&file)).is_ok().then_some(file)
}

#[cfg(not(target_os = "linux"))]
fn nameless(_: &Path) -> Option<File> {
    None
}

#[cfg(target_os = "linux")]
fn link(file: &File, path: &Path) -> std::io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    // The path in /proc is a link to the file, which is what gets the name.
    Ok(linkat(CWD, descriptor(file), CWD, path, AtFlags::SYMLINK_FOLLOW)?)
}

#[cfg(not(target_os = "linux"))]
fn link(_: &File, _: &Path) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

#[cfg(target_os = "linux")]
fn descriptor(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd;
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_ones_go_away_and_take_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a");
        let count = || std::fs::read_dir(folder.path()).unwrap().count();
        let named = TemporaryFile::named(folder.path()).unwrap();
        assert_eq!(count(), 1);
        drop(named);
        assert_eq!(count(), 0);
        for _ in 0..2 {
            TemporaryFile::named(folder.path()).unwrap().place(&target, &target).unwrap();
            assert_eq!(count(), 1);
        }
    }

    /// A disk without nameless files is a rare thing to test on; this one has them.
    #[cfg(target_os = "linux")]
    #[test]
    fn nameless_files_appear_when_they_are_whole() {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let target = folder.path().join("a");
        let count = || std::fs::read_dir(folder.path()).unwrap().count();
        for _ in 0..2 {
            let before = count();
            let temporary = TemporaryFile::beside(&target).unwrap();
            assert!(temporary.name.is_none());
            assert_eq!(count(), before);
            temporary.place(&target, &target).unwrap();
            assert_eq!(count(), 1);
        }
    }
}
