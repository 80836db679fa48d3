//! How a table is laid out, by its first lines.

use super::names::{Name, positions};
use crate::text::lines::without_end;
use crate::text::parse::Layout;
use crate::text::split::{Separator, is_blank, kind_of, number, tokens};

/// Lines of data that are looked at.
const LOOK: usize = 64;
/// Columns that a table may have.
const MOST_COLUMNS: usize = 1 << 12;

/// The layout of a table.
pub struct Guess {
    /// How its lines are taken apart.
    pub layout: Layout,
    /// What the columns are called.
    pub names: Vec<Name>,
    /// Lines before the first row.
    pub rows_after: u64,
    /// Do the columns have names of their own?
    pub named: bool,
    /// Does it look like a table of particles: most rows have as many columns, three of them numbers?
    pub is_likely: bool,
}

impl Guess {
    /// From the beginning of a file; `whole` where that is all of it.
    ///
    /// # Errors
    /// What keeps it from being a table of text.
    pub fn of(head: &[u8], whole: bool) -> Result<Guess, String> {
        // A last line that is cut off says nothing.
        let end = if whole { head.len() } else { memchr::memrchr(b'\n', head).map_or(0, |n| n + 1) };
        let head = &head[..end];
        check_text(head)?;
        let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
        let all: Vec<&[u8]> =
            head.strip_suffix(b"\n").unwrap_or(head).split(|&b| b == b'\n').map(without_end).collect();
        let comment = comment_of(&all);
        let data: Vec<usize> = (0..all.len()).filter(|&i| is_data(all[i], comment)).take(LOOK).collect();
        let &first = data.first().ok_or("there are no rows in it")?;
        let rows: Vec<&[u8]> = data.iter().map(|&i| all[i]).collect();
        let (separator, columns) = separator_of(&rows).ok_or("its lines are no rows of one number of columns")?;
        if columns > MOST_COLUMNS {
            return Err(format!("its rows have {columns} columns, more than {MOST_COLUMNS}"));
        }
        let has_header = is_header(rows[0], &rows[1..], separator);
        let names = if has_header {
            Some(names_of(rows[0], separator, columns))
        } else {
            let comments = all[..first].iter().rev();
            comments.filter_map(|line| commented_names(line, comment, separator, columns)).next()
        };
        let rows = if has_header { &rows[1..] } else { &rows[..] };
        let split: Vec<Vec<&[u8]>> = rows.iter().map(|row| tokens(row, separator)).collect();
        let fitting: Vec<&Vec<&[u8]>> = split.iter().filter(|row| row.len() == columns).collect();
        let is_text = |c: &usize| kind_of(fitting.iter().map(|row| row[*c])) == "text";
        let is_words = |c: &usize| is_text(c) && fitting.iter().any(|row| !row[*c].is_empty());
        let numbers = (0..columns).filter(|c| !is_text(c)).count();
        let words = (0..columns).filter(is_words).count();
        let named = names.is_some();
        let names = names.unwrap_or_else(|| (1..=columns).map(|c| format!("column{c}")).collect());
        let names: Vec<Name> = names.iter().map(|name| Name::of(name)).collect();
        let rows_after = (first + usize::from(has_header)) as u64;
        // Words in a table without names belong to some other format.
        let of_particles = if named { numbers >= 3 || positions(&names).is_some() } else { numbers >= 3 && words == 0 };
        let is_likely = 2 * fitting.len() > rows.len() && of_particles;
        let layout = Layout { separator, columns: unique(&names), comment: Some(comment) };
        Ok(Guess { layout, names, rows_after, named, is_likely })
    }
}

/// Text has no control characters but line ends, tabs and form feeds.
fn check_text(head: &[u8]) -> Result<(), String> {
    let line = |at: usize| 1 + head[..at].iter().filter(|&&b| b == b'\n').count();
    let control = |b: &u8| b.is_ascii_control() && !matches!(b, b'\n' | b'\r' | b'\t' | 0x0c);
    if let Some(at) = head.iter().position(control) {
        return Err(format!("line {} holds the byte {:#04x}: this is not text", line(at), head[at]));
    }
    match std::str::from_utf8(head) {
        Ok(_) => Ok(()),
        Err(e) => Err(format!("line {} is no UTF-8 text", line(e.valid_up_to()))),
    }
}

