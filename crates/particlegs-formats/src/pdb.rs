//! PDB files, plain or compressed: records of fixed columns, models as frames:
//! <https://www.wwpdb.org/documentation/file-format-content/format33/v3.3.html>.

use crate::atoms::cell_of;
use crate::format::FileHead;
use crate::gro::{MOST_NUMBERS, moment};
use crate::single_file::{named, only};
use crate::text::content::TextContent;
use crate::text::lines::{LineReader, of_block};
use crate::text::parse::{RowRule, TableLayout, itself};
use crate::text::snapshot::{TableColumns, TextSnapshot, header_number, kinds};
use crate::text::split::{FixedColumns, Separator, number};
use crate::text::table::{FrameScan, TableBuilder, TextFrame, TextTable, scan};
use crate::topology::elements::substance;
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
mod tests {
    use super::*;
    use crate::testing::{fault, fixture, gzip, open_bytes, read, vectors};

    const TWO: &str = "REMARK made by hand\nCRYST1   20.000   30.000   40.000  90.00  90.00  90.00 P 1           1\n\
    MODEL        1\nATOM      1  OW  SOL     1       1.000   2.000   3.000\nTER\nHETATM    2  C1  LIG     2      -4.000   5.000   6.500\nENDMDL\n\
    MODEL        2\nATOM      1  OW  SOL     1       1.500   2.000   3.000\nHETATM    2  C1  LIG     2      -4.000   5.000   7.500\nENDMDL\nEND\n";

    #[test]
    fn models_are_frames_and_elements_or_residues_species() {
        let snapshot = fixture("fixtures/mdanalysis.pdb", Some(1));
        let d = snapshot.description();
        assert_eq!((d.frames.unwrap().count, d.meta.units.length_text()), (2, Some("Angstrom")));
        let kinds: Vec<_> = d.species.iter().map(|s| (&s.name[..], s.count)).collect();
        assert_eq!(kinds, [("O", 20), ("H", 20), ("NA", 10)]);
        assert_eq!(vectors(&*snapshot, 2, "id,id,id")[0], [41.0; 3]);
        for content in [TWO.as_bytes().to_vec(), gzip(TWO.as_bytes())] {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("two.pdb");
            std::fs::write(&path, content).unwrap();
            for (frame, z) in [(Some(0), 6.5), (None, 7.5)] {
                let snapshot = Choice { frame, ..Choice::default() }.open(std::slice::from_ref(&path)).unwrap();
                let d = snapshot.description();
                assert_eq!(d.meta.cell.unwrap().lengths(), Some([20.0, 30.0, 40.0]));
                assert_eq!(d.species.iter().map(|s| &s.name[..]).collect::<Vec<_>>(), ["water", "LIG"]);
                assert_eq!(read(&*snapshot, 1, &Choice::default()).unwrap().positions, [[-4.0, 5.0, z]]);
            }
        }
        let none = open_bytes("a.pdb", TWO.replace("20.000   30.000   40.000", " 1.000    1.000    1.000").as_bytes())
            .unwrap();
        assert!(none.description().meta.cell.is_none());
    }

    #[test]
    fn broken_files_are_refused() {
        let odd = fault(TWO.replace("20.000   30.000", "20.000   3x.000").as_bytes());
        assert!(odd.contains("line 2: CRYST1: `3x.000` is not a number"), "{odd}");
        let odd = fault(TWO.replace("   7.500", "        ").as_bytes());
        assert!(odd.contains("line 10 column 7 (`z`)"), "{odd}");
        let none = fault(b"HEADER    X\nREMARK nothing\nEND\n");
        assert!(none.contains("the file has no frames"), "{none}");
    }

    #[test]
    fn each_model_has_its_cell_wherever_that_stands() {
        let cell = |a: u32| format!("CRYST1{a:>9}   30.000   40.000  90.00  90.00  90.00 P 1           1\n");
        let atom = "ATOM      1  OW  SOL     1       1.000   2.000   3.000\n";
        let model = |n: u32, inside: &str| format!("MODEL        {n}\n{atom}{inside}ENDMDL\n");
        let [a, b, c] = [20, 21, 22].map(cell);
        let [one, two, three] = [1, 2, 3].map(|n| model(n, ""));
        let files = [
            // Behind each model, the last one behind all, before each, within each, one for all.
            (format!("{one}{a}{two}{b}{three}{c}END\n"), [Some(20.0), Some(21.0), Some(22.0)]),
            (format!("{one}{two}{three}{c}END\n"), [Some(22.0); 3]),
            (format!("{a}{one}{b}{two}{c}{three}END\n"), [Some(20.0), Some(21.0), Some(22.0)]),
            (format!("TITLE x\n{a}{one}TITLE y\n{b}{two}TITLE z\n{c}{three}"), [Some(20.0), Some(21.0), Some(22.0)]),
            (
                [(1, &a), (2, &b), (3, &c)].map(|(n, cell)| model(n, cell)).concat(),
                [Some(20.0), Some(21.0), Some(22.0)],
            ),
            (format!("{a}{one}{two}{three}"), [Some(20.0); 3]),
            // None of the first model: nothing stands behind the last.
            (format!("{one}{b}{two}{c}{three}END\n"), [None, Some(21.0), Some(22.0)]),
            (format!("{a}{atom}{b}{atom}{c}{atom}END\n"), [Some(20.0), Some(21.0), Some(22.0)]),
        ];
        for (text, cells) in files {
            let file = crate::testing::scratch(text.as_bytes());
            for (frame, cell) in cells.into_iter().enumerate() {
                for frame in [frame as i64, frame as i64 - 3] {
                    let snapshot =
                        Choice { frame: Some(frame), ..Choice::default() }.open(&[file.path().into()]).unwrap();
                    let length = snapshot.description().meta.cell.and_then(|c| c.lengths()).map(|l| l[0]);
                    assert_eq!(length, cell, "frame {frame} of\n{text}");
                }
            }
        }
    }
}
