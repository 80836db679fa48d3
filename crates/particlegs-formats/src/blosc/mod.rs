//! Blosc 1 chunks: blocks that are shuffled and compressed apart.

mod blosclz;
#[cfg(test)]
pub mod chunks;

use crate::codecs;

const HEADER: usize = 16;
/// Blosc splits blocks of numbers up to this size into one stream a byte.
const MOST_SPLITS: usize = 16;
/// Shortest stream that a block is split into.
const LEAST_STREAM: usize = 128;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BloscHeader {
    flags: u8,
    type_size: usize,
    /// Bytes decompressed.
    pub length: usize,
    /// Bytes of a block, decompressed.
    pub block: usize,
    size: usize,
}

fn int(bytes: &[u8], at: usize) -> Result<usize, String> {
    let four = at.checked_add(4).and_then(|end| bytes.get(at..end)).and_then(|b| <[u8; 4]>::try_from(b).ok());
    let value = four.map(i32::from_le_bytes).and_then(|v| usize::try_from(v).ok());
    value.ok_or_else(|| "a Blosc chunk is cut short or damaged".into())
}

impl BloscHeader {
    pub fn parse(bytes: &[u8]) -> Result<BloscHeader, String> {
        let head = bytes.get(..HEADER).ok_or("a Blosc chunk is cut short")?;
        let chunk = BloscHeader {
            flags: head[2],
            type_size: usize::from(head[3]).max(1),
            length: int(bytes, 4)?,
            block: int(bytes, 8)?,
            size: int(bytes, 12)?,
        };
        if head[0] == 0 || head[0] > 2 {
            return Err(format!("unknown Blosc version {}", head[0]));
        }
        if chunk.size > bytes.len() || (chunk.block == 0 && chunk.length > 0) {
            return Err("a Blosc chunk is cut short or damaged".into());
        }
        Ok(chunk)
    }

    pub fn blocks(&self) -> usize {
        if self.length == 0 { 0 } else { self.length.div_ceil(self.block) }
    }

    pub fn decode(&self, bytes: &[u8], index: usize) -> Result<Vec<u8>, String> {
        let bytes = &bytes[..self.size.min(bytes.len())];
        let start = index.checked_mul(self.block).filter(|&s| s < self.length).ok_or("a Blosc block does not exist")?;
        let length = self.block.min(self.length - start);
        if length > codecs::MOST_BYTES {
            return Err(format!("a Blosc block has {length} bytes, at most {} are supported", codecs::MOST_BYTES));
        }
        if self.flags & 2 != 0 {
            // Stored as it was.
            let plain = bytes.get(HEADER + start..).and_then(|b| b.get(..length));
            return Ok(plain.ok_or("a Blosc chunk is cut short")?.to_vec());
        }
        let at = int(bytes, HEADER + 4 * index)?;
        let packed = self.streams(bytes, at, length)?;
        Ok(match self.flags {
            f if f & 1 != 0 && self.type_size > 1 => unshuffle(&packed, self.type_size),
            f if f & 4 != 0 => unshuffle_bits(&packed, self.type_size),
            _ => packed,
        })
    }

    fn streams(&self, bytes: &[u8], mut at: usize, length: usize) -> Result<Vec<u8>, String> {
        let split = self.flags & 0x10 == 0
            && self.type_size <= MOST_SPLITS
            && self.block / self.type_size >= LEAST_STREAM
            && length == self.block;
        let streams = if split { self.type_size } else { 1 };
        let each = length / streams;
        let mut out = vec![0; length];
        for stream in out.chunks_exact_mut(each).take(streams) {
            let size = int(bytes, at)?;
            let from = at + 4;
            let packed = from.checked_add(size).and_then(|end| bytes.get(from..end));
            self.stream(packed.ok_or("a Blosc block ends beyond its chunk")?, stream)?;
            at = from + size;
        }
        Ok(out)
    }

    fn stream(&self, packed: &[u8], out: &mut [u8]) -> Result<(), String> {
        if packed.len() == out.len() {
            out.copy_from_slice(packed);
            return Ok(());
        }
        match self.flags >> 5 {
            0 => return blosclz::decompress(packed, out).ok_or_else(|| "a BloscLZ block is damaged".into()),
            1 => out.copy_from_slice(&codecs::lz4(packed, out.len())?),
            3 => out.copy_from_slice(&codecs::zlib(packed, out.len())?),
            4 => out.copy_from_slice(&codecs::zstd(packed, out.len())?),
            2 => return Err("the Blosc codec Snappy is not supported: write the file with another codec".into()),
            n => return Err(format!("unknown Blosc codec {n}")),
        }
        Ok(())
    }
}

/// Bytes by their place in a number, back to numbers; what is no whole number stays at the end.
fn unshuffle(bytes: &[u8], type_size: usize) -> Vec<u8> {
    let n = bytes.len() / type_size;
    let mut out = bytes.to_vec();
    for (k, plane) in bytes.chunks_exact(n.max(1)).take(if n == 0 { 0 } else { type_size }).enumerate() {
        for (i, &byte) in plane.iter().enumerate() {
            out[i * type_size + k] = byte;
        }
    }
    out
}

/// Bits by their place in a number, back to numbers. Blosc 1 does so only with multiples of eight.
fn unshuffle_bits(bytes: &[u8], type_size: usize) -> Vec<u8> {
    let n = bytes.len() / type_size;
    let mut out = bytes.to_vec();
    if n == 0 || !n.is_multiple_of(8) {
        return out;
    }
    out[..n * type_size].fill(0);
    for (plane, row) in bytes.chunks_exact(n / 8).take(8 * type_size).enumerate() {
        let (byte, bit) = (plane / 8, plane % 8);
        for (i, &eight) in row.iter().enumerate() {
            for j in 0..8 {
                out[(8 * i + j) * type_size + byte] |= (eight >> j & 1) << bit;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::chunks::chunks;
    use super::*;

    #[test]
    fn every_codec_and_shuffle_is_read() {
        for (name, n, bytes) in chunks() {
            let chunk = BloscHeader::parse(&bytes).unwrap();
            let expected: Vec<u8> = (0..n).flat_map(|i| (i / 7 + i * i % 13).to_le_bytes()).collect();
            let got: Vec<u8> = (0..chunk.blocks()).flat_map(|b| chunk.decode(&bytes, b).expect(name)).collect();
            assert_eq!(got, expected, "{name} {n}");
            for cut in 0..bytes.len() {
                if let Ok(chunk) = BloscHeader::parse(&bytes[..cut]) {
                    let _ = chunk.decode(&bytes[..cut], 0);
                }
                for bit in 0..8 {
                    let mut bad = bytes.clone();
                    bad[cut] ^= 1 << bit;
                    if let Ok(chunk) = BloscHeader::parse(&bad) {
                        let _ = chunk.decode(&bad, 0);
                    }
                }
            }
        }
    }
}