/// What comments begin with.
fn comment_of(lines: &[&[u8]]) -> u8 {
    let first = lines.iter().find_map(|line| line.iter().find(|b| !is_blank(**b)));
    if first == Some(&b'%') { b'%' } else { b'#' }
}

fn is_data(line: &[u8], comment: u8) -> bool {
    line.iter().find(|b| !is_blank(**b)).is_some_and(|&b| b != comment)
}

/// The separator by which the first rows have the same number of columns, three or more of them
/// numbers where there are data; what comes first in this list where several do.
fn separator_of(rows: &[&[u8]]) -> Option<(Separator, usize)> {
    let candidates = [b',', b';', b'\t'].map(Separator::Byte).into_iter().chain([Separator::Blanks]);
    let mut found: Option<(usize, Separator, usize)> = None;
    for separator in candidates {
        // The first row of numbers counts; a later one that differs is the reader's to refuse.
        let split: Vec<Vec<&[u8]>> = rows.iter().take(2).map(|row| tokens(row, separator)).collect();
        let numbers = |row: &Vec<&[u8]>| row.iter().filter(|v| number(v).is_some()).count();
        let best = split.iter().map(numbers).max().unwrap_or(0).min(3);
        let columns = split.iter().rev().find(|row| numbers(row) >= best).map_or(0, Vec::len);
        if columns >= 3 && found.as_ref().is_none_or(|(most, ..)| best > *most) {
            found = Some((best, separator, columns));
        }
    }
    found.map(|(_, separator, columns)| (separator, columns))
}

/// Names: a first line with a word where the rows below have numbers, or with words only.
fn is_header(first: &[u8], rows: &[&[u8]], separator: Separator) -> bool {
    let names = tokens(first, separator);
    match rows.first() {
        None => names.iter().all(|name| number(name).is_none()),
        Some(row) => {
            let values = tokens(row, separator);
            names.iter().zip(&values).any(|(name, value)| number(name).is_none() && number(value).is_some())
        }
    }
}

/// The names in a header; a column without one is called by its number.
fn names_of(line: &[u8], separator: Separator, columns: usize) -> Vec<String> {
    let mut names: Vec<String> =
        tokens(line, separator).iter().map(|n| String::from_utf8_lossy(n).into_owned()).collect();
    // A unit may stand behind them.
    names.resize(columns, String::new());
    for (c, name) in names.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
        *name = format!("column{}", c + 1);
    }
    names
}

/// The names in a comment such as `# x y z [Mpc/h]`.
fn commented_names(line: &[u8], comment: u8, separator: Separator, columns: usize) -> Option<Vec<String>> {
    let start = line.iter().position(|&b| b != comment && !is_blank(b))?;
    if !line[..start].contains(&comment) {
        return None;
    }
    for separator in [separator, Separator::Blanks] {
        let names = tokens(&line[start..], separator);
        let unit_follows = names.len() == columns + 1 && names[columns].starts_with(b"[");
        let words =
            names.iter().take(3).all(|name| !name.is_empty()) && names.iter().all(|name| number(name).is_none());
        if words && (names.len() == columns || unit_follows) {
            let unit = if unit_follows { String::from_utf8_lossy(names[columns]).into_owned() } else { String::new() };
            let names = names_of(&line[start..], separator, columns);
            return Some(names.iter().map(|name| format!("{name} {unit}").trim_end().to_string()).collect());
        }
    }
    None
}

/// Names that occur again get a number, so that each names one column.
fn unique(names: &[Name]) -> Vec<String> {
    let mut seen = std::collections::HashMap::new();
    let again = |name: &Name| {
        let count = seen.entry(name.text.clone()).and_modify(|n| *n += 1).or_insert(1);
        if *count == 1 { name.text.clone() } else { format!("{}.{count}", name.text) }
    };
    names.iter().map(again).collect()
}
