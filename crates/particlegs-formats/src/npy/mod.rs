//! NumPy arrays: N x 3, 3 x N, records with x, y, z, tables whose first columns are positions.
//! Mapped, not read; f32 in either order is used where it lies.

pub mod header;
pub mod layout;
mod literal;

use crate::affine::Affine;
use crate::laned::{ColumnarField, ColumnarSnapshot};
use crate::stored::{StoredBytes, StreamCoding};
use crate::strided::Bytes;
use crate::{Choice, Description, Format, Snapshot, Species, SpeciesMass};
use header::{MAGIC, NpyElement, NpyHeader};
use particlegs::particles::SnapshotMeta;
use particlegs::{Error, Result};
use particlegs_files::input::map_file;
use std::path::{Path, PathBuf};

/// NumPy array.
pub const FORMAT: Format = Format {
    name: "npy",
    title: "NumPy array",
    detect: |head| head.compression.is_none() && head.bytes.starts_with(MAGIC),
    open,
};

fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let place = path.display().to_string();
    let bytes = mapped(path)?;
    let header = NpyHeader::read(&bytes[..]).map_err(|what| Error::input(path, what))?;
    let length = bytes.len() as u64;
    if header.end() != Some(length) {
        let what = format!(
            "its header says {} of {}, which is not what its {length} bytes hold",
            header.shape_text(),
            header.kind_text()
        );
        return Err(Error::input_with(path, what, "the file is cut short or damaged: save it again"));
    }
    layout::check_numbers(&place, &header)?;
    let mut notes = Vec::new();
    let (count, fields, positions) = particles(&place, &header, &mut notes)?;
    if count == 0 {
        return Err(Error::input(path, "it holds no particles"));
    }
    let stored =
        StoredBytes::new(bytes, 0, length, length, StreamCoding::Plain).map_err(|what| Error::input(path, what))?;
    let species = species(count, &fields, positions, layout::mass_named);
    let description = Description {
        format: format!("NumPy array {} of {}", header.shape_text(), header.kind_text()),
        files: vec![path.clone()],
        meta: named(path),
        species: vec![species],
        notes,
        ..Description::default()
    };
    Ok(Box::new(ColumnarSnapshot { description, place, stored: vec![stored], fields, world: Affine::IDENTITY }))
}

/// The rows, the fields, and which of them hold positions.
fn particles(place: &str, header: &NpyHeader, notes: &mut Vec<String>) -> Result<(u64, Vec<ColumnarField>, String)> {
    let is_record = matches!(header.element, NpyElement::Record { .. });
    if let Some(rows) = layout::rows_of_positions(header) {
        let fields = layout::fields("positions", 0, header, rows);
        let described: Vec<_> = fields.iter().map(ColumnarField::described).collect();
        let positions = layout::positions_named(&described).unwrap_or_default();
        let vectors = described.iter().any(|f| f.components == 3) || described.len() >= 3;
        if !positions.is_empty() || (is_record && vectors) {
            return Ok((rows, fields, positions));
        }
        let names: Vec<&str> = described.iter().map(|f| &f.name[..]).collect();
        let what = format!("its records hold {}, and no x, y and z", names.join(", "));
        return Err(Error::input(place, what));
    }
    if let Some(rows) = layout::rows_of_table(header) {
        let fields = layout::table(0, header, rows);
        notes.push(format!(
            "a table of {} columns: 0, 1 and 2 are read as x, y and z; the field of positions 3,4,5 chooses others",
            fields.len()
        ));
        return Ok((rows, fields, "0,1,2".into()));
    }
    let what = format!("its shape {} of {} is not that of positions", header.shape_text(), header.kind_text());
    Err(Error::input_with(place, what, "save an array of shape (N, 3) or (3, N), or records with x, y and z"))
}

/// The one file of a format in single files.
pub(crate) fn only(paths: &[PathBuf]) -> Result<&PathBuf> {
    match paths {
        [one] => Ok(one),
        [] => Err(Error::argument("no file was named")),
        [first, ..] => {
            let what = format!("{} files were named, and this format has one a snapshot", paths.len());
            Err(Error::input(first, what))
        }
    }
}

/// A file's bytes, mapped.
pub(crate) fn mapped(path: &Path) -> Result<Bytes> {
    match map_file(path)?.0 {
        Some(map) => Ok(Bytes::Mapped(map)),
        None => Err(Error::input(path, "the file is empty")),
    }
}

/// Metadata of a file that says nothing but its name.
pub(crate) fn named(path: &Path) -> SnapshotMeta {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    SnapshotMeta { name, ..SnapshotMeta::default() }
}

/// The one species of a file that has no others.
pub(crate) fn species(
    count: u64,
    fields: &[ColumnarField],
    positions: String,
    mass: impl Fn(&[crate::SpeciesField]) -> Option<String>,
) -> Species {
    let fields: Vec<_> = fields.iter().map(ColumnarField::described).collect();
    let mass = mass(&fields).map_or(SpeciesMass::Unknown, SpeciesMass::Field);
    Species { name: "particles".into(), aliases: vec!["0".into()], count, mass, positions, fields }
}

#[cfg(test)]
pub(crate) mod tests;
