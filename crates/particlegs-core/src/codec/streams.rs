//! What follows a block's header: one stream, or a table of lengths and the streams of a block in
//! segments (docs/format.md, section 4).

use super::tree::SEGMENT;
use super::wire::Reader;
use std::ops::Range;

/// Where the streams of a block lie in its bytes.
pub(crate) struct Streams {
    /// Of the tree above the segments; `None` for a block of one segment without a table.
    pub trunk: Option<Range<usize>>,
    /// One a segment. Without a table the padding is still at the end of the only one.
    pub segments: Vec<Range<usize>>,
    /// What follows the last stream.
    pub padding: Range<usize>,
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

/// Takes what follows the header, which ends at byte `header`, apart; nothing is reserved that the bytes do not hold.
pub(crate) fn read(gaussians: u32, block: &[u8], header: usize) -> Result<Streams, String> {
    if !has_table(gaussians) {
        let end = block.len();
        return Ok(Streams { trunk: None, segments: std::iter::once(header..end).collect(), padding: end..end });
    }
    let mut r = Reader::new(&block[header..]);
    let count = r.u32()?;
    // Two segments that follow each other hold more than one may.
    let most = 2 * (gaussians / SEGMENT) + 1;
    if count == 0 || count > most {
        return Err(format!("{count} segments of {gaussians} Gaussians"));
    }
    let trunk = r.u32()?;
    let lengths = (0..count).map(|_| r.u32()).collect::<Result<Vec<u32>, String>>()?;
    let mut stream = |length: u32| -> Result<Range<usize>, String> {
        let start = header + r.position();
        let bytes = r.take(length as usize)?;
        Ok(start..start + bytes.len())
    };
    let trunk = stream(trunk)?;
    let segments = lengths.into_iter().map(&mut stream).collect::<Result<Vec<_>, String>>()?;
    let padding = header + r.position()..block.len();
    Ok(Streams { trunk: Some(trunk), segments, padding })
}
