//! NumPy arrays: N x 3, 3 x N, records with x, y, z, tables whose first columns are positions.
//! Mapped, not read; f32 in either order is used where it lies.

pub mod header;
pub mod layout;
mod literal;

use crate::affine::Affine;
use crate::columns::{ColumnarField, ColumnarSnapshot, one_species};
use crate::numbers::Bytes;
use crate::single_file::{named, only};
use crate::stored_bytes::StoredBytes;
use crate::{Choice, Description, Format, Snapshot};
use header::{MAGIC, NpyElement, NpyHeader};
use particlegs_core::{Error, Result};
use std::path::PathBuf;

pub const FORMAT: Format = Format {
    name: "npy",
    title: "NumPy array",
    detect: |head| head.compression.is_none() && head.bytes.starts_with(MAGIC),
    open,
};

fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let place = path.display().to_string();
    let bytes = Bytes::from_filled_file(path)?;
    let header = NpyHeader::read(&bytes[..]).map_err(|message| Error::input(path, message))?;
    let length = bytes.len() as u64;
    if header.end() != Some(length) {
        let message = format!(
            "the header says {} of {}, but the data have {length} bytes",
            header.shape_text(),
            header.kind_text()
        );
        return Err(Error::input_with(path, message, "the file is cut short or damaged: save it again"));
    }
    layout::check_numbers(&place, &header)?;
    let mut notes = Vec::new();
    let (count, fields, positions) = particles(&place, &header, &mut notes)?;
    if count == 0 {
        return Err(Error::input(path, "it holds no particles"));
    }
    let species = one_species(count, &fields, positions, layout::mass_named);
    let description = Description {
        species: vec![species],
        notes,
        ..Description::new(
            format!("NumPy array {} of {}", header.shape_text(), header.kind_text()),
            std::slice::from_ref(path),
            named(path),
        )
    };
    Ok(Box::new(ColumnarSnapshot {
        description,
        place,
        stored: vec![StoredBytes::plain_file(bytes)],
        fields,
        world: Affine::IDENTITY,
    }))
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
        let message = format!("the records have {}, but no x, y and z", names.join(", "));
        return Err(Error::input(place, message));
    }
    if let Some(rows) = layout::rows_of_table(header) {
        let fields = layout::table(0, header, rows);
        notes.push(format!(
            "a table of {} columns: 0, 1 and 2 are read as x, y and z; for others give the positions as, say, 3,4,5",
            fields.len()
        ));
        return Ok((rows, fields, "0,1,2".into()));
    }
    let message = format!("an array of shape {} of {} cannot hold positions", header.shape_text(), header.kind_text());
    Err(Error::input_with(place, message, "save an array of shape (N, 3) or (3, N), or records with x, y and z"))
}

#[cfg(test)]
pub(crate) mod tests;
