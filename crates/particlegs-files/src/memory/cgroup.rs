//! Memory that control groups still allow: version 2 (`memory.max`) and version 1
//! (`memory.limit_in_bytes`), of this process's group and of all groups above it.

use std::path::{Path, PathBuf};

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

/// Bytes left under the tightest limit; `None` without one.
pub(super) fn bytes_left(root: &Path) -> Option<u64> {
    let groups = std::fs::read_to_string(root.join("proc/self/cgroup")).ok()?;
    groups.lines().filter_map(|line| left_by_line(root, line)).min()
}

/// Of one line `NUMBER:CONTROLLERS:/PATH`; version 2 names no controllers.
fn left_by_line(root: &Path, line: &str) -> Option<u64> {
    let mut fields = line.splitn(3, ':').skip(1);
    let (controllers, path) = (fields.next()?, fields.next()?);
    let mounts = root.join("sys/fs/cgroup");
    let (version, tops): (Version, Vec<PathBuf>) = if controllers.is_empty() {
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
    use super::super::tests::write;
    use super::*;

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
