//! An array's header: types, order, shape, the first byte of the numbers.

use super::literal::{Literal, parse};
use crate::numbers::NumberType;
use std::io::Read;

pub const MAGIC: &[u8; 6] = b"\x93NUMPY";
/// Longest header that is read; records of a thousand fields have some ten thousand bytes.
const LONGEST: u32 = 1 << 20;
/// Fields that a record may have.
const MOST_FIELDS: usize = 4096;

#[derive(Clone, Debug, PartialEq)]
pub struct NpyHeader {
    pub element: NpyElement,
    /// Whether the first index runs fastest.
    pub fortran: bool,
    pub shape: Vec<u64>,
    pub data: u64,
}

#[derive(Clone, Debug, PartialEq)]
pub enum NpyElement {
    /// One number, or something else of known size.
    Plain(NpyScalar),
    Record {
        /// Its fields, padding left out.
        fields: Vec<RecordField>,
        bytes: u64,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct RecordField {
    pub name: String,
    pub scalar: NpyScalar,
    pub count: u64,
    /// Byte of the record where they begin.
    pub offset: u64,
}

/// A number, or something else of known size.
#[derive(Clone, Debug, PartialEq)]
pub struct NpyScalar {
    /// `None` where it is not a number that can be read.
    pub kind: Option<NumberType>,
    /// Type as text.
    pub name: String,
    pub big_endian: bool,
    pub bytes: u64,
}

impl NpyElement {
    pub fn bytes(&self) -> u64 {
        match self {
            NpyElement::Plain(scalar) => scalar.bytes,
            NpyElement::Record { bytes, .. } => *bytes,
        }
    }
}

impl NpyHeader {
    pub fn read(mut stream: impl Read) -> Result<NpyHeader, String> {
        let broken = || "the NumPy header is damaged".to_string();
        let mut bytes = |n: u32| {
            let mut out = vec![0; n as usize];
            stream.read_exact(&mut out).map(|()| out).map_err(|e| format!("{}: {e}", broken()))
        };
        let start = bytes(8)?;
        if start[..6] != MAGIC[..] {
            return Err("not a NumPy array".into());
        }
        let (prefix, length) = match start[6] {
            1 => (10, bytes(2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]])))?),
            2 | 3 => (12, bytes(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))?),
            version => return Err(format!("NumPy format version {version} is not supported")),
        };
        if length > LONGEST {
            return Err(format!("the header has {length} bytes, which is too long"));
        }
        let raw = bytes(length)?;
        // Version 3 is UTF-8, the others Latin-1.
        let text = match start[6] {
            3 => String::from_utf8(raw).map_err(|_| broken())?,
            _ => raw.iter().map(|&b| b as char).collect(),
        };
        let Some(Literal::Map(entries)) = parse(&text) else { return Err(broken()) };
        let entry = |key: &str| entries.iter().find(|e| e.0 == Literal::Text(key.into())).map(|e| &e.1);
        let (Some(descr), Some(Literal::Flag(fortran)), Some(Literal::List(sides))) =
            (entry("descr"), entry("fortran_order"), entry("shape"))
        else {
            return Err(broken());
        };
        let shape = sides.iter().map(whole).collect::<Option<Vec<u64>>>().ok_or_else(broken)?;
        let header = NpyHeader { element: element(descr)?, fortran: *fortran, shape, data: prefix + u64::from(length) };
        header.end().ok_or_else(|| format!("the shape {} is larger than any file", header.shape_text()))?;
        Ok(header)
    }

    pub fn end(&self) -> Option<u64> {
        let elements = self.shape.iter().try_fold(1u64, |n, &side| n.checked_mul(side));
        elements?.checked_mul(self.element.bytes())?.checked_add(self.data).filter(|&end| end < 1 << 60)
    }

    pub fn shape_text(&self) -> String {
        let sides: Vec<String> = self.shape.iter().map(u64::to_string).collect();
        format!("({}{})", sides.join(", "), if sides.len() == 1 { "," } else { "" })
    }

    pub fn kind_text(&self) -> &str {
        match &self.element {
            NpyElement::Plain(scalar) => &scalar.name,
            NpyElement::Record { .. } => "records",
        }
    }
}

fn whole(literal: &Literal) -> Option<u64> {
    match literal {
        Literal::Number(n) => Some(*n),
        _ => None,
    }
}

fn element(descr: &Literal) -> Result<NpyElement, String> {
    match descr {
        Literal::Text(text) => Ok(NpyElement::Plain(scalar(text)?)),
        Literal::List(fields) if fields.len() <= MOST_FIELDS => record(fields),
        _ => Err("unknown type".into()),
    }
}

