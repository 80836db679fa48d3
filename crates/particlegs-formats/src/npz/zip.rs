//! A ZIP archive's table of contents, large archives (ZIP64) included. Nothing is unpacked.

use crate::TextResult;
use crate::numbers::Bytes;
use crate::stored_bytes::{StoredBytes, StreamCoding};
use rawzip::{CompressionMethod, ZipArchive, ZipFileHeaderRecord, ZipSliceArchive};

/// First bytes of a ZIP archive, unless it is empty.
pub const MAGIC: &[u8; 4] = b"PK\x03\x04";
/// First bytes of an empty one.
pub const MAGIC_EMPTY: &[u8; 4] = b"PK\x05\x06";
const MOST_MEMBERS: u64 = 1 << 14;

pub struct ZipMember {
    pub name: String,
    /// Its content; `Err` says why it cannot be read.
    pub content: TextResult<StoredBytes>,
}

/// All members. An archive without a table of contents, or with a member whose name leads out of it, is refused.
pub fn members(bytes: &Bytes) -> TextResult<Vec<ZipMember>> {
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
