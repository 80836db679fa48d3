//! Structures of VASP (POSCAR, CONTCAR) and their trajectories (XDATCAR), plain or compressed: a scale, three vectors,
//! numbers of atoms, positions, perhaps velocities: <https://www.vasp.at/wiki/index.php/POSCAR>.

use crate::atoms::{AtomSnapshot, AtomSpecies, FieldBuffer};
use crate::format::{FileHead, is_whole};
use crate::frames::choose;
use crate::single_file::{named, only};
use crate::text::content::{TextContent, TextPosition};
use crate::text::lines::LineReader;
use crate::text::snapshot::header_number;
use crate::text::split::{Separator, shown, tokens};
use crate::{Choice, Description, Format, Snapshot, TextResult};
use particlegs_core::model::{Dimension, Unit, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_files::memory;
use particlegs_particles::SnapshotMeta;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub const FORMAT: Format = Format {
    name: "poscar",
    title: "VASP structure (POSCAR)",
    detect: |head| is_poscar(head) && !is_trajectory(head),
    open,
};
pub const XDATCAR: Format = Format {
    name: "xdatcar",
    title: "VASP trajectory (XDATCAR)",
    detect: |head| is_poscar(head) && is_trajectory(head),
    open: open_trajectory,
};

/// Trajectories have such a line before each frame.
const FRAME: &[u8] = b"Direct configuration=";

fn is_trajectory(head: &FileHead) -> bool {
    head.lines().take(16).any(|l| l.starts_with(FRAME))
}

/// A comment, a scale, three vectors, perhaps symbols, numbers of atoms, how positions are meant.
pub fn is_poscar(head: &FileHead) -> bool {
    let scale = head.numbers(1).is_some_and(|n| n.len() == 1 || n.len() == 3);
    let counts = |at: usize| !head.words(at).is_empty() && head.words(at).into_iter().all(is_whole);
    let at = if counts(5) { 5 } else { 6 };
    let mode = head.words(at + 1).first().and_then(|w| w.first()).copied().unwrap_or(0).to_ascii_uppercase();
    scale && head.are_numbers(2..5, 3) && counts(at) && b"DCKS".contains(&mode)
}

/// Memory that an atom takes while the file is read, and atoms for which there must be memory before more are read.
const ATOM: u64 = 120;
const STEP: u64 = 1 << 16;

/// A file's content before the positions.
struct PoscarHead {
    scale: [f64; 3],
    vectors: [[f64; 3]; 3],
    /// Names of the kinds of atoms, in order, and how many there are of each.
    kinds: Vec<(String, u64)>,
}

impl PoscarHead {
    fn count(&self) -> u64 {
        self.kinds.iter().map(|k| k.1).fold(0, u64::saturating_add)
    }
}

struct Poscar {
    head: Arc<PoscarHead>,
    position: Vec<f64>,
    /// Empty where there are none.
    velocity: Vec<f64>,
}

struct PoscarLines<'a> {
    lines: LineReader<'a>,
}

impl PoscarLines<'_> {
    /// The words of the next line; none at the end.
    fn words(&mut self) -> Result<Option<Vec<Vec<u8>>>> {
        let line = self.lines.line()?;
        Ok(line.map(|line| tokens(line, Separator::Blanks).into_iter().map(<[u8]>::to_vec).collect()))
    }

    fn needed(&mut self, path: &PathBuf) -> Result<Vec<Vec<u8>>> {
        self.words()?.ok_or_else(|| Error::input_with(path, "the file is cut off", "copy it again"))
    }

    /// The error for the line that was read last.
    fn error(&self, path: &PathBuf, message: impl std::fmt::Display) -> Error {
        Error::input(path, format!("line {}: {message}", self.lines.place().line.saturating_sub(1)))
    }
}

/// The first three numbers of a line.
fn three(words: &[Vec<u8>]) -> TextResult<[f64; 3]> {
    let [x, y, z, ..] = words else { return Err(format!("{} numbers instead of 3", words.len())) };
    Ok([header_number(x)?, header_number(y)?, header_number(z)?])
}

