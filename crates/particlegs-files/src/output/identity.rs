//! The file that a path is, whatever its spelling, links and letter case.

use super::place::{OutputTarget, folder_of};
use std::path::{Component, Path, PathBuf};

/// One file or folder, there or still to be made.
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
