//! The snapshots that a folder holds, and names in the order that people expect.

use crate::format::{FileHead, Format};
use crate::vtk_xml::lists;
use crate::{Choice, PathKind, csv, hdf5, raw, registry};
use particlegs_core::{Error, Hint, Result};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Snapshots that are named where a folder holds several.
const NAMED: usize = 8;
/// Formats whose snapshots may have several files.
const IN_PARTS: [&str; 5] = ["asdf", "hdf5", "gadget", "genericio", "vtk-xml"];
/// Files that are opened to find out which belong together.
const LOOKED_AT: usize = 64;

/// The file of a snapshot that may be named by its folder: one of them, the formats find the rest.
pub fn resolved(paths: &[PathBuf], options: &Choice) -> Result<Vec<PathBuf>> {
    let [folder] = paths else { return Ok(paths.to_vec()) };
    if !folder.is_dir() {
        return Ok(paths.to_vec());
    }
    let sets = snapshots(&candidates(folder, options)?, options);
    match &sets[..] {
        [one] => Ok(vec![one.first.clone()]),
        [] => Err(none_there(folder)),
        several => {
            let names = several.iter().take(NAMED).map(SnapshotFileSet::name).collect::<Vec<_>>().join(", ");
            let more = if several.len() > NAMED { ", ..." } else { "" };
            let message = format!("the folder has several snapshots: {names}{more}");
            let hint = Hint::from("name one of them; ").option("format", "").words(" ignores files of other formats");
            Err(Error::input_with(folder, message, hint))
        }
    }
}

/// Snapshots of a folder, one path each, `snap.2` before `snap.10`: files, or else folders.
///
/// # Errors
/// The folder cannot be read, or holds none.
pub(crate) fn folder_snapshots(folder: &Path, options: &Choice) -> Result<Vec<PathBuf>> {
    if raw::is_raw(&[folder.to_path_buf()]) {
        return Ok(vec![folder.to_path_buf()]);
    }
    let files = snapshots(&candidates(folder, options)?, options);
    let mut paths: Vec<PathBuf> = files.into_iter().map(|set| set.first).collect();
    if paths.is_empty() {
        let one = |p: &Path| raw::is_raw(&[p.to_path_buf()]) || resolved(&[p.to_path_buf()], options).is_ok();
        paths = entries(folder, |p| p.is_dir() && one(p))?;
    }
    if paths.is_empty() { Err(none_there(folder)) } else { Ok(paths) }
}

fn entries(folder: &Path, wanted: impl Fn(&Path) -> bool) -> Result<Vec<PathBuf>> {
    let all = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
    let mut paths: Vec<PathBuf> = all.filter_map(|entry| Some(entry.ok()?.path()).filter(|p| wanted(p))).collect();
    paths.sort_by_cached_key(|p| (natural_key(p), p.clone()));
    Ok(paths)
}

fn none_there(folder: &Path) -> Error {
    match PathKind::from_path(folder) {
        PathKind::Job => Error::input_with(folder, "a job folder, not a snapshot", PathKind::Job.to_a_model()),
        _ => Error::input_with(
            folder,
            "the folder holds neither xx.f32, yy.f32, zz.f32 nor a snapshot file",
            "name the first file of the snapshot",
        ),
    }
}

/// Files of a folder in a known format, or in the one that is asked for, `snap.2` before `snap.10`.
fn candidates(folder: &Path, options: &Choice) -> Result<Vec<(PathBuf, &'static Format)>> {
    let files = entries(folder, Path::is_file)?;
    let format = |path: PathBuf| {
        let file_format = match PathKind::from_head(&FileHead::read(&path).ok()?) {
            PathKind::Snapshot(format) => format,
            _ => return None,
        };
        Some((path, file_format)).filter(|_| options.format.as_ref().is_none_or(|wanted| file_format.name == wanted))
    };
    let known_files: Vec<_> = files.iter().cloned().filter_map(format).collect();
    // A format that content does not tell may be asked for where there is one file alone.
    match (&files[..], &options.format) {
        ([only], Some(name)) if known_files.is_empty() => Ok(vec![(only.clone(), registry::named(name)?)]),
        _ => Ok(known_files),
    }
}

struct SnapshotFileSet {
    first: PathBuf,
    files: BTreeSet<PathBuf>,
}