fn head(path: &PathBuf, lines: &mut PoscarLines<'_>) -> Result<PoscarHead> {
    lines.needed(path)?;
    let at = lines.lines.place().line;
    let scale = lines.needed(path)?;
    let scale: Vec<f64> =
        scale.iter().map(|w| header_number(w)).collect::<TextResult<_>>().map_err(|e| lines.error(path, e))?;
    let mut vectors = [[0.0; 3]; 3];
    for vector in &mut vectors {
        let words = lines.needed(path)?;
        *vector = three(&words).map_err(|message| lines.error(path, message))?;
    }
    let scale = scales(&scale, vectors);
    let scale = scale.ok_or_else(|| Error::input(path, format!("line {at}: the scale is invalid")))?;
    vectors.iter_mut().for_each(|v| (0..3).for_each(|k| v[k] *= scale[k]));
    Ok(PoscarHead { scale, vectors, kinds: kinds(path, lines)? })
}

fn read(path: &PathBuf, content: &TextContent) -> Result<Poscar> {
    let mut lines = PoscarLines { lines: LineReader::open(content, TextPosition::START, None)? };
    let head = head(path, &mut lines)?;
    let mut mode = lines.needed(path)?;
    // A line `Selective dynamics` may stand before the mode.
    if first_letter(&mode) == Some(b'S') {
        mode = lines.needed(path)?;
    }
    // VASP looks at the first letter alone, and takes K for C.
    let is_cartesian = matches!(first_letter(&mode), Some(b'C' | b'K'));
    let position = positions(path, &mut lines, &head, is_cartesian)?;
    let velocity = velocities(&mut lines, head.count())?;
    Ok(Poscar { head: head.into(), position, velocity })
}

fn positions(path: &PathBuf, lines: &mut PoscarLines<'_>, head: &PoscarHead, is_cartesian: bool) -> Result<Vec<f64>> {
    let (scale, vectors, count) = (head.scale, head.vectors, head.count());
    let place = |v: [f64; 3]| match is_cartesian {
        true => [0, 1, 2].map(|k| v[k] * scale[k]),
        false => [0, 1, 2].map(|k| v[0] * vectors[0][k] + v[1] * vectors[1][k] + v[2] * vectors[2][k]),
    };
    let mut position = Vec::new();
    for atom in 0..count {
        if atom % STEP == 0 {
            memory::require("the atoms of this file", ATOM * (atom + STEP).min(count))?;
        }
        let Some(words) = lines.words()? else {
            let message = format!("the file is cut off: it states {count} atoms, but only {atom} lines follow");
            return Err(Error::input(path, message));
        };
        position.extend(place(three(&words).map_err(|message| lines.error(path, message))?));
    }
    Ok(position)
}

/// Perhaps symbols, and numbers of atoms.
fn kinds(path: &PathBuf, lines: &mut PoscarLines<'_>) -> Result<Vec<(String, u64)>> {
    let mut words = lines.needed(path)?;
    let mut symbols = Vec::new();
    if !words.iter().all(|w| is_whole(w)) {
        // What stands behind a symbol is the potential: `Fe_pv`, `O/1a2b`.
        let symbol =
            |w: &Vec<u8>| String::from_utf8_lossy(w.split(|b| b"_/".contains(b)).next().unwrap_or(w)).into_owned();
        symbols = words.iter().map(symbol).collect();
        words = lines.needed(path)?;
    }
    let count = |w: &Vec<u8>| std::str::from_utf8(w).ok().and_then(|text| text.parse::<u64>().ok());
    let counts: Option<Vec<u64>> = words.iter().map(count).collect();
    let Some(counts) = counts.filter(|c| !c.is_empty() && (symbols.is_empty() || symbols.len() == c.len())) else {
        let message = format!("{} is no list of numbers of atoms", shown(&words.join(&b' ')));
        return Err(lines.error(path, message));
    };
    if symbols.is_empty() {
        symbols = (1..=counts.len()).map(|k| format!("type {k}")).collect();
    }
    Ok(symbols.into_iter().zip(counts).collect())
}

/// The scale along each axis: one number, three, or minus the volume.
fn scales(stated: &[f64], v: [[f64; 3]; 3]) -> Option<[f64; 3]> {
    let volume = v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) - v[0][1] * (v[1][0] * v[2][2] - v[1][2] * v[2][0])
        + v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]);
    let scales = match *stated {
        [scale] if scale < 0.0 => [(-scale / volume.abs()).cbrt(); 3],
        [scale] => [scale; 3],
        [x, y, z] => [x, y, z],
        _ => return None,
    };
    scales.iter().all(|s| *s > 0.0 && s.is_finite()).then_some(scales)
}

