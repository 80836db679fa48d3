//! Compressed blocks whose decompressed length is known: exactly that much memory is taken.
//!
//! Every function fails in words where the bytes are broken or give another length.

use std::io::Read;

/// Longest block that is decompressed at once. Writers use some kilobytes to some megabytes; a
/// longer one comes from a damaged file or would not fit the memory that a reader may take.
pub const MOST_BYTES: usize = 16 << 20;

/// `length` zero bytes, where that is no more than [`MOST_BYTES`].
fn space(length: usize) -> Result<Vec<u8>, String> {
    if length > MOST_BYTES {
        return Err(format!("a compressed block has {length} bytes; at most {MOST_BYTES} are supported"));
    }
    Ok(vec![0; length])
}

/// Reads exactly `length` bytes, and nothing must follow.
fn exactly(mut source: impl Read, length: usize) -> Result<Vec<u8>, String> {
    let mut out = space(length)?;
    source.read_exact(&mut out).map_err(|e| format!("a compressed block is damaged: {e}"))?;
    match source.read(&mut [0]) {
        Ok(0) => Ok(out),
        Ok(_) => Err("a compressed block holds more than it should".into()),
        Err(e) => Err(format!("a compressed block is damaged: {e}")),
    }
}

/// zlib (RFC 1950).
pub fn zlib(bytes: &[u8], length: usize) -> Result<Vec<u8>, String> {
    exactly(flate2::bufread::ZlibDecoder::new(bytes), length)
}

/// One LZ4 block, without a frame.
pub fn lz4(bytes: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let mut out = space(length)?;
    match lz4_flex::block::decompress_into(bytes, &mut out) {
        Ok(n) if n == length => Ok(out),
        Ok(n) => Err(format!("an LZ4 block decompresses to {n} bytes instead of {length}")),
        Err(e) => Err(format!("an LZ4 block is damaged: {e}")),
    }
}

pub fn zstd(bytes: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let decoder = ruzstd::decoding::StreamingDecoder::new_with_max_window_size(bytes, MOST_BYTES as u64)
        .map_err(|e| format!("a Zstandard block is damaged: {e}"))?;
    exactly(decoder, length)
}

/// An .xz stream of one block of LZMA2, as liblzma's buffer encoder writes it. The dictionary is
/// taken as large as the result, whatever the stream says: level 9 says 64 MiB for any block.
pub fn xz(bytes: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let broken = |message: &str| format!("an LZMA block is damaged: {message}");
    if length > MOST_BYTES {
        // This gives the error, before the stream is looked at.
        return space(length);
    }
    let magic = [0xfd, b'7', b'z', b'X', b'Z', 0];
    let (head, rest) = bytes.split_at_checked(12).ok_or_else(|| broken("it is cut short"))?;
    if head[..6] != magic || crc32fast::hash(&head[6..8]).to_le_bytes() != head[8..12] {
        return Err(broken("the .xz header is missing"));
    }
    // The block's header states its own size in words of four bytes, less one.
    let size = rest.first().map_or(0, |&b| 4 * (usize::from(b) + 1));
    let (block, data) = rest.split_at_checked(size).ok_or_else(|| broken("it is cut short"))?;
    let (fields, sum) = block.split_at(size.saturating_sub(4));
    // A 0 in place of the size begins the index: the stream has no block.
    if rest.first() == Some(&0) || crc32fast::hash(fields).to_le_bytes() != *sum {
        return if length == 0 { Ok(Vec::new()) } else { Err(broken("it is empty")) };
    }
    // Flags: one filter, perhaps both sizes; then the filter LZMA2 with a byte of properties.
    let sizes = usize::from(fields[1] & 0x40 != 0) + usize::from(fields[1] & 0x80 != 0);
    let mut filter = &fields[2..];
    for _ in 0..sizes {
        let end = filter.iter().position(|b| b & 0x80 == 0).ok_or_else(|| broken("its sizes are wrong"))?;
        filter = &filter[end + 1..];
    }
    if fields[1] & 0x3f != 0 || !filter.starts_with(&[0x21, 1]) {
        return Err(broken("it uses filters other than LZMA2"));
    }
    let dictionary = length.max(4096) as u32;
    let mut left = data;
    let out = exactly(lzma_rust2::Lzma2Reader::new(&mut left, dictionary, None), length)?;
    // The block is padded to 4 bytes; its checksum follows.
    let used = (data.len() - left.len()).next_multiple_of(4);
    let checked = |n: usize| data.get(used..used + n);
    // The stream's flags say which checksum it has; SHA-256 is not checked.
    let good = match head[7] {
        0 => true,
        1 => checked(4).is_some_and(|sum| crc32fast::hash(&out).to_le_bytes() == *sum),
        4 => checked(8).is_some_and(|sum| crc64(&out).to_le_bytes() == *sum),
        _ => true,
    };
    if good { Ok(out) } else { Err(broken("its checksum is wrong")) }
}

/// CRC-64/XZ.
pub fn crc64(bytes: &[u8]) -> u64 {
    let mut digest = crc64fast::Digest::new();
    digest.write(bytes);
    digest.sum64()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::hex;

    const TEXT: &[u8] = b"particles particles particles";
    /// `python3 -c "import lzma; ..."`: xz with the presets 0 (CRC-64) and 9 (CRC-32).
    const XZ: &[&str] = &[
        "fd377a585a000004e6d6b446020021010c0000008f98419ce0001c00115d0038184aac21286e1d98edf9a483545000000000000039319963e6035ffd00012d1d1d83aa631fb6f37d010000000004595a",
        "fd377a585a0000016922de36020021011c00000010cf58cce0001c00115d0038184aac21286e1d98edf9a4835450000000000000098f7c4d0001291d1946c6079042990d010000000001595a",
    ];

    #[test]
    fn wrong_lengths_and_broken_bytes_are_refused() {
        let packed = crate::testing::zlib(TEXT);
        assert_eq!(zlib(&packed, TEXT.len()).unwrap(), TEXT);
        for wrong in [0, TEXT.len() - 1, TEXT.len() + 1, MOST_BYTES + 1, usize::MAX] {
            assert!(zlib(&packed, wrong).is_err(), "{wrong}");
        }
        assert!(lz4(&packed, 20).is_err() && zstd(&packed, 20).is_err() && xz(&packed, 20).is_err());
        // A literal of 3 bytes.
        assert_eq!(lz4(&[0x30, b'a', b'b', b'c'], 3).unwrap(), b"abc");
        assert!(lz4(&[0x30, b'a', b'b', b'c'], 4).is_err());
    }

    #[test]
    fn xz_streams_are_read_and_checked() {
        for text in XZ {
            let packed = hex(text);
            assert_eq!(xz(&packed, TEXT.len()).unwrap(), TEXT);
            assert!(xz(&packed, TEXT.len() + 1).is_err());
            for n in 0..packed.len() {
                let _ = xz(&packed[..n], TEXT.len());
                for bit in 0..8 {
                    let mut bad = packed.clone();
                    bad[n] ^= 1 << bit;
                    // What lies behind the block (index, footer) is not looked at.
                    assert!(xz(&bad, TEXT.len()).is_err() || xz(&bad, TEXT.len()).unwrap() == TEXT, "{n} {bit}");
                }
            }
        }
    }
}
