//! PDB files, plain or compressed: records of fixed columns, models as frames:
//! <https://www.wwpdb.org/documentation/file-format-content/format33/v3.3.html>.

use crate::atoms::cell_of;
use crate::format::FileHead;
use crate::gro::{MOST_NUMBERS, moment};
use crate::residues::substance;
use crate::single_file::{named, only};
use crate::text::content::TextContent;
use crate::text::frames::{FrameScan, TextFrame, scan};
use crate::text::lines::{LineReader, of_block};
use crate::text::parse::{RowRule, TableLayout, itself};
use crate::text::snapshot::{TableColumns, TextSnapshot, header_number, kinds};
use crate::text::split::{FixedColumns, Separator, number};
use crate::text::table::{TableBuilder, TextTable};
use crate::topology::{AtomRow, Topology};
use crate::{Choice, Description, Format, Snapshot, SpeciesField, TextResult};
use particlegs_core::model::{Epoch, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotMeta;
use std::path::{Path, PathBuf};

pub const FORMAT: Format = Format { name: "pdb", title: "PDB file", detect, open };

/// Records of atoms.
const ATOMS: &[&[u8]] = &[b"ATOM  ", b"HETATM"];
/// Names of the columns that are read, and their bytes: positions, and what else there is of an atom.
const COLUMNS: [(&str, [u16; 2]); 7] = [
    ("element", [76, 78]),
    ("residue", [17, 21]),
    ("name", [12, 16]),
    ("number", [6, 11]),
    ("x", [30, 38]),
    ("y", [38, 46]),
    ("z", [46, 54]),
];

fn is_atom(line: &[u8]) -> bool {
    ATOMS.iter().any(|name| line.starts_with(name))
}

/// An atom with its position in the right columns; long entries begin with pages of remarks.
fn detect(head: &FileHead) -> bool {
    let is_number = |line: &[u8], at: usize| line.get(at..at + 8).is_some_and(|f| number(f.trim_ascii()).is_some());
    let is_placed = |line: &[u8]| is_atom(line) && [30, 38, 46].into_iter().all(|at| is_number(line, at));
    head.begins(&[b"HEADER    "]) && head.names(b"\nREMARK ", 1 << 14) || head.lines().any(is_placed)
}

#[derive(Clone, Default)]
struct PdbFrameHead {
    cell: Option<Cell>,
    /// Whether a cell stands before the atoms, of this model or one before.
    is_stated: bool,
    /// The cell behind the end of the model, if one stands there.
    behind: Option<Option<Cell>>,
    in_model: bool,
    moment: (Option<f64>, Option<i64>),
    has_elements: bool,
    /// Whether all atoms are one species.
    is_one: bool,
}

fn open(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let content = TextContent::open(path)?;
    let scan = scanned(&content, choice)?;
    let meta = SnapshotMeta {
        cell: scan.head.cell,
        units: Units::new(Some("Angstrom"), None, None),
        epoch: Epoch { time: scan.head.moment.0, ..scan.frames.epoch() },
        ..named(path)
    };
    let columns = columns(&scan.table);
    let description = Description {
        frames: Some(scan.frames),
        notes: scan.notes,
        ..Description::new(content.title(FORMAT.title), paths, meta)
    };
    let snapshot = TextSnapshot::new(description, scan.table, columns, "atoms", "");
    Ok(Box::new(snapshot.with_unwrapped(false, choice)?))
}

fn scanned(content: &TextContent, choice: &Choice) -> Result<FrameScan<PdbFrameHead>> {
    // What stands before the first model holds for all.
    let mut head = PdbFrameHead { is_one: choice.by_atoms(), ..PdbFrameHead::default() };
    let before = head.clone();
    let (mut leads, mut follows, mut next) = (true, false, None);
    let mut scan = scan(content, choice.frame, |lines, number, wanted| {
        if number == 0 {
            head = before.clone();
        }
        let text_frame = frame(content, lines, &mut head, number, wanted)?;
        if let Some(PdbFrameHead { is_stated, behind, .. }) = text_frame.as_ref().map(|f| &f.head) {
            leads = if number == 0 { *is_stated } else { leads };
            next = if wanted { *behind } else { next.or(*behind) };
            follows = behind.is_some();
        }
        Ok(text_frame)
    })?;
    // Cells belong to the model behind them, but where the first model has none and one stands behind the last.
    if !leads && follows {
        scan.head.cell = next.flatten();
    }
    Ok(scan)
}

/// The atoms of a model.
pub fn topology(path: &Path, choice: &Choice) -> Result<Topology> {
    let content = TextContent::open(path)?;
    let scan = scanned(&content, choice)?;
    let bytes = FixedColumns::new([COLUMNS[0].1, COLUMNS[1].1, COLUMNS[2].1, [22, 26]]);
    let mut topology = Topology::new(path);
    scan.table.for_each_row(|line| {
        let value = |column| bytes.value(line, column).unwrap_or_default();
        let [element, residue, name, number] = [0, 1, 2, 3].map(value);
        let residue_number = std::str::from_utf8(number).ok().and_then(|text| text.parse().ok());
        topology.species.push(if scan.head.has_elements { element } else { substance(residue) });
        topology.push(AtomRow { name, residue, residue_number, element, ..AtomRow::default() })
    })?;
    Ok(topology)
}

fn columns(table: &TextTable) -> TableColumns {
    let count: u64 = table.kinds.iter().map(|kind| kind.count).sum();
    // Beyond five digits programs count in several ways.
    let number = match kinds(table).get(3) {
        Some(&"i64") if count <= MOST_NUMBERS => SpeciesField::new("id", "i64", 1),
        _ => SpeciesField::new("number", "text", 1),
    };
    let text = |name| SpeciesField::new(name, "text", 1);
    let pos = SpeciesField { unit: Some("Angstrom".into()), ..SpeciesField::new("pos", "f64", 3) };
    let fields = vec![text("element"), text("residue"), text("name"), number, pos];
    TableColumns { fields, positions: "pos".into(), mass: None }
}

fn layout(has_elements: bool) -> TableLayout {
    TableLayout {
        separator: Separator::Fixed(FixedColumns::new(COLUMNS.map(|c| c.1))),
        columns: COLUMNS.iter().map(|c| c.0.into()).collect(),
        rows: RowRule::Records(ATOMS),
        comma: false,
        species: if has_elements { itself } else { substance },
    }
}

/// Reads the model that begins at the next line, or all atoms to the end.
fn frame<'c>(
    content: &'c TextContent,
    lines: &mut LineReader<'c>,
    head: &mut PdbFrameHead,
    number: u64,
    wanted: bool,
) -> Result<Option<TextFrame<'c, PdbFrameHead>>> {
    loop {
        let line_number = lines.place().line;
        let Some(line) = lines.peek()? else { return Ok(None) };
        if is_atom(line) {
            // The first atom decides for the model: species are elements, else by residues.
            head.has_elements = line.get(76..78).is_some_and(|element| !element.trim_ascii().is_empty());
            break;
        }
        if line.starts_with(b"CRYST1") {
            let cell = crystal(line);
            head.cell = cell.map_err(|message| {
                Error::input(content.path(), format!("frame {number}, line {line_number}: CRYST1: {message}"))
            })?;
            head.is_stated = true;
        } else if line.starts_with(b"MODEL ") {
            head.in_model = true;
        } else if line.starts_with(b"TITLE") {
            head.moment = moment(line);
        }
        lines.line()?;
    }
    let key = if head.has_elements { 0 } else { 1 };
    let mut rows = TableBuilder::new(content, layout(head.has_elements), (!head.is_one).then_some(key), lines.place());
    let mut end = lines.place();
    loop {
        let place = lines.place();
        let Some(block) = lines.block()? else { break };
        let (mut bytes, mut count, mut ended) = (0, 0, false);
        for (line, length) in of_block(block) {
            // `END` covers `ENDMDL`; in files without models a CRYST1 begins the next frame.
            ended = line.starts_with(b"END") || line.starts_with(b"MODEL ") || line.starts_with(b"CRYST1");
            if ended {
                break;
            }
            (bytes, count) = (bytes + length, count + 1);
        }
        // Blocks are cut at the end of the model, so that the next frame finds its own lines.
        if wanted && bytes > 0 {
            rows.add(place, &block[..bytes])?;
        }
        lines.consume(bytes, count);
        end = lines.place();
        if ended {
            break;
        }
    }
    let step = head.moment.1;
    let model = PdbFrameHead { behind: None, ..head.clone() };
    let head_with_cell = cell_behind(lines, head, model)?;
    Ok(Some(TextFrame { head: head_with_cell, rows: wanted.then(|| rows.until(end)), step }))
}

