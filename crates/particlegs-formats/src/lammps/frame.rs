//! One frame of a dump: sections that begin with `ITEM:`, the last of them with a line an atom, and its box in three
//! spellings: <https://docs.lammps.org/Howto_triclinic.html>.

use crate::TextResult;
use crate::text::content::TextContent;
use crate::text::lines::{LineReader, of_block};
use crate::text::parse::{RowRule, TableLayout, itself};
use crate::text::snapshot::header_number;
use crate::text::split::{Separator, shown, tokens};
use crate::text::table::{TableBuilder, TextFrame};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};

/// Most columns that an atom may have.
const MOST_COLUMNS: usize = 1 << 10;

/// A frame's content before its atoms.
#[derive(Default)]
pub struct LammpsFrameHead {
    step: Option<i64>,
    pub time: Option<f64>,
    count: Option<u64>,
    pub cell: LammpsBox,
    columns: Vec<String>,
}

impl LammpsFrameHead {
    /// The column that tells species apart.
    fn key(&self) -> Option<usize> {
        let find = |name| self.columns.iter().position(|c| c == name);
        find("type").or_else(|| find("element"))
    }

    /// The noun before a species' number or symbol.
    pub fn noun(&self) -> &'static str {
        if self.columns.iter().any(|c| c == "type") { "type " } else { "" }
    }
}

/// Reads the frame that begins at the next line. A style of units, which stands once a file, goes to
/// `units`.
pub fn next<'c>(
    content: &'c TextContent,
    lines: &mut LineReader<'c>,
    units: &mut Option<String>,
    number: u64,
    wanted: bool,
) -> Result<Option<TextFrame<'c, LammpsFrameHead>>> {
    let Some(head) = (Sections { content, lines, number }).read(units)? else { return Ok(None) };
    let (step, start) = (head.step, lines.place());
    let layout = TableLayout {
        separator: Separator::Blanks,
        columns: head.columns.clone(),
        rows: RowRule::All,
        comma: false,
        species: itself,
    };
    let mut builder = TableBuilder::new(content, layout, head.key(), start);
    let count = head.count.unwrap_or(0);
    let (mut atom_lines, mut left) = (0, count);
    while left > 0 {
        let mut comments = 0;
        let passed = lines.pass(left, |place, block| {
            let block_comments = comments_in(block);
            comments += block_comments;
            if block_comments > 0 {
                builder.has_comments(COMMENT);
            }
            if wanted { builder.add(place, block) } else { Ok(()) }
        })?;
        atom_lines += passed - comments;
        // Comments were passed as lines, but are no atoms: as many lines more are needed.
        left = if passed < left { 0 } else { comments };
    }
    if atom_lines < count {
        let message = format!("frame {number} is cut off: it states {count} atoms, but only {atom_lines} lines follow");
        return Err(Error::input(content.path(), message));
    }
    let end = lines.place();
    while lines.peek()?.is_some_and(is_comment) {
        lines.line()?;
    }
    if let Some(line) = lines.peek()?.filter(|line| !line.trim_ascii().is_empty() && !line.starts_with(b"ITEM:")) {
        let message = format!("line {} is {}, but frame {number} states only {count} atoms", end.line, shown(line));
        return Err(Error::input(content.path(), message));
    }
    Ok(Some(TextFrame { head, rows: wanted.then(|| builder.until(end)), step }))
}

/// Units of length, mass and time in a style of units: <https://docs.lammps.org/units.html>.
pub fn units_of(style: &str) -> [Option<&'static str>; 3] {
    match style {
        "real" => [Some("Angstrom"), Some("g/mol"), Some("fs")],
        "metal" => [Some("Angstrom"), Some("g/mol"), Some("ps")],
        "si" => [Some("m"), Some("kg"), Some("s")],
        "cgs" => [Some("cm"), Some("g"), Some("s")],
        "electron" => [Some("Bohr"), Some("amu"), Some("fs")],
        "micro" => [Some("um"), Some("pg"), Some("us")],
        "nano" => [Some("nm"), Some("ag"), Some("ns")],
        "lj" => [Some("sigma"), None, Some("tau")],
        _ => [None; 3],
    }
}

/// Edited dumps have comments, which LAMMPS itself does not write.
const COMMENT: u8 = b'#';

