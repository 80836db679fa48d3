//! NumPy archives: arrays by name, as `numpy.savez` and `savez_compressed` write them.
//!
//! Members that are not compressed are read where they lie; compressed ones as streams. Of the archive (ZIP, large ones
//! included) the table of contents is read; nothing is unpacked.

use crate::affine::Affine;
use crate::columns::{ColumnarField, ColumnarSnapshot, one_species};
use crate::npy::header::{NpyElement, NpyHeader};
use crate::npy::layout;
use crate::numbers::Bytes;
use crate::single_file::{named, only};
use crate::stored_bytes::{StoredBytes, StreamCoding};
use crate::{Choice, Description, Format, Snapshot, SpeciesField, SpeciesMass, TextResult};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use rawzip::{CompressionMethod, ZipArchive, ZipFileHeaderRecord, ZipSliceArchive};
use std::io::Read;
use std::path::PathBuf;

pub const FORMAT: Format = Format {
    name: "npz",
    title: "NumPy archive",
    detect: |head| head.bytes.starts_with(MAGIC) || head.bytes.starts_with(MAGIC_EMPTY),
    open,
};

const CELLS: [&str; 6] = ["box", "boxsize", "box_size", "lattice", "cell", "boxlength"];

struct ArchiveArray {
    name: String,
    stored: usize,
    header: NpyHeader,
}

fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let place = path.display().to_string();
    let refuse = |message: String| Error::input(path, message);
    let mut notes = Vec::new();
    let (stored, arrays) = arrays(&Bytes::from_filled_file(path)?, &mut notes).map_err(refuse)?;
    let rows = rows(&place, &arrays)?;
    if rows == 0 {
        return Err(refuse("it holds no particles".into()));
    }
    let mut fields: Vec<ColumnarField> = Vec::new();
    for array in &arrays {
        for field in layout::fields(&array.name, array.stored, &array.header, rows) {
            let taken = fields.iter().any(|f| f.name == field.name);
            let name = if taken { format!("{}.{}", array.name, field.name) } else { field.name.clone() };
            fields.push(ColumnarField { name, ..field });
        }
    }
    let positions = positions(&place, &fields)?;
    let mut meta = named(path);
    let mut species = one_species(rows, &fields, positions, layout::mass_named);
    for array in &arrays {
        let name = array.name.to_ascii_lowercase();
        if CELLS.contains(&&name[..]) {
            let values =
                small(array, &stored).map_err(|message| refuse(format!("member `{}`: {message}", array.name)))?;
            meta.cell = cell(&values).map_err(|message| refuse(format!("member `{}`: {message}", array.name)))?;
        } else if species.mass == SpeciesMass::Unknown && ["mass", "masses"].contains(&&name[..]) {
            // One number: every particle's.
            if let Ok([mass]) = small(array, &stored).as_deref() {
                species.mass = SpeciesMass::Each(*mass);
            }
        }
    }
    let description = Description {
        species: vec![species],
        notes,
        ..Description::new(format!("NumPy archive of {} arrays", arrays.len()), std::slice::from_ref(path), meta)
    };
    Ok(Box::new(ColumnarSnapshot { description, place, stored, fields, world: Affine::IDENTITY }))
}

/// The archive's arrays; members that cannot be read are named in `notes`.
fn arrays(bytes: &Bytes, notes: &mut Vec<String>) -> TextResult<(Vec<StoredBytes>, Vec<ArchiveArray>)> {
    let (mut stored, mut arrays) = (Vec::new(), Vec::new());
    for member in members(bytes)? {
        let name = member.name.strip_suffix(".npy").unwrap_or(&member.name).to_string();
        let array = member.content.and_then(|content| {
            let stream = content.open().map_err(|e| format!("it cannot be read: {e}"))?;
            let header = NpyHeader::read(stream)?;
            if header.end() != Some(content.size()) {
                let says = format!("{} of {}", header.shape_text(), header.kind_text());
                return Err(format!("the header says {says}, but the size is {} bytes", content.size()));
            }
            Ok((content, header))
        });
        match array {
            Ok((content, header)) => {
                arrays.push(ArchiveArray { name, stored: stored.len(), header });
                stored.push(content);
            }
            Err(message) => notes.push(format!("member `{}` is skipped: {message}", name.escape_debug())),
        }
    }
    if arrays.is_empty() {
        return Err(match &notes[..] {
            [] => "an archive without arrays".into(),
            some => some.join("; "),
        });
    }
    Ok((stored, arrays))
}

