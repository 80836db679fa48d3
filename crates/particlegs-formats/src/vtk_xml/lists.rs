//! Files that list others: the pieces of a VTP or VTU, blocks (VTM), moments (PVD).

use super::document::CollectionEntry;
use super::file::VtkXmlFile;
use crate::ascii::shown;
use crate::{TrajectoryFrames, frames};
use particlegs_core::{Error, Result};
use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

const MOST_DEPTH: usize = 4;

/// The files that hold the points of one moment.
#[derive(Default)]
pub struct CollectionParts {
    pub files: Vec<VtkXmlFile>,
    pub frames: Option<TrajectoryFrames>,
    /// The moment, as a list has it.
    pub time: Option<f64>,
    pub notes: Vec<String>,
}

/// Opens `path` and what it lists, of moment `frame` or the last.
pub fn open(path: &Path, frame: Option<i64>) -> Result<CollectionParts> {
    let mut parts = CollectionParts::default();
    parts.add(path, frame, 0)?;
    if parts.files.is_empty() {
        return Err(Error::input(path, "none of the listed files has points"));
    }
    if let Some(TrajectoryFrames { count: 2.., chosen, .. }) = parts.frames.filter(|_| frame.is_none()) {
        parts.notes.push(format!("using frame {chosen}, the last of {} (0 to {chosen})", chosen + 1));
    }
    Ok(parts)
}

/// The files that a list names itself, of all moments; none for what is no list.
pub fn named(path: &Path) -> Vec<PathBuf> {
    let Ok(list) = VtkXmlFile::open(path) else { return Vec::new() };
    list.document.listed.iter().filter_map(|l| beside(path, &l.file).ok()).collect()
}

impl CollectionParts {
    fn add(&mut self, path: &Path, frame: Option<i64>, depth: usize) -> Result<()> {
        let file = VtkXmlFile::open(path)?;
        let document = &file.document;
        match &document.kind[..] {
            "PolyData" | "UnstructuredGrid" => self.files.push(file),
            "PPolyData" | "PUnstructuredGrid" => {
                let sources: Vec<String> = document.pieces.iter().filter_map(|p| p.source.clone()).collect();
                for name in sources {
                    let piece = VtkXmlFile::open(&beside(path, &name)?)?;
                    match &piece.document.kind[..] {
                        "PolyData" | "UnstructuredGrid" => self.files.push(piece),
                        _ => return Err(Error::input(&piece.path, "this piece is neither a VTP nor a VTU file")),
                    }
                }
            }
            _ if depth == MOST_DEPTH => return Err(Error::input(path, "lists of files are nested too deeply")),
            "Collection" => {
                let (listed, frames) = moment(path, &document.listed, frame)?;
                self.time = listed.first().and_then(|l| l.time);
                self.frames = Some(frames);
                for one in &listed {
                    self.add(&beside(path, &one.file)?, frame, depth + 1)?;
                }
            }
            "vtkMultiBlockDataSet" | "vtkPartitionedDataSet" | "vtkPartitionedDataSetCollection" => {
                for one in &document.listed {
                    self.add(&beside(path, &one.file)?, frame, depth + 1)?;
                }
            }
            // A block among others.
            other if depth > 0 => {
                self.notes.push(format!("{} is skipped: `{}` has no explicit points", path.display(), shown(other)));
            }
            other => {
                let message = format!("VTK data of type `{}` have no explicit points", shown(other));
                return Err(Error::input_with(path, message, "save them as VTP or VTU"));
            }
        }
        Ok(())
    }
}

/// The files of moment `frame`, or of the last, and how many moments there are. Files without a time are moments of
/// their own.
fn moment(
    path: &Path,
    listed: &[CollectionEntry],
    frame: Option<i64>,
) -> Result<(Vec<CollectionEntry>, TrajectoryFrames)> {
    let mut moments: Vec<Vec<CollectionEntry>> = Vec::new();
    let mut known = HashMap::new();
    for one in listed {
        let next = moments.len();
        // f64 cannot be a key; equal times have equal bits.
        let index = one.time.map_or(next, |t| *known.entry(t.to_bits()).or_insert(next));
        match moments.get_mut(index) {
            Some(same) => same.push(one.clone()),
            None => moments.push(vec![one.clone()]),
        }
    }
    let count = moments.len() as u64;
    if count == 0 {
        return Err(Error::input(path, "the list of files is empty"));
    }
    let chosen = frames::number(path, frame, count)?;
    Ok((moments.swap_remove(chosen as usize), TrajectoryFrames { count, chosen, step: None }))
}

/// The file `name` that the list `path` names, which lies beside or below it.
fn beside(path: &Path, name: &str) -> Result<PathBuf> {
    let relative = Path::new(name);
    if !relative.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir)) {
        let message = format!("it lists a file outside its folder: `{}`", shown(name));
        return Err(Error::input_with(path, message, "put the listed files beside it"));
    }
    let file = path.parent().unwrap_or(Path::new("")).join(relative);
    match file.is_file() {
        true => Ok(file),
        false => Err(Error::input(&file, format!("this file is missing: {} lists it", path.display()))),
    }
}
