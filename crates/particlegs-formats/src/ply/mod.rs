//! PLY: the vertices of any PLY file, text or binary, as points.
//!
//! Vertices of one length are read where they lie; others, and text, through an index of rows.

mod header;
mod rows;

use crate::affine::Affine;
use crate::columns::{ColumnarField, ColumnarSnapshot, one_species};
use crate::npy::layout;
use crate::numbers::Bytes;
use crate::pieces::PieceReader;
use crate::single_file::{named, only};
use crate::stored_bytes::StoredBytes;
use crate::{Choice, Description, Format, Snapshot, TextResult, axes};
use header::{Encoding, PlyElement, PlyHeader};
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotReader;
use rows::{RowFormat, VariableLengthRows, VertexStart};
use std::path::PathBuf;

pub const FORMAT: Format =
    Format { name: "ply", title: "PLY points", detect: |head| header::is_ply(&head.content), open };

fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let place = path.display().to_string();
    let bytes = Bytes::from_filled_file(path)?;
    if let Some(compression) = crate::compression::FileCompression::from_magic(&bytes) {
        let message = format!("a PLY file compressed with {}, which this program does not read", compression.name());
        return Err(Error::input_with(path, message, "unpack it first"));
    }
    let header = header::parse(&bytes).map_err(|message| Error::input(path, message))?;
    let number = vertices(&place, &header)?;
    let element = &header.elements[number];
    let fields = fields(element);
    let mut description = describe(path, &header, element, &fields)?;
    let broken = |message: String| Error::input_with(path, message, "the file is cut short or damaged: copy it again");
    let start = start(&bytes, &header, number).map_err(broken)?;
    let format = RowFormat::new(header.encoding, element);
    let least = element.count.checked_mul(format.least_bytes()).and_then(|b| b.checked_add(start.byte));
    // The last line of text may lack its end.
    if least.is_none_or(|end| end > bytes.len() as u64 + 1) {
        let message =
            format!("the header says {} vertices, but the file has only {} bytes", element.count, bytes.len());
        return Err(broken(message));
    }
    match element.bytes() {
        Some(stride) if header.encoding != Encoding::Ascii => {
            let stored = StoredBytes::plain_file(bytes);
            let place_field =
                |f| ColumnarField { base: start.byte, stride, big_endian: header.encoding == Encoding::Big, ..f };
            let fields = fields.into_iter().map(place_field).collect();
            Ok(Box::new(ColumnarSnapshot { description, place, stored: vec![stored], fields, world: Affine::IDENTITY }))
        }
        _ => {
            let lists = element.properties.iter().filter(|p| p.list.is_some());
            description.notes.extend(lists.map(|p| format!("list `{}` is skipped", p.name.escape_debug())));
            let (element, encoding) = (element.clone(), header.encoding);
            Ok(Box::new(VariableLengthPly { description, place, bytes, element, encoding, start }))
        }
    }
}

fn vertices(place: &str, header: &PlyHeader) -> Result<usize> {
    let number = header.elements.iter().position(|e| e.name == "vertex").ok_or_else(|| {
        let names: Vec<&str> = header.elements.iter().map(|e| &e.name[..]).take(20).collect();
        Error::input(place, format!("there is no element `vertex`; the elements are: {}", names.join(", ")))
    })?;
    match header.elements[number].count {
        0 => Err(Error::input(place, "it holds no vertices")),
        _ => Ok(number),
    }
}

/// Scalar properties as fields, each at its byte of the vertex (where no list stands before it).
fn fields(element: &PlyElement) -> Vec<ColumnarField> {
    let mut offset = 0;
    let mut out = Vec::new();
    for property in &element.properties {
        if property.list.is_none() {
            let (name, kind) = (property.name.clone(), property.kind);
            let field =
                ColumnarField { name, kind_name: kind.name().into(), kind: Some(kind), ..ColumnarField::default() };
            out.push(ColumnarField { components: 1, offset, ..field });
        }
        offset += property.kind.bytes();
    }
    out
}