fn first_letter(words: &[Vec<u8>]) -> Option<u8> {
    words.first().and_then(|w| w.first()).map(u8::to_ascii_uppercase)
}

/// Cartesian velocities behind a line that is empty or says so; nothing of anything else.
fn velocities(lines: &mut PoscarLines<'_>, count: u64) -> Result<Vec<f64>> {
    let mut velocity = Vec::new();
    if !matches!(lines.words()?, Some(words) if matches!(first_letter(&words), None | Some(b'C' | b'K'))) {
        return Ok(velocity);
    }
    for _ in 0..count {
        match lines.words()?.map(|words| three(&words)) {
            Some(Ok(vector)) => velocity.extend(vector),
            _ => return Ok(Vec::new()),
        }
    }
    Ok(velocity)
}

fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let content = TextContent::open(path)?;
    let poscar = read(path, &content)?;
    let description = Description { format: content.title(FORMAT.title), ..Description::default() };
    Ok(Box::new(described(path, poscar, description)))
}

fn open_trajectory(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let content = TextContent::open(path)?;
    let begin = || LineReader::open(&content, TextPosition::START, None).map(|lines| PoscarLines { lines });
    let (mut lines, mut head) = (begin()?, None);
    let chosen_frame = choose(path, choice.frame, |number, is_wanted| {
        if number == 0 {
            (lines, head) = (begin()?, None);
        }
        frame(path, &mut lines, &mut head, is_wanted)
    })?;
    let frames = chosen_frame.frames(Some(chosen_frame.frame.1));
    let description = Description {
        format: content.title(XDATCAR.title),
        meta: SnapshotMeta { epoch: frames.epoch(), ..SnapshotMeta::default() },
        frames: Some(frames),
        notes: chosen_frame.notes,
        ..Description::default()
    };
    Ok(Box::new(described(path, chosen_frame.frame.0, description).with_unwrapped(choice)?))
}

/// The next frame and its number in the file; without positions where it is not wanted. The head of the one `before`
/// holds unless it has its own.
fn frame(
    path: &PathBuf,
    lines: &mut PoscarLines<'_>,
    before: &mut Option<Arc<PoscarHead>>,
    is_wanted: bool,
) -> Result<Option<(Poscar, i64)>> {
    match lines.lines.peek()? {
        None => return Ok(None),
        Some(line) if !line.starts_with(FRAME) => {
            if line.trim_ascii().is_empty() && before.is_some() {
                return Ok(None);
            }
            *before = Some(head(path, lines)?.into());
        }
        Some(_) => {}
    }
    let title = lines.lines.line()?.map(<[u8]>::to_vec).unwrap_or_default();
    let number = title.strip_prefix(FRAME).and_then(|text| std::str::from_utf8(text.trim_ascii()).ok()?.parse().ok());
    let (Some(number), Some(head)) = (number, before.clone()) else {
        return Err(lines.error(path, format!("{} is not the beginning of a frame", shown(&title))));
    };
    let position = match is_wanted {
        true => positions(path, lines, &head, false)?,
        false => {
            let (count, passed) = (head.count(), lines.lines.pass(head.count(), |_, _| Ok(()))?);
            if passed < count {
                let message = format!("the file is cut off: it states {count} atoms, but only {passed} lines follow");
                return Err(Error::input(path, message));
            }
            Vec::new()
        }
    };
    Ok(Some((Poscar { head, position, velocity: Vec::new() }, number)))
}

