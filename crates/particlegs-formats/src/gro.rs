//! GROMACS structures and their trajectories, plain or compressed: a title, a number of atoms, a line of fixed columns an
//! atom, the cell: <https://manual.gromacs.org/current/reference-manual/file-formats.html#gro>.

use crate::format::{FileHead, is_whole};
use crate::single_file::named;
use crate::text::content::TextContent;
use crate::text::lines::LineReader;
use crate::text::parse::{RowRule, TableLayout};
use crate::text::snapshot::{TableColumns, TextSnapshot, header_number, kinds};
use crate::text::split::{FixedColumns, Separator, shown, tokens};
use crate::text::table::{TableBuilder, TextFrame, TextTable, scan};
use crate::topology::elements::substance;
use crate::topology::{AtomRow, Topology};
use crate::{Choice, Description, Format, Snapshot, SpeciesField, TextResult};
use particlegs_core::model::{Dimension, Epoch, Unit, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotMeta;
use std::path::{Path, PathBuf};

pub const FORMAT: Format = Format { name: "gro", title: "GROMACS structure (GRO)", detect, open };

/// A title, a number of atoms, and lines of fixed columns.
fn detect(head: &FileHead) -> bool {
    let is_count = matches!(head.words(1)[..], [n] if is_whole(n)) && !matches!(head.words(0)[..], [n] if is_whole(n));
    is_count
        && head.lines().nth(2).is_some_and(|line| {
            let field = |range| line.get(range).map_or(&b""[..], <[u8]>::trim_ascii);
            // Some programs write asterisks for numbers of more than five digits.
            is_whole(field(0..5)) && (is_whole(field(15..20)) || field(15..20) == b"*****") && width(line).is_some()
        })
}

/// Bytes of a line before its positions.
const BEFORE: usize = 20;
/// Atoms have numbers of five digits; those of larger files begin again at 0.
pub const MOST_NUMBERS: u64 = 99_999;

/// Bytes of each number of a position: as many as from one point to the next.
fn width(line: &[u8]) -> Option<usize> {
    let mut points = memchr::memchr_iter(b'.', line.get(BEFORE..)?);
    let (first, second, third) = (points.next()?, points.next()?, points.next()?);
    let width = second - first;
    (third - second == width && (2..=40).contains(&width) && first < width).then_some(width)
}

/// A frame's content beside its atoms.
struct GroFrameHead {
    time: Option<f64>,
    cell: Option<Cell>,
    has_velocities: bool,
    count: u64,
}

fn open(paths: &[PathBuf], options: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = crate::single_file::only(paths)?;
    let content = TextContent::open(path)?;
    let as_one = options.by_atoms();
    let scan = scan(&content, options.frame, |lines, number, wanted| frame(&content, lines, number, wanted, as_one))?;
    let units = Units { time: Some(Unit::parse("ps", Dimension::Time)), ..Units::new(Some("nm"), None, None) };
    let meta = SnapshotMeta {
        cell: scan.head.cell,
        units,
        epoch: Epoch { time: scan.head.time, ..scan.frames.epoch() },
        ..named(path)
    };
    let columns = columns(&scan.head, &scan.table);
    let description = Description {
        frames: Some(scan.frames),
        notes: scan.notes,
        ..Description::new(content.title(FORMAT.title), paths, meta)
    };
    let snapshot = TextSnapshot::new(description, scan.table, columns, "atoms", "");
    Ok(Box::new(snapshot.with_unwrapped(false, options)?))
}

/// The atoms of a frame.
pub fn topology(path: &Path, choice: &Choice) -> Result<Topology> {
    let content = TextContent::open(path)?;
    let scan = scan(&content, choice.frame, |lines, number, wanted| frame(&content, lines, number, wanted, true))?;
    let bytes = FixedColumns::new([[0, 5], [5, 10], [10, 15]]);
    let mut topology = Topology::new(path);
    scan.table.for_each_row(|line| {
        let [number, residue, name] = [0, 1, 2].map(|column| bytes.value(line, column).unwrap_or_default());
        let residue_number = std::str::from_utf8(number).ok().and_then(|text| text.parse().ok());
        topology.species.push(substance(residue));
        topology.push(AtomRow { name, residue, residue_number, ..AtomRow::default() })
    })?;
    Ok(topology)
}

fn columns(head: &GroFrameHead, table: &TextTable) -> TableColumns {
    let field = |name, kind, components, unit: Option<&str>| SpeciesField {
        unit: unit.map(String::from),
        ..SpeciesField::new(name, kind, components)
    };
    let number = if head.count <= MOST_NUMBERS { "id" } else { "number" };
    let mut fields = vec![
        field("residue", "text", 1, None),
        field("name", "text", 1, None),
        field(number, kinds(table).get(2).copied().unwrap_or("text"), 1, None),
        field("pos", "f64", 3, Some("nm")),
    ];
    fields.extend(head.has_velocities.then(|| field("velocity", "f64", 3, Some("nm/ps"))));
    TableColumns { fields, positions: "pos".into(), mass: None }
}

/// Reads the frame that begins at the next line; all atoms are one species where `as_one` says so.
fn frame<'c>(
    content: &'c TextContent,
    lines: &mut LineReader<'c>,
    number: u64,
    wanted: bool,
    as_one: bool,
) -> Result<Option<TextFrame<'c, GroFrameHead>>> {
    let error = |message: String| Error::input(content.path(), format!("frame {number}{message}"));
    let Some(title) = lines.line()?.map(<[u8]>::to_vec) else { return Ok(None) };
    let Some(second) = lines.line()?.map(<[u8]>::to_vec) else {
        // A blank line may stand behind the last frame.
        return match title.trim_ascii().is_empty() {
            true => Ok(None),
            false => Err(error(" ends after its title".into())),
        };
    };
    let at = lines.place().line - 1;
    let count = std::str::from_utf8(second.trim_ascii()).ok().and_then(|text| text.parse().ok());
    let count: u64 = count.ok_or_else(|| error(format!(", line {at}: {} is not a number of atoms", shown(&second))))?;
    let first = lines.peek()?.unwrap_or_default();
    let has_atoms = count > 0;
    // Without atoms no line shows the width, and none needs it.
    let width = width(first).or((!has_atoms).then_some(8));
    let width = width.ok_or_else(|| error(format!(", line {}: there are no three numbers in columns", at + 1)))?;
    let velocity = first.get(BEFORE + 3 * width..BEFORE + 4 * width).unwrap_or_default();
    let has_velocities = has_atoms && !velocity.trim_ascii().is_empty();
    let mut rows = TableBuilder::new(content, layout(width, has_velocities), (!as_one).then_some(0), lines.place());
    let line_count = lines.pass(count, |place, block| if wanted { rows.add(place, block) } else { Ok(()) })?;
    let end = lines.place();
    let cell = lines.line()?.map(<[u8]>::to_vec);
    let (true, Some(cell)) = (line_count == count, cell) else {
        return Err(error(format!(" is cut off: it states {count} atoms, but only {line_count} lines follow")));
    };
    let cell = cell_of(&cell).map_err(|message| error(format!(", line {}: the cell: {message}", end.line)))?;
    let (time, step) = moment(&title);
    let head = GroFrameHead { time, cell, has_velocities, count };
    Ok(Some(TextFrame { head, rows: wanted.then(|| rows.until(end)), step }))
}

