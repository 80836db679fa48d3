//! The kind of an output's content, and so of the files that it may replace.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes that tell what a file holds.
const HEAD: u64 = 1 << 16;

/// The kind of an output's content. A file that is there is replaced by one of its own kind only.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Its name in messages, with its article: `a model file`.
    pub name: &'static str,
    /// Whether it is kept unless replacing is asked for.
    pub kept: bool,
    /// Whether a file of this path that begins with these bytes holds this.
    pub is: fn(&Path, &[u8]) -> bool,
}

impl Kind {
    /// Whether the regular file at `path` may be replaced by this at all. An empty file always may.
    pub(super) fn may_replace(&self, path: &Path) -> std::io::Result<bool> {
        let head = head(path)?;
        Ok(head.is_empty() || (self.is)(path, &head))
    }
}

fn head(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut head = Vec::new();
    File::open(path)?.take(HEAD).read_to_end(&mut head)?;
    Ok(head)
}
