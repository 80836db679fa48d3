//! The file: a head with its own length, then sections with checksums (docs/format.md, section 1).

use super::wire::WireReader;
use crate::{Error, Result};

/// First bytes of a model file; like PNG's, they show transfers that change bytes.
pub(crate) const MAGIC: [u8; 8] = *b"\x89PGS\r\n\x1a\n";
/// Version that is written. A reader takes any minor version of its major one.
pub(crate) const MAJOR: u8 = 1;
pub(crate) const MINOR: u8 = 0;
/// Kinds of files: one model, or a series of them; within a series also the changes from one to the next. Files of
/// before the first release say 0.
pub(crate) const MODEL: u8 = 1;
pub(crate) const SERIES: u8 = 2;
pub(crate) const CHANGE: u8 = 3;
/// Magic, major, minor, kind, reserved, length, checksum.
pub const HEAD_BYTES: usize = 8 + 1 + 1 + 1 + 1 + 8 + 4;
/// Tag, length, checksum.
pub(crate) const SECTION_BYTES: usize = 4 + 8 + 4;
/// The number of the block that a section belongs to.
pub(crate) const OWNER_BYTES: usize = 4;
/// Bytes before a further stage of a block.
pub(crate) const STAGE_BYTES: usize = SECTION_BYTES + OWNER_BYTES;
/// An entry of the index: tag, block, place, length.
pub(crate) const ENTRY_BYTES: usize = 4 + 4 + 8 + 8;
/// Block of an entry that belongs to none.
const NO_BLOCK: u32 = u32::MAX;

/// A section's tag. A lower-case first letter: readers that do not know it skip it. A lower-case second letter: it
/// belongs to a block, whose number its content begins with. A lower-case last letter: a merge keeps it, though it
/// belongs to no block.
pub(crate) type Tag = [u8; 4];

pub(crate) const META: Tag = *b"META";
pub(crate) const CERTIFICATE: Tag = *b"CERT";
/// The network of the alpha-blend law.
pub(crate) const VIZMAPPER: Tag = *b"VIZM";
/// A layer: name and number of blocks, which follow.
pub(crate) const LAYER: Tag = *b"LAYR";
/// A block, up to the end of its first stage.
pub(crate) const BLOCK: Tag = *b"BLOK";
/// A further stage of a block.
pub(crate) const STAGE: Tag = *b"FiNE";
/// The moments of a field of a block.
pub const FIELD: [u8; 4] = *b"fiEL";
/// Changes of a field of a block from the frame before.
pub const FIELD_CHANGE: [u8; 4] = *b"fiMO";
/// The shares of a species in a block's Gaussians.
pub const SHARE: [u8; 4] = *b"shAR";
/// Correlations between two scalar fields of a block.
pub const CORRELATION: [u8; 4] = *b"fiCO";
/// A block of a frame, as changes from the frame before.
pub(crate) const BLOCK_CHANGE: Tag = *b"MoVE";
/// Of a series: where its frames lie, how it was made, a frame.
pub(crate) const FRAME_INDEX: Tag = *b"FRMS";
pub(crate) const SERIES_RECIPE: Tag = *b"rECI";
pub(crate) const FRAME: Tag = *b"FRAM";
/// The index of the sections.
pub(crate) const INDEX: Tag = *b"iNDX";

/// Whether a reader that does not know the tag may skip its section.
pub(crate) fn is_optional(tag: Tag) -> bool {
    tag[0].is_ascii_lowercase()
}

/// Whether a section of the tag belongs to a block.
pub(crate) fn belongs_to_block(tag: Tag) -> bool {
    tag[1].is_ascii_lowercase()
}

/// Whether a merge keeps sections of the tag that belong to no block.
pub(crate) fn survives_merging(tag: Tag) -> bool {
    tag[3].is_ascii_lowercase()
}

#[derive(Clone, Copy)]
pub(crate) struct Section<'a> {
    pub tag: Tag,
    /// Place of its head in the file that it was read from.
    pub offset: usize,
    /// The block that it belongs to.
    pub block: Option<u32>,
    /// Content, without the block's number.
    pub bytes: &'a [u8],
}

impl<'a> Section<'a> {
    pub(crate) fn new(tag: Tag, block: Option<u32>, bytes: &'a [u8]) -> Self {
        Section { tag, offset: 0, block, bytes }
    }

    fn content(&self) -> usize {
        self.bytes.len() + if self.block.is_some() { OWNER_BYTES } else { 0 }
    }