fn layout(width: usize, has_velocities: bool) -> TableLayout {
    let names = ["residue", "name", "number", "x", "y", "z", "vx", "vy", "vz"];
    let names = &names[..if has_velocities { 9 } else { 6 }];
    let bounds = |k: usize| match k {
        0..3 => [5 + 5 * k, 10 + 5 * k],
        k => [BEFORE + (k - 3) * width, BEFORE + (k - 2) * width],
    };
    let columns = FixedColumns::new((0..names.len()).map(|k| bounds(k).map(|byte| byte as u16)));
    TableLayout {
        separator: Separator::Fixed(columns),
        columns: names.iter().map(ToString::to_string).collect(),
        rows: RowRule::All,
        comma: false,
        species: substance,
    }
}

/// The diagonal of the vectors, and perhaps v1y v1z v2x v2z v3x v3y.
fn cell_of(line: &[u8]) -> TextResult<Option<Cell>> {
    let numbers: Vec<f64> =
        tokens(line, Separator::Blanks).into_iter().map(header_number).collect::<TextResult<_>>()?;
    let [x, y, z, rest @ ..] = &numbers[..] else { return Err(format!("{} numbers instead of 3 or 9", numbers.len())) };
    let [xy, xz, yx, yz, zx, zy] = match *rest {
        [] => [0.0; 6],
        [xy, xz, yx, yz, zx, zy] => [xy, xz, yx, yz, zx, zy],
        _ => return Err(format!("{} numbers instead of 3 or 9", numbers.len())),
    };
    Ok(Cell::stated([0.0; 3], [[*x, xy, xz], [yx, *y, yz], [zx, zy, *z]], [true; 3]))
}

