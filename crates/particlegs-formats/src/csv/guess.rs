//! The layout of a table, guessed by its first lines, and what the names of its columns say: positions, masses, units.

use crate::text::lines::without_end;
use crate::text::parse::{RowRule, TableLayout, itself};
use crate::text::split::{Separator, first_byte, is_blank, kind_of, number, number_with, tokens, unquoted};

/// Lines of data that are looked at.
const LOOK: usize = 64;
const MOST_COLUMNS: usize = 1 << 12;

pub struct Guess {
    pub layout: TableLayout,
    pub names: Vec<ColumnName>,
    pub rows_after: u64,
    /// Whether the columns have names of their own.
    pub named: bool,
    /// Of columns without names, the first that may be a position, behind an index.
    pub first_column: usize,
    /// Lines of comments before the first row.
    pub remarks: Vec<String>,
    /// Whether it looks like a table of particles: most rows have as many columns, three of them numbers.
    pub is_likely: bool,
}

impl Guess {
    /// From the beginning of a file; `whole` where that is all of it.
    pub fn new(head: &[u8], whole: bool) -> Result<Guess, String> {
        // A last line that is cut off says nothing.
        let end = if whole { head.len() } else { memchr::memrchr(b'\n', head).map_or(0, |n| n + 1) };
        let head = &head[..end];
        check_text(head)?;
        // Spreadsheets begin UTF-8 with a byte order mark.
        let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
        let all: Vec<&[u8]> =
            head.strip_suffix(b"\n").unwrap_or(head).split(|&b| b == b'\n').map(without_end).collect();
        let stated = separator_stated(all[0]);
        let begin = usize::from(stated.is_some());
        let comment = comment_of(&all[begin..]);
        let data: Vec<usize> = (begin..all.len()).filter(|&i| is_data(all[i], comment)).take(LOOK).collect();
        let &first = data.first().ok_or("there are no rows")?;
        let rows: Vec<&[u8]> = data.iter().map(|&i| all[i]).collect();
        let (separator, columns) = separator_of(&rows, stated).ok_or("rows have different numbers of columns")?;
        if columns > MOST_COLUMNS {
            return Err(format!("rows have {columns} columns; at most {MOST_COLUMNS} are supported"));
        }
        let split: Vec<Vec<&[u8]>> = rows.iter().map(|row| tokens(row, separator)).collect();
        // Decimal commas come first: names are told from numbers by them.
        let comma = has_decimal_commas(&split);
        let above = header_rows(&split, comma);
        let numbered = above == 1 && is_counted(&split);
        let comments = &all[begin..first];
        let names = match above {
            0 => commented_names(comments, comment, separator, columns),
            _ => Some(names_of(rows[0], separator, columns)),
        };
        // Rows of other lengths say nothing about the columns.
        let fitting: Vec<&Vec<&[u8]>> = split[above..].iter().filter(|row| row.len() == columns).collect();
        let is_text = |c: &usize| kind_of(fitting.iter().map(|row| row[*c]), comma) == "text";
        let is_words = |c: &usize| is_text(c) && fitting.iter().any(|row| !row[*c].is_empty());
        let numbers = (0..columns).filter(|c| !is_text(c)).count();
        let words = (0..columns).filter(is_words).count();
        let named = names.is_some() && !numbered;
        let names = names.unwrap_or_else(|| (1..=columns).map(|c| format!("column{c}")).collect());
        let mut names: Vec<ColumnName> = unnumbered(names).iter().map(|name| ColumnName::parse(name)).collect();
        if above == 2 {
            units_below(&mut names, &split[1]);
        }
        let rows_after = data.get(above).map_or(all.len(), |&at| at) as u64;
        // Words in a table without names belong to some other format.
        let of_particles = if named { numbers >= 3 || positions(&names).is_some() } else { numbers >= 3 && words == 0 };
        let is_likely = 2 * fitting.len() > split.len() - above && of_particles;
        let layout = TableLayout {
            separator,
            columns: unique(&names),
            rows: RowRule::Uncommented(comment),
            comma,
            species: itself,
        };
        let first_column = usize::from(numbered && split[0][0].is_empty());
        // Also those between names and rows.
        let remarks = all[begin..rows_after as usize].iter().filter(|line| !is_data(line, comment));
        let remarks = remarks.map(|line| String::from_utf8_lossy(line).into_owned()).collect();
        Ok(Guess { layout, names, rows_after, named, first_column, remarks, is_likely })
    }
}

