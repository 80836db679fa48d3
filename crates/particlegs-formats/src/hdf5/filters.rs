//! Decoding of chunks by undoing the filters of their writer: gzip, shuffle, fletcher32, LZF and LZ4 here,
//! because they are the common ones and must be fast; szip, N-bit and scale-offset by the library.

use crate::{TextResult, codecs};
use flate2::{Decompress, FlushDecompress, Status};
use hdf5_reader::checksum::fletcher32;
use hdf5_reader::filters::{FILTER_DEFLATE, FILTER_FLETCHER32, FILTER_SHUFFLE, apply_pipeline_with_limit};
use hdf5_reader::messages::filter_pipeline::FilterDescription;
use particlegs_core::{Error, Result};
use std::borrow::Cow;
use std::ops::Range;

enum FilterStage {
    Deflate,
    /// Bytes of equal place in all numbers lie together.
    Shuffle,
    Fletcher32,
    Lzf,
    Lz4,
    Library(FilterDescription),
}

/// The steps in the order in which they were applied.
pub struct Pipeline {
    stages: Vec<FilterStage>,
    element: usize,
}

/// Filters that the library decodes: szip, N-bit, scale-offset.
const BY_LIBRARY: [u16; 3] = [4, 5, 6];

/// Names of registered filters that are not read.
const UNREAD: [(u16, &str); 10] = [
    (305, "LZO"),
    (307, "bzip2"),
    (32001, "Blosc"),
    (32008, "bitshuffle"),
    (32013, "ZFP"),
    (32015, "Zstandard"),
    (32017, "SZ"),
    (32018, "FCIDECOMP"),
    (32024, "SZ3"),
    (32026, "Blosc2"),
];

impl Pipeline {
    /// The filters of a data set `place` of numbers of `element` bytes.
    pub fn new(filters: &[FilterDescription], element: usize, place: &str) -> Result<Self> {
        let stage = |f: &FilterDescription| match f.id {
            FILTER_DEFLATE => Ok(FilterStage::Deflate),
            FILTER_SHUFFLE if f.client_data.first().is_none_or(|&n| n as usize == element) => Ok(FilterStage::Shuffle),
            FILTER_SHUFFLE => Err(Error::input(place, "damaged HDF5 file: shuffle has a wrong number size")),
            FILTER_FLETCHER32 => Ok(FilterStage::Fletcher32),
            32000 => Ok(FilterStage::Lzf),
            32004 => Ok(FilterStage::Lz4),
            id if BY_LIBRARY.contains(&id) => Ok(FilterStage::Library(f.clone())),
            id => {
                let name = UNREAD.iter().find(|u| u.0 == id).map_or(String::new(), |u| format!(" ({})", u.1));
                let message = format!("it is compressed with HDF5 filter {id}{name}, which is not supported");
                let hint = "rewrite the file with the program that wrote it, or `h5repack -f GZIP=4 in.hdf5 out.hdf5`";
                Err(Error::input_with(place, message, hint))
            }
        };
        Ok(Pipeline { stages: filters.iter().map(stage).collect::<Result<_>>()?, element })
    }

    /// Whether it leaves bytes as they are; `mask` has a bit for each filter that was not applied.
    pub fn is_plain(&self, mask: u32) -> bool {
        (0..self.stages.len()).all(|i| skipped(mask, i))
    }

