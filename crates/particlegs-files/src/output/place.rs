//! The target of a path that is to be written: a regular file behind any links, or a stream.

use crate::{Error, Result};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

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