/// Text has no control characters but line ends, tabs and form feeds.
fn check_text(head: &[u8]) -> Result<(), String> {
    let line = |at: usize| 1 + head[..at].iter().filter(|&&b| b == b'\n').count();
    let control = |b: &u8| b.is_ascii_control() && !matches!(b, b'\n' | b'\r' | b'\t' | 0x0c);
    if let Some(at) = head.iter().position(control) {
        return Err(format!("line {} has the byte {:#04x}: this is not a text file", line(at), head[at]));
    }
    match std::str::from_utf8(head) {
        Ok(_) => Ok(()),
        Err(e) => Err(format!("line {} is not UTF-8 text", line(e.valid_up_to()))),
    }
}

fn comment_of(lines: &[&[u8]]) -> u8 {
    if lines.iter().find_map(|line| first_byte(line)) == Some(b'%') { b'%' } else { b'#' }
}

fn is_data(line: &[u8], comment: u8) -> bool {
    first_byte(line).is_some_and(|b| b != comment)
}

/// The separator that a spreadsheet states in a line of its own: `sep=;`.
fn separator_stated(line: &[u8]) -> Option<Separator> {
    match unquoted(line).strip_prefix(b"sep=")? {
        [separator] => Some(Separator::Byte(*separator)),
        _ => None,
    }
}

/// The separator by which the first rows have the same number of columns, three or more of them
/// numbers where there are data; what comes first in this list where several do.
fn separator_of(rows: &[&[u8]], stated: Option<Separator>) -> Option<(Separator, usize)> {
    let candidates = [b',', b';', b'\t'].map(Separator::Byte).into_iter().chain([Separator::Blanks]);
    let mut best_separator: Option<(usize, Separator, usize)> = None;
    for separator in stated.map_or(candidates.collect::<Vec<_>>(), |one| vec![one]) {
        let split: Vec<Vec<&[u8]>> = rows.iter().take(3).map(|row| tokens(row, separator)).collect();
        let numbers = |row: &Vec<&[u8]>| row.iter().filter(|v| number_with(v, true).is_some()).count();
        // The first row of numbers counts, below names and perhaps units; a later one that differs is the reader's to
        // refuse.
        let units = matches!(&split[..], [_, units, row] if units.len() == row.len() && numbers(units) < 3);
        let looked_at = if units { 3 } else { 2 };
        let split = &split[..split.len().min(looked_at)];
        // Three numbers make a table of positions; more of them do not make a separator more likely.
        let best = split.iter().map(numbers).max().unwrap_or(0).min(3);
        let columns = split.iter().rev().find(|row| numbers(row) >= best).map_or(0, Vec::len);
        if columns >= 3 && best_separator.as_ref().is_none_or(|(most, ..)| best > *most) {
            best_separator = Some((best, separator, columns));
        }
    }
    best_separator.map(|(_, separator, columns)| (separator, columns))
}

/// Whether there are numbers with a decimal comma, and none with a point.
fn has_decimal_commas(rows: &[Vec<&[u8]>]) -> bool {
    let values = || rows.iter().flatten();
    let comma = values().any(|v| number(v).is_none() && number_with(v, true).is_some());
    comma && !values().any(|v| v.contains(&b'.') && number(v).is_some())
}

