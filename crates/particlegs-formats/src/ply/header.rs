//! A PLY header: elements, their properties, the encoding.

use crate::numbers::NumberType;

/// Longest header: real ones have some kilobytes; comments may be long.
const LONGEST: usize = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Property {
    pub name: String,
    pub kind: NumberType,
    /// Type of its length, where it is a list.
    pub list: Option<NumberType>,
}

/// A kind of things in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct PlyElement {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct PlyHeader {
    pub encoding: Encoding,
    pub elements: Vec<PlyElement>,
    pub data: u64,
}

impl PlyElement {
    /// Bytes of one in a binary file; `None` where lists make them differ.
    pub fn bytes(&self) -> Option<u64> {
        self.properties.iter().try_fold(0, |sum, p| p.list.is_none().then(|| sum + p.kind.bytes()))
    }
}

/// Whether a file that begins so has one.
pub fn is_ply(head: &[u8]) -> bool {
    head.starts_with(b"ply\n") || head.starts_with(b"ply\r\n")
}

pub fn parse(bytes: &[u8]) -> Result<PlyHeader, String> {
    if !is_ply(bytes) {
        return Err("not a PLY file".into());
    }
    let bytes = &bytes[..bytes.len().min(LONGEST)];
    let (mut encoding, mut elements) = (None, Vec::<PlyElement>::new());
    let mut at = 0;
    for number in 1.. {
        let Some(length) = bytes[at..].iter().position(|&b| b == b'\n') else { break };
        let line = String::from_utf8_lossy(&bytes[at..at + length]);
        at += length + 1;
        let words: Vec<&str> = line.split_ascii_whitespace().take(8).collect();
        let bad = |message: &str| {
            let shown: String = line.trim_end().chars().take(60).collect();
            format!("header line {number}, `{}`: {message}", shown.escape_debug())
        };
        match words[..] {
            [] | ["ply"] | ["comment" | "obj_info", ..] => {}
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(bad("unknown format")),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| bad("the number of elements is not a count"))?;
                elements.push(PlyElement { name: name.into(), count, properties: Vec::new() });
            }
            ["property", "list", _, kind, name] | ["property", kind, name] => {
                let named = |kind| kind_named(kind).ok_or_else(|| bad("unknown type"));
                let list = if words[1] == "list" && words.len() == 5 { Some(named(words[2])?) } else { None };
                let kind = named(kind)?;
                let element = elements.last_mut().ok_or_else(|| bad("it belongs to no element"))?;
                element.properties.push(Property { name: name.into(), kind, list });
            }
            ["end_header"] => {
                let encoding = encoding.ok_or("the header does not state the format")?;
                return Ok(PlyHeader { encoding, elements, data: at as u64 });
            }
            _ => return Err(bad("not a line of a PLY header")),
        }
    }
    Err("the header has no `end_header` line".into())
}

fn kind_named(name: &str) -> Option<NumberType> {
    Some(match name {
        "char" | "int8" => NumberType::I8,
        "uchar" | "uint8" => NumberType::U8,
        "short" | "int16" => NumberType::I16,
        "ushort" | "uint16" => NumberType::U16,
        "int" | "int32" => NumberType::I32,
        "uint" | "uint32" => NumberType::U32,
        "half" | "float16" => NumberType::F16,
        "float" | "float32" => NumberType::F32,
        "double" | "float64" => NumberType::F64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read() {
        let text = "ply\r\nformat binary_big_endian 1.0\r\ncomment a b c\r\nobj_info n 1\r\nelement face 2\r\n\
                    property list uchar int i\r\nelement vertex 7\r\nproperty double x\r\nproperty short y\r\nend_header\r\n";
        let header = parse(text.as_bytes()).unwrap();
        assert_eq!((header.encoding, header.data), (Encoding::Big, text.len() as u64));
        assert_eq!(header.elements.iter().map(PlyElement::bytes).collect::<Vec<_>>(), [None, Some(10)]);
    }

    #[test]
    fn broken_ones_name_the_line() {
        let error_of = |lines: &str| parse(format!("ply\n{lines}").as_bytes()).unwrap_err();
        assert!(error_of("format middle 1.0\n").contains("line 2"));
        assert!(error_of("property float x\n").contains("no element"));
        assert!(error_of("element vertex -3\n").contains("not a count"));
        assert!(error_of("end_header\n").contains("format"));
        assert!(error_of("format ascii 1.0\nelement vertex 3\n").contains("end_header"));
    }
}
