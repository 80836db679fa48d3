//! Blosc 1 chunks: blocks that are shuffled and compressed apart, by BloscLZ (literals and copies of what came before, after
//! FastLZ) or by codecs of others.

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
        // Behind the header stands the first byte of each block.
        let at = int(bytes, HEADER + 4 * index)?;
        let packed = self.streams(bytes, at, length)?;
        Ok(match self.flags {
            f if f & 1 != 0 && self.type_size > 1 => unshuffle(&packed, self.type_size),
            f if f & 4 != 0 => unshuffle_bits(&packed, self.type_size),
            _ => packed,
        })
    }

    fn streams(&self, bytes: &[u8], mut at: usize, length: usize) -> Result<Vec<u8>, String> {
        // c-blosc splits a block under these conditions alone; the last, shorter block is never split.
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
        // A stream that compression did not make shorter is stored as it was.
        if packed.len() == out.len() {
            out.copy_from_slice(packed);
            return Ok(());
        }
        // The top three bits of the flags name the codec.
        match self.flags >> 5 {
            0 => return decompress(packed, out).ok_or_else(|| "a BloscLZ block is damaged".into()),
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
    // `chunks_exact` panics at 0.
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

/// Decompresses `bytes` into exactly `out`; `None` for broken bytes.
pub fn decompress(bytes: &[u8], out: &mut [u8]) -> Option<()> {
    let mut at = 0;
    let mut next = || {
        let byte = bytes.get(at).copied();
        at += 1;
        byte
    };
    let mut done = 0;
    // The first three bits of the stream are its version.
    let mut control = Some(next()? & 31);
    while let Some(c) = control {
        if c < 32 {
            for _ in 0..=c {
                *out.get_mut(done)? = next()?;
                done += 1;
            }
        } else {
            let mut length = usize::from(c >> 5) + 2;
            // A long length goes on in further bytes until one is below 255.
            if c >> 5 == 7 {
                loop {
                    let more = next()?;
                    length += usize::from(more);
                    if more != 255 {
                        break;
                    }
                }
            }
            let (high, low) = (usize::from(c & 31), usize::from(next()?));
            // The largest short distance says that a long one follows.
            let distance = if high == 31 && low == 255 {
                (usize::from(next()?) << 8) + usize::from(next()?) + 8192
            } else {
                (high << 8) + low + 1
            };
            let from = done.checked_sub(distance)?;
            let end = done.checked_add(length).filter(|&e| e <= out.len())?;
            // Byte by byte: a copy may run into what it writes.
            for i in 0..length {
                out[done + i] = out[from + i];
            }
            done = end;
        }
        control = next();
    }
    (done == out.len()).then_some(())
}

/// Chunks of python-blosc 1.11.4: `i / 7 + i * i % 13` as u32, by codec, shuffle and count.
#[cfg(test)]
pub fn chunks() -> impl Iterator<Item = (&'static str, u32, Vec<u8>)> {
    include_str!("../tests/data/blosc_chunks.txt").lines().map(|line| {
        let [name, count, bytes] = line.split(", ").collect::<Vec<_>>().try_into().unwrap();
        (name, count.parse().unwrap(), crate::testing::hex(bytes))
    })
}

#[cfg(test)]
mod tests {
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

    #[test]
    fn literals_copies_and_runs() {
        // "abc", then 6 from 3 back, then a run.
        let mut out = [0; 9];
        assert_eq!(decompress(&[2, b'a', b'b', b'c', 4 << 5, 2], &mut out), Some(()));
        assert_eq!(&out, b"abcabcabc");
        let mut out = [0; 10];
        assert_eq!(decompress(&[0, b'x', 7 << 5, 0, 0], &mut out), Some(()));
        assert_eq!(&out, b"xxxxxxxxxx");
    }

    #[test]
    fn broken_streams_are_refused() {
        let mut out = [0; 9];
        for bad in [&[][..], &[31], &[2, b'a'], &[0, b'a', 4 << 5, 2], &[2, b'a', b'b', b'c', 7 << 5, 255, 255, 0]] {
            assert_eq!(decompress(bad, &mut out), None);
        }
    }
}