    /// Its entry in an index, at a place.
    fn entry(&self, offset: usize) -> [u8; ENTRY_BYTES] {
        let mut out = [0; ENTRY_BYTES];
        out[..4].copy_from_slice(&self.tag);
        out[4..8].copy_from_slice(&self.block.unwrap_or(NO_BLOCK).to_le_bytes());
        out[8..16].copy_from_slice(&(offset as u64).to_le_bytes());
        out[16..].copy_from_slice(&(self.content() as u64).to_le_bytes());
        out
    }
}

/// Puts the sections of a model together; with an index behind the first where it is asked for.
pub(crate) fn write(kind: u8, sections: &[Section<'_>], index: bool) -> Vec<u8> {
    let mut entries = Vec::new();
    if index {
        let mut at = HEAD_BYTES;
        for (number, section) in sections.iter().enumerate() {
            // The index will stand behind the first section and moves all others.
            if number == 1 {
                at += SECTION_BYTES + ENTRY_BYTES * sections.len();
            }
            entries.extend(section.entry(at));
            at += SECTION_BYTES + section.content();
        }
    }
    let index = index.then(|| Section::new(INDEX, None, &entries));
    let (first, rest) = sections.split_at(sections.len().min(1));
    let sections = || first.iter().chain(&index).chain(rest);
    let length = HEAD_BYTES + sections().map(|s| SECTION_BYTES + s.content()).sum::<usize>();
    let mut out = Vec::with_capacity(length);
    out.extend(MAGIC);
    out.extend([MAJOR, MINOR, kind, 0]);
    out.extend((length as u64).to_le_bytes());
    out.extend(crc32fast::hash(&out).to_le_bytes());
    for section in sections() {
        let start = out.len();
        out.extend(section.tag);
        out.extend((section.content() as u64).to_le_bytes());
        let number = section.block.map(u32::to_le_bytes);
        let number = number.as_ref().map_or(&[][..], |n| n);
        out.extend(checksum([&out[start..], number, section.bytes]).to_le_bytes());
        out.extend(number);
        out.extend(section.bytes);
    }
    out
}

/// Over tag, length and content.
fn checksum(parts: [&[u8]; 3]) -> u32 {
    let mut h = crc32fast::Hasher::new();
    parts.iter().for_each(|part| h.update(part));
    h.finalize()
}

/// Whether a file that begins so claims to be a model file.
pub fn is_model(head: &[u8]) -> bool {
    head.starts_with(&MAGIC)
}

/// The length of the file that begins with `head`, as its head says: what a reader asks memory for. `None`: the file
/// ends with its last whole section.
pub fn promised_length(head: &[u8], place: &str) -> Result<Option<u64>> {
    promise(head, place).map(|length| Some(length).filter(|length| *length > 0))
}

pub(crate) struct FileSections<'a> {
    /// In their order; those of unknown tags that may be skipped are among them, the index is not.
    pub sections: Vec<Section<'a>>,
    /// Whether sections may be missing at the end.
    pub open: bool,
}

/// Takes a file apart and checks every checksum.
pub(crate) fn read<'a>(kind: u8, file: &'a [u8], place: &str) -> Result<FileSections<'a>> {
    let length = promise(file, place)?;
    is_of_kind(kind, file, place)?;
    let open = length == 0;
    if !open && file.len() as u64 != length {
        return Err(Error::corrupt(place, other_length(file.len() as u64, length)));
    }
    let mut sections = Vec::new();
    let mut index = None;
    let mut at = HEAD_BYTES;
    while at < file.len() {
        // An open file may end within a section, which is then ignored.
        if open && section_end(file, at).is_none_or(|end| end > file.len() as u64) {
            break;
        }
        let section = section(file, at).map_err(|message| Error::corrupt(place, format!("at byte {at}: {message}")))?;
        at += SECTION_BYTES + section.content();
        if sections.is_empty() && section.tag != META && kind != SERIES {
            return Err(Error::corrupt(place, "the file does not begin with metadata"));
        }
        match section.tag {
            INDEX if index.is_some() => return Err(Error::corrupt(place, "the file has two indexes")),
            INDEX => index = Some(section),
            META | CERTIFICATE => sections.push(section),
            VIZMAPPER | LAYER | BLOCK | STAGE if kind == MODEL => sections.push(section),
            BLOCK_CHANGE if kind == CHANGE => sections.push(section),
            FRAME_INDEX | FRAME if kind == SERIES => sections.push(section),
            tag if is_optional(tag) => sections.push(section),
            tag => {
                let message = format!("section `{}` is unknown and required", tag.escape_ascii());
                return Err(Error::Compatibility { place: place.into(), what: message });
            }
        }
    }
    match index {
        Some(index) if !is_index_of(index.bytes, &sections, open) => {
            Err(Error::corrupt(place, "the index does not match the sections"))
        }
        _ => Ok(FileSections { sections, open }),
    }
}

