//! Tables of text: columns between commas, semicolons, tabs or blanks, with a line of names or
//! without, comments behind `#`, plain or compressed.

mod catalogue;
mod centres;
mod guess;

pub use catalogue::Catalogue;

use crate::fields::is_id;
use crate::foreign::foreign_of;
use crate::format::FileHead;
use crate::single_file::named;
use crate::text::content::{TextContent, TextPosition};
use crate::text::lines::LineReader;
use crate::text::snapshot::{TableColumns, TextSnapshot, kinds};
use crate::text::table::TableBuilder;
use crate::{Choice, Description, Format, Snapshot, SpeciesField};
use guess::{ColumnName, Guess};
use particlegs_core::model::Units;
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotMeta;
use std::path::PathBuf;

pub const FORMAT: Format = Format { name: "csv", title: "Text table", detect, open };

fn detect(head: &FileHead) -> bool {
    Guess::new(&head.content, head.content.len() < 1 << 16).is_ok_and(|guess| guess.is_likely)
        && foreign_of(head).is_none()
}

fn open(paths: &[PathBuf], options: &Choice) -> Result<Box<dyn Snapshot>> {
    let [path] = paths else {
        return Err(Error::argument("name one text table at a time"));
    };
    if options.frame.is_some_and(|frame| ![0, -1].contains(&frame)) {
        return Err(Error::input(path, "a text table has only one frame"));
    }
    let content = TextContent::open(path)?;
    let mut lines = LineReader::open(&content, TextPosition::START, None)?;
    let first = lines.block()?.unwrap_or(&[]);
    // The guess sees as much as detection does, so that both agree.
    let whole = first.len() < 1 << 16;
    let guess = Guess::new(&first[..first.len().min(1 << 16)], whole).map_err(|message| Error::input(path, message))?;
    lines.pass(guess.rows_after, |_, _| Ok(()))?;
    let mut builder = TableBuilder::new(&content, guess.layout.clone(), None, lines.place());
    lines.pass(u64::MAX, |place, block| builder.add(place, block))?;
    let mut notes = Vec::new();
    if lines.ends_open() {
        notes.push("the last line has no newline: the file may be cut off there".into());
    }
    let table = builder.until(lines.place()).finish()?;
    let kinds = kinds(&table);
    let columns = columns(&guess, &kinds);
    let meta = meta(path, &columns);
    let description = Description { notes, ..Description::new(content.title(FORMAT.title), paths, meta) };
    Ok(Box::new(TextSnapshot::new(description, table, columns, "particles", "")))
}

fn columns(guess: &Guess, kinds: &[&'static str]) -> TableColumns {
    let names = &guess.names;
    let field = |((text, name), kind): ((&String, &ColumnName), &&str)| SpeciesField {
        name: text.clone(),
        // What is whole in the first rows need not be in all, but for numbers that name things.
        kind: if matches!(*kind, "i64" | "u64") && !is_id(text) { "f64" } else { *kind }.into(),
        components: 1,
        unit: name.unit.clone(),
    };
    let of_numbers: Vec<usize> = (0..names.len()).filter(|&c| kinds[c] != "text").collect();
    let positions = match (guess.named, &of_numbers[..]) {
        (true, _) => guess::positions(names),
        (false, _) => match of_numbers.get(guess.first_column..) {
            Some(&[x, y, z, ..]) => Some([x, y, z]),
            _ => None,
        },
    };
    let all = &guess.layout.columns;
    let mass = of_numbers.iter().find(|&&c| names[c].is_mass() && !positions.is_some_and(|p| p.contains(&c)));
    TableColumns {
        fields: all.iter().zip(names).zip(kinds).map(field).collect(),
        positions: positions.map_or(String::new(), |[x, y, z]| format!("{},{},{}", all[x], all[y], all[z])),
        mass: mass.filter(|_| guess.named).map(|&c| all[c].clone()),
    }
}

/// Units are known where the names of the columns state them, as in `x [kpc]`.
fn meta(path: &std::path::Path, columns: &TableColumns) -> SnapshotMeta {
    let unit_of = |name: &str| columns.fields.iter().find(|f| f.name == name)?.unit.clone();
    let lengths: Vec<Option<String>> = columns.positions.split(',').map(unit_of).collect();
    let same = lengths.iter().all(|unit| *unit == lengths[0]);
    SnapshotMeta {
        units: Units::new(
            lengths[0].as_deref().filter(|_| same),
            columns.mass.as_deref().and_then(unit_of).as_deref(),
            None,
        ),
        ..named(path)
    }
}

#[cfg(test)]
mod tests;
