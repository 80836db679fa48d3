//! VTK's XML files of points: VTP and VTU, and the files that list them: pieces, blocks, moments.

mod blocks;
mod document;
mod file;
pub(crate) mod lists;
pub(crate) mod points;
pub(crate) mod stream;
mod write;

use crate::cache::{ChunkCache, DEFAULT_BYTES};
use crate::format::FileHead;
use crate::pieces::{ParticlePiece, PieceReader};
use crate::single_file::named;
use crate::{Choice, Description, Format, Snapshot, Species, SpeciesField, SpeciesMass, axes};
use document::ArrayDeclaration;
use file::VtkXmlFile;
use particlegs_core::model::Epoch;
use particlegs_core::{Error, Result};
use particlegs_particles::{SnapshotMeta, SnapshotReader};
use points::{ArraySource, PiecePoints, open_columns};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use write::{common, write};

pub const FORMAT: Format = Format {
    name: "vtk-xml",
    title: "VTK XML (VTP, VTU, lists of them)",
    detect,
    open: |paths, choice| Ok(Box::new(VtkXml::open(paths, choice)?)),
};

fn detect(head: &FileHead) -> bool {
    let text = head.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&head.bytes);
    let text = text.trim_ascii_start();
    // The file may end within the tag.
    let cut = |whole: &[u8]| !text.is_empty() && (text.starts_with(whole) || whole.starts_with(text));
    head.compression.is_none()
        && (cut(b"<VTKFile") || (text.starts_with(b"<?xml") && text.windows(8).any(|w| w == b"<VTKFile")))
}

struct VtkXml {
    files: Vec<VtkXmlFile>,
    description: Description,
}

impl VtkXml {
    fn open(paths: &[PathBuf], choice: &Choice) -> Result<VtkXml> {
        if let Some(second) = paths.get(1) {
            let hint = "if the files form one snapshot, name the .pvtp, .pvtu, .vtm or .pvd file that lists them";
            return Err(Error::input_with(second, "a second VTK file was named", hint));
        }
        let parts = lists::open(&paths[0], choice.frame)?;
        let description = describe(&paths[0], &parts)?;
        Ok(VtkXml { files: parts.files, description })
    }
}

fn pieces(files: &[VtkXmlFile]) -> impl Iterator<Item = (&VtkXmlFile, &document::VtkPiece)> {
    files.iter().flat_map(|f| f.document.pieces.iter().filter(|p| p.points > 0).map(move |p| (f, p)))
}

/// The array of a name, positions before others.
fn find<'a>(piece: &'a document::VtkPiece, name: &str) -> Option<&'a ArrayDeclaration> {
    let is_named = |d: &&ArrayDeclaration| field_name(d, piece) == name && d.kind.is_some();
    piece.positions.iter().chain(&piece.arrays).find(is_named)
}

/// Positions without a name are called `Points`.
fn field_name<'a>(declared: &'a ArrayDeclaration, piece: &document::VtkPiece) -> &'a str {
    match &declared.name[..] {
        "" if piece.positions.as_ref() == Some(declared) => "Points",
        name => name,
    }
}

fn describe(path: &Path, parts: &lists::CollectionParts) -> Result<Description> {
    let files = &parts.files[..];
    let count = pieces(files).try_fold(0u64, |n, (_, p)| n.checked_add(p.points));
    let count = count.ok_or_else(|| Error::input(path, "too many points to count"))?;
    let Some((file, first)) = pieces(files).next() else { return Err(Error::input(path, "it holds no points")) };
    let mut fields: Vec<SpeciesField> = Vec::new();
    for declared in first.positions.iter().chain(&first.arrays) {
        let name = field_name(declared, first);
        let alike = |p: &document::VtkPiece| find(p, name).is_some_and(|d| d.components == declared.components);
        if name.is_empty() || fields.iter().any(|f| f.name == name) || !pieces(files).all(|(_, p)| alike(p)) {
            continue;
        }
        if let Some(kind) = declared.kind {
            fields.push(SpeciesField::new(name, kind.name(), declared.components));
        }
    }
    let positions = first.positions.as_ref().map_or("Points", |p| field_name(p, first)).to_string();
    let mass = mass_of(&fields);
    let d = &file.document;
    let order = if d.big_endian { "big-endian" } else { "little-endian" };
    let packed = d.compressor.map_or(String::new(), |c| format!(", {c:?}").to_lowercase());
    let format = format!("VTK XML, {}, {order}{packed}", d.kind);
    let epoch = Epoch { time: parts.time.or(file.time()), ..parts.frames.map_or_else(Epoch::default, |f| f.epoch()) };
    let meta = SnapshotMeta { epoch, ..named(path) };
    let species = Species { name: "points".into(), aliases: vec![], count, mass, positions, fields };
    let files: Vec<_> = files.iter().map(|f| f.path.clone()).collect();
    let (frames, notes) = (parts.frames, parts.notes.clone());
    Ok(Description { species: vec![species], frames, notes, ..Description::new(format, &files, meta) })
}

pub(crate) fn mass_of(fields: &[SpeciesField]) -> SpeciesMass {
    let named = |f: &&SpeciesField| f.components == 1 && matches!(&f.name.to_lowercase()[..], "mass" | "masses");
    fields.iter().find(named).map_or(SpeciesMass::Unknown, |f| SpeciesMass::Field(f.name.clone()))
}

impl Snapshot for VtkXml {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let species = &self.description.species[species];
        let place = self.files[0].path.display().to_string();
        let columns = axes::columns(&place, species, choice)?;
        let cache = Arc::new(ChunkCache::new(DEFAULT_BYTES / 2));
        let mut key = 0;
        let mut out: Vec<Box<dyn ParticlePiece>> = Vec::new();
        for (file, piece) in pieces(&self.files) {
            let arrays = open_columns(&columns, |name| {
                let missing = || Error::input(&file.path, format!("there is no array `{name}`"));
                let declared = find(piece, name).ok_or_else(missing)?;
                let mut array = file.array(declared, piece.points, &cache)?.ok_or_else(missing)?;
                if let ArraySource::Blocks(blocks) = &mut array.source {
                    // Arrays share the cache: the keys of each begin behind those of the one before.
                    blocks.key = key;
                    key += blocks.count();
                }
                array.kind = array.kind.stored(choice.as_stored);
                Ok(array)
            })?;
            let place = file.path.display().to_string();
            out.push(Box::new(PiecePoints::new(&place, file.bytes.clone(), piece.points, arrays)?));
        }
        Ok(Box::new(PieceReader::new(self.description.meta.clone(), out, columns.len() > 3)?))
    }
}

#[cfg(test)]
mod tests;
