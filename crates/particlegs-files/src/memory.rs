//! The memory that there is, so that a job that cannot fit says so before it starts.
//!
//! Three things bound it: what the machine has left, what the control group of a container or a batch
//! job still allows, of version 2 (`memory.max`) or 1 (`memory.limit_in_bytes`), and the limit on address space that a
//! shell sets (`ulimit -v`).

use crate::Result;
use crate::context::Context;
use std::path::{Path, PathBuf};

/// Bytes that this process can take without swapping, and without being refused or killed; `None`
/// where the system does not tell.
pub fn available_bytes() -> Option<u64> {
    let root = Path::new("/");
    let bounds = [machine_bytes(root), bytes_left(root), address_space_left(root)];
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
    // `unlimited` is no number, and so no bound.
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

/// A version of control groups.
struct Version {
    limit: &'static str,
    used: &'static str,
    /// Lines of memory.stat: pages of files that the kernel drops when memory is short.
    files: [&'static str; 2],
}

const FIRST: Version = Version {
    limit: "memory.limit_in_bytes",
    used: "memory.usage_in_bytes",
    files: ["total_inactive_file ", "total_active_file "],
};
const SECOND: Version =
    Version { limit: "memory.max", used: "memory.current", files: ["inactive_file ", "active_file "] };

/// Bytes that control groups leave under the tightest limit, of this process's group and of all groups above it; `None`
/// without one.
fn bytes_left(root: &Path) -> Option<u64> {
    let groups = std::fs::read_to_string(root.join("proc/self/cgroup")).ok()?;
    groups.lines().filter_map(|line| left_by_line(root, line)).min()
}

/// Of one line `NUMBER:CONTROLLERS:/PATH`; version 2 names no controllers.
fn left_by_line(root: &Path, line: &str) -> Option<u64> {
    let mut fields = line.splitn(3, ':').skip(1);
    let (controllers, path) = (fields.next()?, fields.next()?);
    let mounts = root.join("sys/fs/cgroup");
    let (version, tops): (Version, Vec<PathBuf>) = if controllers.is_empty() {
        // Systems with both versions mount the second at `unified`.
        (SECOND, vec![mounts.join("unified"), mounts])
    } else if controllers.split(',').any(|c| c == "memory") {
        (FIRST, vec![mounts.join("memory")])
    } else {
        return None;
    };
    tops.iter().filter_map(|top| version.tightest(top, path)).min()
}

impl Version {
    /// Of the group `path` and those above it. In a container the path may be that of the host and
    /// not be there; the container's own group is then the top.
    fn tightest(&self, top: &Path, path: &str) -> Option<u64> {
        let group = top.join(path.trim_start_matches('/'));
        group.ancestors().take_while(|g| g.starts_with(top)).filter_map(|g| self.left(g)).min()
    }

    fn left(&self, group: &Path) -> Option<u64> {
        let read = |name: &str| std::fs::read_to_string(group.join(name)).ok();
        let number = |text: &str| text.trim().parse::<u64>().ok();
        // `max` is no number: no limit. Version 1 says so by a number near 2^63.
        let limit = number(&read(self.limit)?).filter(|l| *l < 1 << 60)?;
        let used = number(&read(self.used)?)?;
        let stat = read("memory.stat").unwrap_or_default();
        let bytes_of = |name: &str| stat.lines().find_map(|l| number(l.strip_prefix(name)?)).unwrap_or(0);
        let droppable: u64 = self.files.iter().map(|name| bytes_of(name)).sum();
        Some(limit.saturating_sub(used.saturating_sub(droppable)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(root: &Path, name: &str, text: &str) {
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

    #[test]
    fn the_tightest_group_above_decides() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        assert_eq!(bytes_left(root), None);
        write(root, "proc/self/cgroup", "0::/slurm/job_7/step_0\n");
        write(root, "sys/fs/cgroup/slurm/job_7/step_0/memory.max", "max\n");
        write(root, "sys/fs/cgroup/slurm/job_7/step_0/memory.current", "100\n");
        assert_eq!(bytes_left(root), None);
        write(root, "sys/fs/cgroup/slurm/job_7/memory.max", "1000\n");
        write(root, "sys/fs/cgroup/slurm/job_7/memory.current", "700\n");
        assert_eq!(bytes_left(root), Some(300));
        // Pages of files are given up when memory is short.
        write(root, "sys/fs/cgroup/slurm/job_7/memory.stat", "anon 500\ninactive_file 150\nactive_file 50\n");
        assert_eq!(bytes_left(root), Some(500));
    }

    #[test]
    fn version_1_and_paths_of_the_host_are_understood() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        write(root, "proc/self/cgroup", "5:cpu,cpuacct:/\n4:memory:/docker/abc\n0::/\n");
        write(root, "sys/fs/cgroup/memory/memory.limit_in_bytes", "5000\n");
        write(root, "sys/fs/cgroup/memory/memory.usage_in_bytes", "6000\n");
        assert_eq!(bytes_left(root), Some(0));
        write(root, "sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
        assert_eq!(bytes_left(root), None);
    }
}