fn describe(path: &PathBuf, header: &PlyHeader, element: &PlyElement, fields: &[ColumnarField]) -> Result<Description> {
    let described: Vec<_> = fields.iter().map(ColumnarField::described).collect();
    let has = |name: &str| described.iter().any(|f| f.name == name);
    let positions = layout::positions_named(&described).ok_or_else(|| {
        let hint = match has("packed_position") {
            true => "a compressed splat file: unpack it first, e.g. `splat-transform a.compressed.ply a.ply`",
            false => "points need the properties x, y and z",
        };
        let names: Vec<&str> = described.iter().take(20).map(|f| &f.name[..]).collect();
        let message = format!("the vertices lack x, y and z; their properties are: {}", names.join(", "));
        Error::input_with(path, message.escape_debug().to_string(), hint)
    })?;
    let encoding = match header.encoding {
        Encoding::Ascii => "ascii",
        Encoding::Little => "binary, little-endian",
        Encoding::Big => "binary, big-endian",
    };
    let mut notes = Vec::new();
    if ["f_dc_0", "opacity", "scale_0", "rot_0"].into_iter().all(has) {
        notes.push(Description::SPLATS.to_string());
    }
    Ok(Description {
        species: vec![one_species(element.count, fields, positions, layout::mass_named)],
        notes,
        ..Description::new(format!("PLY, {encoding}"), std::slice::from_ref(path), named(path))
    })
}

/// The start of the vertices, the element of that number.
fn start(bytes: &Bytes, header: &PlyHeader, vertices: usize) -> TextResult<VertexStart> {
    let mut at = header.data;
    let mut lines = 0u64;
    for element in &header.elements[..vertices] {
        let beyond = || format!("the {} elements `{}` end beyond the file", element.count, element.name.escape_debug());
        // Such elements take neither bytes nor lines.
        if element.properties.is_empty() {
            continue;
        }
        let format = RowFormat::new(header.encoding, element);
        if header.encoding == Encoding::Ascii {
            lines = lines.checked_add(element.count).filter(|&l| l <= bytes.len() as u64).ok_or_else(beyond)?;
        } else if let Some(size) = element.bytes() {
            let end = element.count.checked_mul(size).and_then(|b| b.checked_add(at));
            at = end.filter(|&end| end <= bytes.len() as u64).ok_or_else(beyond)?;
        } else {
            for number in 0..element.count {
                let row = format.row(bytes, at);
                at = row.map_err(|e| format!("`{}` {number}: {e}", element.name.escape_debug()))?.end;
            }
        }
    }
    Ok(VertexStart { byte: at, lines })
}

/// A file whose vertices have different lengths.
struct VariableLengthPly {
    description: Description,
    place: String,
    bytes: Bytes,
    element: PlyElement,
    encoding: Encoding,
    start: VertexStart,
}