pub fn is_comment(line: &[u8]) -> bool {
    line.trim_ascii_start().first() == Some(&COMMENT)
}

fn comments_in(block: &[u8]) -> u64 {
    match memchr::memchr(COMMENT, block) {
        None => 0,
        Some(_) => of_block(block).filter(|(line, _)| is_comment(line)).count() as u64,
    }
}

struct Sections<'a, 'c> {
    content: &'a TextContent,
    lines: &'a mut LineReader<'c>,
    number: u64,
}

impl Sections<'_, '_> {
    fn error(&self, message: impl std::fmt::Display) -> Error {
        // The line that was read last.
        let line = self.lines.place().line.saturating_sub(1);
        Error::input(self.content.path(), format!("frame {}, line {line}: {message}", self.number))
    }

    fn line(&mut self) -> Result<Vec<u8>> {
        match self.lines.line()? {
            Some(line) => Ok(line.to_vec()),
            None => Err(self.error("the file is cut off here")),
        }
    }

    /// All sections up to the columns of the atoms; nothing at the end of the file.
    fn read(&mut self, units: &mut Option<String>) -> Result<Option<LammpsFrameHead>> {
        let mut head = LammpsFrameHead::default();
        let mut begun = false;
        let mut has_box = false;
        loop {
            let line = match self.lines.line()? {
                Some(line) => line.to_vec(),
                None if begun => return Err(self.error("the file is cut off here")),
                None => return Ok(None),
            };
            if (line.trim_ascii().is_empty() && !begun) || is_comment(&line) {
                continue;
            }
            begun = true;
            let text = String::from_utf8_lossy(&line);
            let words: Vec<&str> = text.split_ascii_whitespace().collect();
            match &words[..] {
                ["ITEM:", "TIMESTEP"] => head.step = Some(self.whole("a step")?),
                ["ITEM:", "NUMBER", "OF", "ATOMS"] => head.count = Some(self.count()?),
                ["ITEM:", "UNITS"] => *units = Some(String::from_utf8_lossy(self.line()?.trim_ascii()).into_owned()),
                ["ITEM:", "TIME"] => head.time = Some(self.time()?),
                ["ITEM:", "BOX", "BOUNDS", words @ ..] => {
                    let rows = [self.line()?, self.line()?, self.line()?];
                    head.cell =
                        LammpsBox::new(words, &rows).map_err(|message| self.error(format!("BOX BOUNDS: {message}")))?;
                    has_box = true;
                }
                ["ITEM:", "ATOMS", names @ ..] => {
                    head.columns = names.iter().map(ToString::to_string).collect();
                    break;
                }
                ["ITEM:", ..] => {
                    return Err(self.error(format!("unexpected section {}", shown(&line))));
                }
                _ => return Err(self.error(format!("{} is not an `ITEM:` line", shown(&line)))),
            }
        }
        self.check(&head, has_box)?;
        Ok(Some(head))
    }

    fn check(&self, head: &LammpsFrameHead, has_box: bool) -> Result<()> {
        match head {
            LammpsFrameHead { count: None, .. } => Err(self.error("`ITEM: NUMBER OF ATOMS` is missing")),
            _ if !has_box => Err(self.error("`ITEM: BOX BOUNDS` is missing")),
            LammpsFrameHead { columns, .. } if columns.is_empty() => Err(self.error("`ITEM: ATOMS` lists no columns")),
            LammpsFrameHead { columns, .. } if columns.len() > MOST_COLUMNS => {
                Err(self.error(format!("`ITEM: ATOMS` has {} columns; at most {MOST_COLUMNS} fit", columns.len())))
            }
            _ => Ok(()),
        }
    }

    fn whole(&mut self, noun: &str) -> Result<i64> {
        let line = self.line()?;
        let value = std::str::from_utf8(line.trim_ascii()).ok().and_then(|text| text.parse().ok());
        value.ok_or_else(|| self.error(format!("{} is not {noun}", shown(&line))))
    }

    fn count(&mut self) -> Result<u64> {
        let count = self.whole("a number of atoms")?;
        u64::try_from(count).map_err(|_| self.error(format!("{count} is not a number of atoms")))
    }

    fn time(&mut self) -> Result<f64> {
        let line = self.line()?;
        header_number(line.trim_ascii()).map_err(|message| self.error(message))
    }
}

