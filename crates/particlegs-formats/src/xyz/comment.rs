//! The comment of an extended XYZ frame: `key=value`, values quoted where they hold blanks.

use crate::SpeciesField;
use crate::text::snapshot::header_number;
use crate::text::split::shown;
use particlegs_core::space::Cell;

/// Most columns that a line may have.
pub const MOST_COLUMNS: usize = 1 << 10;

/// The metadata in a comment.
#[derive(Debug, Default)]
pub struct Comment {
    /// `Lattice`, `Origin` and `pbc`.
    pub cell: Option<Cell>,
    /// `time`, and `step`.
    pub time: Option<f64>,
    /// The step.
    pub step: Option<i64>,
    /// `Properties`.
    pub fields: Option<Vec<SpeciesField>>,
    pub notes: Vec<String>,
}

impl Comment {
    pub fn parse(line: &[u8]) -> Result<Comment, String> {
        let text = String::from_utf8_lossy(line);
        let mut comment = Comment::default();
        let (mut lattice, mut origin, mut periodic) = (None, [0.0; 3], None);
        for (key, value) in pairs(&text) {
            match &key.to_ascii_lowercase()[..] {
                // Rows are vectors; three numbers are the diagonal.
                "lattice" if parts(value).len() == 3 => {
                    let [x, y, z] = numbers(key, value)?;
                    lattice = Some([x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]);
                }
                "lattice" => lattice = Some(numbers::<9>(key, value)?),
                "origin" | "cell_origin" => origin = numbers::<3>(key, value)?,
                "pbc" => periodic = Some(flags(value)?),
                "time" => comment.time = header_number(value.as_bytes()).ok(),
                "step" | "timestep" => comment.step = value.parse().ok(),
                "properties" => comment.fields = Some(fields(value)?),
                _ => {}
            }
        }
        if let Some(n) = lattice {
            let vectors = [[n[0], n[1], n[2]], [n[3], n[4], n[5]], [n[6], n[7], n[8]]];
            // The format's own rule: a lattice repeats unless `pbc` says otherwise.
            comment.cell = Cell::stated(origin, vectors, periodic.unwrap_or([true; 3]));
            if comment.cell.is_none() {
                comment.notes.push("the lattice has no volume and is ignored".into());
            }
        }
        Ok(comment)
    }

    pub fn is_extended(&self) -> bool {
        self.fields.is_some() || self.cell.is_some()
    }
}

/// All `key=value` of a line; other words are passed over.
fn pairs(line: &str) -> Vec<(&str, &str)> {
    let mut pairs = Vec::new();
    let mut rest = line.trim_start();
    while !rest.is_empty() {
        let end = rest.find(|c: char| c == '=' || c.is_whitespace()).unwrap_or(rest.len());
        let (key, after) = rest.split_at(end);
        let Some(value) = after.trim_start().strip_prefix('=').map(str::trim_start) else {
            rest = after.trim_start();
            continue;
        };
        let length = quoted(value).or_else(|| value.find(char::is_whitespace)).unwrap_or(value.len());
        let (value, after) = value.split_at(length);
        pairs.push((key, value.trim_matches(['"', '\'', '{', '}'])));
        rest = after.trim_start();
    }
    pairs
}

/// Bytes of a value between quotes or brackets, which may lie within each other.
fn quoted(value: &str) -> Option<usize> {
    let (open, close) = match value.chars().next()? {
        quote @ ('"' | '\'') => return value[1..].find(quote).map(|at| at + 2),
        '{' => ('{', '}'),
        '[' => ('[', ']'),
        _ => return None,
    };
    let mut depth = 0;
    let ends = |c: char| {
        depth += i32::from(c == open) - i32::from(c == close);
        depth == 0
    };
    value.find(ends).map(|at| at + 1)
}

/// The parts of an array, old style (blanks between) or new (`[1, 2]`, also of rows in brackets).
fn parts(value: &str) -> Vec<&str> {
    value.split(|c: char| c.is_whitespace() || matches!(c, ',' | '[' | ']')).filter(|p| !p.is_empty()).collect()
}

fn numbers<const N: usize>(key: &str, value: &str) -> Result<[f64; N], String> {
    if value.matches('[').count() != value.matches(']').count() {
        return Err(format!("`{key}`: {} lacks a bracket", shown(value.as_bytes())));
    }
    let parts = parts(value);
    if parts.len() != N {
        return Err(format!("`{key}` has {} numbers, not {N}", parts.len()));
    }
    let mut values = [0.0; N];
    for (value, part) in values.iter_mut().zip(parts) {
        *value = header_number(part.as_bytes()).map_err(|message| format!("`{key}`: {message}"))?;
    }
    Ok(values)
}

fn flags(value: &str) -> Result<[bool; 3], String> {
    let words = parts(value);
    let flag = |word: &str| match &word.to_ascii_lowercase()[..] {
        "t" | "true" | "1" => Ok(true),
        "f" | "false" | "0" => Ok(false),
        _ => Err(format!("`pbc`: {} is neither T nor F", shown(word.as_bytes()))),
    };
    match words[..] {
        [all] => flag(all).map(|f| [f; 3]),
        [x, y, z] => Ok([flag(x)?, flag(y)?, flag(z)?]),
        _ => Err(format!("`pbc` has {} values, not 3", words.len())),
    }
}

/// `name:kind:columns`, again and again.
fn fields(value: &str) -> Result<Vec<SpeciesField>, String> {
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
            other => return Err(format!("`Properties`: kind {} is not S, R, I or L", shown(other.as_bytes()))),
        };
        let components = part[2].parse().ok().filter(|n| (1..=MOST_COLUMNS as u32).contains(n));
        let Some(components) = components else {
            return Err(format!("`Properties`: {} is not a number of columns", shown(part[2].as_bytes())));
        };
        all = all.saturating_add(components);
        fields.push(SpeciesField::new(part[0], kind, components));
    }
    if all > MOST_COLUMNS as u32 {
        return Err(format!("`Properties` lists {all} columns; at most {MOST_COLUMNS} are supported"));
    }
    Ok(fields)
}
