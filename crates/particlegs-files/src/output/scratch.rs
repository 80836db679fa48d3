//! Files that nobody else can open, and that are gone when the process is.

use std::fs::File;
use std::path::Path;

/// A new file of `bytes` zeros without a name in `folder`, its blocks taken where the file system can: writing
/// into it does not find the disk full.
pub fn scratch_file(folder: &Path, bytes: u64) -> std::io::Result<File> {
    let file = tempfile::tempfile_in(folder)?;
    #[cfg(target_os = "linux")]
    {
        use rustix::io::Errno;
        match rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, bytes) {
            Err(Errno::OPNOTSUPP | Errno::NOSYS) => {}
            taken => return Ok(taken.map(|()| file)?),
        }
    }
    file.set_len(bytes)?;
    Ok(file)
}
