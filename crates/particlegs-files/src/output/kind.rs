//! The kind of an output: by its content, which decides on the files that it may replace, and by the ending of its
//! name.

use super::write::is_stream;
use crate::{Error, Result};
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

/// Types of files whose endings have digits: `run.v2` and `run.2024` may well be folders.
const WITH_DIGITS: [&str; 17] = [
    "7z", "bz2", "ccp4", "f32", "f64", "g96", "h5", "hdf4", "hdf5", "he5", "jp2", "m4v", "mp3", "mp4", "nc3", "nc4",
    "x3d",
];
/// Endings of letters that promise no type: of names on the way, and of folders with raw columns.
const NO_TYPES: [&str; 10] = ["bak", "d", "dir", "new", "old", "orig", "out", "part", "raw", "tmp"];

/// The ending of an output's name that is one of those `written`. None of a stream, a folder (one that is there, or a
/// name that ends in a slash), and a name whose ending is no type of file.
///
/// # Errors
///
/// An argument if the name means another type of file: one with an ending of letters, or a common one with digits.
pub fn ending<'a>(out: &Path, written: &[&'a str]) -> Result<Option<&'a str>> {
    // `Path` leaves out a slash at the end, so the bytes are looked at.
    let is_folder = out.as_os_str().as_encoded_bytes().last().is_some_and(|&b| std::path::is_separator(b.into()));
    if is_folder || out.is_dir() || is_stream(out)? {
        return Ok(None);
    }
    let Some(name) = out.extension().map(|e| e.to_string_lossy().to_lowercase()) else { return Ok(None) };
    if let Some(known) = written.iter().find(|w| **w == name) {
        return Ok(Some(known));
    }
    let is_type = !name.is_empty() && name.chars().all(char::is_alphabetic) || WITH_DIGITS.contains(&&name[..]);
    if !is_type || NO_TYPES.contains(&&name[..]) {
        return Ok(None);
    }
    let message = format!("{}: this command does not write .{name} files", out.display());
    let hint = match written {
        [] => "it writes a folder: end its name in /, or omit the ending".to_string(),
        _ => format!("possible endings: .{}", written.join(", .")),
    };
    Err(Error::argument_with(message, hint))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_means_what_is_written_or_a_folder_or_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("there.jpg")).unwrap();
        let ending_of =
            |name: &str| ending(&folder.path().join(name), &["png", "svg"]).map_err(|e| e.hint().to_string());
        for (name, is) in [("a.png", "png"), ("a.PNG", "png"), ("a.b.svg", "svg")] {
            assert_eq!(ending_of(name), Ok(Some(is)), "{name}");
        }
        for name in
            ["a", "run.2024", "out.v2", "snap_0.5", "a.jpg/", "there.jpg", ".hidden", "a.", "a.png.tmp", "a b.c d"]
        {
            assert_eq!(ending_of(name), Ok(None), "{name}");
        }
        for name in ["a.jpg", "a.JPG", "a.mp4", "a.png.h5", "a.xyzw", "a.größe"] {
            assert_eq!(ending_of(name), Err("possible endings: .png, .svg".into()), "{name}");
        }
        assert!(ending(Path::new("a.png"), &[]).unwrap_err().hint().to_string().contains("end its name in /"));
        assert_eq!(ending(Path::new("-"), &["png"]).unwrap(), None);
    }
}
