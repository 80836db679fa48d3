//! Output files that appear whole or not at all.

use crate::{Error, Result};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes `path` through a temporary file in its folder: written, synced, then renamed.
///
/// # Errors
/// [`Error::Io`] where the folder cannot be written or the disk is full; nothing is left then.
pub fn write_atomic(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let fail = |e| Error::io(path, e);
    let temporary = temporary_beside(path).map_err(fail)?;
    let mut writer = BufWriter::with_capacity(1 << 20, temporary);
    fill(&mut writer).map_err(fail)?;
    let temporary = writer.into_inner().map_err(|e| fail(e.into_error()))?;
    temporary.as_file().sync_all().map_err(fail)?;
    temporary.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

/// Says early, before long work, whether `path` can be created in its folder.
///
/// # Errors
/// [`Error::Io`] where the folder is missing or cannot be written, or `path` is a folder.
pub fn check_writable(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::io(path, std::io::Error::new(std::io::ErrorKind::IsADirectory, "is a folder")));
    }
    tempfile::tempfile_in(folder_of(path)).map(drop).map_err(|e| Error::io(path, e))
}

/// A file beside `path` that goes away unless it is moved there.
fn temporary_beside(path: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".particlegs-").suffix(".tmp").permissions_like_new().tempfile_in(folder_of(path))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

/// [`write_atomic`] of bytes at hand.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomic(path, |w| w.write_all(bytes))
}

/// An output file whose length is known: written from several threads at places known beforehand,
/// and moved to its place by [`PlacedFile::finish`]; else nothing is left of it.
pub struct PlacedFile {
    out: PathBuf,
    file: tempfile::NamedTempFile,
}

impl PlacedFile {
    /// A file of `length` bytes for `out`.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder cannot be written or the disk has no room.
    pub fn create(out: &Path, length: u64) -> Result<PlacedFile> {
        let fail = |e| Error::io(out, e);
        check_space(folder_of(out), length).map_err(fail)?;
        let file = temporary_beside(out).map_err(fail)?;
        file.as_file().set_len(length).map_err(fail)?;
        Ok(PlacedFile { out: out.to_path_buf(), file })
    }

    /// Writes `bytes` from byte `offset` on.
    ///
    /// # Errors
    /// [`Error::Io`], e.g. for a full disk.
    pub fn write_at(&self, bytes: &[u8], offset: u64) -> Result<()> {
        write_at(self.file.as_file(), bytes, offset).map_err(|e| Error::io(&self.out, e))
    }

    /// Syncs the file and moves it to its place.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(self) -> Result<()> {
        let fail = |e| Error::io(&self.out, e);
        self.file.as_file().sync_all().map_err(fail)?;
        self.file.persist(&self.out).map_err(|e| fail(e.error))?;
        Ok(())
    }
}

/// Says before the work that the disk of `folder` has no room for `bytes`.
///
/// # Errors
/// [`Error::Io`].
pub fn check_space_in(folder: &Path, bytes: u64) -> Result<()> {
    check_space(folder, bytes).map_err(|e| Error::io(folder, e))
}

/// Says before the work that the disk is too small, rather than after half of it.
#[cfg(unix)]
pub(crate) fn check_space(folder: &Path, bytes: u64) -> std::io::Result<()> {
    let disk = rustix::fs::statvfs(folder)?;
    let free = disk.f_bavail.saturating_mul(disk.f_frsize);
    if free < bytes {
        let what = format!("the output takes {bytes} bytes and the disk has {free} free");
        return Err(std::io::Error::new(std::io::ErrorKind::StorageFull, what));
    }
    Ok(())
}

#[cfg(not(unix))]
pub(crate) fn check_space(_: &Path, _: u64) -> std::io::Result<()> {
    Ok(())
}

/// Writes all of `bytes` from byte `offset` of `file` on.
#[cfg(unix)]
pub(crate) fn write_at(file: &File, bytes: &[u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

/// Writes all of `bytes` from byte `offset` of `file` on.
#[cfg(windows)]
pub(crate) fn write_at(file: &File, mut bytes: &[u8], mut offset: u64) -> std::io::Result<()> {
    while !bytes.is_empty() {
        let n = std::os::windows::fs::FileExt::seek_write(file, bytes, offset)?;
        if n == 0 {
            return Err(std::io::ErrorKind::WriteZero.into());
        }
        bytes = &bytes[n..];
        offset += n as u64;
    }
    Ok(())
}

trait PermissionsLikeNew {
    fn permissions_like_new(&mut self) -> &mut Self;
}

impl PermissionsLikeNew for tempfile::Builder<'_, '_> {
    /// Temporary files are private by default; an output should be as readable as any new file.
    fn permissions_like_new(&mut self) -> &mut Self {
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            self.permissions(std::fs::Permissions::from_mode(0o666));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        let r = write_atomic(&path, |w| {
            w.write_all(b"half")?;
            Err(std::io::Error::other("disk full"))
        });
        assert!(r.is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        write_bytes(&path, b"whole").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
    }

    #[test]
    fn appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a");
        let file = PlacedFile::create(&out, 4).unwrap();
        file.write_at(b"cd", 2).unwrap();
        file.write_at(b"ab", 0).unwrap();
        assert!(!out.exists());
        file.finish().unwrap();
        assert_eq!(std::fs::read(&out).unwrap(), b"abcd");
        drop(PlacedFile::create(&folder.path().join("b"), 4).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