fn record(descr: &[Literal]) -> Result<NpyElement, String> {
    let mut fields = Vec::new();
    let mut offset = 0u64;
    for field in descr {
        let Literal::List(parts) = field else { return Err("the fields of the record type cannot be read".into()) };
        let (name, descr, sides) = match &parts[..] {
            [name, descr] => (name, descr, &[][..]),
            [name, descr, Literal::List(sides)] => (name, descr, &sides[..]),
            _ => return Err("the fields of the record type cannot be read".into()),
        };
        // A title may stand beside a name.
        let name = match name {
            Literal::Text(name) => name,
            Literal::List(names) => match &names[..] {
                [_, Literal::Text(name)] => name,
                _ => return Err("a field has no name".into()),
            },
            _ => return Err("a field has no name".into()),
        };
        let too_large = || format!("field `{name}` is too large");
        let count = sides.iter().try_fold(1u64, |n, side| n.checked_mul(whole(side)?)).ok_or_else(too_large)?;
        let scalar = match element(descr)? {
            NpyElement::Plain(scalar) => scalar,
            // Records within records are passed over.
            NpyElement::Record { bytes, .. } => {
                NpyScalar { kind: None, name: "record".into(), big_endian: false, bytes }
            }
        };
        let bytes = count.checked_mul(scalar.bytes).filter(|&b| b <= u32::MAX.into()).ok_or_else(too_large)?;
        let (at, padding) = (offset, name.is_empty());
        offset = offset.checked_add(bytes).ok_or_else(too_large)?;
        if !padding {
            fields.push(RecordField { name: name.clone(), scalar, count, offset: at });
        }
    }
    Ok(NpyElement::Record { fields, bytes: offset })
}

/// A type as `<f4`: byte order, letter, bytes.
pub fn scalar(text: &str) -> Result<NpyScalar, String> {
    let unknown = || format!("unknown type `{}`", text.escape_default());
    let mut chars = text.chars();
    let big_endian = match chars.next().ok_or_else(unknown)? {
        '<' | '|' => false,
        '>' => true,
        '=' => cfg!(target_endian = "big"),
        _ => return Err(unknown()),
    };
    let letter = chars.next().ok_or_else(unknown)?;
    if letter == 'O' {
        return Err("it holds Python objects (a pickle), which may run code when loaded".into());
    }
    let digits: String = chars.take_while(char::is_ascii_digit).collect();
    let number: u64 = digits.parse().map_err(|_| unknown())?;
    let kind = match (letter, number) {
        ('f', 2) => Some(NumberType::F16),
        ('f', bytes) => NumberType::float(bytes),
        ('i' | 'u', bytes) => NumberType::integer(bytes, letter == 'i'),
        ('b', 1) => Some(NumberType::U8),
        _ => None,
    };
    let (name, bytes) = match letter {
        'f' | 'i' | 'u' => (format!("{letter}{}", number.saturating_mul(8)), number),
        'b' => ("bool".into(), number),
        'c' => (format!("complex{}", number.saturating_mul(8)), number),
        'S' | 'a' => ("text".into(), number),
        'U' => ("text".into(), number.saturating_mul(4)),
        'm' | 'M' => ("date".into(), number),
        'V' => ("bytes".into(), number),
        _ => return Err(unknown()),
    };
    Ok(NpyScalar { kind, name, big_endian, bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(dictionary: &str, version: u8) -> Result<NpyHeader, String> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([version, 0]);
        match version {
            1 => bytes.extend((dictionary.len() as u16).to_le_bytes()),
            _ => bytes.extend((dictionary.len() as u32).to_le_bytes()),
        }
        bytes.extend(dictionary.as_bytes());
        NpyHeader::read(&bytes[..])
    }

    #[test]
    fn records_are_laid_out() {
        let text = "{'descr': [('id', '>u2'), ('', '|V2'), (('title', 'pos'), '<f8', (3,)), ('in', [('a', '<i4')])], \
                    'fortran_order': True, 'shape': (7,)}";
        for version in [1, 2, 3] {
            let header = header(text, version).unwrap();
            assert_eq!(header.element.bytes(), 32);
            let NpyElement::Record { fields, .. } = &header.element else { panic!() };
            let seen: Vec<_> = fields.iter().map(|f| (&f.name[..], &f.scalar.name[..], f.count, f.offset)).collect();
            assert_eq!(seen, [("id", "u16", 1, 0), ("pos", "f64", 3, 4), ("in", "record", 1, 28)]);
            assert!(header.fortran && fields[0].scalar.big_endian);
            assert_eq!(header.shape_text(), "(7,)");
        }
    }

    #[test]
    fn lies_are_refused() {
        let header_of = |descr: &str, shape: &str| {
            header(&format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"), 1)
        };
        assert!(header_of("'<f4'", "(2, 3)").is_ok());
        assert!(header_of("'|O'", "(2, 3)").unwrap_err().contains("pickle"));
        assert!(header_of("'<f4'", "(18446744073709551615, 3)").unwrap_err().contains("larger"));
        assert!(header_of("[('a', '<f4', (99999999999, 99999999999))]", "(2,)").is_err());
        for descr in ["'f4'", "'<'", "'<f'", "7", "[('a',)]", "'<x4'"] {
            assert!(header_of(descr, "(2, 3)").is_err(), "{descr}");
        }
        assert!(NpyHeader::read(&b"\x93NUMPY\x02\x00\xff\xff\xff\xff"[..]).unwrap_err().contains("too long"));
    }
}
