//! A block behind its header: a table of lengths, and the streams of the block stage by stage (docs/format.md,
//! section 4).

use super::header::BlockHeader;
use super::tree::SEGMENT;
use super::wire::WireReader;
use std::ops::Range;

/// Shares of what is coded level by level after which a stage ends.
pub(super) const STAGES: [f64; 2] = [0.12, 0.45];

/// Places of the streams of a block in its bytes, whether these go that far or not.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Streams {
    /// Of the tree above the segments; `None` for a block of one segment.
    pub trunk: Option<Range<usize>>,
    /// For each stage, the stream of each segment. Without a table the padding is still at the end of the only one.
    pub stages: Vec<Vec<Range<usize>>>,
    pub segments: usize,
    /// Whether there is a table of lengths.
    pub table: bool,
}

/// Whether a block with this many Gaussians is split into segments.
pub(crate) fn has_segments(gaussians: u32) -> bool {
    gaussians > SEGMENT
}

/// Writes the table, the trunk's stream, and those of the segments for each stage.
pub(crate) fn write(header: &BlockHeader, trunk: &[u8], stages: &[Vec<Vec<u8>>], out: &mut Vec<u8>) {
    let segments = stages.first().map_or(0, Vec::len);
    let trunk = if has_segments(header.gaussians) {
        out.extend((segments as u32).to_le_bytes());
        out.extend((trunk.len() as u32).to_le_bytes());
        trunk
    } else {
        &[]
    };
    if segments * stages.len() > 1 {
        stages.iter().flatten().for_each(|s| out.extend((s.len() as u32).to_le_bytes()));
    }
    out.extend(trunk);
    stages.iter().flatten().for_each(|s| out.extend(s));
}

/// Takes what follows the header apart; nothing is reserved that the bytes do not hold.
pub(crate) fn read(header: &BlockHeader, block: &[u8]) -> Result<Streams, String> {
    let mut r = WireReader::new(&block[header.bytes()..]);
    let stages = header.cuts.len() + 1;
    let (segments, trunk) = match has_segments(header.gaussians) {
        true => (r.u32()?, Some(r.u32()?)),
        false => (1, None),
    };
    // Two segments that follow each other hold more than one may.
    if segments == 0 || segments > 2 * (header.gaussians / SEGMENT) + 1 {
        return Err(format!("{segments} segments but {} Gaussians", header.gaussians));
    }
    let segments = segments as usize;
    let table = segments * stages > 1;
    let lengths = r.take(if table { 4 * segments * stages } else { 0 })?;
    let mut at = header.bytes() + r.position();
    let mut stream = |length: u32| {
        // Lengths may lead beyond the block: callers compare them with its bytes.
        let stream = at..at.saturating_add(length as usize);
        at = stream.end;
        stream
    };
    let trunk = trunk.map(&mut stream);
    let lengths = lengths.chunks_exact(4).map(|l| u32::from_le_bytes([l[0], l[1], l[2], l[3]]));
    let mut all = lengths.map(stream).collect::<Vec<_>>();
    if !table {
        let start = trunk.as_ref().map_or(header.bytes(), |t| t.end);
        all.push(start.min(block.len())..block.len());
    }
    let stages = all.chunks(segments).map(<[_]>::to_vec).collect();
    Ok(Streams { trunk, stages, segments, table })
}

/// The bytes of each stage that is there whole: the first with all that stands before its streams, the last of all with
/// the padding.
///
/// # Errors
/// Says what is wrong where a block neither ends with a stage nor goes on to its end.
pub(crate) fn stages(header: &BlockHeader, block: &[u8]) -> Result<Vec<Range<usize>>, String> {
    let streams = read(header, block)?;
    let ends = streams.stages.iter().filter_map(|s| s.last().map(|s| s.end));
    let mut ends: Vec<usize> = ends.take_while(|&end| end <= block.len()).collect();
    let all = ends.len() == streams.stages.len();
    match ends.last_mut() {
        Some(last) if all || *last == block.len() => *last = block.len(),
        _ => return Err("a stream ends too soon".into()),
    }
    let mut start = 0;
    Ok(ends.into_iter().map(|end| std::mem::replace(&mut start, end)..end).collect())
}