/// The snapshot of what was found; `description` says what else there is.
fn described(path: &Path, poscar: Poscar, mut description: Description) -> AtomSnapshot {
    let mut buffer = FieldBuffer::default();
    buffer.add("pos", 3, Some("Angstrom"), &poscar.position);
    if !poscar.velocity.is_empty() {
        buffer.add("velocity", 3, Some("Angstrom/fs"), &poscar.velocity);
    }
    let (bytes, fields) = buffer.finish();
    // A symbol may stand twice.
    let mut names: Vec<(String, Vec<String>)> = Vec::new();
    let mut types = Vec::new();
    for (name, count) in &poscar.head.kinds {
        let at = names.iter().position(|n| n.0 == *name).unwrap_or(names.len());
        if at == names.len() {
            names.push((name.clone(), vec![name.to_lowercase()]));
        }
        types.extend(std::iter::repeat_n(at as u32, *count as usize));
    }
    let atoms = AtomSpecies::all(fields, types.len() as u64);
    let species = if types.is_empty() { Vec::new() } else { atoms.by_type(&types, &names) };
    description.files = vec![path.to_path_buf()];
    description.meta = SnapshotMeta {
        cell: Cell::stated([0.0; 3], poscar.head.vectors, [true; 3]),
        units: Units { time: Some(Unit::parse("fs", Dimension::Time)), ..Units::new(Some("Angstrom"), None, None) },
        name: named(path).name,
        ..description.meta
    };
    AtomSnapshot::new(description, bytes, species)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{fault, fixture, open_bytes, read, vectors};

    const FOUR: &str = "old\n2.0\n10 0 0\n0 10 0\n0 5 10\n1 2\nDirect\n0.5 0.5 0.5\n0.1 0.2 0.3\n0 0 0\n";

    #[test]
    fn scales_modes_and_velocities_are_followed() {
        let snapshot = fixture("fixtures/volume.vasp", None);
        let d = snapshot.description();
        assert_eq!(d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(), [("O", 30), ("H", 20)]);
        assert!((vectors(&*snapshot, 1, "velocity")[19][2] - 13.625).abs() < 1e-9);
        let by_ase = fixture("fixtures/ase.vasp", None);
        assert_eq!(by_ase.description().species.len(), 3);
        assert!((vectors(&*by_ase, 0, "velocity")[0][0] + 0.005).abs() < 1e-9);
        let old = open_bytes("POSCAR", FOUR.as_bytes()).unwrap();
        let d = old.description();
        assert_eq!(
            d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(),
            [("type 1", 1), ("type 2", 2)]
        );
        assert_eq!(d.meta.cell.unwrap().vectors[2], [0.0, 10.0, 20.0]);
        assert_eq!(read(&*old, 0, &Choice::default()).unwrap().positions, [[10.0, 15.0, 10.0]]);
    }

    #[test]
    fn broken_files_are_refused() {
        let cut = fault(&FOUR.as_bytes()[..FOUR.len() - 6]);
        assert!(cut.contains("it states 3 atoms, but only 2 lines follow"), "{cut}");
        let many = fault(FOUR.replace("1 2\n", "1 99999999999\n").as_bytes());
        assert!(many.contains("it states 100000000000 atoms, but only 3"), "{many}");
        let odd = fault(FOUR.replace("0.1 0.2", "0.1 y").as_bytes());
        assert!(odd.contains("line 9: `y` is not a number"), "{odd}");
        assert!(fault(FOUR.replace("2.0\n", "0\n").as_bytes()).contains("the scale is invalid"));
    }

    const TWO: &str = "a run\n1.0\n10 0 0\n0 10 0\n0 0 10\nO H\n1 1\nDirect configuration= 1\n0.5 0.5 0.5\n0.1 0.2 0.3\n\
                       Direct configuration= 11\n0.6 0.5 0.5\n0.2 0.2 0.3\n";

    #[test]
    fn frames_of_trajectories_share_a_head_or_have_their_own() {
        let x = |text: &str, frame: i64| {
            let file = crate::testing::scratch(text.as_bytes());
            let choice = Choice { frame: Some(frame), ..Choice::default() };
            let snapshot = choice.open(&[file.path().into()]).unwrap();
            let frames = snapshot.description().frames.unwrap();
            (vectors(&*snapshot, 0, "pos")[0][0], frames.count, frames.step)
        };
        assert_eq!((x(TWO, 0), x(TWO, 1), x(TWO, -2)), ((5.0, 2, Some(1)), (6.0, 2, Some(11)), (5.0, 2, Some(1))));
        // Of changing cells each frame has all that stands before the positions.
        let changing = format!("{TWO}{}", TWO.replace("1.0\n", "2.0\n"));
        assert_eq!(
            (x(&changing, 2), x(&changing, -1), x(&changing, 1)),
            ((10.0, 4, Some(1)), (12.0, 4, Some(11)), (6.0, 4, Some(11)))
        );
        assert_eq!(x(&format!("{TWO}\n"), -1).1, 2);
        assert!(fault(&TWO.as_bytes()[..TWO.len() - 12]).contains("it states 2 atoms, but only 1 lines follow"));
        assert!(
            fault(format!("{TWO}a\n1\n1 0 0\n0 1 0\n0 0 1\nO\n1\nKartesian\n").as_bytes())
                .contains("`Kartesian` is not the beginning of a frame")
        );
    }
}
