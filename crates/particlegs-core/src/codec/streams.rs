//! What follows a block's header: one stream, or a table of lengths and the streams of a block in
//! segments (docs/format.md, section 4).

use super::tree::SEGMENT;
use super::wire::Reader;

/// The streams of a block.
pub(crate) struct Streams<'a> {
    /// Of the tree above the segments; `None` for a block of one segment without a table.
    pub trunk: Option<&'a [u8]>,
    /// One a segment. Without a table the padding is still at the end of the only one.
    pub segments: Vec<&'a [u8]>,
    /// What follows the last stream.
    pub padding: &'a [u8],
}

/// Has a block of so many Gaussians a table?
pub(crate) fn has_table(gaussians: u32) -> bool {
    gaussians > SEGMENT
}

/// Writes the trunk's stream and the segments'.
pub(crate) fn write(gaussians: u32, trunk: &[u8], segments: &[Vec<u8>], out: &mut Vec<u8>) {
    if has_table(gaussians) {
        out.extend((segments.len() as u32).to_le_bytes());
        for length in std::iter::once(trunk.len()).chain(segments.iter().map(Vec::len)) {
            out.extend((length as u32).to_le_bytes());
        }
        out.extend(trunk);
    }
    segments.iter().for_each(|s| out.extend(s));
}

/// Takes what follows the header apart; nothing is reserved that the bytes do not hold.
pub(crate) fn read(gaussians: u32, bytes: &[u8]) -> Result<Streams<'_>, String> {
    if !has_table(gaussians) {
        return Ok(Streams { trunk: None, segments: vec![bytes], padding: &[] });
    }
    let mut r = Reader::new(bytes);
    let count = r.u32()?;
    // Two segments that follow each other hold more than one may.
    let most = 2 * (gaussians / SEGMENT) + 1;
    if count == 0 || count > most {
        return Err(format!("{count} segments of {gaussians} Gaussians"));
    }
    let trunk = r.u32()?;
    let lengths = (0..count).map(|_| r.u32()).collect::<Result<Vec<u32>, String>>()?;
    let mut stream = |length: u32| r.take(length as usize);
    let trunk = stream(trunk)?;
    let segments = lengths.into_iter().map(stream).collect::<Result<Vec<&[u8]>, String>>()?;
    let padding = &bytes[r.position()..];
    Ok(Streams { trunk: Some(trunk), segments, padding })
}
