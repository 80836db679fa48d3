//! How much memory there is, so that a job that cannot fit says so before it starts.

use crate::{Error, Result};

/// Bytes that the system can give without swapping; `None` where it does not tell.
pub fn available_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kib * 1024)
}

/// Asks for memory before it is taken.
///
/// # Errors
/// [`Error::Memory`] where `need_bytes` are more than there are.
pub fn require(what: &str, need_bytes: u64) -> Result<()> {
    match available_bytes() {
        Some(have_bytes) if need_bytes > have_bytes => {
            Err(Error::Memory { what: what.to_string(), need_bytes, have_bytes })
        }
        _ => Ok(()),
    }
}
