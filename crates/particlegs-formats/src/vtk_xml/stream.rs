//! Bytes in a file, as they are or as base64, from any place.

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;
use std::ops::Range;

/// Characters from one kept place to the next, where the text is broken into lines.
const STEP: u64 = 1 << 16;

const ENGINE: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// A stretch of text.
#[derive(Clone, Debug)]
pub struct Base64Text {
    range: Range<u64>,
    /// Places of every [`STEP`]-th character that is no blank; empty where there are no blanks.
    starts: Vec<u64>,
}

impl Base64Text {
    /// Bytes `range` of a file, which must lie within it and hold no blanks.
    pub fn plain(range: Range<u64>) -> Base64Text {
        Base64Text { range, starts: Vec::new() }
    }

    /// Bytes `range` of `bytes`, which may hold blanks.
    pub fn find(bytes: &[u8], range: Range<u64>) -> Base64Text {
        let text = &bytes[range.start as usize..range.end as usize];
        let before = text.iter().take_while(|b| b.is_ascii_whitespace()).count();
        let after = text[before..].iter().rev().take_while(|b| b.is_ascii_whitespace()).count();
        let text = &text[before..text.len() - after];
        let range = range.start + before as u64..range.end - after as u64;
        let mut starts = Vec::new();
        if text.iter().any(u8::is_ascii_whitespace) {
            let places = text.iter().enumerate().filter(|(_, b)| !b.is_ascii_whitespace());
            starts.extend(places.step_by(STEP as usize).map(|(i, _)| range.start + i as u64));
        }
        Base64Text { range, starts }
    }

    /// Up to `n` characters from the `from`-th on, blanks left out.
    fn characters<'a>(&self, bytes: &'a [u8], from: u64, n: usize) -> Cow<'a, [u8]> {
        let text = |start: u64| &bytes[start.min(self.range.end) as usize..self.range.end as usize];
        if self.starts.is_empty() {
            let text = text(self.range.start.saturating_add(from));
            return text[..n.min(text.len())].into();
        }
        let Some(&start) = self.starts.get((from / STEP) as usize) else { return Vec::new().into() };
        let black = text(start).iter().filter(|b| !b.is_ascii_whitespace());
        black.skip((from % STEP) as usize).take(n).copied().collect::<Vec<u8>>().into()
    }

    /// Whether the `at`-th character pads a stream's end.
    pub fn pads(&self, bytes: &[u8], at: u64) -> bool {
        self.characters(bytes, at, 1).first() == Some(&b'=')
    }

    /// Bytes `range` of the stream that begins with the `base`-th character.
    pub fn decode(&self, bytes: &[u8], base: u64, range: Range<u64>) -> Result<Vec<u8>, String> {
        let broken = || format!("the base64 text at byte {} is damaged or too short", self.range.start);
        let (first, last) = (range.start / 3, range.end.div_ceil(3));
        let n = usize::try_from(4 * (last - first)).map_err(|_| broken())?;
        let text = self.characters(bytes, base + 4 * first, n);
        let mut out = ENGINE.decode(&text).map_err(|_| broken())?;
        out.drain(..((range.start - 3 * first) as usize).min(out.len()));
        let length = (range.end - range.start) as usize;
        if out.len() < length {
            return Err(broken());
        }
        out.truncate(length);
        Ok(out)
    }
}

/// Bytes in a file: as they are, or as base64.
#[derive(Clone, Debug)]
pub enum Stream {
    /// From this byte on.
    Raw(u64),
    /// From a byte of what a text decodes to.
    Base64 {
        text: Base64Text,
        /// Its character that the stream begins with.
        base: u64,
        /// Decoded bytes before the first.
        skip: u64,
    },
}

impl Stream {
    pub fn get<'a>(&self, bytes: &'a [u8], range: Range<u64>) -> Result<Cow<'a, [u8]>, String> {
        match self {
            Stream::Raw(start) => {
                let at = |n: u64| start.checked_add(n).and_then(|n| usize::try_from(n).ok());
                let slice = at(range.start).zip(at(range.end)).and_then(|(a, b)| bytes.get(a..b));
                slice.map(Cow::Borrowed).ok_or_else(|| format!("it ends beyond the file's {} bytes", bytes.len()))
            }
            Stream::Base64 { text, base, skip } => {
                let shifted = range.start.checked_add(*skip).zip(range.end.checked_add(*skip));
                let (start, end) = shifted.ok_or("it ends beyond the file")?;
                // No more is decoded than the file can hold.
                if end - start > bytes.len() as u64 {
                    return Err(format!("it ends beyond the file's {} bytes", bytes.len()));
                }
                text.decode(bytes, *base, start..end).map(Cow::Owned)
            }
        }
    }

    /// The stream behind its first `n` bytes, which may have been encoded on their own.
    pub fn after(self, bytes: &[u8], n: u64) -> Stream {
        match self {
            Stream::Raw(start) => Stream::Raw(start.saturating_add(n)),
            Stream::Base64 { text, base, skip } => {
                let characters = 4 * n.div_ceil(3);
                // Padding shows that the first bytes were encoded apart from those behind them.
                if n.is_multiple_of(3) || text.pads(bytes, base + characters - 1) {
                    Stream::Base64 { base: base + characters, skip, text }
                } else {
                    Stream::Base64 { text, base, skip: skip + n }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_stretch_is_decoded_with_and_without_lines() {
        let data: Vec<u8> = (0..100_000u32).map(|i| (i.wrapping_mul(i) >> 3) as u8).collect();
        let plain = ENGINE.encode(&data);
        let lines: String =
            plain.as_bytes().chunks(76).map(|l| format!("\n {}", std::str::from_utf8(l).unwrap())).collect();
        for text in [&plain, &lines] {
            let bytes = text.as_bytes();
            let base64 = Base64Text::find(bytes, 0..bytes.len() as u64);
            for range in [0..0, 0..1, 1..5, 7..90_001, 99_999..100_000] {
                let part = &data[range.start as usize..range.end as usize];
                assert_eq!(base64.decode(bytes, 0, range).unwrap(), part);
            }
            assert!(base64.decode(bytes, 0, 99_999..100_001).is_err());
            assert!(base64.decode(bytes, 0, 1 << 40..(1 << 40) + 2).is_err());
        }
    }
}
