//! The files of a snapshot: `snap.0`, `snap.1`, ...

use super::blocks::GadgetFile;
use super::header::TYPES;
use crate::Choice;
use particlegs_core::{Error, Result};
use std::path::{Path, PathBuf};

/// More files than any snapshot has.
const MOST_FILES: u32 = 65_536;

/// Opens all files of the snapshot that `paths` belong to: one of them is enough; their blocks as
/// [`GadgetFile::open`]. Also what a user should know.
pub fn open(paths: &[PathBuf], options: &Choice) -> Result<(Vec<GadgetFile>, Vec<String>)> {
    let given = GadgetFile::open(&paths[0], &options.blocks)?;
    let files = given.header.files;
    if files > MOST_FILES {
        return Err(Error::input(&paths[0], format!("the header says {files} files: the header is damaged")));
    }
    let mut notes = Vec::new();
    let names = match names(&paths[0], files) {
        Err(_) if !options.strict && paths.len() == 1 => {
            notes.push(format!("the snapshot has {files} files; this file is read as one part of it"));
            vec![paths[0].clone()]
        }
        names => names?,
    };
    if let Some(alien) = paths.iter().find(|p| !names.contains(p)) {
        let message = format!("this is not one of the {files} file(s) of the snapshot {}", names[0].display());
        return Err(Error::input_with(alien, message, "name one snapshot at a time"));
    }
    let mut parts: Vec<GadgetFile> = Vec::with_capacity(names.len());
    for name in &names {
        if !name.exists() {
            let message =
                format!("this file is missing: {} says that the snapshot has {files} files", paths[0].display());
            return Err(Error::input_with(name, message, "put all files of the snapshot into one folder"));
        }
        let part = GadgetFile::open(name, &options.blocks)?;
        check_alike(&given, &part)?;
        parts.push(part);
    }
    for message in wrong_totals(&parts) {
        if options.strict {
            return Err(Error::input_with(&parts[0].path, message, "a file of the snapshot is missing or damaged"));
        }
        notes.push(format!("{message}: using the particles found"));
    }
    Ok((parts, notes))
}

/// `snap.0` ... of one of them.
fn names(path: &Path, files: u32) -> Result<Vec<PathBuf>> {
    if files == 1 {
        return Ok(vec![path.to_path_buf()]);
    }
    let text = path.to_str().unwrap_or_default();
    match text.rsplit_once('.') {
        Some((stem, number)) if number.parse().is_ok_and(|n: u32| n < files) => {
            Ok((0..files).map(|i| PathBuf::from(format!("{stem}.{i}"))).collect())
        }
        _ => Err(Error::input_with(
            path,
            format!("the snapshot has {files} files, but this file name has no number"),
            format!("name them NAME.0 to NAME.{}", files - 1),
        )),
    }
}

fn check_alike(first: &GadgetFile, part: &GadgetFile) -> Result<()> {
    let (a, b) = (&first.header, &part.header);
    let same = a.files == b.files && a.total == b.total && a.box_size == b.box_size && a.time == b.time;
    let masses = (0..TYPES).all(|t| a.count[t] == 0 || b.count[t] == 0 || a.mass[t] == b.mass[t]);
    if same && masses {
        return Ok(());
    }
    let message = format!("the header differs from that of {}", first.path.display());
    Err(Error::input_with(&part.path, message, "the files are of different snapshots"))
}

/// Notes of the types whose totals in the headers are not what the files hold together. Codes that leave the totals 0
/// are believed, and the high words are not looked at: old codes leave what was in memory there.
fn wrong_totals(parts: &[GadgetFile]) -> Vec<String> {
    let total = parts[0].header.total;
    let sum = |t: usize| parts.iter().map(|p| u64::from(p.header.count[t])).sum::<u64>();
    let wrong = (0..TYPES).filter(|&t| total != [0; TYPES] && sum(t) as u32 != total[t]);
    wrong
        .map(|t| format!("the header says {} particles of type {t} in total, but the files have {}", total[t], sum(t)))
        .collect()
}
