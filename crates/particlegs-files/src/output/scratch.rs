//! Files that nobody else can open, and that are gone when the process is.

use std::fs::File;
use std::path::Path;

/// A new file of `bytes` zeros without a name in `folder`, its blocks taken where the file system can: writing
/// into it does not find the disk full.
pub fn scratch_file(folder: &Path, bytes: u64) -> std::io::Result<File> {
    let file = tempfile::tempfile_in(folder)?;
    reserve(&file, bytes)?;
    Ok(file)
}

/// Takes the disk's blocks now, where the file system can say so.
#[cfg(target_os = "linux")]
fn reserve(file: &std::fs::File, bytes: u64) -> std::io::Result<()> {
    use rustix::io::Errno;
    match rustix::fs::fallocate(file, rustix::fs::FallocateFlags::empty(), 0, bytes) {
        Err(Errno::OPNOTSUPP | Errno::NOSYS) => file.set_len(bytes),
        other => Ok(other?),
    }
}

#[cfg(not(target_os = "linux"))]
fn reserve(file: &std::fs::File, bytes: u64) -> std::io::Result<()> {
    file.set_len(bytes)
}