    /// Undoes it but for a shuffle that was the first step: `stored` must become `length` bytes.
    /// [`Pipeline::numbers`] puts shuffled numbers together where they are used, by few, in the CPU cache.
    pub fn undo<'a>(&self, stored: &'a [u8], mask: u32, length: usize) -> TextResult<Cow<'a, [u8]>> {
        // What a compressor may have added to `length` bytes before another came.
        let limit = length + length / 64 + 1024;
        let mut bytes = Cow::Borrowed(stored);
        let last = self.first(mask).filter(|_| self.leaves_shuffled(mask));
        for (i, stage) in self.stages.iter().enumerate().rev() {
            if skipped(mask, i) || Some(i) == last {
                continue;
            }
            bytes = match stage {
                FilterStage::Deflate => Cow::Owned(inflate(&bytes, limit)?),
                FilterStage::Shuffle => Cow::Owned(unshuffle(&bytes, self.element)),
                FilterStage::Fletcher32 => checked(bytes)?,
                FilterStage::Lzf => Cow::Owned(unlzf(&bytes, limit)?),
                FilterStage::Lz4 => Cow::Owned(unlz4(&bytes, limit)?),
                FilterStage::Library(filter) => {
                    let filter = std::slice::from_ref(filter);
                    let done = apply_pipeline_with_limit(&bytes, filter, 0, self.element, None, Some(limit));
                    Cow::Owned(done.map_err(|e| e.to_string())?)
                }
            };
        }
        if bytes.len() == length { Ok(bytes) } else { Err(format!("{} bytes instead of {length}", bytes.len())) }
    }

    /// The first step that was taken.
    fn first(&self, mask: u32) -> Option<usize> {
        (0..self.stages.len()).find(|&i| !skipped(mask, i))
    }

    /// Whether the last step to undo is a shuffle that [`Pipeline::undo`] leaves.
    pub fn leaves_shuffled(&self, mask: u32) -> bool {
        self.first(mask).is_some_and(|i| matches!(self.stages[i], FilterStage::Shuffle))
    }

    /// Numbers `range` of a chunk that is left shuffled, their bytes together.
    pub fn numbers(&self, shuffled: &[u8], range: Range<usize>, out: &mut Vec<u8>) {
        gather(shuffled, self.element, range, out);
    }
}

fn skipped(mask: u32, stage: usize) -> bool {
    // The mask has 32 bits: filters beyond these always apply.
    stage < 32 && mask & (1 << stage) != 0
}

/// A zlib stream of at most `limit` bytes, which must end and have the right checksum.
fn inflate(stored: &[u8], limit: usize) -> TextResult<Vec<u8>> {
    // No stream expands more than 1032-fold: a chunk cannot ask for much more than the file has.
    let capacity = limit.min(stored.len().saturating_mul(1032).saturating_add(64));
    let mut out = Vec::new();
    out.try_reserve_exact(capacity).map_err(|_| format!("not enough memory for {capacity} bytes"))?;
    let status = Decompress::new(true).decompress_vec(stored, &mut out, FlushDecompress::Finish);
    match status {
        Ok(Status::StreamEnd) => Ok(out),
        Ok(_) => Err("the gzip data have no end".into()),
        Err(e) => Err(format!("gzip: {e}")),
    }
}

/// Checks the sum at the end and takes it off.
fn checked(mut bytes: Cow<'_, [u8]>) -> TextResult<Cow<'_, [u8]>> {
    let Some(length) = bytes.len().checked_sub(4) else { return Err("too short for its checksum".into()) };
    let sum = u32::from_le_bytes([bytes[length], bytes[length + 1], bytes[length + 2], bytes[length + 3]]);
    // Big-endian machines once wrote the sum with each half's bytes swapped.
    let swapped = sum.swap_bytes().rotate_left(16);
    let computed_sum = fletcher32(&bytes[..length]);
    if computed_sum != sum && computed_sum != swapped {
        return Err("the fletcher32 checksum is wrong".into());
    }
    match &mut bytes {
        Cow::Borrowed(slice) => *slice = &slice[..length],
        Cow::Owned(vec) => vec.truncate(length),
    }
    Ok(bytes)
}

/// Puts the bytes of all numbers together; what is left over at the end was not moved.
fn unshuffle(bytes: &[u8], size: usize) -> Vec<u8> {
    let count = bytes.len() / size;
    let mut out = Vec::with_capacity(bytes.len());
    gather(bytes, size, 0..count, &mut out);
    out.extend_from_slice(&bytes[count * size..]);
    out
}

/// Numbers `range` of shuffled ones of `size` bytes, their bytes together.
fn gather(shuffled: &[u8], size: usize, range: Range<usize>, out: &mut Vec<u8>) {
    let count = shuffled.len() / size;
    let plane = |k: usize| &shuffled[k * count..][range.clone()];
    out.resize(range.len() * size, 0);
    // Sizes that are known when this is compiled make vector instructions of the loop.
    match size {
        4 => interleave::<4>(plane, out),
        8 => interleave::<8>(plane, out),
        _ => (0..size).for_each(|k| {
            for (number, &byte) in out.chunks_exact_mut(size).zip(plane(k)) {
                number[k] = byte;
            }
        }),
    }
}

fn interleave<'a, const SIZE: usize>(plane: impl Fn(usize) -> &'a [u8], out: &mut [u8]) {
    let planes: [&[u8]; SIZE] = std::array::from_fn(plane);
    for (i, number) in out.chunks_exact_mut(SIZE).enumerate() {
        for k in 0..SIZE {
            number[k] = planes[k][i];
        }
    }
}

