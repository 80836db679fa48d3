//! The file: a head with its own length, then sections with checksums (docs/format.md, section 1).

use super::wire::Reader;
use crate::{Error, Result};

/// First bytes of a model file; like PNG's, they show transfers that change bytes.
pub(crate) const MAGIC: [u8; 8] = *b"\x89PGS\r\n\x1a\n";
/// Version that is written. A reader takes any minor version of its major one.
pub(crate) const MAJOR: u8 = 1;
/// See [`MAJOR`].
pub(crate) const MINOR: u8 = 6;
/// Magic, major, minor, reserved, length, checksum.
pub const HEAD_BYTES: usize = 8 + 1 + 1 + 2 + 8 + 4;
/// Tag, length, checksum.
pub(crate) const SECTION_BYTES: usize = 4 + 8 + 4;

/// Metadata.
pub(crate) const META: [u8; 4] = *b"META";
/// Certificate.
pub(crate) const CERTIFICATE: [u8; 4] = *b"CERT";
/// Statistics: a further part of the certificate, since version 1.2.
pub(crate) const SCIENCE: [u8; 4] = *b"stat";
/// The first minor version whose readers know [`SCIENCE`].
pub(crate) const SCIENCE_SINCE: u8 = 2;
/// Baselines: what trivial pictures and densities score beside the certificate's, since version 1.4.
pub(crate) const BASELINES: [u8; 4] = *b"base";
/// The first minor version whose readers know [`BASELINES`].
pub(crate) const BASELINES_SINCE: u8 = 4;
/// Further figures of the certificate, since version 1.5.
pub(crate) const MEASURES: [u8; 4] = *b"meas";
/// The first minor version whose readers know [`MEASURES`].
pub(crate) const MEASURES_SINCE: u8 = 5;
/// The network of the alpha-blend law.
pub(crate) const VIZMAPPER: [u8; 4] = *b"VIZM";
/// The first minor version whose readers know the alpha-blend law and [`VIZMAPPER`].
pub(crate) const ALPHA_BLEND_SINCE: u8 = 3;
/// The first minor version whose readers know the second coding of blocks.
pub(crate) const SECOND_CODING_SINCE: u8 = 6;
/// The first minor version that has P(k) by mass among the measures.
pub(crate) const MASS_POWER_SINCE: u8 = 6;
/// A layer: name and number of blocks, which follow.
pub(crate) const LAYER: [u8; 4] = *b"LAYR";
/// A block.
pub(crate) const BLOCK: [u8; 4] = *b"BLOK";

/// A section as it lies in the file.
#[derive(Clone, Copy)]
pub(crate) struct Section<'a> {
    pub tag: [u8; 4],
    /// Place of its head in the file.
    pub offset: usize,
    pub bytes: &'a [u8],
}

/// Puts sections together.
pub(crate) fn write<'a>(minor: u8, sections: impl Iterator<Item = ([u8; 4], &'a [u8])> + Clone) -> Vec<u8> {
    let length = HEAD_BYTES + sections.clone().map(|s| SECTION_BYTES + s.1.len()).sum::<usize>();
    let mut out = Vec::with_capacity(length);
    out.extend(MAGIC);
    out.extend([MAJOR, minor, 0, 0]);
    out.extend((length as u64).to_le_bytes());
    out.extend(crc32fast::hash(&out).to_le_bytes());
    for (tag, bytes) in sections {
        let start = out.len();
        out.extend(tag);
        out.extend((bytes.len() as u64).to_le_bytes());
        out.extend(checksum(&out[start..], bytes).to_le_bytes());
        out.extend(bytes);
    }
    out
}

/// Over tag, length and content.
fn checksum(head: &[u8], bytes: &[u8]) -> u32 {
    let mut h = crc32fast::Hasher::new();
    h.update(head);
    h.update(bytes);
    h.finalize()
}

/// Does a file that begins so claim to be a model file?
pub fn is_model(head: &[u8]) -> bool {
    head.starts_with(&MAGIC)
}

/// The length of the file that begins with `head`, as its head says: what a reader asks memory for.
///
/// # Errors
/// [`Error::Corrupt`] for what is no model file or ends within its head; [`Error::Compatibility`].
pub fn promised_length(head: &[u8], place: &str) -> Result<u64> {
    promise(head, place).map(|p| p.1)
}