#[derive(Clone, Debug, Default)]
pub struct LammpsBox {
    pub origin: [f64; 3],
    pub vectors: [[f64; 3]; 3],
    /// Whether each of them repeats.
    pub periodic: [bool; 3],
    pub notes: Vec<String>,
}

#[derive(Clone, Copy)]
enum BoxShape {
    /// lo and hi.
    Orthogonal,
    /// lo and hi of the box around the cell, and tilt factors xy, xz, yz.
    Triclinic,
    /// Cell vectors, and the origin's components behind them.
    General,
}

/// The shape, and the boundary flags where there are some.
fn shape(words: &[&str]) -> (BoxShape, [bool; 3], bool) {
    let (shape, flags) = match words {
        ["xy", "xz", "yz", flags @ ..] => (BoxShape::Triclinic, flags),
        ["abc", "origin", flags @ ..] => (BoxShape::General, flags),
        flags => (BoxShape::Orthogonal, flags),
    };
    let periodic = |k: usize| flags.get(k).is_some_and(|flag| *flag == "pp");
    (shape, [periodic(0), periodic(1), periodic(2)], flags.len() >= 3)
}

impl LammpsBox {
    /// From the words behind `BOX BOUNDS` and the three lines below.
    fn new(words: &[&str], lines: &[Vec<u8>; 3]) -> TextResult<Self> {
        let (shape, periodic, stated) = shape(words);
        let mut rows = [[0.0; 4]; 3];
        for (row, line) in rows.iter_mut().zip(lines) {
            let all = tokens(line, Separator::Blanks);
            let need = match shape {
                BoxShape::Orthogonal => 2,
                BoxShape::Triclinic => 3,
                BoxShape::General => 4,
            };
            if all.len() < need {
                return Err(format!("{} numbers instead of {need}", all.len()));
            }
            for (value, token) in row.iter_mut().zip(&all[..need]) {
                *value = header_number(token)?;
            }
        }
        let mut bounds = match shape {
            BoxShape::Orthogonal => Self::tilted(rows.map(|r| [r[0], r[1]]), [0.0; 3])?,
            BoxShape::Triclinic => Self::tilted(rows.map(|r| [r[0], r[1]]), rows.map(|r| r[2]))?,
            BoxShape::General => LammpsBox {
                origin: rows.map(|r| r[3]),
                vectors: rows.map(|r| [r[0], r[1], r[2]]),
                ..LammpsBox::default()
            },
        };
        bounds.periodic = periodic;
        if !stated {
            bounds.notes.push("the file does not say which sides are periodic: assuming none".into());
        }
        if bounds.cell().is_none() {
            bounds.notes.push("the box has no volume and is ignored".into());
        }
        Ok(bounds)
    }

    /// From the bounds of the cell's corners and its tilt factors xy, xz, yz.
    fn tilted(around: [[f64; 2]; 3], [xy, xz, yz]: [f64; 3]) -> TextResult<Self> {
        let least = |shifts: &[f64]| shifts.iter().fold(0.0, |a: f64, &b| a.min(b));
        let most = |shifts: &[f64]| shifts.iter().fold(0.0, |a: f64, &b| a.max(b));
        // LAMMPS states the box around the tilted cell, whose corners the tilts have moved.
        let shifts: [&[f64]; 3] = [&[xy, xz, xy + xz], &[yz], &[]];
        let low: [f64; 3] = std::array::from_fn(|k| around[k][0] - least(shifts[k]));
        let length: [f64; 3] = std::array::from_fn(|k| (around[k][1] - most(shifts[k])) - low[k]);
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            if around[k][0] > around[k][1] {
                let [low, high] = around[k];
                return Err(format!("the box is inverted: {axis} runs from {low} to {high}"));
            }
            if !(length[k] >= 0.0 && length[k].is_finite()) {
                return Err(format!("the box is inverted: its length along {axis} is {}", length[k]));
            }
        }
        let vectors = [[length[0], 0.0, 0.0], [xy, length[1], 0.0], [xz, yz, length[2]]];
        Ok(LammpsBox { origin: low, vectors, ..LammpsBox::default() })
    }

    pub fn cell(&self) -> Option<Cell> {
        Cell::stated(self.origin, self.vectors, self.periodic)
    }
}
