//! Output files whose length is known: written from several threads, whole or not at all.

use particlegs::{Error, Result};
use std::fs::File;
use std::path::{Path, PathBuf};

/// A file beside its place, moved there by [`PlacedFile::finish`]; else nothing is left of it.
pub struct PlacedFile {
    out: PathBuf,
    file: tempfile::NamedTempFile,
}

impl PlacedFile {
    /// A file of `length` bytes for `out`.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder cannot be written.
    pub fn create(out: &Path, length: u64) -> Result<PlacedFile> {
        let fail = |e| Error::io(out, e);
        let folder = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        builder.prefix(".particlegs-").suffix(".tmp");
        // As readable as any new file.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder).map_err(fail)?;
        file.as_file().set_len(length).map_err(fail)?;
        Ok(PlacedFile { out: out.to_path_buf(), file })
    }

    /// Writes `bytes` from byte `offset` on.
    ///
    /// # Errors
    /// [`Error::Io`], e.g. for a full disk.
    pub fn write_at(&self, bytes: &[u8], offset: u64) -> Result<()> {
        write_all_at(self.file.as_file(), bytes, offset).map_err(|e| Error::io(&self.out, e))
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

#[cfg(unix)]
fn write_all_at(file: &File, bytes: &[u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

#[cfg(windows)]
fn write_all_at(file: &File, mut bytes: &[u8], mut offset: u64) -> std::io::Result<()> {
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

#[cfg(test)]
mod tests {
    use super::*;

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
