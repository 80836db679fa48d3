//! Streams of numbers coded by pco, one after the other, behind a checksum. Readers limit the numbers they accept.

use pco::ChunkConfig;
use pco::data_types::Number;
use pco::standalone::{DecompressorItem, FileDecompressor, simple_compress};

/// pco's highest level.
const LEVEL: usize = 12;
const CHECKSUM: usize = 4;
/// Particles that any file may decode to, and how many more per byte: this limits a reader's memory. Writers append
/// zeros to files that hold more particles.
const PARTICLES_OF_ANY: usize = 1 << 22;
const PARTICLES_A_BYTE: usize = 1 << 13;

/// Appends a number, seven bits per byte, the lowest first.
pub fn write_number(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Reads a number; also returns the rest.
pub fn read_number(mut bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut value = 0u64;
    for shift in (0..64).step_by(7) {
        let (first, rest) = bytes.split_first()?;
        let low = u64::from(first & 0x7f);
        bytes = rest;
        // The number has more than 64 bits.
        if low << shift >> shift != low {
            return None;
        }
        value |= low << shift;
        if first & 0x80 == 0 {
            return Some((value, bytes));
        }
    }
    None
}

/// Appends numbers; for none, only a zero.
pub fn write<T: Number>(values: &[T], out: &mut Vec<u8>) {
    let config = ChunkConfig::default().with_compression_level(LEVEL);
    let coded = match values.is_empty() {
        true => Vec::new(),
        false => simple_compress(values, &config).expect("compression into memory cannot fail"),
    };
    write_number(coded.len() as u64, out);
    out.extend(coded);
}

/// Reads at most `most` numbers; also returns the rest; `None` for bytes that [`write()`] did not make.
pub fn read<T: Number + Default>(bytes: &[u8], most: usize) -> Option<(Vec<T>, &[u8])> {
    let (length, rest) = read_number(bytes)?;
    let (coded, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
    let mut values = Vec::new();
    if coded.is_empty() {
        return Some((values, rest));
    }
    let (file, mut coded) = FileDecompressor::new(coded).ok()?;
    while let DecompressorItem::Chunk(mut chunk) = file.chunk_decompressor::<T, _>(coded).ok()? {
        let done = values.len();
        let all = chunk.n().checked_add(done).filter(|n| *n <= most)?;
        values.resize(all, T::default());
        chunk.read(&mut values[done..]).ok().filter(|p| p.finished)?;
        coded = chunk.into_src();
    }
    Some((values, rest))
}

/// Prepends a checksum, and pads the bytes as the number of particles requires.
pub fn sealed(mut bytes: Vec<u8>, particles: usize) -> Vec<u8> {
    let least = particles.saturating_sub(PARTICLES_OF_ANY).div_ceil(PARTICLES_A_BYTE);
    bytes.resize(bytes.len().max(least), 0);
    let mut out = crc32fast::hash(&bytes).to_le_bytes().to_vec();
    out.extend(bytes);
    out
}

/// The bytes, and how many particles they may decode to; `None` if [`sealed`] did not make them.
pub fn opened(bytes: &[u8]) -> Option<(&[u8], usize)> {
    let (checksum, rest) = bytes.split_first_chunk::<CHECKSUM>()?;
    let most = PARTICLES_OF_ANY.saturating_add(rest.len().saturating_mul(PARTICLES_A_BYTE));
    (crc32fast::hash(rest) == u32::from_le_bytes(*checksum)).then_some((rest, most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_survive_a_round_trip() {
        for value in [0, 1, 127, 128, 300, u64::from(u32::MAX), u64::MAX] {
            let mut bytes = Vec::new();
            write_number(value, &mut bytes);
            bytes.push(9);
            assert_eq!(read_number(&bytes), Some((value, &[9u8][..])));
        }
        assert!(read_number(&[0x80; 9]).is_none() && read_number(&[0xff; 12]).is_none());
    }

    #[test]
    fn streams_survive_a_round_trip_and_are_limited() {
        let values: Vec<u64> = (0..1000u64).map(|i| i * i % 77).collect();
        let mut bytes = Vec::new();
        write(&values, &mut bytes);
        write::<u32>(&[], &mut bytes);
        let (read_values, rest) = read::<u64>(&bytes, 1000).unwrap();
        assert_eq!((read_values, rest), (values, &[0u8][..]));
        assert!(read::<u64>(&bytes, 999).is_none() && read::<u32>(&bytes, 1000).is_none());
        assert!(read::<u32>(rest, 0).unwrap().0.is_empty());
    }

    /// A file of a few bytes may not claim more memory than a reader would give any file.
    #[test]
    fn small_files_of_many_particles_are_padded() {
        let sealed_bytes = sealed(vec![1, 2, 3], 100_000_000);
        let (inner, most) = opened(&sealed_bytes).unwrap();
        assert!(inner.starts_with(&[1, 2, 3, 0]) && most >= 100_000_000);
        assert!(opened(&sealed(vec![1], 5)).unwrap().1 < 5_000_000);
        assert!(opened(&[1, 2, 3]).is_none());
    }
}
