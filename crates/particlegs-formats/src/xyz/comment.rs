//! The comment of an extended XYZ frame: `key=value`, values quoted where they hold blanks.

use super::MOST_COLUMNS;
use crate::Field;
use crate::text::snapshot::header_number;
use crate::text::split::{Separator, shown, tokens};
use particlegs::space::Cell;

/// What a comment says.
#[derive(Debug, Default)]
pub struct Comment {
    /// `Lattice`, `Origin` and `pbc`.
    pub cell: Option<Cell>,
    /// `Properties`.
    pub fields: Option<Vec<Field>>,
    /// What a user should know.
    pub notes: Vec<String>,
}

impl Comment {
    /// # Errors
    /// What is wrong with a lattice or properties that are there.
    pub fn parse(line: &[u8]) -> Result<Comment, String> {
        let text = String::from_utf8_lossy(line);
        let mut comment = Comment::default();
        let (mut lattice, mut origin, mut periodic) = (None, [0.0; 3], None);
        for (key, value) in pairs(&text) {
            match &key.to_ascii_lowercase()[..] {
                "lattice" => lattice = Some(numbers::<9>(key, value)?),
                "origin" | "cell_origin" => origin = numbers::<3>(key, value)?,
                "pbc" => periodic = Some(flags(value)?),
                "properties" => comment.fields = Some(fields(value)?),
                _ => {}
            }
        }
        if let Some(n) = lattice {
            let vectors = [[n[0], n[1], n[2]], [n[3], n[4], n[5]], [n[6], n[7], n[8]]];
            if volume(vectors) == 0.0 {
                comment.notes.push("the lattice has no volume: taken as none".into());
            } else {
                // The format's own rule: a lattice repeats unless `pbc` says otherwise.
                comment.cell = Some(Cell { origin, vectors, periodic: periodic.unwrap_or([true; 3]) });
            }
        }
        Ok(comment)
    }

    /// Does it hold more than words?
    pub fn is_extended(&self) -> bool {
        self.fields.is_some() || self.cell.is_some()
    }
}

fn volume([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    cross[0] * c[0] + cross[1] * c[1] + cross[2] * c[2]
}

/// All `key=value` of a line; other words are passed over.
fn pairs(line: &str) -> Vec<(&str, &str)> {
    let mut pairs = Vec::new();
    let mut rest = line.trim_start();
    while !rest.is_empty() {
        let end = rest.find(|c: char| c == '=' || c.is_whitespace()).unwrap_or(rest.len());
        let (key, after) = rest.split_at(end);
        let Some(value) = after.strip_prefix('=') else {
            rest = after.trim_start();
            continue;
        };
        let closing = match value.chars().next() {
            Some('"') => Some('"'),
            Some('\'') => Some('\''),
            Some('{') => Some('}'),
            Some('[') => Some(']'),
            _ => None,
        };
        let inner = closing.and_then(|c| value[1..].split_once(c));
        let (value, after) = match inner {
            Some(quoted) => quoted,
            None => value.split_at(value.find(char::is_whitespace).unwrap_or(value.len())),
        };
        pairs.push((key, value));
        rest = after.trim_start_matches(']').trim_start();
    }
    pairs
}

fn numbers<const N: usize>(key: &str, value: &str) -> Result<[f64; N], String> {
    let parts = value.split(|c: char| c.is_whitespace() || matches!(c, ',' | '[' | ']')).filter(|p| !p.is_empty());
    let parts: Vec<&str> = parts.collect();
    if parts.len() != N {
        return Err(format!("`{key}` has {} numbers, not {N}", parts.len()));
    }
    let mut values = [0.0; N];
    for (value, part) in values.iter_mut().zip(parts) {
        *value = header_number(part.as_bytes()).map_err(|what| format!("`{key}`: {what}"))?;
    }
    Ok(values)
}

fn flags(value: &str) -> Result<[bool; 3], String> {
    let words = tokens(value.as_bytes(), Separator::Blanks);
    let flag = |word: &[u8]| match &word.to_ascii_lowercase()[..] {
        b"t" | b"true" | b"1" => Ok(true),
        b"f" | b"false" | b"0" => Ok(false),
        _ => Err(format!("`pbc`: {} is neither T nor F", shown(word))),
    };
    match &words[..] {
        [all] => flag(all).map(|f| [f; 3]),
        [x, y, z] => Ok([flag(x)?, flag(y)?, flag(z)?]),
        _ => Err(format!("`pbc` has {} values, not 3", words.len())),
    }
}

/// `name:kind:columns`, again and again.
fn fields(value: &str) -> Result<Vec<Field>, String> {
    let parts: Vec<&str> = value.split(':').collect();
    if !parts.len().is_multiple_of(3) {
        return Err("`Properties` is not a list of name:kind:columns".into());
    }
    let mut all = 0u32;
    let mut fields = Vec::new();
    for part in parts.chunks(3) {
        let kind = match part[1] {
            "R" => "f64",
            "I" => "i64",
            "S" => "text",
            "L" => "bool",
            other => return Err(format!("`Properties`: kind {} is none of S, R, I and L", shown(other.as_bytes()))),
        };
        let components = part[2].parse().ok().filter(|n| (1..=MOST_COLUMNS as u32).contains(n));
        let Some(components) = components else {
            return Err(format!("`Properties`: {} is not a number of columns", shown(part[2].as_bytes())));
        };
        all = all.saturating_add(components);
        fields.push(Field { name: part[0].into(), kind: kind.into(), components, unit: None });
    }
    if all > MOST_COLUMNS as u32 {
        return Err(format!("`Properties` names {all} columns, more than {MOST_COLUMNS}"));
    }
    Ok(fields)
}
