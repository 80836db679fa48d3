//! Snapshots in several files: `name` maps ranks to partitions, `name#0`, `name#7`, ... hold them.

use super::header::GenericIoFile;
use crate::numbers::NumberType;
use particlegs_core::{Error, Result};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The column of a map.
const PARTITION: &str = "$partition";

pub fn open(paths: &[PathBuf]) -> Result<Vec<GenericIoFile>> {
    let whole = whole_of(&paths[0]);
    let first = GenericIoFile::open(&whole)?;
    let Some(partition) = first.variable(PARTITION) else {
        return match paths.iter().find(|p| **p != whole) {
            Some(other) => Err(Error::input_with(
                other,
                format!("a second file was named, but {} is a whole snapshot", whole.display()),
                "name one snapshot at a time",
            )),
            None => Ok(vec![first]),
        };
    };
    let parts: Vec<PathBuf> = partitions(&first, partition)?.iter().map(|p| part(&whole, *p)).collect();
    if let Some(alien) = paths.iter().find(|p| **p != whole && !parts.contains(p)) {
        let message = format!("{} does not list this file", whole.display());
        return Err(Error::input_with(alien, message, "name one snapshot at a time"));
    }
    let open = |path: &PathBuf| {
        if path.exists() {
            return GenericIoFile::open(path);
        }
        let message = format!("this file is missing: {} lists it as part of the snapshot", whole.display());
        Err(Error::input_with(path, message, "put all files of the snapshot into one folder"))
    };
    let files: Vec<GenericIoFile> = parts.iter().map(open).collect::<Result<_>>()?;
    if files.is_empty() {
        return Err(Error::input(&whole, "the map lists no files"));
    }
    if let Some(odd) = files.iter().find(|f| f.scale != files[0].scale || f.origin != files[0].origin) {
        return Err(Error::input(&odd.path, format!("the box differs from that of {}", files[0].path.display())));
    }
    Ok(files)
}

fn part(whole: &Path, number: i64) -> PathBuf {
    PathBuf::from(format!("{}#{number}", whole.display()))
}

/// `name` for `name#7` where there is such a file.
fn whole_of(path: &Path) -> PathBuf {
    let text = path.to_string_lossy();
    match text.rsplit_once('#') {
        Some((stem, number)) if number.parse::<u32>().is_ok() && Path::new(stem).is_file() => stem.into(),
        _ => path.to_path_buf(),
    }
}

fn partitions(map: &GenericIoFile, variable: usize) -> Result<BTreeSet<i64>> {
    let mut out = BTreeSet::new();
    for (r, rank) in map.ranks.iter().enumerate() {
        let column = map.column(r, variable)?;
        let kind =
            map.variables[variable].kind.filter(|k| matches!(k, NumberType::I32 | NumberType::I64 | NumberType::U32));
        let kind = kind.filter(|_| !column.blosc);
        let kind = kind.ok_or_else(|| Error::input(&map.path, "the map of ranks has an unknown layout"))?;
        for i in 0..rank.count {
            let at = (column.start + i * kind.bytes()) as usize;
            out.insert(kind.get(&map.bytes[at..], map.big_endian) as i64);
            if out.len() > 65_536 {
                return Err(Error::input(&map.path, "the map lists more than 65536 files"));
            }
        }
    }
    Ok(out)
}
