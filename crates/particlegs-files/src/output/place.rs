//! The target of a path that is to be written: a regular file behind any links, or a stream; and the one file that
//! paths of different spelling are.

use crate::{Error, Result};
use std::fs::File;
use std::io::Write;
use std::path::{Component, Path, PathBuf};

pub const STANDARD_OUTPUT: &str = "-";

/// Links that are followed one after the other before they are taken for a ring.
const MOST_LINKS: usize = 40;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum OutputTarget {
    /// A regular file (or a folder), there or not, with every link followed.
    File(PathBuf),
    /// A device, a pipe or an open descriptor: written through.
    Stream(PathBuf),
    /// Standard output, as `-` or by one of its names.
    StandardOutput,
}

impl OutputTarget {
    pub fn new(path: &Path) -> Result<OutputTarget> {
        if path == Path::new(STANDARD_OUTPUT) {
            return Ok(OutputTarget::StandardOutput);
        }
        let mut at = path.to_path_buf();
        for _ in 0..MOST_LINKS {
            match descriptor(&at) {
                Some(1) => return Ok(OutputTarget::StandardOutput),
                Some(_) => return Ok(OutputTarget::Stream(at)),
                None => {}
            }
            let metadata = match std::fs::symlink_metadata(&at) {
                Ok(metadata) => metadata,
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(OutputTarget::File(at)),
                Err(e) => return Err(Error::io(path, e)),
            };
            if !metadata.is_symlink() {
                return stands_for(path, at, &metadata);
            }
            let target = std::fs::read_link(&at).map_err(|e| Error::io(path, e))?;
            at = folder_of(&at).join(target);
        }
        Err(Error::io(path, std::io::Error::other("too many levels of symbolic links")))
    }

    pub fn open(&self) -> std::io::Result<Box<dyn Write + Send>> {
        match self {
            OutputTarget::StandardOutput => Ok(Box::new(std::io::stdout())),
            OutputTarget::Stream(path) | OutputTarget::File(path) => Ok(Box::new(open_stream(path)?)),
        }
    }
}

/// Something that is there, which is no link, as an output.
fn stands_for(path: &Path, at: PathBuf, metadata: &std::fs::Metadata) -> Result<OutputTarget> {
    #[cfg(unix)]
    if std::os::unix::fs::FileTypeExt::is_block_device(&metadata.file_type()) {
        return Err(Error::output(path, "is a block device, whose data would be lost", "name a file"));
    }
    let regular = metadata.is_file() || metadata.is_dir();
    Ok(if regular { OutputTarget::File(at) } else { OutputTarget::Stream(at) })
}

/// Opens a device, a named pipe or a descriptor's name for writing, without waiting for a reader and
/// without cutting off what a redirected file holds.
#[cfg(unix)]
pub(super) fn open_stream(path: &Path) -> std::io::Result<File> {
    use rustix::fs::OFlags;
    use std::os::unix::fs::OpenOptionsExt;
    let flags = OFlags::NONBLOCK | OFlags::APPEND | OFlags::NOCTTY;
    let file = std::fs::OpenOptions::new().write(true).custom_flags(flags.bits() as i32).open(path);
    let file = file.map_err(|e| match e.raw_os_error() {
        Some(code) if code == rustix::io::Errno::NXIO.raw_os_error() => {
            std::io::Error::new(std::io::ErrorKind::NotConnected, "no process reads this pipe")
        }
        _ => e,
    })?;
    // Writes wait for the reader as usual.
    rustix::fs::fcntl_setfl(&file, OFlags::APPEND)?;
    Ok(file)
}

#[cfg(not(unix))]
pub(super) fn open_stream(path: &Path) -> std::io::Result<File> {
    std::fs::OpenOptions::new().append(true).open(path)
}

/// The number of the open descriptor of this process that `path` is a name of, such as `/dev/fd/3`.
fn descriptor(path: &Path) -> Option<u32> {
    let number = path.file_name()?.to_str()?.parse().ok()?;
    // Of the folder alone: the path would be followed to the file behind the descriptor.
    let folder = std::fs::canonicalize(folder_of(path)).ok()?;
    let pid = std::process::id();
    let ours = [format!("/proc/{pid}/fd"), format!("/proc/{pid}/task/{pid}/fd"), "/dev/fd".to_string()];
    ours.iter().any(|o| folder == Path::new(o)).then_some(number)
}

pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

/// One file or folder, there or still to be made, whatever the spelling, links and letter case of its path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Identity {
    /// A file, folder or pipe that is there: its device and number.
    There(u64, u64),
    /// One that is not there: the whole path to it.
    Free(PathBuf),
    StandardOutput,
}

impl Identity {
    /// Of an output; none of a device, which several outputs may share.
    pub fn from_target(place: &OutputTarget) -> Option<Identity> {
        match place {
            OutputTarget::StandardOutput => Some(Identity::StandardOutput),
            OutputTarget::File(path) => Some(Identity::from_path(path)),
            OutputTarget::Stream(path) => is_pipe(path).then(|| Identity::from_path(path)),
        }
    }

    /// Of a path; links are followed.
    pub fn from_path(path: &Path) -> Identity {
        #[cfg(unix)]
        if let Ok(metadata) = std::fs::metadata(path) {
            use std::os::unix::fs::MetadataExt;
            return Identity::There(metadata.dev(), metadata.ino());
        }
        Identity::Free(spelled_out(path))
    }
}

/// Whether this is a named pipe, or the name of an open one.
pub(super) fn is_pipe(path: &Path) -> bool {
    #[cfg(unix)]
    return std::fs::metadata(path).is_ok_and(|m| std::os::unix::fs::FileTypeExt::is_fifo(&m.file_type()));
    #[cfg(not(unix))]
    return {
        let _ = path;
        false
    };
}

/// The whole path to something, with the links of the folders that are there followed.
pub(super) fn spelled_out(path: &Path) -> PathBuf {
    if let Ok(path) = std::fs::canonicalize(path) {
        return as_compared(path);
    }
    let folder = match folder_of(path) {
        folder if folder == path => PathBuf::from("."),
        folder => spelled_out(folder),
    };
    match path.components().next_back() {
        Some(Component::ParentDir) => folder.parent().unwrap_or(&folder).to_path_buf(),
        Some(Component::Normal(name)) => as_compared(folder.join(name)),
        _ => folder,
    }
}

/// The path as names are compared: without upper case where disks usually tell none from lower case.
fn as_compared(path: PathBuf) -> PathBuf {
    if cfg!(any(windows, target_os = "macos")) { path.to_string_lossy().to_lowercase().into() } else { path }
}