/// Reads on from the atoms of `model` to the title, the model or the atoms of the next; gives it with the cell that
/// stands there. One within the model is its own, one behind it may be that of the next.
fn cell_behind(lines: &mut LineReader<'_>, head: &mut PdbFrameHead, mut model: PdbFrameHead) -> Result<PdbFrameHead> {
    let is_next = |line: &[u8]| is_atom(line) || line.starts_with(b"MODEL ") || line.starts_with(b"TITLE");
    while let Some(line) = lines.peek()?.filter(|line| !is_next(line)) {
        if line.starts_with(b"CRYST1") {
            // What is wrong with it is said where the next model is read.
            let Ok(cell) = crystal(line) else { break };
            (head.cell, head.is_stated) = (cell, true);
            match head.in_model {
                true => (model.cell, model.is_stated) = (cell, true),
                false => model.behind = model.behind.or(Some(cell)),
            }
        }
        head.in_model &= !line.starts_with(b"END");
        lines.line()?;
    }
    Ok(model)
}

/// Three lengths and angles; a cube of 1 stands for none.
fn crystal(line: &[u8]) -> TextResult<Option<Cell>> {
    let bounds = [[6, 15], [15, 24], [24, 33], [33, 40], [40, 47], [47, 54]];
    let mut values = [0.0; 6];
    for (value, [start, end]) in values.iter_mut().zip(bounds) {
        let field = line.get(start..end.min(line.len())).unwrap_or_default();
        *value = header_number(field.trim_ascii())?;
    }
    let [a, b, c, alpha, beta, gamma] = values;
    Ok(if [a, b, c] == [1.0; 3] { None } else { cell_of([a, b, c], [alpha, beta, gamma]) })
}

#[cfg(test)]
mod tests;
