//! XYZ and extended XYZ files, plain or compressed: a number of atoms, a comment, a line an atom.
//! The comment may hold a lattice and the names of the columns:
//! <https://github.com/libAtoms/extxyz>.

mod comment;

use crate::format::FileHead;
use crate::single_file::named;
use crate::text::content::TextContent;
use crate::text::lines::{LineReader, without_end};
use crate::text::parse::{RowRule, TableLayout, itself};
use crate::text::snapshot::{TableColumns, TextSnapshot, kinds};
use crate::text::split::{Separator, number, shown, tokens};
use crate::text::table::{TableBuilder, TextFrame, TextTable, scan};
use crate::{Choice, Description, Format, Snapshot, SpeciesField};
use comment::{Comment, MOST_COLUMNS};
use particlegs_core::model::Epoch;
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotMeta;
use std::path::PathBuf;

pub const FORMAT: Format = Format { name: "xyz", title: "XYZ", detect, open };

/// A line with a number alone, a comment, and a line with three numbers, perhaps behind a symbol.
fn detect(head: &FileHead) -> bool {
    let mut lines = head.content.split(|&b| b == b'\n').map(without_end);
    let count = lines.next().and_then(count_of);
    let (_, atom) = (lines.next(), lines.next());
    match (count, atom) {
        (Some(0), _) => true,
        (Some(_), Some(atom)) => {
            let values = tokens(atom, Separator::Blanks);
            let numbers = values.iter().filter(|v| number(v).is_some()).count();
            (numbers >= 3 && values.len() <= 1 << 10) || head.content.windows(11).any(|w| w == b"Properties=")
        }
        _ => false,
    }
}

fn count_of(line: &[u8]) -> Option<u64> {
    std::str::from_utf8(line.trim_ascii()).ok()?.parse().ok()
}

/// A frame's content before its atoms.
struct XyzFrameHead {
    comment: Comment,
    fields: Vec<SpeciesField>,
}

fn open(paths: &[PathBuf], options: &Choice) -> Result<Box<dyn Snapshot>> {
    let [path] = paths else {
        return Err(Error::argument("name one XYZ file at a time"));
    };
    let content = TextContent::open(path)?;
    let scan = scan(&content, options.frame, |lines, number, wanted| frame(&content, lines, number, wanted))?;
    let mut notes = scan.notes;
    notes.extend(scan.head.comment.notes.clone());
    notes.push("the format states no unit of length (usually Angstrom)".into());
    let title = if scan.head.comment.is_extended() { "Extended XYZ" } else { FORMAT.title };
    let meta = SnapshotMeta {
        cell: scan.head.comment.cell,
        epoch: Epoch { time: scan.head.comment.time, ..scan.frames.epoch() },
        ..named(path)
    };
    let columns = columns(scan.head.fields, &scan.table);
    let description =
        Description { frames: Some(scan.frames), notes, ..Description::new(content.title(title), paths, meta) };
    let snapshot = TextSnapshot::new(description, scan.table, columns, "atoms", "");
    Ok(Box::new(snapshot.with_unwrapped(false, options)?))
}

/// The fields, with those that hold positions and masses. Kinds that the file does not state come from its rows.
fn columns(mut fields: Vec<SpeciesField>, table: &TextTable) -> TableColumns {
    let kinds = kinds(table);
    let mut column = 0;
    for field in &mut fields {
        let column_kinds = &kinds[column..column + field.components as usize];
        if field.kind.is_empty() {
            field.kind = if column_kinds.contains(&"text") { "text" } else { "f64" }.into();
        }
        column += column_kinds.len();
    }
    let has = |name: &str, components| fields.iter().any(|f| f.name == name && f.components == components);
    let positions = if has("pos", 3) { "pos" } else { "" };
    let mass = ["mass", "masses"].into_iter().find(|name| has(name, 1));
    TableColumns { positions: positions.into(), mass: mass.map(String::from), fields }
}

/// Reads the frame that begins at the next line.
fn frame<'c>(
    content: &'c TextContent,
    lines: &mut LineReader<'c>,
    number: u64,
    wanted: bool,
) -> Result<Option<TextFrame<'c, XyzFrameHead>>> {
    let error = |message: String| Error::input(content.path(), format!("frame {number}{message}"));
    let mut first = lines.line()?.map(<[u8]>::to_vec);
    while first.as_ref().is_some_and(|line| line.trim_ascii().is_empty()) {
        first = lines.line()?.map(<[u8]>::to_vec);
    }
    let Some(first) = first else { return Ok(None) };
    let at = lines.place().line - 1;
    let count =
        count_of(&first).ok_or_else(|| error(format!(", line {at}: {} is not a number of atoms", shown(&first))))?;
    let line = lines.line()?.map(<[u8]>::to_vec).ok_or_else(|| error(" ends after the number of atoms".into()))?;
    let comment = Comment::parse(&line).map_err(|message| error(format!(", line {}: {message}", at + 1)))?;
    let fields = match comment.fields.clone() {
        Some(fields) => fields,
        None if count == 0 => plain_fields(4),
        None => plain_fields(lines.peek()?.map_or(0, |line| tokens(line, Separator::Blanks).len())),
    };
    if fields.len() > MOST_COLUMNS {
        return Err(error(format!(" has more than {MOST_COLUMNS} columns")));
    }
    let mut rows = TableBuilder::new(content, layout(&fields), key_column(&fields), lines.place());
    let line_count = lines.pass(count, |place, block| if wanted { rows.add(place, block) } else { Ok(()) })?;
    if line_count < count {
        return Err(error(format!(" is cut off: it states {count} atoms, but only {line_count} lines follow")));
    }
    let rows = wanted.then(|| rows.until(lines.place()));
    let step = comment.step;
    Ok(Some(TextFrame { head: XyzFrameHead { comment, fields }, rows, step }))
}

fn layout(fields: &[SpeciesField]) -> TableLayout {
    let name = |f: &SpeciesField| (0..f.components).map(|_| f.name.clone()).collect::<Vec<_>>();
    TableLayout {
        separator: Separator::Blanks,
        columns: fields.iter().flat_map(name).collect(),
        rows: RowRule::All,
        comma: false,
        species: itself,
    }
}

/// The column of symbols or atomic numbers, wherever it stands.
fn key_column(fields: &[SpeciesField]) -> Option<usize> {
    if fields.first().is_some_and(|f| f.kind == "text" && f.components == 1) {
        return Some(0);
    }
    let names = ["species", "element", "symbol", "Z", "type"];
    let index = names.iter().find_map(|n| fields.iter().position(|f| f.name == *n && f.components == 1))?;
    Some(fields[..index].iter().map(|f| f.components as usize).sum())
}

/// Fields of a plain file with so many columns: symbol, position, and what else there may be.
fn plain_fields(columns: usize) -> Vec<SpeciesField> {
    let mut fields = Vec::new();
    if columns != 3 {
        fields.push(SpeciesField::new("species", "text", 1));
    }
    fields.push(SpeciesField::new("pos", "f64", 3));
    fields.extend((5..=columns).map(|c| SpeciesField::new(format!("column{c}"), "", 1)));
    fields
}

#[cfg(test)]
mod tests;
