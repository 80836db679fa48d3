//! A ZIP archive's table of contents, large archives (ZIP64) included. Nothing is unpacked.

use crate::stored::{StoredBytes, StreamCoding};
use crate::strided::Bytes;

/// How a ZIP archive begins, unless it is empty.
pub const MAGIC: &[u8; 4] = b"PK\x03\x04";
/// How an empty one begins.
pub const MAGIC_EMPTY: &[u8; 4] = b"PK\x05\x06";
/// Members that are looked at.
const MOST_MEMBERS: u64 = 1 << 14;

/// A member: its name and what it holds.
pub struct ZipMember {
    /// As the archive has it.
    pub name: String,
    /// What it holds; `Err` says why it cannot be read.
    pub content: Result<StoredBytes, String>,
}

fn u16_at(bytes: &[u8], at: u64) -> Option<u64> {
    let at = usize::try_from(at).ok()?;
    Some(u16::from_le_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?).into())
}

fn u32_at(bytes: &[u8], at: u64) -> Option<u64> {
    let at = usize::try_from(at).ok()?;
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?).into())
}

fn u64_at(bytes: &[u8], at: u64) -> Option<u64> {
    let at = usize::try_from(at).ok()?;
    Some(u64::from_le_bytes(bytes.get(at..at.checked_add(8)?)?.try_into().ok()?))
}

/// All members.
///
/// # Errors
/// In words, where there is no table of contents or a member's name leads out of the archive.
pub fn members(bytes: &Bytes) -> Result<Vec<ZipMember>, String> {
    let (mut at, count) = directory(bytes).ok_or("no table of contents at its end: it is cut short or no archive")?;
    if count > MOST_MEMBERS {
        return Err(format!("its table of contents lists {count} members"));
    }
    let mut out = Vec::new();
    for number in 0..count {
        let entry =
            ZipEntry::read(bytes, at).ok_or_else(|| format!("member {number} of {count} is not listed whole"))?;
        check_name(&entry.name)?;
        let content = entry.content(bytes);
        at = entry.next;
        // Folders have a name and nothing in it.
        if !entry.name.ends_with('/') {
            out.push(ZipMember { name: entry.name, content });
        }
    }
    Ok(out)
}

/// Byte of the first entry, and how many there are.
fn directory(bytes: &[u8]) -> Option<(u64, u64)> {
    // The end record has 22 bytes and a comment of at most 65535 behind it.
    let last = bytes.len().checked_sub(22)?;
    let first = last.saturating_sub(65_535);
    let is_end = |at: &usize| {
        let comment = u16_at(bytes, *at as u64 + 20);
        bytes[*at..].starts_with(b"PK\x05\x06") && comment == Some((bytes.len() - at - 22) as u64)
    };
    let end = (first..=last).rev().find(is_end)? as u64;
    let (count, start) = (u16_at(bytes, end + 10)?, u32_at(bytes, end + 16)?);
    if count != 0xffff && start != 0xffff_ffff {
        return Some((start, count));
    }
    let locator = end.checked_sub(20)?;
    if !bytes[locator as usize..].starts_with(b"PK\x06\x07") {
        return Some((start, count));
    }
    let large = u64_at(bytes, locator + 8)?;
    if u32_at(bytes, large)? != 0x0606_4b50 {
        return None;
    }
    Some((u64_at(bytes, large.checked_add(48)?)?, u64_at(bytes, large.checked_add(32)?)?))
}

/// Members must lie in the archive's own folder; that nothing is unpacked here does not make an
/// archive that tries it a good one.
fn check_name(name: &str) -> Result<(), String> {
    let outside = name.split(['/', '\\']).any(|part| part == "..") || name.starts_with(['/', '\\']);
    if outside || name.contains(':') || name.contains('\0') {
        return Err(format!("its member `{}` has a name that leads out of the archive", name.escape_debug()));
    }
    Ok(())
}

/// An entry of the table of contents.
struct ZipEntry {
    name: String,
    flags: u64,
    method: u64,
    crc: u32,
    packed: u64,
    size: u64,
    local: u64,
    /// Byte of the next entry.
    next: u64,
}

impl ZipEntry {
    fn read(bytes: &[u8], at: u64) -> Option<ZipEntry> {
        if u32_at(bytes, at)? != 0x0201_4b50 {
            return None;
        }
        let (name_length, extra_length) = (u16_at(bytes, at + 28)?, u16_at(bytes, at + 30)?);
        let name_at = at + 46;
        let extra_at = name_at + name_length;
        let next = extra_at + extra_length + u16_at(bytes, at + 32)?;
        let name = String::from_utf8_lossy(bytes.get(name_at as usize..extra_at as usize)?).into_owned();
        let mut entry = ZipEntry {
            name,
            flags: u16_at(bytes, at + 8)?,
            method: u16_at(bytes, at + 10)?,
            crc: u32_at(bytes, at + 16)? as u32,
            packed: u32_at(bytes, at + 20)?,
            size: u32_at(bytes, at + 24)?,
            local: u32_at(bytes, at + 42)?,
            next,
        };
        entry.enlarge(bytes.get(extra_at as usize..(extra_at + extra_length) as usize)?);
        Some(entry)
    }

    /// Takes the values that 32 bits do not hold from the ZIP64 field.
    fn enlarge(&mut self, mut extra: &[u8]) {
        while let (Some(id), Some(length)) = (u16_at(extra, 0), u16_at(extra, 2)) {
            let Some(field) = extra.get(4..4 + length as usize) else { return };
            if id == 1 {
                let mut at = 0;
                for value in [&mut self.size, &mut self.packed, &mut self.local] {
                    if *value == 0xffff_ffff {
                        let Some(large) = u64_at(field, at) else { return };
                        *value = large;
                        at += 8;
                    }
                }
            }
            extra = &extra[4 + length as usize..];
        }
    }

    fn content(&self, bytes: &Bytes) -> Result<StoredBytes, String> {
        if self.flags & 1 != 0 {
            return Err("it is encrypted".into());
        }
        let coding = match self.method {
            0 => StreamCoding::Plain,
            8 => StreamCoding::Deflate { crc: self.crc },
            method => return Err(format!("its compression (ZIP method {method}) is not supported: use numpy's own")),
        };
        let start = self.start(bytes).ok_or("it begins where no member is")?;
        StoredBytes::new(bytes.clone(), start, self.packed, self.size, coding)
    }

    /// Byte where its data begin: behind its own header, which repeats the name.
    fn start(&self, bytes: &[u8]) -> Option<u64> {
        if u32_at(bytes, self.local)? != 0x0403_4b50 {
            return None;
        }
        Some(self.local + 30 + u16_at(bytes, self.local + 26)? + u16_at(bytes, self.local + 28)?)
    }
}