/// Particles: the rows of the array whose name says that it holds positions, else of any that may.
fn rows(place: &str, arrays: &[ArchiveArray]) -> Result<u64> {
    // Names decide as they do among fields; x alone has as many rows as x, y and z.
    let as_field = |a: &ArchiveArray| {
        let components = match a.header.shape[..] {
            [_] => 1,
            _ if layout::rows_of_positions(&a.header).is_some() => 3,
            _ => return None,
        };
        Some(SpeciesField::new(&a.name, "", components))
    };
    let fields: Vec<SpeciesField> = arrays.iter().filter_map(as_field).collect();
    let first = layout::positions_named(&fields);
    let first = first.as_deref().map(|names| names.split(',').next().unwrap_or(names));
    if let Some(array) = first.and_then(|name| arrays.iter().find(|a| a.name == name)) {
        return match (&array.header.element, &array.header.shape[..]) {
            (NpyElement::Plain(_), [n]) => Ok(*n),
            _ => Ok(layout::rows_of_positions(&array.header).unwrap_or(0)),
        };
    }
    arrays.iter().find_map(|a| layout::rows_of_positions(&a.header)).ok_or_else(|| {
        let listed: Vec<String> =
            arrays.iter().take(20).map(|a| format!("{} {}", a.name.escape_debug(), a.header.shape_text())).collect();
        let hint = "save positions as `pos` of shape (N, 3), or as `x`, `y` and `z`";
        Error::input_with(place, format!("no array holds positions; the arrays are: {}", listed.join(", ")), hint)
    })
}

/// The field that holds positions: by name, else the only one of three components, else none.
fn positions(place: &str, fields: &[ColumnarField]) -> Result<String> {
    let described: Vec<SpeciesField> = fields.iter().map(ColumnarField::described).collect();
    if let Some(name) = layout::positions_named(&described) {
        return match fields.iter().find(|f| f.name == name) {
            Some(field) if field.kind.is_none() => {
                let message =
                    format!("`{name}` holds {}, but positions must be floating-point numbers", field.kind_name);
                Err(Error::input_with(place, message, "save x, y and z as float32 or float64"))
            }
            _ => Ok(name),
        };
    }
    let mut vectors = fields.iter().filter(|f| f.components == 3 && f.kind.is_some());
    match (vectors.next(), vectors.next()) {
        (Some(one), None) => Ok(one.name.clone()),
        (None, _) => Err(Error::input(place, "no array holds positions")),
        _ => Ok(String::new()),
    }
}

/// The numbers of an array of nine at most.
fn small(array: &ArchiveArray, stored: &[StoredBytes]) -> TextResult<Vec<f64>> {
    let NpyElement::Plain(scalar) = &array.header.element else { return Err("records are not numbers".into()) };
    let kind = scalar.kind.ok_or_else(|| format!("{} values are not numbers", scalar.name))?;
    let count = array.header.shape.iter().try_fold(1u64, |n, &side| n.checked_mul(side));
    let count = count.filter(|n| (1..=9).contains(n)).ok_or("the cell must have 1 to 9 numbers")?;
    let mut stream = stored[array.stored].open().map_err(|e| e.to_string())?;
    let mut bytes = vec![0; (count * kind.bytes()) as usize];
    std::io::copy(&mut (&mut stream).take(array.header.data), &mut std::io::sink()).map_err(|e| e.to_string())?;
    stream.read_exact(&mut bytes).map_err(|e| e.to_string())?;
    let mut values: Vec<f64> =
        bytes.chunks_exact(kind.bytes() as usize).map(|b| kind.get(b, scalar.big_endian)).collect();
    if array.header.fortran && array.header.shape[..] == [3, 3] {
        values = (0..9).map(|i| values[i % 3 * 3 + i / 3]).collect();
    }
    Ok(values)
}

