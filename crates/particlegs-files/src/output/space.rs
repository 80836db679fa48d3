//! Storage on the disk, asked for before the work.

use crate::{Error, Result};
use std::path::Path;

/// Says before the work that the disk of `folder` has no room for `bytes`.
pub fn check_space_in(folder: &Path, bytes: u64) -> Result<()> {
    check_space(folder, bytes).map_err(|e| Error::io(folder, e))
}

/// Says before the work that the disk is too small, rather than after half of it.
#[cfg(unix)]
pub fn check_space(folder: &Path, bytes: u64) -> std::io::Result<()> {
    let disk = rustix::fs::statvfs(folder)?;
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
