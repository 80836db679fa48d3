//! SPZ: positions as fixed-point numbers of 24 bits (version 1: half floats), all splats' one after
//! the other, then the other attributes. Versions 1 to 3 are one gzip stream; version 4 has a plain
//! header and a Zstandard stream an attribute.

use crate::affine::Affine;
use crate::columns::{ColumnarField, ColumnarSnapshot, one_species};
use crate::format::FileHead;
use crate::numbers::{Bytes, NumberType};
use crate::single_file::{named, only};
use crate::stored_bytes::{StoredBytes, StreamCoding};
use crate::{Choice, Description, Snapshot, TextResult};
use particlegs_core::{Error, Result};
use std::io::Read;
use std::path::PathBuf;

const MAGIC: &[u8; 4] = b"NGSP";
/// Bytes of the header of versions 1 to 3.
const HEADER: u64 = 16;
/// Fraction bits that leave the 24 some sense.
const MOST_FRACTION: u8 = 24;

/// By the signature, within gzip or not.
pub fn detect(head: &FileHead) -> bool {
    head.content.starts_with(MAGIC)
}

struct SpzHeader {
    version: u32,
    count: u64,
    /// Degree of spherical harmonics.
    degree: u8,
    fraction: u8,
    flags: u8,
    /// Version 4: streams, and where they are listed.
    streams: u8,
    table: u32,
}

impl SpzHeader {
    fn parse(b: &[u8; HEADER as usize], table: u32) -> TextResult<SpzHeader> {
        let word = |at: usize| u32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
        if b[..4] != MAGIC[..] {
            return Err("not an SPZ file".into());
        }
        let (version, count, [degree, fraction, flags, streams]) =
            (word(4), word(8).into(), [b[12], b[13], b[14], b[15]]);
        let header = SpzHeader { version, count, degree, fraction, flags, streams, table };
        match header.version {
            1..=4 => {}
            version => return Err(format!("SPZ version {version} is not supported (1 to 4 are)")),
        }
        if header.count == 0 {
            return Err("it holds no splats".into());
        }
        if header.fraction > MOST_FRACTION || header.degree > 4 {
            return Err(format!("the header is damaged: {} fraction bits, degree {}", header.fraction, header.degree));
        }
        Ok(header)
    }

    fn position(&self) -> u64 {
        if self.version == 1 { 6 } else { 9 }
    }

    /// Bytes of everything of a splat, versions 1 to 3.
    fn splat(&self) -> u64 {
        let harmonics = (u64::from(self.degree) + 1).pow(2) - 1;
        let rotation = if self.version >= 3 { 4 } else { 3 };
        // Position, size, rotation, opacity, colour, harmonics.
        self.position() + 3 + rotation + 1 + 3 + 3 * harmonics
    }
}

pub fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let hint = "the file is damaged or cut short: copy it again";
    let refuse = |message: String| Error::input_with(path, message, hint);
    let (header, base, stored) = parts(Bytes::from_filled_file(path)?).map_err(refuse)?;
    let stride = header.position();
    let (kind, world) = match header.version {
        1 => (NumberType::F16, Affine::IDENTITY),
        _ => (NumberType::I24, Affine::scale(2f64.powi(-i32::from(header.fraction)))),
    };
    let fields = vec![ColumnarField::in_records("position", kind, 3, [base, stride, 0])];
    let mut notes = vec![Description::SPLATS.to_string()];
    if header.flags & !1 != 0 {
        notes.push(format!("the flags {:#x} mark extensions, which are skipped", header.flags));
    }
    let description = Description {
        species: vec![one_species(header.count, &fields, "position".into(), |_| None)],
        notes,
        ..Description::new(
            format!("SPZ version {}, spherical harmonics of degree {}", header.version, header.degree),
            std::slice::from_ref(path),
            named(path),
        )
    };
    let place = path.display().to_string();
    Ok(Box::new(ColumnarSnapshot { description, place, stored: vec![stored], fields, world }))
}

/// The header, and what holds the positions from which byte on.
fn parts(bytes: Bytes) -> TextResult<(SpzHeader, u64, StoredBytes)> {
    let length = bytes.len() as u64;
    let mut start = [0; HEADER as usize];
    let packed = bytes.starts_with(&[0x1f, 0x8b]);
    if packed {
        let read = flate2::bufread::MultiGzDecoder::new(&bytes[..]).read_exact(&mut start);
        read.map_err(|e| format!("the header cannot be read: {e}"))?;
    } else {
        start.copy_from_slice(bytes.get(..HEADER as usize).ok_or("the file is shorter than a header")?);
    }
    let table = bytes.get(16..20).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let header = SpzHeader::parse(&start, table)?;
    if header.version == 4 && !packed {
        let stored = stream(&bytes, &header)?;
        return Ok((header, 0, stored));
    }
    if header.version == 4 {
        return Err("version 4 inside gzip is not supported".into());
    }
    let size = HEADER + header.count * header.splat();
    let coding = if packed { StreamCoding::Gzip } else { StreamCoding::Plain };
    if !packed && size > length {
        return Err(format!("{} splats need {size} bytes, but the file has {length}", header.count));
    }
    let stored = StoredBytes::new(bytes, 0, length, if packed { size } else { length }, coding);
    let stored = stored.map_err(|message| format!("{} splats: {message}", header.count))?;
    Ok((header, HEADER, stored))
}

/// Version 4's stream of positions, the first of those listed.
fn stream(bytes: &Bytes, header: &SpzHeader) -> TextResult<StoredBytes> {
    let table = u64::from(header.table);
    let entry = |i: u64| {
        let at = usize::try_from(table + 16 * i).ok()?;
        let b = bytes.get(at..at + 16)?;
        let word = |k: usize| u64::from_le_bytes(std::array::from_fn(|j| b[k + j]));
        Some((word(0), word(8)))
    };
    let data = table + 16 * u64::from(header.streams);
    let mut end = Some(data);
    for i in 0..u64::from(header.streams) {
        let (packed, _) = entry(i).ok_or("the list of streams is cut short")?;
        end = end.and_then(|e| e.checked_add(packed));
    }
    if end.is_none_or(|end| end > bytes.len() as u64) {
        return Err("the streams end beyond the file".into());
    }
    let (packed, size) = entry(0).ok_or("the list of streams is empty")?;
    if size != header.count * header.position() {
        return Err(format!("{} splats, but positions of {size} bytes", header.count));
    }
    StoredBytes::new(bytes.clone(), data, packed, size, StreamCoding::Zstd)
}