/// LZF, as h5py has it: literal runs and references to what was decoded before.
fn unlzf(stored: &[u8], limit: usize) -> TextResult<Vec<u8>> {
    let cut = || "the LZF data are cut short".to_string();
    let mut out = Vec::with_capacity(limit.min(stored.len().saturating_mul(8)));
    let mut rest = stored;
    let byte = |rest: &mut &[u8]| {
        let (&first, left) = rest.split_first().ok_or_else(cut)?;
        *rest = left;
        Ok::<usize, String>(usize::from(first))
    };
    while !rest.is_empty() {
        let control = byte(&mut rest)?;
        if control < 32 {
            out.extend_from_slice(rest.get(..control + 1).ok_or_else(cut)?);
            rest = &rest[control + 1..];
        } else {
            let more = if control >> 5 == 7 { byte(&mut rest)? } else { 0 };
            let length = (control >> 5) + 2 + more;
            let distance = ((control & 31) << 8 | byte(&mut rest)?) + 1;
            let start = out.len().checked_sub(distance).ok_or("the LZF data refer to bytes before their start")?;
            // The copy may overlap what it writes.
            (start..start + length).for_each(|i| out.push(out[i]));
        }
        if out.len() > limit {
            return Err("the LZF data are too long".into());
        }
    }
    Ok(out)
}

