//! The XML of a VTK file: pieces and where their arrays are said to be.

use super::blocks::Compressor;
use crate::TextResult;
use crate::ascii::shown;
use crate::numbers::NumberType;
use particlegs_core::{Error, Result};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::ops::Range;
use std::path::Path;

/// Limits that no writer comes near: what lies beyond is damage or an attack.
const MOST_PIECES: usize = 65_536;
const MOST_ARRAYS: usize = 1 << 18;
const MOST_ARRAYS_OF_PIECE: usize = 1024;
const MOST_DEPTH: usize = 32;
const MOST_NAME: usize = 1024;

#[derive(Clone, Debug, PartialEq)]
pub enum ArrayLocation {
    /// As text in these bytes.
    Ascii(Range<u64>),
    /// As base64 in these bytes.
    Inline(Range<u64>),
    /// From this byte of the appended data on.
    Appended(u64),
}

#[derive(Clone, Debug, PartialEq)]
pub struct ArrayDeclaration {
    pub name: String,
    /// Type of its numbers; `None` for what are no numbers.
    pub kind: Option<NumberType>,
    pub components: u32,
    pub place: ArrayLocation,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct VtkPiece {
    pub points: u64,
    pub positions: Option<ArrayDeclaration>,
    pub arrays: Vec<ArrayDeclaration>,
    /// The file that holds it, in files that only list pieces.
    pub source: Option<String>,
}

/// A file that a collection or a set of blocks names.
#[derive(Clone, Debug, PartialEq)]
pub struct CollectionEntry {
    /// The file, relative to the list's folder.
    pub file: String,
    /// The time that it belongs to, as the list has it.
    pub time: Option<f64>,
}

#[derive(Clone, Debug, Default)]
pub struct VtkDocument {
    pub kind: String,
    pub big_endian: bool,
    /// Bytes of the integers before binary data.
    pub header: u64,
    pub compressor: Option<Compressor>,
    pub pieces: Vec<VtkPiece>,
    pub listed: Vec<CollectionEntry>,
    /// Arrays outside any piece, such as the time.
    pub fields: Vec<ArrayDeclaration>,
    /// First byte of appended data, and whether they are base64.
    pub appended: Option<(u64, bool)>,
}

#[derive(Default)]
struct XmlState {
    /// Elements that are open, by their first letters' meaning.
    open: Vec<XmlElement>,
    /// The array whose text is awaited.
    array: Option<(ArrayDeclaration, bool)>,
    arrays: usize,
    closed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum XmlElement {
    File,
    Piece,
    Points,
    PointData,
    FieldData,
    Array,
    Other,
}

/// Reads the XML of `bytes`, up to the appended data.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<VtkDocument> {
    let mut reader = Reader::from_reader(bytes);
    // The integers have four bytes where the file does not say.
    let mut document = VtkDocument { header: 4, ..VtkDocument::default() };
    let mut walk = XmlState::default();
    loop {
        let at = reader.buffer_position();
        let fault = |message: String| Error::input_with(path, format!("byte {at}: {message}"), HINT);
        let event = reader.read_event().map_err(|e| fault(format!("broken XML: {}", shown(&e.to_string()))))?;
        match event {
            Event::Start(tag) if tag.name().as_ref() == "AppendedData" => {
                let base64 = attribute(&tag, "encoding").map_err(fault)?.as_deref() == Some("base64");
                let start = reader.buffer_position() as usize;
                // What follows may be raw bytes, which are no XML: reading ends here.
                let blank = bytes[start..].iter().take_while(|b| b.is_ascii_whitespace()).count();
                if bytes.get(start + blank) != Some(&b'_') {
                    return Err(fault("the appended data do not begin with `_`".into()));
                }
                document.appended = Some(((start + blank + 1) as u64, base64));
                walk.closed = true;
                break;
            }
            Event::Start(tag) => {
                let element = walk.enter(&mut document, &tag, false).map_err(fault)?;
                walk.open.push(element);
                if walk.open.len() > MOST_DEPTH {
                    return Err(fault("the XML is nested too deeply".into()));
                }
            }
            Event::Empty(tag) => {
                walk.enter(&mut document, &tag, true).map_err(fault)?;
                walk.leave(&mut document).map_err(fault)?;
            }
            Event::End(_) => {
                let element = walk.open.pop();
                if matches!(element, Some(XmlElement::Array)) {
                    walk.leave(&mut document).map_err(fault)?;
                }
                walk.closed |= element == Some(XmlElement::File);
            }
            Event::Text(_) => walk.text(bytes, at..reader.buffer_position()),
            Event::DocType(_) | Event::GeneralRef(_) => {
                let message = format!("byte {at}: the XML defines or uses entities, which VTK files never do");
                return Err(Error::input_with(path, message, "save it again with VTK or ParaView"));
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if walk.closed {
        Ok(document)
    } else {
        Err(Error::input_with(path, format!("the file ends at byte {}, inside the XML", bytes.len()), HINT))
    }
}

const HINT: &str = "the file is cut short or damaged: copy it again from its source";

fn attribute(tag: &BytesStart<'_>, name: &str) -> TextResult<Option<String>> {
    let lookup = tag.try_get_attribute(name).map_err(|e| format!("broken XML: {}", shown(&e.to_string())))?;
    let Some(attribute) = lookup else { return Ok(None) };
    let text =
        quick_xml::escape::unescape(&attribute.value).map_err(|e| format!("broken XML: {}", shown(&e.to_string())))?;
    if text.len() > MOST_NAME {
        return Err(format!("attribute {name} is too long: {} bytes", text.len()));
    }
    Ok(Some(text.into_owned()))
}

fn number(tag: &BytesStart<'_>, name: &str) -> TextResult<Option<u64>> {
    let Some(text) = attribute(tag, name)? else { return Ok(None) };
    text.trim().parse().map(Some).map_err(|_| format!("{name} is `{}`, which is not a count", shown(&text)))
}

impl XmlState {
    /// Handles the start of an element and its attributes.
    fn enter(&mut self, document: &mut VtkDocument, tag: &BytesStart<'_>, empty: bool) -> TextResult<XmlElement> {
        let inside = self.open.last().copied();
        let name = tag.name();
        Ok(match (name.as_ref(), inside) {
            ("VTKFile", None) => {
                self.file(document, tag)?;
                XmlElement::File
            }
            (_, None) => return Err("the root element is not VTKFile".into()),
            ("Piece", _) => {
                if document.pieces.len() == MOST_PIECES {
                    return Err(format!("more than {MOST_PIECES} pieces"));
                }
                let points = number(tag, "NumberOfPoints")?.unwrap_or(0);
                document.pieces.push(VtkPiece { points, source: attribute(tag, "Source")?, ..VtkPiece::default() });
                if empty { XmlElement::Other } else { XmlElement::Piece }
            }
            ("DataSet", _) => {
                if document.listed.len() == MOST_PIECES {
                    return Err(format!("more than {MOST_PIECES} files"));
                }
                let time =
                    attribute(tag, "timestep")?.and_then(|t| t.trim().parse().ok()).filter(|t: &f64| t.is_finite());
                document.listed.extend(attribute(tag, "file")?.map(|file| CollectionEntry { file, time }));
                XmlElement::Other
            }
            ("Points", Some(XmlElement::Piece)) => XmlElement::Points,
            ("PointData", Some(XmlElement::Piece)) => XmlElement::PointData,
            ("FieldData", _) => XmlElement::FieldData,
            ("DataArray", Some(XmlElement::Points | XmlElement::PointData | XmlElement::FieldData)) => {
                self.arrays += 1;
                if self.arrays > MOST_ARRAYS {
                    return Err(format!("more than {MOST_ARRAYS} arrays"));
                }
                self.array = Some(declared(tag)?);
                XmlElement::Array
            }
            _ => XmlElement::Other,
        })
    }

    fn file(&mut self, document: &mut VtkDocument, tag: &BytesStart<'_>) -> TextResult<()> {
        document.kind = attribute(tag, "type")?.unwrap_or_default();
        document.big_endian = attribute(tag, "byte_order")?.as_deref() == Some("BigEndian");
        document.header = match attribute(tag, "header_type")?.as_deref() {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => return Err(format!("unknown header_type {}", shown(other))),
        };
        if let Some(name) = attribute(tag, "compressor")?.filter(|n| !n.is_empty()) {
            let unknown = || format!("unknown compressor {}", shown(&name));
            document.compressor = Some(Compressor::from_name(&name).ok_or_else(unknown)?);
        }
        Ok(())
    }

    /// Text within an element: an array's numbers, where it is directly in one.
    fn text(&mut self, bytes: &[u8], range: Range<u64>) {
        let Some((array, awaited)) = &mut self.array else { return };
        let blank = bytes[range.start as usize..range.end as usize].iter().all(u8::is_ascii_whitespace);
        if !*awaited || blank || self.open.last() != Some(&XmlElement::Array) {
            return;
        }
        match &mut array.place {
            ArrayLocation::Ascii(place) | ArrayLocation::Inline(place) => *place = range,
            ArrayLocation::Appended(_) => {}
        }
        *awaited = false;
    }

    fn leave(&mut self, document: &mut VtkDocument) -> TextResult<()> {
        let Some((array, _)) = self.array.take() else { return Ok(()) };
        // Of an empty element, nothing was opened: the last open one holds it.
        match self.open.last() {
            Some(XmlElement::FieldData) => document.fields.push(array),
            Some(inside) => {
                let piece = document.pieces.last_mut().ok_or("an array is outside any piece")?;
                if *inside == XmlElement::Points {
                    piece.positions = Some(array);
                } else if piece.arrays.len() < MOST_ARRAYS_OF_PIECE {
                    piece.arrays.push(array);
                } else {
                    return Err(format!("more than {MOST_ARRAYS_OF_PIECE} arrays in a piece"));
                }
            }
            None => {}
        }
        Ok(())
    }
}

fn declared(tag: &BytesStart<'_>) -> TextResult<(ArrayDeclaration, bool)> {
    let kind = attribute(tag, "type")?.and_then(|t| kind_of(&t));
    let name = attribute(tag, "Name")?.unwrap_or_default().replace(char::is_control, "?");
    let components = number(tag, "NumberOfComponents")?.unwrap_or(1).max(1);
    let components = u32::try_from(components).map_err(|_| format!("array {name} has {components} components"))?;
    let place = match attribute(tag, "format")?.as_deref() {
        None | Some("ascii") => ArrayLocation::Ascii(0..0),
        Some("binary") => ArrayLocation::Inline(0..0),
        Some("appended") => ArrayLocation::Appended(number(tag, "offset")?.ok_or("an appended array has no offset")?),
        Some(other) => return Err(format!("unknown format `{}`", shown(other))),
    };
    Ok((ArrayDeclaration { name, kind, components, place }, true))
}

fn kind_of(name: &str) -> Option<NumberType> {
    Some(match name {
        "Float32" => NumberType::F32,
        "Float64" => NumberType::F64,
        "Int8" => NumberType::I8,
        "Int16" => NumberType::I16,
        "Int32" => NumberType::I32,
        "Int64" => NumberType::I64,
        "UInt8" => NumberType::U8,
        "UInt16" => NumberType::U16,
        "UInt32" => NumberType::U32,
        "UInt64" => NumberType::U64,
        _ => return None,
    })
}