/// The time and the step that a title ends with: `Protein in water t= 100.0 step= 5000`.
pub fn moment(title: &[u8]) -> (Option<f64>, Option<i64>) {
    let behind = |name: &[u8]| {
        let at = memchr::memmem::rfind(title, name)?;
        tokens(&title[at + name.len()..], Separator::Blanks).first().copied()
    };
    let time = behind(b" t=").and_then(|token| header_number(token).ok());
    let step = behind(b" step=").and_then(|token| std::str::from_utf8(token).ok()?.parse().ok());
    (time, step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{gzip, open_bytes, read, scratch};
    use tempfile::NamedTempFile;

    const WATER: &str = "Water t= 2.5 step= 5\n    3\n    1SOL     OW    1   0.126   1.624   1.679  0.1227 -0.0580  0.0434\n\
        \u{20}   1SOL    HW1    2   0.190   1.661   1.747  0.8085  0.3191 -0.7791\n\
        \u{20}   2NA      NA    3   0.177   1.568   1.613 -0.9045 -2.6469  1.3180\n   1.86206   1.86206   1.86206\n";

    /// With the file, which is read later.
    fn open(text: &str, frame: Option<i64>) -> particlegs_core::Result<(NamedTempFile, Box<dyn Snapshot>)> {
        let file = scratch(text.as_bytes());
        let snapshot = Choice { frame, ..Choice::default() }.open(&[file.path().to_path_buf()])?;
        Ok((file, snapshot))
    }

    fn message(text: &str) -> String {
        open(text, None).err().map_or("it was read".into(), |e| e.to_string())
    }

    #[test]
    fn residues_are_species_with_velocities_and_numbers() {
        let (_file, snapshot) = open(WATER, None).unwrap();
        let d = snapshot.description();
        assert_eq!((d.meta.epoch.time, d.meta.epoch.step), (Some(2.5), Some(5)));
        assert_eq!(d.meta.units.length_text(), Some("nm"));
        assert_eq!(d.meta.cell.unwrap().lengths(), Some([1.86206; 3]));
        assert_eq!(d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(), [("water", 2), ("NA", 1)]);
        let values_of = |species, name: &str| {
            let choice = Choice { positions: Some(name.into()), ..Choice::default() };
            read(&*snapshot, species, &choice).unwrap().positions
        };
        assert_eq!(values_of(0, "pos")[1].map(|v| (v * 1e3).round()), [190.0, 1661.0, 1747.0]);
        assert_eq!(values_of(1, "velocity")[0].map(|v| (v * 1e4).round()), [-9045.0, -26469.0, 13180.0]);
        assert_eq!(values_of(1, "id,id,id")[0], [3.0; 3]);
    }

    #[test]
    fn residues_of_proteins_are_one_species() {
        let names = ["ALA", "NALA", "CGLY", "HISB", "SOL", "NA", "CLA", "POPC"].map(|name| substance(name.as_bytes()));
        let wanted = ["protein", "protein", "protein", "protein", "water", "NA", "CLA", "POPC"].map(str::as_bytes);
        assert_eq!(names, wanted);
    }

    /// MDAnalysis wrote it: three decimals, a cell with angles of 60, 60 and 90 degrees.
    #[test]
    fn triclinic_cells_are_read_as_written() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/mdanalysis.gro");
        let snapshot = Choice::default().open(&[path]).unwrap();
        let vectors = snapshot.description().meta.cell.unwrap().vectors;
        assert_eq!(vectors, [[25.0, 0.0, 0.0], [0.0, 25.0, 0.0], [12.5, 12.5, 17.67767]]);
        let velocity = Choice { positions: Some("velocity".into()), ..Choice::default() };
        assert_eq!(read(&*snapshot, 1, &velocity).unwrap().positions[9], [13.375, 13.5, 13.625]);
    }

    #[test]
    fn frames_and_compression_are_read() {
        let two = WATER.to_string() + &WATER.replace("t= 2.5", "t= 3.5").replace("0.126", "9.126");
        for (frame, time, x) in [(Some(0), 2.5, 0.126), (None, 3.5, 9.126)] {
            let (_file, snapshot) = open(&two, frame).unwrap();
            assert_eq!(snapshot.description().frames.unwrap().count, 2);
            assert_eq!(snapshot.description().meta.epoch.time, Some(time));
            let keep = Choice { positions: Some("pos[0],id,id".into()), as_stored: true, ..Choice::default() };
            assert!((read(&*snapshot, 0, &keep).unwrap().positions[0][0] - x).abs() < 1e-6);
        }
        let packed = open_bytes("a.gro.gz", &gzip(WATER.as_bytes())).unwrap();
        assert_eq!(packed.description().format, "GROMACS structure (GRO), gzip");
    }

    #[test]
    fn broken_files_are_refused() {
        let cut = &WATER[..WATER.len() - 80];
        assert!(message(cut).contains("frame 0 is cut off: it states 3 atoms"), "{}", message(cut));
        let many = WATER.replacen("    3", "99999999999", 1);
        assert!(message(&many).contains("it states 99999999999 atoms, but only 4 lines follow"), "{}", message(&many));
        let odd = WATER.replace("   1.86206   1.86206   1.86206", "   1.86206   x   1.86206");
        assert!(message(&odd).contains("line 6: the cell: `x` is not a number"), "{}", message(&odd));
    }
}
