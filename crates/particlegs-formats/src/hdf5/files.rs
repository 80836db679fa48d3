//! The files of a snapshot: found from one of them, and in order.

use particlegs_core::{Error, Result};
use std::path::{Path, PathBuf};

/// More files than any snapshot has.
const MAX_FILES: u64 = 1 << 16;

/// A name with a number between dots before its ending, as in `snap_010.0.hdf5`: what is before the
/// number, the number, what is after it.
fn numbered(path: &Path) -> Option<(String, u64, String)> {
    let name = path.file_name()?.to_str()?;
    let parts: Vec<&str> = name.split('.').collect();
    // The last number counts: names may hold others, as in `run.3.snap.0.hdf5`.
    let at = (1..parts.len()).rev().find(|&i| !parts[i].is_empty() && parts[i].bytes().all(|b| b.is_ascii_digit()))?;
    let number = parts[at].parse().ok()?;
    let rest: String = parts[at + 1..].iter().flat_map(|p| [".", p]).collect();
    Some((format!("{}.", parts[..at].join(".")), number, rest))
}

/// Whether a file, whose header is of a snapshot of `count` files, is none of those by its name.
pub fn stands_alone(path: &Path, count: u64) -> bool {
    count > 1 && numbered(path).is_none_or(|(_, number, _)| number >= count)
}

/// All `count` files of the snapshot that `given` are of, in order.
pub fn all(given: &[PathBuf], count: u64) -> Result<Vec<PathBuf>> {
    let first = &given[0];
    if count == 1 {
        if let Some(second) = given.get(1) {
            let message = "the header says that this file is the whole snapshot, but more files were named";
            let hint = format!("name one snapshot at a time, without {}", second.display());
            return Err(Error::input_with(first, message, hint));
        }
        return Ok(given.to_vec());
    }
    if count > MAX_FILES {
        return Err(Error::input(first, format!("the header has a wrong number of files: {count}")));
    }
    let Some((before, _, after)) = numbered(first) else {
        let message = format!("the snapshot has {count} files, but this file name has no number");
        return Err(Error::input_with(first, message, "name the files like snap.0.hdf5, snap.1.hdf5"));
    };
    let paths: Vec<PathBuf> = (0..count).map(|i| first.with_file_name(format!("{before}{i}{after}"))).collect();
    if let Some(missing) = paths.iter().find(|p| !p.is_file()) {
        let message = format!("this file is missing: the snapshot has {count} files");
        return Err(Error::input_with(missing, message, format!("put it beside {}", first.display())));
    }
    if let Some(other) = given.iter().find(|g| !paths.contains(g)) {
        return Err(Error::input(other, format!("it does not belong to the {count} files of {}", first.display())));
    }
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_from_any_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for i in 0..3 {
            std::fs::write(path(&format!("snap_010.{i}.hdf5")), b"").unwrap();
        }
        let wanted: Vec<PathBuf> = (0..3).map(|i| path(&format!("snap_010.{i}.hdf5"))).collect();
        assert_eq!(all(&[path("snap_010.0.hdf5")], 3).unwrap(), wanted);
        assert_eq!(all(&[path("snap_010.1.hdf5")], 3).unwrap(), wanted);
        assert_eq!(all(&wanted, 3).unwrap(), wanted);
        let missing = all(&[path("snap_010.0.hdf5")], 4).unwrap_err().to_string();
        assert!(missing.contains("snap_010.3.hdf5"), "{missing}");
        assert!(all(&wanted, 1).is_err());
        assert!(all(&[path("snap_010.0.hdf5"), path("other.1.hdf5")], 3).is_err());
        assert!(all(&[path("snap.hdf5")], 3).is_err());
        assert!(all(&wanted, u64::MAX).is_err());
    }
}