impl SnapshotFileSet {
    fn name(&self) -> String {
        self.first.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// Files that belong together are one: parts name each other, and a list names its pieces. Catalogues
/// and tables of text are none where there is another.
fn snapshots(candidates: &[(PathBuf, &'static Format)], options: &Choice) -> Vec<SnapshotFileSet> {
    let (mut sets, mut catalogues) = (Vec::<SnapshotFileSet>::new(), Vec::new());
    for (path, format) in candidates {
        if sets.iter().any(|s| s.files.contains(path)) {
            continue;
        }
        let mut files = BTreeSet::from([path.clone()]);
        if format.name == csv::FORMAT.name {
            catalogues.push(SnapshotFileSet { first: path.clone(), files });
            continue;
        }
        if IN_PARTS.contains(&format.name) && sets.len() < LOOKED_AT {
            // Which files belong together does not depend on the frame, and not all snapshots have the wanted one.
            let opened = (format.open)(std::slice::from_ref(path), &Choice { frame: None, ..options.clone() });
            if opened.is_err() && format.name == hdf5::FORMAT.name && hdf5::is_catalogue(path) {
                catalogues.push(SnapshotFileSet { first: path.clone(), files });
                continue;
            }
            files.extend(opened.map(|s| s.description().files.clone()).unwrap_or_default());
            files.extend(lists::named(path));
        }
        // A piece may sort before the file that lists it.
        sets.retain(|s| !s.files.is_subset(&files));
        sets.push(SnapshotFileSet { first: path.clone(), files });
    }
    if sets.is_empty() { catalogues } else { sets }
}

/// Text and numbers in turn, the numbers as their digits without leading zeros: `snap_2` sorts before `snap_10`.
pub(crate) fn natural_key(path: &Path) -> Vec<(String, usize, String)> {
    let text = path.to_string_lossy();
    let mut parts = Vec::new();
    let mut rest = &*text;
    while !rest.is_empty() {
        let (words, tail) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let (digits, tail) = tail.split_at(tail.find(|c: char| !c.is_ascii_digit()).unwrap_or(tail.len()));
        let number = digits.trim_start_matches('0');
        parts.push((words.to_string(), number.len(), number.to_string()));
        rest = tail;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixture(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
    }

    fn names(folder: &Path, format: Option<&str>) -> Result<Vec<String>> {
        let options = Choice { format: format.map(String::from), frame: None, ..Choice::default() };
        let paths = resolved(&[folder.to_path_buf()], &options)?;
        Ok(paths.iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect())
    }

    #[test]
    fn one_snapshot_is_found_and_several_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let put = |from: &str, name: &str| std::fs::copy(fixture(from), dir.path().join(name)).unwrap();
        let refused = |text: &str| {
            let error = names(dir.path(), None).unwrap_err().to_string();
            assert!(error.contains(text), "{error}");
        };
        refused("nor a snapshot file");
        std::fs::write(dir.path().join("picture.png"), b"\x89PNG\r\n\x1a\n").unwrap();
        std::fs::write(dir.path().join("views.json"), b"{}").unwrap();
        put("species.hdf5", "b.hdf5");
        assert_eq!(names(dir.path(), None).unwrap(), ["b.hdf5"]);
        put("species.hdf5", "a.hdf5");
        refused("several snapshots: a.hdf5, b.hdf5");
        std::fs::remove_file(dir.path().join("a.hdf5")).unwrap();
        std::fs::write(dir.path().join("atoms.xyz"), "1\nfirst\nAr 0 0 0\n").unwrap();
        refused("several snapshots: atoms.xyz, b.hdf5");
        assert_eq!(names(dir.path(), Some("hdf5")).unwrap(), ["b.hdf5"]);
        assert_eq!(names(dir.path(), Some("xyz")).unwrap(), ["atoms.xyz"]);
        assert!(names(dir.path(), Some("npy")).is_err());
    }

    #[test]
    fn catalogues_beside_a_snapshot_do_not_disturb() {
        let dir = tempfile::tempdir().unwrap();
        let put = |from: &str, name: &str| std::fs::copy(fixture(from), dir.path().join(name)).unwrap();
        put("species.hdf5", "snap_099.hdf5");
        put("../data/catalogue.hdf5", "fof_subhalo_tab_099.hdf5");
        put("header.csv", "out_99.list");
        assert_eq!(names(dir.path(), None).unwrap(), ["snap_099.hdf5"]);
        assert_eq!(names(dir.path(), Some("csv")).unwrap(), ["out_99.list"]);
        std::fs::remove_file(dir.path().join("snap_099.hdf5")).unwrap();
        assert!(names(dir.path(), None).is_err());
        // A file that is broken is no catalogue.
        std::fs::remove_file(dir.path().join("out_99.list")).unwrap();
        put("contiguous.hdf5", "snap_099.hdf5");
        let bytes = std::fs::read(fixture("species.hdf5")).unwrap();
        std::fs::write(dir.path().join("snap_100.hdf5"), &bytes[..bytes.len() / 2]).unwrap();
        assert!(names(dir.path(), None).is_err());
    }

    #[test]
    fn a_virtual_file_and_its_sources_are_one_snapshot() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("parts")).unwrap();
        for name in ["latest.hdf5", "masses.hdf5", "parts/part.0.hdf5", "parts/part.1.hdf5"] {
            std::fs::copy(fixture("../data/virtual").join(name), dir.path().join(name)).unwrap();
        }
        assert_eq!(names(dir.path(), None).unwrap(), ["latest.hdf5"]);
        std::fs::copy(fixture("../data/virtual/parts/part.0.hdf5"), dir.path().join("a.hdf5")).unwrap();
        assert!(names(dir.path(), None).is_err());
    }

    #[test]
    fn a_list_and_its_pieces_are_one_snapshot() {
        let dir = tempfile::tempdir().unwrap();
        let piece = "<?xml version=\"1.0\"?><VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\
            <PolyData><Piece NumberOfPoints=\"1\"><Points><DataArray type=\"Float32\" Name=\"Points\" \
            NumberOfComponents=\"3\" format=\"ascii\">1 2 3</DataArray></Points></Piece></PolyData></VTKFile>";
        let list = "<?xml version=\"1.0\"?><VTKFile type=\"PPolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\
            <PPolyData><PPoints><PDataArray type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\"/></PPoints>\
            <Piece Source=\"p0.vtp\"/><Piece Source=\"p1.vtp\"/></PPolyData></VTKFile>";
        for (name, text) in [("p0.vtp", piece), ("p1.vtp", piece), ("list.pvtp", list)] {
            std::fs::write(dir.path().join(name), text).unwrap();
        }
        assert_eq!(names(dir.path(), None).unwrap(), ["list.pvtp"]);
        std::fs::remove_file(dir.path().join("list.pvtp")).unwrap();
        assert!(names(dir.path(), None).unwrap_err().to_string().contains("p0.vtp, p1.vtp"));
    }
}