/// A cell of one length, three lengths, or three vectors; of a length of 0 nothing repeats.
fn cell(values: &[f64]) -> TextResult<Option<Cell>> {
    if let Some(bad) = values.iter().find(|v| !v.is_finite()) {
        return Err(format!("the cell has an edge of length {bad}"));
    }
    let cell = match *values {
        [l] => Cell::orthogonal([l; 3]),
        [x, y, z] => Cell::orthogonal([x, y, z]),
        [a, b, c, d, e, f, g, h, i] => {
            Cell { vectors: [[a, b, c], [d, e, f], [g, h, i]], ..Cell::orthogonal([0.0; 3]) }
        }
        _ => return Err(format!("a cell of {} numbers: it must have 1, 3 or 3x3", values.len())),
    };
    if values.iter().all(|v| *v == 0.0) {
        return Ok(None);
    }
    let negative = values.len() < 9 && values.iter().any(|v| *v < 0.0);
    match Cell::stated(cell.origin, cell.vectors, cell.periodic).filter(|_| !negative) {
        None => Err(format!("the cell {values:?} has no volume")),
        cell => Ok(cell),
    }
}

/// First bytes of a ZIP archive, unless it is empty.
const MAGIC: &[u8; 4] = b"PK\x03\x04";
/// First bytes of an empty one.
const MAGIC_EMPTY: &[u8; 4] = b"PK\x05\x06";
const MOST_MEMBERS: u64 = 1 << 14;

struct ZipMember {
    name: String,
    /// Its content; `Err` says why it cannot be read.
    content: TextResult<StoredBytes>,
}

/// All members. An archive without a table of contents, or with a member whose name leads out of it, is refused.
fn members(bytes: &Bytes) -> TextResult<Vec<ZipMember>> {
    let archive = ZipArchive::from_slice(&bytes[..]).ok().filter(|a| a.end_offset() == bytes.len() as u64);
    let archive = archive.ok_or("no table of contents: the file is cut short or not a ZIP archive")?;
    let count = archive.entries_hint();
    if count > MOST_MEMBERS {
        return Err(format!("the table of contents lists too many members: {count}"));
    }
    let (mut out, mut entries) = (Vec::new(), archive.entries());
    for number in 0..count {
        let entry = entries.next_entry().ok().flatten();
        let entry = entry.ok_or_else(|| format!("the entry of member {number} of {count} is incomplete"))?;
        let name = String::from_utf8_lossy(entry.file_path().as_ref()).into_owned();
        check_name(&name)?;
        // Folders have a name and nothing in it.
        if !name.ends_with('/') {
            out.push(ZipMember { name, content: content(bytes, &archive, &entry) });
        }
    }
    Ok(out)
}

/// Members must lie in the archive's own folder; that nothing is unpacked here does not make an
/// archive that tries it a good one.
fn check_name(name: &str) -> TextResult<()> {
    let outside = name.split(['/', '\\']).any(|part| part == "..") || name.starts_with(['/', '\\']);
    if outside || name.contains(':') || name.contains('\0') {
        return Err(format!("the name of member `{}` points outside the archive", name.escape_debug()));
    }
    Ok(())
}

fn content(
    bytes: &Bytes,
    archive: &ZipSliceArchive<&[u8]>,
    entry: &ZipFileHeaderRecord<'_>,
) -> TextResult<StoredBytes> {
    if entry.flags().is_encrypted() {
        return Err("it is encrypted".into());
    }
    let coding = match entry.compression_method() {
        CompressionMethod::STORE => StreamCoding::Plain,
        CompressionMethod::DEFLATE => StreamCoding::Deflate { crc: entry.crc32() },
        other => {
            let method = other.as_u16();
            return Err(format!("its compression (ZIP method {method}) is not supported: use numpy.savez"));
        }
    };
    let zip_entry =
        archive.get_entry(entry.wayfinder()).map_err(|_| "it starts at a wrong place or ends beyond the file")?;
    let (start, end) = zip_entry.compressed_data_range();
    StoredBytes::new(bytes.clone(), start, end - start, entry.uncompressed_size_hint(), coding)
}

#[cfg(test)]
mod tests;