/// Whether an index lists these sections. Of an open file the last ones may be missing on either side.
fn is_index_of(index: &[u8], sections: &[Section<'_>], open: bool) -> bool {
    let listed = index.chunks(ENTRY_BYTES);
    let alike = sections.iter().zip(listed.clone()).all(|(section, listed)| section.entry(section.offset) == *listed);
    alike && (open || listed.len() == sections.len())
}

/// End of a section by its head, if that is there.
pub(crate) fn section_end(file: &[u8], offset: usize) -> Option<u64> {
    let length = WireReader::new(file.get(offset + 4..)?).u64().ok()?;
    (offset as u64 + SECTION_BYTES as u64).checked_add(length)
}

/// The fault of a file of `length` bytes of which `available` are there, in words.
pub fn other_length(available: u64, length: u64) -> String {
    match available.checked_sub(length) {
        None => format!("the file ends after {available} of {length} bytes"),
        Some(more) => format!("{more} bytes follow the end at byte {length}"),
    }
}

/// The length of the file that its head says, 0 where it says none.
fn promise(file: &[u8], place: &str) -> Result<u64> {
    let corrupt = |message: String| Err(Error::corrupt(place, message));
    if !file.starts_with(&MAGIC) {
        let message =
            if file.is_empty() { "the file is empty" } else { "the first bytes are not those of a model file" };
        return corrupt(message.into());
    }
    let Some(head) = file.get(..HEAD_BYTES) else {
        return corrupt(format!("the file ends after {} bytes, inside the header", file.len()));
    };
    let field = |r: &mut WireReader<'_>| -> std::result::Result<_, String> {
        r.take(8)?;
        Ok((r.u8()?, r.u8()?, r.u8()?, r.u8()?, r.u64()?, r.u32()?))
    };
    let (major, minor, kind, reserved, length, sum) =
        field(&mut WireReader::new(head)).map_err(|message| Error::corrupt(place, message))?;
    // Before the version, so that a damaged head is not taken for that of a newer program.
    if crc32fast::hash(&head[..HEAD_BYTES - 4]) != sum {
        return corrupt("the checksum of the header is wrong".into());
    }
    let incompatible = |message: String| Err(Error::Compatibility { place: place.into(), what: message });
    if major != MAJOR {
        return incompatible(format!("the file has version {major}.{minor}; this program reads version {MAJOR}"));
    }
    match kind {
        MODEL | SERIES | CHANGE if reserved == 0 || minor > MINOR => Ok(length),
        MODEL | SERIES | CHANGE => corrupt(format!("the reserved byte of the header is {reserved}")),
        0 => incompatible("the file was made before the first release: compress again".into()),
        _ => incompatible(format!("the file is of the unknown kind {kind}")),
    }
}

/// Whether a file begins as a series of models does.
pub fn is_series(head: &[u8]) -> bool {
    is_model(head) && head.get(KIND_AT) == Some(&SERIES)
}

/// Place of the kind in the head.
const KIND_AT: usize = 10;

/// Refuses a file of another kind; its head is known to be whole.
fn is_of_kind(kind: u8, file: &[u8], place: &str) -> Result<()> {
    match file.get(KIND_AT) {
        Some(&file_kind) if file_kind == kind => Ok(()),
        Some(&SERIES) => Err(Error::input(place, "the file is a series of models: choose a frame")),
        _ => Err(Error::corrupt(place, "the file is of another kind than its place says")),
    }
}

pub(crate) fn section(file: &[u8], offset: usize) -> std::result::Result<Section<'_>, String> {
    let mut r = WireReader::new(&file[offset..]);
    let head = r.take(12)?;
    let mut fields = WireReader::new(head);
    let tag = fields.take(4)?;
    let tag = [tag[0], tag[1], tag[2], tag[3]];
    if !tag.iter().all(u8::is_ascii_alphabetic) {
        return Err(format!("the tag `{}` of a section has characters other than letters", tag.escape_ascii()));
    }
    let length = fields.u64()?;
    let sum = r.u32()?;
    let length = usize::try_from(length).map_err(|_| format!("a section is too long: {length} bytes"))?;
    let bytes = r.take(length)?;
    if checksum([head, bytes, &[]]) != sum {
        return Err(format!("the checksum of section `{}` is wrong", tag.escape_ascii()));
    }
    if !belongs_to_block(tag) {
        return Ok(Section { tag, offset, block: None, bytes });
    }
    let mut content = WireReader::new(bytes);
    let block = Some(content.u32()?);
    Ok(Section { tag, offset, block, bytes: &bytes[OWNER_BYTES..] })
}
