//! The files of a snapshot: `slab000.L0.pack9.asdf`, `slab001.L0.pack9.asdf`, ... or `field_rv_A_000.asdf`, ...

use super::AsdfFile;
use particlegs_core::{Error, Result};
use std::path::{Path, PathBuf};

/// More files than any snapshot has.
const MOST_FILES: usize = 1 << 16;

/// The parts of a name before, in and behind the number of a slab.
fn numbered(path: &Path) -> Option<(&str, &str, &str)> {
    let name = path.file_name()?.to_str()?;
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let at = match name.strip_suffix(".asdf")?.rsplit_once('_') {
        _ if name.starts_with("slab") => 4,
        Some((before, number)) if digits(number) == number.len() => before.len() + 1,
        _ => return None,
    };
    let end = at + digits(&name[at..]);
    (end > at).then(|| (&name[..at], &name[at..end], &name[end..]))
}

/// The files that are named, or where one is, those of its snapshot beside it, by number.
pub fn open(paths: &[PathBuf]) -> Result<Vec<AsdfFile>> {
    let first = paths.first().ok_or_else(|| Error::argument("no file was named"))?;
    let files: Vec<AsdfFile> = paths.iter().map(|path| AsdfFile::open(path)).collect::<Result<_>>()?;
    if let Some(other) = files.iter().find(|f| f.packed != files[0].packed || f.abacus != files[0].abacus) {
        let message = format!("the header differs from that of {}", first.display());
        return Err(Error::input_with(&other.path, message, "name one snapshot at a time"));
    }
    let ([_], Some((before, number, after)), Some(_)) = (paths, numbered(first), files[0].packed) else {
        return Ok(files);
    };
    let folder = first.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut beside: Vec<(u64, PathBuf)> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = first.with_file_name(entry.map_err(|e| Error::io(folder, e))?.file_name());
        let alike = numbered(&path).filter(|n| (n.0, n.1.len(), n.2) == (before, number.len(), after));
        if let Some(number) = alike.and_then(|n| n.1.parse().ok()) {
            beside.push((number, path));
        }
    }
    if beside.len() > MOST_FILES {
        return Err(Error::input(folder, format!("it has more than {MOST_FILES} slabs")));
    }
    beside.sort();
    let (mut all, mut last) = (Vec::new(), None);
    for (number, path) in beside {
        let file = AsdfFile::open(&path)?;
        // Those of other moments and simulations may lie in the same folder.
        if file.packed != files[0].packed || file.abacus != files[0].abacus {
            continue;
        }
        if last.is_some_and(|last: u64| last + 1 < number) {
            let hint = format!("put all files of the snapshot beside {}, or name those to read", first.display());
            return Err(Error::input_with(&path, "the slab before this one is missing", hint));
        }
        last = Some(number);
        all.push(file);
    }
    Ok(if all.is_empty() { files } else { all })
}
