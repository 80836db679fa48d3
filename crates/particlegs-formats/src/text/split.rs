//! Splits a line into tokens, quoted or not, and numbers.

use std::borrow::Cow;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Separator {
    Blanks,
    /// One such byte; blanks around a value do not count.
    Byte(u8),
    /// None: each value has its own bytes of the line.
    Fixed(FixedColumns),
}

/// Bytes of a line that hold its values, as in files for punched cards; blanks around a value do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FixedColumns {
    bounds: [[u16; 2]; FixedColumns::MOST],
    count: usize,
}

impl FixedColumns {
    const MOST: usize = 16;

    /// Of bounds one after the other, at most 16: the first byte of each, and the one behind its last.
    pub fn new(bounds: impl IntoIterator<Item = [u16; 2]>) -> Self {
        let mut columns = FixedColumns::default();
        for (column_bounds, bounds) in columns.bounds.iter_mut().zip(bounds) {
            *column_bounds = bounds;
            columns.count += 1;
        }
        columns
    }

    /// The value in `column`; empty where the line does not go so far.
    pub fn value<'a>(&self, line: &'a [u8], column: usize) -> Option<&'a [u8]> {
        let [start, end] = self.bounds[..self.count].get(column)?.map(|byte| line.len().min(byte.into()));
        Some(line[start..end.max(start)].trim_ascii())
    }
}

pub fn is_blank(byte: u8) -> bool {
    byte == b' ' || byte == b'\t'
}

/// The first byte of a line that is neither blank nor the page's or the line's end.
pub fn first_byte(line: &[u8]) -> Option<u8> {
    line.iter().copied().find(|b| !is_blank(*b) && !matches!(b, b'\r' | 0x0c)).filter(|&b| b != b'\n')
}

/// The values of a line, quotes taken off.
pub fn tokens(line: &[u8], separator: Separator) -> Vec<&[u8]> {
    match separator {
        Separator::Blanks => blank_tokens(line),
        Separator::Byte(byte) => byte_tokens(line, byte),
        Separator::Fixed(columns) => (0..columns.count).filter_map(|c| columns.value(line, c)).collect(),
    }
}

fn blank_tokens(line: &[u8]) -> Vec<&[u8]> {
    let mut tokens = Vec::new();
    let mut rest = line.trim_ascii();
    while let Some(&first) = rest.first() {
        let closing = |quote| rest[1..].iter().position(|&b| b == quote).map(|n| n + 2);
        let quoted = if first == b'"' || first == b'\'' { closing(first) } else { None };
        let length = quoted.or_else(|| rest.iter().position(|&b| is_blank(b))).unwrap_or(rest.len());
        tokens.push(unquoted(&rest[..length]));
        rest = rest[length..].trim_ascii_start();
    }
    tokens
}

fn byte_tokens(line: &[u8], separator: u8) -> Vec<&[u8]> {
    let mut tokens = Vec::new();
    let (mut from, mut quoted) = (0, false);
    for (at, &byte) in line.iter().enumerate() {
        if byte == b'"' {
            quoted = !quoted;
        } else if byte == separator && !quoted {
            tokens.push(unquoted(line[from..at].trim_ascii()));
            from = at + 1;
        }
    }
    tokens.push(unquoted(line[from..].trim_ascii()));
    tokens
}

pub fn unquoted(token: &[u8]) -> &[u8] {
    match token {
        [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] => inner.trim_ascii(),
        _ => token,
    }
}

/// The number that `token` is, `nan` and `inf` among them, and Fortran's `1.5D+03`.
pub fn number(token: &[u8]) -> Option<f64> {
    if let Ok(value) = fast_float2::parse::<f64, _>(token) {
        return Some(value);
    }
    let at = token.iter().position(|b| matches!(b, b'd' | b'D'))?;
    let mut with_e = token.to_vec();
    with_e[at] = b'e';
    let digits = with_e.iter().all(|b| b.is_ascii_digit() || matches!(b, b'e' | b'.' | b'+' | b'-'));
    if digits { fast_float2::parse(&with_e).ok() } else { None }
}

/// The same where a comma stands for the decimal point, if `comma` says so.
pub fn number_with(token: &[u8], comma: bool) -> Option<f64> {
    match token.iter().position(|&b| b == b',') {
        Some(at) if comma && !token.contains(&b'.') => {
            let mut with_point = token.to_vec();
            with_point[at] = b'.';
            number(&with_point)
        }
        _ => number(token),
    }
}

/// A token as a message shows it: short, and without control characters.
pub fn shown(token: &[u8]) -> String {
    const LONGEST: usize = 24;
    let text: Cow<'_, str> = String::from_utf8_lossy(&token[..token.len().min(4 * LONGEST)]);
    let short: String = text.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if text.chars().count() > LONGEST || token.len() > 4 * LONGEST {
        format!("`{short}...`")
    } else {
        format!("`{short}`")
    }
}

/// The kind of a column's values, as far as those seen tell: `i64`, `u64` where one is too large for that, `f64`, or
/// `text` where most of them are no numbers. A broken row among good ones is the reader's to refuse.
/// `comma` as in [`number_with`].
pub fn kind_of<'a>(values: impl Iterator<Item = &'a [u8]>, comma: bool) -> &'static str {
    let (mut all, mut words, mut signed, mut unsigned) = (0, 0, true, true);
    for value in values {
        all += 1;
        match number_with(value, comma) {
            None => words += 1,
            Some(_) => {
                let text = std::str::from_utf8(value).unwrap_or("");
                signed &= text.parse::<i64>().is_ok();
                unsigned &= text.parse::<u64>().is_ok();
            }
        }
    }
    match words {
        _ if 2 * words > all => "text",
        _ if signed && words < all => "i64",
        _ if unsigned && words < all => "u64",
        _ => "f64",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(line: &str, separator: Separator) -> Vec<String> {
        tokens(line.as_bytes(), separator).iter().map(|t| String::from_utf8_lossy(t).into_owned()).collect()
    }

    #[test]
    fn lines_are_split() {
        assert_eq!(split("  1\t 2 'a b' \"c\"", Separator::Blanks), ["1", "2", "a b", "c"]);
        assert_eq!(split("1, 2 ,\"a, b\",", Separator::Byte(b',')), ["1", "2", "a, b", ""]);
        assert_eq!(split("\"", Separator::Blanks), ["\""]);
        assert_eq!(split("", Separator::Blanks), [""; 0]);
    }

    #[test]
    fn numbers_in_all_spellings() {
        for (text, value) in [("1", 1.0), ("-2.5e3", -2500.0), ("+.5", 0.5), ("1.5D+03", 1500.0), ("1d2", 100.0)] {
            assert_eq!(number(text.as_bytes()), Some(value), "{text}");
        }
        assert!(number(b"NaN").unwrap().is_nan());
        assert_eq!(number(b"-inf"), Some(f64::NEG_INFINITY));
        assert_eq!(number(b"1e400"), Some(f64::INFINITY));
        for text in ["", "abc", "1.5x", "1,5", "0x10", "infd", "--1", "1 2", "."] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
    }
}