/// Takes a file apart and checks every checksum. Sections that a newer minor version added and
/// that may be skipped are left out.
///
/// # Errors
/// [`Error::Corrupt`] and [`Error::Compatibility`].
pub(crate) fn read<'a>(file: &'a [u8], place: &str) -> Result<Vec<Section<'a>>> {
    let minor = head(file, place)?;
    let mut out = Vec::new();
    let mut at = HEAD_BYTES;
    while at < file.len() {
        let section = section(file, at).map_err(|what| Error::corrupt(place, format!("at byte {at}: {what}")))?;
        at += SECTION_BYTES + section.bytes.len();
        match section.tag {
            META | CERTIFICATE | LAYER | BLOCK => out.push(section),
            VIZMAPPER if minor >= ALPHA_BLEND_SINCE => out.push(section),
            SCIENCE if minor >= SCIENCE_SINCE => out.push(section),
            BASELINES if minor >= BASELINES_SINCE => out.push(section),
            MEASURES if minor >= MEASURES_SINCE => out.push(section),
            [b'a'..=b'z', ..] => {}
            tag => {
                let what = format!("section `{}` is not known and may not be skipped", tag.escape_ascii());
                return Err(Error::Compatibility { place: place.into(), what });
            }
        }
    }
    Ok(out)
}

/// Checks the head and gives the minor version.
fn head(file: &[u8], place: &str) -> Result<u8> {
    let (minor, length) = promise(file, place)?;
    match file.len() as u64 == length {
        true => Ok(minor),
        false => Err(Error::corrupt(place, other_length(file.len() as u64, length))),
    }
}

/// What is wrong with a file of `length` bytes of which `there` are there.
pub fn other_length(there: u64, length: u64) -> String {
    match there.checked_sub(length) {
        None => format!("it ends after {there} of {length} bytes"),
        Some(more) => format!("{more} bytes follow its end at byte {length}"),
    }
}

/// What the head says: minor version and length of the file.
fn promise(file: &[u8], place: &str) -> Result<(u8, u64)> {
    let corrupt = |what: String| Err(Error::corrupt(place, what));
    if !file.starts_with(&MAGIC) {
        let what = if file.is_empty() { "it is empty" } else { "it does not begin as a model file does" };
        return corrupt(what.into());
    }
    let Some(head) = file.get(..HEAD_BYTES) else {
        return corrupt(format!("it ends after {} bytes, within its head", file.len()));
    };
    let field = |r: &mut Reader<'_>| -> std::result::Result<_, String> {
        r.take(8)?;
        Ok((r.u8()?, r.u8()?, r.u16()?, r.u64()?, r.u32()?))
    };
    let (major, minor, reserved, length, sum) =
        field(&mut Reader::new(head)).map_err(|what| Error::corrupt(place, what))?;
    if crc32fast::hash(&head[..HEAD_BYTES - 4]) != sum {
        return corrupt("the checksum of its head is wrong".into());
    }
    if major != MAJOR {
        let what = format!("a model file of version {major}.{minor}; this program reads version {MAJOR}");
        return Err(Error::Compatibility { place: place.into(), what });
    }
    if reserved != 0 && minor <= MINOR {
        return corrupt(format!("reserved bytes of the head are {reserved:#06x}"));
    }
    Ok((minor, length))
}

fn section(file: &[u8], offset: usize) -> std::result::Result<Section<'_>, String> {
    let mut r = Reader::new(&file[offset..]);
    let head = r.take(12)?;
    let mut fields = Reader::new(head);
    let tag = fields.take(4)?;
    let tag = [tag[0], tag[1], tag[2], tag[3]];
    let length = fields.u64()?;
    let sum = r.u32()?;
    let length = usize::try_from(length).map_err(|_| format!("a section of {length} bytes"))?;
    let bytes = r.take(length)?;
    if checksum(head, bytes) != sum {
        return Err(format!("the checksum of section `{}` is wrong", tag.escape_ascii()));
    }
    Ok(Section { tag, offset, bytes })
}