/// Rows above the first row of numbers: 1 of names (words, or the numbers of columns), or 2 where units stand below them.
fn header_rows(rows: &[Vec<&[u8]>], comma: bool) -> usize {
    let is_number = |v: &[u8]| number_with(v, comma).is_some();
    let names = |row: &[&[u8]], below: &[&[u8]]| row.iter().zip(below).any(|(n, v)| !is_number(n) && is_number(v));
    match rows {
        [] => 0,
        [only] => usize::from(only.iter().all(|name| !is_number(name))),
        // A unit has no number, but for a 1.
        [first, units, row, ..]
            if names(first, row) && names(units, row) && units.iter().all(|u| !is_number(u) || *u == b"1") =>
        {
            2
        }
        [first, row, ..] => usize::from(names(first, row) || is_counted(rows)),
    }
}

/// Whether the first row is 0, 1, 2 ..., perhaps behind an index without a name, above rows of fractions. Tables whose
/// columns have no names begin so.
fn is_counted(rows: &[Vec<&[u8]>]) -> bool {
    let [first, rows @ ..] = rows else { return false };
    let from = usize::from(first[0].is_empty());
    let counted = first[from..].iter().enumerate().all(|(i, name)| *name == i.to_string().as_bytes());
    let fraction =
        |v: &&[u8]| v.iter().any(|b| matches!(b, b'.' | b',' | b'e' | b'E')) && number_with(v, true).is_some();
    counted && first.len() >= from + 3 && rows.iter().flatten().any(fraction)
}

/// Names without the number of their column behind them, as in `Xc(6)`, where they differ without it.
fn unnumbered(names: Vec<String>) -> Vec<String> {
    let short = |name: &String| {
        let (stem, number) = name.strip_suffix(')')?.rsplit_once('(')?;
        (!stem.is_empty() && number.parse::<u16>().is_ok()).then(|| stem.to_string())
    };
    let all: Vec<String> = names.iter().map(|name| short(name).unwrap_or_else(|| name.clone())).collect();
    let mut seen = std::collections::HashSet::new();
    if all.iter().all(|name| seen.insert(name)) { all } else { names }
}

