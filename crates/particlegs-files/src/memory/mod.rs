//! The memory that there is, so that a job that cannot fit says so before it starts.
//!
//! Three things bound it: what the machine has left, what the control group of a container or a batch
//! job still allows (`cgroup`), and the limit on address space that a shell sets (`ulimit -v`).

mod cgroup;

use crate::Result;
use crate::context::Context;
use std::path::Path;

/// Bytes that this process can take without swapping, and without being refused or killed; `None`
/// where the system does not tell.
pub fn available_bytes() -> Option<u64> {
    let root = Path::new("/");
    let bounds = [machine_bytes(root), cgroup::bytes_left(root), address_space_left(root)];
    bounds.into_iter().flatten().min()
}

fn machine_bytes(root: &Path) -> Option<u64> {
    kib_of(&std::fs::read_to_string(root.join("proc/meminfo")).ok()?, "MemAvailable:")
}

/// The rest of the limit on this process's address space, mapped files included; `None` without
/// a limit.
fn address_space_left(root: &Path) -> Option<u64> {
    let limits = std::fs::read_to_string(root.join("proc/self/limits")).ok()?;
    let line = limits.lines().find_map(|l| l.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    let taken = kib_of(&std::fs::read_to_string(root.join("proc/self/status")).ok()?, "VmSize:")?;
    Some(limit.saturating_sub(taken))
}

/// A line `NAME  1234 kB` of a file of /proc, in bytes.
fn kib_of(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|l| l.strip_prefix(name))?;
    let kib: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    kib.checked_mul(1024)
}

/// Asks for memory before it is taken, where there is no one else to ask.
pub fn require(purpose: &str, need_bytes: u64) -> Result<()> {
    Context::SILENT.with_memory(&available_bytes).require_memory(purpose, need_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    pub fn write(root: &Path, name: &str, text: &str) {
        let path = root.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }

    #[test]
    fn the_limit_of_a_shell_counts_what_is_taken() {
        let root = tempfile::tempdir().unwrap();
        assert_eq!((machine_bytes(root.path()), address_space_left(root.path())), (None, None));
        write(root.path(), "proc/meminfo", "MemTotal:       32000 kB\nMemAvailable:    2000 kB\n");
        write(root.path(), "proc/self/status", "Name:\tx\nVmSize:\t    1000 kB\n");
        write(root.path(), "proc/self/limits", "Max address space         unlimited   unlimited   bytes\n");
        assert_eq!((machine_bytes(root.path()), address_space_left(root.path())), (Some(2_048_000), None));
        write(
            root.path(),
            "proc/self/limits",
            "Max stack size  1  2  bytes\nMax address space   1034000  4096000  bytes\n",
        );
        assert_eq!(address_space_left(root.path()), Some(10_000));
        write(root.path(), "proc/self/limits", "Max address space         10000   10000   bytes\n");
        assert_eq!(address_space_left(root.path()), Some(0));
    }

    #[test]
    fn what_there_is_not_is_an_error() {
        if available_bytes().is_some() {
            assert!(matches!(require("a job", u64::MAX).unwrap_err(), crate::Error::Memory { .. }));
        }
    }
}
