//! Files whose length is known before the work: outputs written in parts, scratch files, and the room on the disk that
//! they take.

use super::place::{OutputTarget, folder_of};
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
                // Else the name could survive a crash of the machine and the bytes not.
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

/// A new file of `bytes` zeros without a name in `folder`, gone when the process is; its blocks are taken where the file
/// system can: writing into it does not find the disk full.
pub fn scratch_file(folder: &Path, bytes: u64) -> std::io::Result<File> {
    let file = tempfile::tempfile_in(folder)?;
    #[cfg(target_os = "linux")]
    {
        use rustix::io::Errno;
        match rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, bytes) {
            // On such a disk blocks are taken as they are written.
            Err(Errno::OPNOTSUPP | Errno::NOSYS) => {}
            taken => return Ok(taken.map(|()| file)?),
        }
    }
    file.set_len(bytes)?;
    Ok(file)
}

/// Says before the work that the disk of `folder` has no room for `bytes`.
pub fn check_space_in(folder: &Path, bytes: u64) -> Result<()> {
    check_space(folder, bytes).map_err(|e| Error::io(folder, e))
}

/// Says before the work that the disk is too small, rather than after half of it.
#[cfg(unix)]
pub fn check_space(folder: &Path, bytes: u64) -> std::io::Result<()> {
    let disk = rustix::fs::statvfs(folder)?;
    // Not `f_bfree`, which counts what is kept for root.
    let free = disk.f_bavail.saturating_mul(disk.f_frsize);
    if free < bytes {
        let message = format!("the output needs {bytes} bytes, but the disk has only {free} free");
        return Err(std::io::Error::new(std::io::ErrorKind::StorageFull, message));
    }
    Ok(())
}

#[cfg(not(unix))]
pub fn check_space(_: &Path, _: u64) -> std::io::Result<()> {
    Ok(())
}