impl Snapshot for VariableLengthPly {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let species = self.description.species.get(species);
        let species = species.ok_or_else(|| Error::argument("the file has only one particle type"))?;
        let number = |name: &str| {
            let index = self.element.properties.iter().position(|p| p.list.is_none() && p.name == name);
            index.ok_or_else(|| species.missing(&self.place, name, [].into_iter()))
        };
        let columns = axes::columns(&self.place, species, choice)?;
        let columns: Vec<usize> = columns.iter().map(|c| number(&c.field)).collect::<Result<_>>()?;
        let weighted = columns.len() > 3;
        let format = RowFormat::new(self.encoding, &self.element);
        let rows = VariableLengthRows::new(self.bytes.clone(), &self.place, format, self.start, species.count, columns);
        let meta = self.description.meta.clone();
        Ok(Box::new(PieceReader::new(meta, vec![Box::new(rows)], weighted)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::open_bytes;

    fn header(format: &str, rest: &str) -> Vec<u8> {
        format!("ply\nformat {format} 1.0\ncomment by hand\n{rest}end_header\n").into_bytes()
    }

    const FACES: &str = "element face 2\nproperty list uchar int vertex_indices\nproperty uchar flags\n";

    fn rows(bytes: &[u8]) -> Result<Vec<[f64; 4]>> {
        let snapshot = open_bytes("a", bytes)?;
        crate::testing::rows(&*snapshot, 0, &Choice::default())
    }

    #[test]
    fn text_with_other_elements_first() {
        let properties = "element vertex 2\nproperty double z\nproperty list uchar float t\nproperty float x\nproperty \
                          float y\nproperty float mass\n";
        let mut bytes = header("ascii", &format!("{FACES}{properties}"));
        bytes.extend(b"3 0 1 1 7\n\n0 9\n3 2 8 9 1 2e0 0.5\r\n-6 0 4 5 0.25");
        assert_eq!(rows(&bytes).unwrap(), [[1.0, 2.0, 3.0, 0.5], [4.0, 5.0, -6.0, 0.25]]);
        for end in ["3 2 8 9 1 2 0.5 7\n", "3 2 8 9 1 2\n", "3 2 8 9 1 x 0.5\n", "3 9 8 9 1 2 0.5\n"] {
            let mut bytes = header("ascii", properties);
            bytes.extend(end.repeat(2).as_bytes());
            assert!(rows(&bytes).err().unwrap().to_string().contains("vertex 0"), "{end}");
        }
    }

    #[test]
    fn binary_with_lists_before_and_within() {
        for big in [false, true] {
            let f = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
            let format = if big { "binary_big_endian" } else { "binary_little_endian" };
            let faces = [2u8, 0, 0, 0, 1, 0, 0, 0, 2, 7, 0, 8];
            let mut plain = header(
                format,
                &format!(
                    "{FACES}element vertex 2\nproperty float y\nproperty uchar c\n\
                                                     property float x\nproperty float z\n"
                ),
            );
            let mut lists = header(
                format,
                &format!(
                    "{FACES}element vertex 2\nproperty float y\nproperty list uchar \
                                                     uchar l\nproperty float x\nproperty float z\n"
                ),
            );
            plain.extend(faces);
            lists.extend(faces);
            for (row, list) in [([2f32, 1., 3.], &[2u8, 9, 9][..]), ([5., 4., 6.], &[0])] {
                for (out, between) in [(&mut plain, &[1u8][..]), (&mut lists, list)] {
                    out.extend(f(row[0]));
                    out.extend(between);
                    out.extend(f(row[1]));
                    out.extend(f(row[2]));
                }
            }
            for bytes in [plain, lists] {
                assert_eq!(rows(&bytes).unwrap(), [[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]]);
                for cut in 0..bytes.len() {
                    assert!(rows(&bytes[..cut]).is_err(), "cut at {cut}");
                }
            }
        }
    }

    #[test]
    fn lies_are_refused() {
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        let error = |elements: &str, data: &[u8]| {
            let mut bytes = header("binary_little_endian", elements);
            bytes.extend(data);
            rows(&bytes).err().unwrap().to_string()
        };
        assert!(error(&format!("element vertex 1000000000000000\n{xyz}"), &[0; 24]).contains("but the file has only"));
        assert!(
            error(&format!("element vertex 18446744073709551615\n{xyz}"), &[0; 24]).contains("but the file has only")
        );
        assert!(error("element vertex 0\n", &[]).contains("no vertices"));
        assert!(error("element point 1\nproperty float x\n", &[0; 4]).contains("no element `vertex`"));
        assert!(error("element vertex 1\nproperty float x\n", &[0; 4]).contains("lack x, y and z"));
        let list = format!("element face 1\nproperty list uint int i\nelement vertex 1\n{xyz}");
        assert!(error(&list, &[0xff; 16]).contains("4294967295 items"));
        let list = format!("element face 1\nproperty list float int i\nelement vertex 1\n{xyz}");
        assert!(error(&list, &[0xff; 16]).contains("NaN items"));
    }
}
