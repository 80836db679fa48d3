//! Numbers as text between blanks, read from any place: where every so many-th begins is kept.

use crate::numbers::NumberType;
use std::ops::Range;

/// Numbers from one kept place to the next.
const STEP: u64 = 16_384;
const MOST_DIGITS: usize = 400;

pub struct Ascii {
    /// First byte of every [`STEP`]-th number.
    starts: Vec<u64>,
    count: u64,
    /// Byte behind the last.
    end: u64,
}

/// The next word of `bytes` at or after `at`.
pub fn word(bytes: &[u8], at: usize) -> Option<Range<usize>> {
    let start = at + bytes.get(at..)?.iter().position(|b| !b.is_ascii_whitespace())?;
    let length = bytes[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(bytes.len() - start);
    Some(start..start + length)
}

/// Text of a file as it may stand in a line of a message.
pub fn shown(text: &str) -> String {
    const MOST: usize = 60;
    let cut = text.chars().nth(MOST).map_or("", |_| "...");
    text.chars().take(MOST).map(|c| if c.is_control() { '?' } else { c }).collect::<String>() + cut
}

impl Ascii {
    /// Finds `count` words in `bytes` from byte `start`.
    pub fn find(bytes: &[u8], start: u64, count: u64) -> Result<Ascii, String> {
        let missing = || format!("expected {count} numbers from byte {start} on, but there are fewer");
        let text = usize::try_from(start).ok().and_then(|s| bytes.get(s..)).ok_or_else(missing)?;
        // Each but the last needs a byte and a blank.
        if count > (text.len() as u64).div_ceil(2) {
            return Err(missing());
        }
        let mut starts = Vec::with_capacity((count / STEP) as usize + 1);
        let (mut word_index, mut at) = (0, 0);
        while word_index < count {
            let word = word(text, at).ok_or_else(missing)?;
            if word_index % STEP == 0 {
                starts.push(start + word.start as u64);
            }
            at = word.end;
            word_index += 1;
        }
        Ok(Ascii { starts, count, end: start + at as u64 })
    }

    pub fn end(&self) -> u64 {
        self.end
    }

    /// Appends numbers `range`. Those of f32 are rounded once, from the decimal.
    pub fn append(&self, bytes: &[u8], range: Range<u64>, kind: NumberType, out: &mut Vec<f64>) -> Result<(), String> {
        if range.end > self.count {
            return Err("too few numbers".into());
        }
        if range.is_empty() {
            return Ok(());
        }
        let bytes = &bytes[..self.end as usize];
        // From the kept place before, over the numbers between.
        let mut at = self.starts[(range.start / STEP) as usize] as usize;
        for i in range.start - range.start % STEP..range.end {
            let word = word(bytes, at).ok_or("the file has fewer numbers than before")?;
            at = word.end;
            if i >= range.start {
                let text = &bytes[word.clone()];
                let value = parse(text, kind);
                out.push(value.ok_or_else(|| {
                    let text = shown(&String::from_utf8_lossy(&text[..text.len().min(400)]));
                    format!("`{text}` at byte {} is not a number", word.start)
                })?);
            }
        }
        Ok(())
    }
}

/// The bits of a whole number, of either sign.
pub fn whole_bits(text: &str) -> Option<u64> {
    text.parse().or_else(|_| text.parse::<i64>().map(|v| v as u64)).ok()
}

fn parse(text: &[u8], kind: NumberType) -> Option<f64> {
    // A word of a damaged file may be as long as the file.
    let text = std::str::from_utf8(text.get(..MOST_DIGITS.min(text.len()))?).ok()?;
    match kind {
        NumberType::F32 => text.parse::<f32>().ok().map(f64::from),
        NumberType::B64 => whole_bits(text).map(f64::from_bits),
        _ => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_found_and_read_from_any_place() {
        let n = 3 * STEP + 5;
        let text: String = (0..n).map(|i| format!(" {i}{}", if i % 7 == 0 { "\n" } else { "" })).collect();
        let numbers = Ascii::find(text.as_bytes(), 0, n).unwrap();
        assert_eq!(numbers.end(), text.trim_end().len() as u64);
        for start in [0, 1, STEP - 1, STEP, 2 * STEP + 7] {
            let mut out = Vec::new();
            numbers.append(text.as_bytes(), start..start + 9, NumberType::F64, &mut out).unwrap();
            assert_eq!(out, (start..start + 9).map(|i| i as f64).collect::<Vec<_>>());
        }
        assert!(Ascii::find(text.as_bytes(), 0, n + 1).is_err());
        assert!(Ascii::find(text.as_bytes(), 0, u64::MAX).is_err());
        assert!(Ascii::find(b"", 7, 1).is_err());
    }

    #[test]
    fn words_that_are_no_numbers_are_named() {
        let numbers = Ascii::find(b"1 2,5 3", 0, 3).unwrap();
        let error = numbers.append(b"1 2,5 3", 0..3, NumberType::F32, &mut Vec::new()).unwrap_err();
        assert_eq!(error, "`2,5` at byte 2 is not a number");
    }
}
