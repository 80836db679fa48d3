//! A file whose length is known, written in parts.

use super::place::{OutputTarget, folder_of};
use super::space::check_space;
use super::temporary::TemporaryFile;
use crate::{Error, Result};
use std::fs::File;
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};

/// An output file whose length is known: written from several threads at places known beforehand,
/// and moved to its place by [`PlacedFile::finish`]; else nothing is left of it. For a device or a pipe
/// it waits in the system's folder for temporary files, and is copied there in the end.
pub struct PlacedFile {
    out: PathBuf,
    target: FileDestination,
}

enum FileDestination {
    File(TemporaryFile, PathBuf),
    Stream(File, OutputTarget),
}

impl PlacedFile {
    pub fn create(out: &Path, length: u64) -> Result<PlacedFile> {
        let fail = |e| Error::io(out, e);
        let target = match OutputTarget::new(out)? {
            OutputTarget::File(path) => {
                check_space(folder_of(&path), length).map_err(fail)?;
                FileDestination::File(TemporaryFile::beside(&path).map_err(fail)?, path)
            }
            stream => {
                check_space(&std::env::temp_dir(), length).map_err(fail)?;
                FileDestination::Stream(tempfile::tempfile().map_err(fail)?, stream)
            }
        };
        let file = PlacedFile { out: out.to_path_buf(), target };
        file.file().set_len(length).map_err(fail)?;
        Ok(file)
    }

    fn file(&self) -> &File {
        match &self.target {
            FileDestination::File(temporary, _) => temporary.file(),
            FileDestination::Stream(file, _) => file,
        }
    }

    pub fn write_at(&self, bytes: &[u8], offset: u64) -> Result<()> {
        write_at(self.file(), bytes, offset).map_err(|e| Error::io(&self.out, e))
    }

    pub fn finish(self) -> Result<()> {
        let fail = |e| Error::io(&self.out, e);
        match self.target {
            FileDestination::File(temporary, path) => {
                temporary.file().sync_all().map_err(fail)?;
                temporary.place(&self.out, &path)
            }
            FileDestination::Stream(file, stream) => copy(file, &stream).map_err(fail),
        }
    }
}

fn copy(mut file: File, stream: &OutputTarget) -> std::io::Result<()> {
    file.rewind()?;
    let mut to = stream.open()?;
    std::io::copy(&mut file, &mut to)?;
    to.flush()
}

#[cfg(unix)]
pub fn write_at(file: &File, bytes: &[u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

#[cfg(windows)]
pub fn write_at(file: &File, mut bytes: &[u8], mut offset: u64) -> std::io::Result<()> {
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
