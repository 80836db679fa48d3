//! Names with numbers in them, in the order that people expect.

use std::path::Path;

/// Text and numbers in turn, the numbers as their digits without leading zeros: `snap_2` sorts before `snap_10`.
pub(crate) fn natural_key(path: &Path) -> Vec<(String, usize, String)> {
    let text = path.to_string_lossy();
    let mut parts = Vec::new();
    let mut rest = &*text;
    while !rest.is_empty() {
        let (words, tail) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let (digits, tail) = tail.split_at(tail.find(|c: char| !c.is_ascii_digit()).unwrap_or(tail.len()));
        let number = digits.trim_start_matches('0');
        parts.push((words.to_string(), number.len(), number.to_string()));
        rest = tail;
    }
    parts
}
