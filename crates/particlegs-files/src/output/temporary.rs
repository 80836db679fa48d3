//! Files and folders on their way to their place.
//!
//! Where the system can, a file has no name until it is whole. Else its name is
//! `.particlegs-MACHINE-PROCESS.NUMBER.tmp`, where MACHINE stands for this host, its boot and its process
//! namespace: a later run there removes what a process that is gone has left, and nothing else.

use super::place::folder_of;
use std::collections::HashSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{LazyLock, Mutex};

const PREFIX: &str = ".particlegs-";
const SUFFIX: &str = ".tmp";

/// Is this the name of something on its way to its place?
pub(crate) fn is_temporary(name: &std::ffi::OsStr) -> bool {
    name.to_str().is_some_and(|n| n.starts_with(PREFIX) && n.ends_with(SUFFIX))
}

/// A file that goes away unless it is moved to its place.
pub(super) struct Temporary {
    file: File,
    /// Where it is, if it has a name.
    name: Option<PathBuf>,
}

impl Temporary {
    /// A new file in the folder of `target`, as readable as any new file.
    pub fn beside(target: &Path) -> std::io::Result<Temporary> {
        let folder = folder_of(target);
        sweep(folder);
        match nameless(folder) {
            Some(file) => Ok(Temporary { file, name: None }),
            None => Temporary::named(folder),
        }
    }

    /// A file with a name, where the system has no nameless ones.
    fn named(folder: &Path) -> std::io::Result<Temporary> {
        let path = new_name(folder);
        let file = std::fs::OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
        Ok(Temporary { file, name: Some(path) })
    }

    /// The file.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// The file, to write at places of it.
    pub fn shared(&self) -> &File {
        &self.file
    }

    /// Moves it to `target`, over what is there.
    pub fn replace(mut self, target: &Path) -> std::io::Result<()> {
        if self.name.is_none() {
            match link(&self.file, target) {
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
                done => return done,
            }
            // Only a name can take another's place; it is there for as long as a rename takes.
            let name = new_name(folder_of(target));
            link(&self.file, &name)?;
            self.name = Some(name);
        }
        if let Some(name) = &self.name {
            std::fs::rename(name, target)?;
        }
        self.name = None;
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(name) = &self.name {
            let _ = std::fs::remove_file(name);
        }
    }
}

/// A folder that goes away with what it holds unless it is moved to its place.
pub(super) struct TemporaryFolder {
    path: Option<PathBuf>,
}

impl TemporaryFolder {
    /// A new folder within `folder`.
    pub fn within(folder: &Path) -> std::io::Result<TemporaryFolder> {
        sweep(folder);
        let path = new_name(folder);
        std::fs::create_dir(&path)?;
        Ok(TemporaryFolder { path: Some(path) })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.path.as_deref().unwrap_or(Path::new(""))
    }

    /// It has been moved away.
    pub fn moved(&mut self) {
        self.path = None;
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            let _ = std::fs::remove_dir_all(path);
        }
    }
}

/// A file without a name in `folder`, where system and disk have such files and can give them one.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    let file = File::from(rustix::fs::open(folder, flags, Mode::from_raw_mode(0o666)).ok()?);
    std::fs::symlink_metadata(descriptor(&file)).is_ok().then_some(file)
}

#[cfg(not(target_os = "linux"))]
fn nameless(_: &Path) -> Option<File> {
    None
}

/// Gives a nameless file the name `path`, which must be free.
#[cfg(target_os = "linux")]
fn link(file: &File, path: &Path) -> std::io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    Ok(linkat(CWD, descriptor(file), CWD, path, AtFlags::SYMLINK_FOLLOW)?)
}

#[cfg(not(target_os = "linux"))]
fn link(_: &File, _: &Path) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

#[cfg(target_os = "linux")]
fn descriptor(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd;
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

/// A free name in `folder`.
fn new_name(folder: &Path) -> PathBuf {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let (machine, process) = (MACHINE.as_deref().unwrap_or("unknown"), std::process::id());
    loop {
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("{PREFIX}{machine}-{process}.{number}{SUFFIX}"));
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
fn sweep(folder: &Path) {
    static SWEPT: LazyLock<Mutex<HashSet<PathBuf>>> = LazyLock::new(Mutex::default);
    let Some(machine) = MACHINE.as_deref() else { return };
    if !SWEPT.lock().unwrap_or_else(|e| e.into_inner()).insert(folder.to_path_buf()) {
        return;
    }
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(|name| is_left_over(name, machine)) {
            let path = entry.path();
            let is_folder = entry.file_type().is_ok_and(|t| t.is_dir());
            // What cannot be removed does no harm.
            let _ = if is_folder { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        }
    }
}

/// Is this the name of something of this machine whose process is gone?
fn is_left_over(name: &str, machine: &str) -> bool {
    let inner = name.strip_prefix(PREFIX).and_then(|n| n.strip_suffix(SUFFIX));
    let Some((of, rest)) = inner.and_then(|n| n.split_once('-')) else { return false };
    let Some(process) = rest.split('.').next().and_then(|p| p.parse::<u32>().ok()) else { return false };
    of == machine && std::fs::symlink_metadata(format!("/proc/{process}")).is_err()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A name that a process of this machine could have left, which is gone.
    pub fn name_of_gone() -> Option<String> {
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
        drop(Temporary::beside(&folder.path().join("a")).unwrap());
        let there = |name: &String| folder.path().join(name).exists();
        assert!(!there(&gone));
        assert!([&alive, &elsewhere, &foreign].iter().all(|n| there(n)));
    }

    #[test]
    fn named_ones_go_away_and_take_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a");
        let count = || std::fs::read_dir(folder.path()).unwrap().count();
        let named = Temporary::named(folder.path()).unwrap();
        assert_eq!(count(), 1);
        drop(named);
        assert_eq!(count(), 0);
        for _ in 0..2 {
            Temporary::named(folder.path()).unwrap().replace(&target).unwrap();
            assert_eq!(count(), 1);
        }
    }

    /// A disk without nameless files is a rare thing to test on; this one has them.
    #[cfg(target_os = "linux")]
    #[test]
    fn nameless_files_appear_when_they_are_whole() {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let target = folder.path().join("a");
        let count = || std::fs::read_dir(folder.path()).unwrap().count();
        for _ in 0..2 {
            let before = count();
            let temporary = Temporary::beside(&target).unwrap();
            assert!(temporary.name.is_none());
            assert_eq!(count(), before);
            temporary.replace(&target).unwrap();
            assert_eq!(count(), 1);
        }
    }
}
