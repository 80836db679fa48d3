//! Names of files and folders on their way to their place: `.particlegs-MACHINE-PROCESS.NUMBER.tmp`, where MACHINE
//! stands for this host, its boot and its process namespace: a later run there removes what a process that is gone has
//! left, and nothing else.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{LazyLock, Mutex};

const PREFIX: &str = ".particlegs-";
const SUFFIX: &str = ".tmp";

/// Whether this is the name of something on its way to its place.
pub fn is_temporary(name: &std::ffi::OsStr) -> bool {
    name.to_str().is_some_and(|n| n.starts_with(PREFIX) && n.ends_with(SUFFIX))
}

/// A free name in `folder`.
pub(super) fn new_name(folder: &Path) -> PathBuf {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    // What is named after an unknown machine is never swept.
    let (machine, process) = (MACHINE.as_deref().unwrap_or("unknown"), std::process::id());
    loop {
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("{PREFIX}{machine}-{process}.{number}{SUFFIX}"));
        // A link takes the name even where it leads nowhere.
        if std::fs::symlink_metadata(&path).is_err() {
            return path;
        }
    }
}

/// Digits that stand for this host, its boot and its process namespace; none where the system does not say.
static MACHINE: LazyLock<Option<String>> = LazyLock::new(|| {
    let host = std::fs::read("/proc/sys/kernel/hostname").ok()?;
    let boot = std::fs::read("/proc/sys/kernel/random/boot_id").ok()?;
    let namespace = std::fs::read_link("/proc/self/ns/pid").ok()?;
    let mut hash = blake3::Hasher::new();
    hash.update(&host).update(&boot).update(namespace.as_os_str().as_encoded_bytes());
    Some(hash.finalize().to_hex()[..16].to_string())
});

/// Removes from `folder`, once a process, what processes of this machine and boot that are gone have left.
pub(super) fn sweep(folder: &Path) {
    static SWEPT: LazyLock<Mutex<HashSet<PathBuf>>> = LazyLock::new(Mutex::default);
    let Some(machine) = MACHINE.as_deref() else { return };
    if !SWEPT.lock().unwrap_or_else(|e| e.into_inner()).insert(folder.to_path_buf()) {
        return;
    }
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if is_of(&entry, user()) && entry.file_name().to_str().is_some_and(|name| is_left_over(name, machine)) {
            let path = entry.path();
            let is_folder = entry.file_type().is_ok_and(|t| t.is_dir());
            // What cannot be removed does no harm.
            let _ = if is_folder { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        }
    }
}

/// Whether this is the name of something of this machine whose process is gone.
fn is_left_over(name: &str, machine: &str) -> bool {
    let inner = name.strip_prefix(PREFIX).and_then(|n| n.strip_suffix(SUFFIX));
    let Some((name_machine, rest)) = inner.and_then(|n| n.split_once('-')) else { return false };
    let Some(process) = rest.split('.').next().and_then(|p| p.parse::<i32>().ok()) else { return false };
    name_machine == machine && is_gone(process)
}

/// The number of this user; 0 where the system has none.
fn user() -> u32 {
    #[cfg(unix)]
    return rustix::process::geteuid().as_raw();
    #[cfg(not(unix))]
    0
}

/// Whether it is a user's. Processes of others may be hidden from this one.
#[cfg_attr(not(unix), expect(unused_variables))]
fn is_of(entry: &std::fs::DirEntry, user: u32) -> bool {
    #[cfg(unix)]
    return entry.metadata().is_ok_and(|m| std::os::unix::fs::MetadataExt::uid(&m) == user);
    #[cfg(not(unix))]
    true
}

/// Whether there is no process of this number. Another user's process answers that it may not be signalled.
#[cfg(unix)]
fn is_gone(process: i32) -> bool {
    use rustix::process::{Pid, test_kill_process};
    Pid::from_raw(process).is_some_and(|pid| test_kill_process(pid) == Err(rustix::io::Errno::SRCH))
}

#[cfg(not(unix))]
fn is_gone(_: i32) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::super::temporary::TemporaryFile;
    use super::*;

    /// A name that a process of this machine could have left, which is gone.
    fn name_of_gone() -> Option<String> {
        let gone = (2..4_194_304).rev().find(|p| !Path::new(&format!("/proc/{p}")).exists())?;
        Some(format!("{PREFIX}{}-{gone}.0{SUFFIX}", MACHINE.as_deref()?))
    }

    #[test]
    fn only_what_is_left_over_is_removed() {
        let Some(gone) = name_of_gone() else { panic!("this system names its boot") };
        let folder = tempfile::tempdir().unwrap();
        let alive = format!("{PREFIX}{}-{}.99999{SUFFIX}", MACHINE.as_deref().unwrap(), std::process::id());
        let elsewhere = format!("{PREFIX}0000000000000000-2.0{SUFFIX}");
        let foreign = format!("{PREFIX}notes{SUFFIX}");
        for name in [&gone, &alive, &elsewhere, &foreign] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        drop(TemporaryFile::beside(&folder.path().join("a")).unwrap());
        let exists = |name: &String| folder.path().join(name).exists();
        assert!(!exists(&gone));
        assert!([&alive, &elsewhere, &foreign].iter().all(|n| exists(n)));
        // Another user's stay, whose processes may be hidden.
        let entry = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap();
        assert!(is_of(&entry, user()) && (cfg!(not(unix)) || !is_of(&entry, user() + 1)));
        // Everybody has it, whether it can be seen in /proc or not.
        assert!(!is_gone(1));
    }
}