/// LZ4 as HDF5's filter has it, big-endian: the length of all (8 bytes) and of a block (4), then of each block
/// its compressed length (4) and its bytes, which are as they were where that is the block's own.
fn unlz4(stored: &[u8], limit: usize) -> TextResult<Vec<u8>> {
    let cut = || "the LZ4 blocks are cut short".to_string();
    let take = |rest: &mut &[u8], n: usize| {
        let (first, left) = rest.split_at_checked(n).ok_or_else(cut)?;
        *rest = left;
        Ok::<_, String>(first.iter().fold(0u64, |v, b| v << 8 | u64::from(*b)))
    };
    let mut rest = stored;
    let (length, block) = (take(&mut rest, 8)?, take(&mut rest, 4)?);
    let length = usize::try_from(length).ok().filter(|l| *l <= limit).ok_or("the LZ4 blocks are too long")?;
    if block == 0 && length > 0 {
        return Err("the LZ4 blocks are empty".into());
    }
    let mut out = Vec::new();
    while out.len() < length {
        let size = (length - out.len()).min(block as usize);
        let packed = take(&mut rest, 4)? as usize;
        let (bytes, left) = rest.split_at_checked(packed).ok_or_else(cut)?;
        rest = left;
        match packed == size {
            true => out.extend_from_slice(bytes),
            // No block expands more than 255-fold.
            false if size / 255 > packed => return Err("an LZ4 block is too short for its content".into()),
            false => out.extend(codecs::lz4(bytes, size)?),
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shuffled(bytes: &[u8], size: usize) -> Vec<u8> {
        let count = bytes.len() / size;
        let mut out: Vec<u8> = (0..size).flat_map(|k| (0..count).map(move |i| bytes[i * size + k])).collect();
        out.extend_from_slice(&bytes[count * size..]);
        out
    }

    #[test]
    fn shuffle_of_any_size_is_undone() {
        let bytes: Vec<u8> = (0..=250).collect();
        for size in [1, 2, 3, 4, 8, 16, 300] {
            assert_eq!(unshuffle(&shuffled(&bytes, size), size), bytes, "{size}");
        }
    }

    #[test]
    fn lzf_literals_and_overlapping_references() {
        // "abc", then 9 + 3 bytes from 3 before, then one literal.
        let stored = [2, b'a', b'b', b'c', 0b1110_0000, 3, 2, 0, b'z'];
        assert_eq!(unlzf(&stored, 100).unwrap(), b"abcabcabcabcabcz");
        assert!(unlzf(&stored, 10).is_err());
        for cut in [1, 3, 5, 6, 8] {
            assert!(unlzf(&stored[..cut], 100).is_err(), "{cut}");
        }
        assert!(unlzf(&[0b0010_0000, 9], 100).is_err());
    }

    #[test]
    fn lz4_blocks_packed_and_as_they_were() {
        // Two blocks of four bytes and one of two: literals, as they were, literals.
        let head = [0, 0, 0, 0, 0, 0, 0, 10, 0, 0, 0, 4];
        let blocks = [&[0, 0, 0, 5, 0x40, b'a', b'b', b'c', b'd'][..], &[0, 0, 0, 4], b"efgh", &[0, 0, 0, 2], b"ij"];
        let stored = [&head[..], &blocks.concat()].concat();
        assert_eq!(unlz4(&stored, 100).unwrap(), b"abcdefghij");
        assert!(unlz4(&stored, 9).is_err() && unlz4(&[0xff; 40], 1 << 40).is_err());
        for cut in 0..stored.len() {
            assert!(unlz4(&stored[..cut], 100).is_err(), "{cut}");
        }
        let empty = [&[0; 7][..], &[9, 0, 0, 0, 0], &[0; 9]].concat();
        assert!(unlz4(&empty, 100).is_err());
    }

    #[test]
    fn a_stream_must_end_and_be_of_the_right_length() {
        let bytes = vec![7u8; 1000];
        let stored = crate::testing::zlib(&bytes);
        let filter = |id, client_data: Vec<u32>| FilterDescription { id, name: None, client_data };
        let pipeline = Pipeline::new(&[filter(1, vec![4])], 4, "a").unwrap();
        assert_eq!(pipeline.undo(&stored, 0, 1000).unwrap(), bytes);
        assert!(pipeline.undo(&stored, 0, 999).is_err());
        assert!(pipeline.undo(&stored[..stored.len() - 1], 0, 1000).is_err());
        let mut wrong = stored.clone();
        *wrong.last_mut().unwrap() ^= 1;
        assert!(pipeline.undo(&wrong, 0, 1000).is_err());
        // A chunk that claims gigabytes takes no more than its stream can give.
        assert!(pipeline.undo(&stored, 0, 1 << 40).is_err());
        assert!(pipeline.undo(&bytes, 1, 1000).is_ok());
        let error = Pipeline::new(&[filter(32001, vec![])], 4, "a").err().unwrap();
        assert!(error.to_string().contains("Blosc"), "{error}");
    }

    #[test]
    fn checksums_are_checked() {
        let mut bytes = vec![1u8, 2, 3, 4, 5];
        bytes.extend(fletcher32(&bytes).to_le_bytes());
        assert_eq!(&*checked(Cow::Borrowed(&bytes)).unwrap(), &[1, 2, 3, 4, 5]);
        bytes[0] ^= 16;
        assert!(checked(Cow::Borrowed(&bytes)).is_err());
        assert!(checked(Cow::Borrowed(&bytes[..3])).is_err());
    }
}