/// Units from the row below the names.
fn units_below(names: &mut [ColumnName], units: &[&[u8]]) {
    for (name, unit) in names.iter_mut().zip(units) {
        let text = String::from_utf8_lossy(unit);
        let text = text.trim_matches(['[', ']', '(', ')', ' ']);
        if name.unit.is_none() && !["", "-", "1"].contains(&text) {
            name.unit = Some(text.to_string());
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

/// The names in one of the comments above the rows, such as `# x y z [Mpc/h]`: the nearest that names positions, else
/// the nearest.
fn commented_names(comments: &[&[u8]], comment: u8, separator: Separator, columns: usize) -> Option<Vec<String>> {
    let names = |line: &&[u8]| names_in_comment(line, comment, separator, columns);
    let all: Vec<Vec<String>> = comments.iter().rev().filter_map(names).collect();
    let places = |names: &Vec<String>| {
        let names: Vec<ColumnName> = unnumbered(names.clone()).iter().map(|name| ColumnName::parse(name)).collect();
        positions(&names).is_some()
    };
    let best = all.iter().position(places).unwrap_or(0);
    all.into_iter().nth(best)
}

fn names_in_comment(line: &[u8], comment: u8, separator: Separator, columns: usize) -> Option<Vec<String>> {
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
fn unique(names: &[ColumnName]) -> Vec<String> {
    let mut seen = std::collections::HashMap::new();
    let again = |name: &ColumnName| {
        let count = seen.entry(name.text.clone()).and_modify(|n| *n += 1).or_insert(1);
        if *count == 1 { name.text.clone() } else { format!("{}.{count}", name.text) }
    };
    names.iter().map(again).collect()
}

/// A column name and its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnName {
    /// As the file has it, without the unit.
    pub text: String,
    /// Lower case, letters and digits alone, without the unit.
    pub stem: String,
    pub unit: Option<String>,
}

/// Names of positions before their axis; the axis may stand alone, too.
const POSITIONS: &str = "p pos position positions point points coord coords coordinate coordinates center";
/// The same behind the axis, as in `x_pos`.
const BEHIND: [&str; 9] = ["pos", "position", "coord", "coordinate", "center", "centre", "com", "cm", "c"];

impl ColumnName {
    pub fn parse(name: &str) -> ColumnName {
        let open = name.find(['[', '(']);
        let (stem, rest) = open.map_or((name, ""), |at| name.split_at(at));
        let inner = match rest.as_bytes() {
            [b'[', .., b']'] | [b'(', .., b')'] => rest[1..rest.len() - 1].trim(),
            _ => "",
        };
        // `pos[0]` numbers a component, `x [kpc]` names a unit.
        let counts = inner.parse::<u32>().is_ok();
        let unit = (!inner.is_empty() && !counts && !stem.trim().is_empty()).then(|| inner.to_string());
        let text = if unit.is_some() { stem.trim() } else { name }.to_string();
        let stem = text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
        ColumnName { text, stem, unit }
    }

    pub fn is_mass(&self) -> bool {
        ["mass", "masses", "particlemass", "weight", "weights"].contains(&&self.stem[..])
    }
}

/// The columns x, y, z: plain ones first, else the first that are called so.
pub fn positions(names: &[ColumnName]) -> Option<[usize; 3]> {
    let find = |stem: &str| names.iter().position(|name| name.stem == stem);
    let triple = |axes: [&str; 3], join: &dyn Fn(&str) -> String| {
        let [x, y, z] = axes.map(|axis| find(&join(axis)));
        Some([x?, y?, z?])
    };
    const LETTERS: [&str; 3] = ["x", "y", "z"];
    for word in std::iter::once("").chain(POSITIONS.split(' ')) {
        // Digits alone name columns by their place: they are no axes.
        let digits = (!word.is_empty()).then_some(["0", "1", "2"]);
        for axes in [Some(LETTERS), digits].into_iter().flatten() {
            if let Some(axes_columns) = triple(axes, &|axis| format!("{word}{axis}")) {
                return Some(axes_columns);
            }
        }
    }
    BEHIND.iter().find_map(|word| triple(LETTERS, &|axis| format!("{axis}{word}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_taken_apart() {
        let apart = |name| {
            let ColumnName { text, stem, unit } = ColumnName::parse(name);
            (text, stem, unit.unwrap_or_default())
        };
        assert_eq!(apart("Mass [Msun/h]"), ("Mass".into(), "mass".into(), "Msun/h".into()));
        assert_eq!(apart("Points:0"), ("Points:0".into(), "points0".into(), String::new()));
        assert_eq!(apart("pos[2]"), ("pos[2]".into(), "pos2".into(), String::new()));
        assert_eq!(apart("X (kpc)"), ("X".into(), "x".into(), "kpc".into()));
        assert_eq!(apart("[x]").2, "");
    }

    #[test]
    fn positions_are_found_by_their_names() {
        let find = |names: &[&str]| {
            let names: Vec<ColumnName> = names.iter().map(|n| ColumnName::parse(n)).collect();
            positions(&names)
        };
        assert_eq!(find(&["id", "z", "Y", "x"]), Some([3, 2, 1]));
        assert_eq!(find(&["Points_0", "Points_1", "Points_2"]), Some([0, 1, 2]));
        assert_eq!(find(&["px", "py", "pz", "x", "y", "z"]), Some([3, 4, 5]));
        assert_eq!(find(&["vx", "vy", "vz", "Coordinates:0", "Coordinates:1", "Coordinates:2"]), Some([3, 4, 5]));
        assert_eq!(find(&["x_pos", "y_pos", "z_pos"]), Some([0, 1, 2]));
        assert_eq!(find(&["vx", "vy", "vz"]), None);
        assert_eq!(find(&["0", "1", "2"]), None);
    }
}
