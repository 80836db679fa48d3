//! A stream of integers, of fixed length or Huffman-coded, whichever is smaller after zstd.

use super::huffman::{self, BitReader, BitWriter};
use super::zstd;

const ONE_VALUE: u8 = 0;
const FIXED: u8 = 1;
const HUFFMAN: u8 = 2;

pub fn write(values: &[i64], out: &mut Vec<u8>) {
    let low = values.iter().copied().min().unwrap_or(0);
    let high = values.iter().copied().max().unwrap_or(0);
    let bits = (64 - low.abs_diff(high).leading_zeros()).max(1);
    // Differences are unsigned, because they may be too large for an i64.
    let plain: Vec<u64> = values.iter().map(|v| low.abs_diff(*v)).collect();
    let (kind, coded) = match low == high {
        true => (ONE_VALUE, Vec::new()),
        false => {
            let fixed = fixed(&plain, bits);
            match huffman::write(&plain, bits) {
                Some(huffman) if zstd(&huffman).len() < zstd(&fixed).len() => (HUFFMAN, huffman),
                _ => (FIXED, fixed),
            }
        }
    };
    out.push(kind);
    out.extend(low.to_le_bytes());
    out.push(bits as u8);
    out.extend((values.len() as u64).to_le_bytes());
    out.extend((coded.len() as u64).to_le_bytes());
    out.extend(coded);
}

fn fixed(values: &[u64], bits: u32) -> Vec<u8> {
    let mut out = BitWriter::default();
    values.iter().for_each(|v| out.put_long(*v, bits));
    out.finish()
}

/// A stream of at most `most` values, and the rest of the bytes; `None` for bytes that [`write()`] did not make.
pub fn read(bytes: &[u8], most: usize) -> Option<(Vec<i64>, &[u8])> {
    let (head, rest) = bytes.split_first_chunk::<26>()?;
    let long = |at: usize| <[u8; 8]>::try_from(&head[at..at + 8]).expect("eight bytes");
    let (kind, low, bits) = (head[0], i64::from_le_bytes(long(1)), u32::from(head[9]));
    let count = usize::try_from(u64::from_le_bytes(long(10))).ok().filter(|n| *n <= most)?;
    let length = usize::try_from(u64::from_le_bytes(long(18))).ok()?;
    let (coded, rest) = rest.split_at_checked(length)?;
    let values = match kind {
        _ if !(1..=64).contains(&bits) => return None,
        ONE_VALUE => vec![0; count],
        FIXED => {
            let mut reader = BitReader::new(coded);
            (0..count).map(|_| reader.take(bits)).collect::<Option<_>>()?
        }
        HUFFMAN => huffman::read(coded, count, bits)?,
        _ => return None,
    };
    // Damaged bytes can give any sum, and must not cause a panic.
    Some((values.into_iter().map(|v| low.wrapping_add_unsigned(v)).collect(), rest))
}
