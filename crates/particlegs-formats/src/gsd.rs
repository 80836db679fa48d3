//! Trajectories of HOOMD-blue (GSD): chunks of numbers found by an index of frames. Chunks that a frame lacks are as in
//! the first one, else as the schema says: <https://gsd.readthedocs.io>.

use crate::atoms::{AtomField, AtomSnapshot, AtomSpecies, array, widened};
use crate::compression::refuse;
use crate::frames::{self, ChosenFrame};
use crate::numbers::{Bytes, NumberType};
use crate::single_file::{named, only};
use crate::{AbsentField, Choice, Description, Format, Snapshot, SpeciesMass, TextResult, TrajectoryFrames};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_files::memory;
use particlegs_particles::SnapshotMeta;
use std::path::PathBuf;

pub const FORMAT: Format =
    Format { name: "gsd", title: "HOOMD-blue trajectory (GSD)", detect: |h| h.begins(&[&MAGIC]), open };

const MAGIC: [u8; 8] = [0xdf, 0x65, 0xdf, 0x65, 0xdf, 0x65, 0xdf, 0x65];
/// Bytes of the header, of an entry of the index, and of a name's place in the list of names.
const HEADER: usize = 256;
const ENTRY: u64 = 32;
const NAME: u64 = 64;
/// Most names that a file may have: they are numbered by 16 bits.
const MOST_NAMES: usize = 1 << 16;

/// A chunk: an array of `rows` times `columns` numbers.
#[derive(Clone, Copy)]
struct GsdChunk {
    rows: u64,
    columns: u32,
    start: u64,
    kind: NumberType,
}

impl GsdChunk {
    /// The number at place `index`, where the chunk has so many.
    fn number(&self, bytes: &[u8], index: u64) -> Option<f64> {
        let at = usize::try_from(self.start + index * self.kind.bytes()).ok()?;
        (index < self.rows * u64::from(self.columns)).then(|| Some(self.kind.get(bytes.get(at..)?, false)))?
    }
}

/// An entry of the index.
struct GsdEntry {
    frame: u64,
    name: u16,
    chunk: TextResult<GsdChunk>,
}

struct GsdFile {
    bytes: Bytes,
    names: Vec<String>,
    /// First byte of the index, and entries in it.
    index: u64,
    entries: u64,
    frames: u64,
}

impl GsdFile {
    fn read(bytes: Bytes) -> TextResult<GsdFile> {
        let word = |at: usize| Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?));
        let cut = "the header is cut off";
        let [index, allocated, list, places] = [8, 16, 24, 32].map(word);
        let (index, allocated) = (index.ok_or(cut)?, allocated.ok_or(cut)?);
        let (list, places) = (list.ok_or(cut)?, places.ok_or(cut)?);
        // The upper half of `gsd_version`, 32 bits at byte 44, is the major version.
        let version = bytes.get(40..HEADER).ok_or(cut)?[6..8].iter().rev().fold(0u32, |v, &b| v << 8 | u32::from(b));
        let stretch = |start: u64, count: u64, size: u64, list_name: &str| {
            let end = count.checked_mul(size).and_then(|n| n.checked_add(start));
            let wrong = || format!("its {list_name} of {count} entries lies beyond the file");
            end.filter(|&end| end <= bytes.len() as u64).map(|end| start as usize..end as usize).ok_or_else(wrong)
        };
        let names = &bytes[stretch(list, places, NAME, "list of names")?];
        stretch(index, allocated, ENTRY, "index")?;
        let text =
            |name: &[u8]| String::from_utf8_lossy(name.split(|&b| b == 0).next().unwrap_or_default()).into_owned();
        // The first version has a place for each name, the second one behind the other.
        let names: Vec<String> = if version >= 2 {
            names.split(|&b| b == 0).take_while(|n| !n.is_empty()).take(MOST_NAMES).map(text).collect()
        } else {
            names.chunks(NAME as usize).map(text).take_while(|n| !n.is_empty()).take(MOST_NAMES).collect()
        };
        let mut file = GsdFile { bytes, names, index, entries: allocated, frames: 0 };
        // Entries behind the last one are empty, and frames ascend.
        file.entries = (0..allocated).take_while(|&i| file.word(i, 16) != 0).count() as u64;
        file.frames = (0..file.entries).map(|i| file.word(i, 0)).max().map_or(0, |last| last.saturating_add(1));
        // Every frame has an entry at least; `absent` makes room for so many frames.
        if file.frames > file.entries {
            return Err(format!("its index has {} entries for {} frames", file.entries, file.frames));
        }
        Ok(file)
    }

    /// Eight bytes of an entry of the index.
    fn word(&self, entry: u64, at: u64) -> u64 {
        let at = (self.index + entry * ENTRY + at) as usize;
        self.bytes[at..at + 8].try_into().map_or(0, u64::from_le_bytes)
    }

    fn entry(&self, index: u64) -> GsdEntry {
        let [frame, rows, start, rest] = [0, 8, 16, 24].map(|at| self.word(index, at));
        let columns = rest as u32;
        // The last word has the columns in 32 bits, the number of the name in 16 and the type in 8.
        let [name, kind] = [rest >> 32 & 0xffff, rest >> 48 & 0xff];
        let kind = match kind {
            // Type 11 is that of letters, a byte each.
            1 | 11 => Some(NumberType::U8),
            2 => Some(NumberType::U16),
            3 => Some(NumberType::U32),
            4 => Some(NumberType::U64),
            5 => Some(NumberType::I8),
            6 => Some(NumberType::I16),
            7 => Some(NumberType::I32),
            8 => Some(NumberType::I64),
            9 => Some(NumberType::F32),
            10 => Some(NumberType::F64),
            _ => None,
        };
        let chunk = || {
            let kind = kind.ok_or_else(|| "its numbers are of an unknown type".to_string())?;
            let size = rows.checked_mul(u64::from(columns)).and_then(|n| n.checked_mul(kind.bytes()));
            let end = size.and_then(|size| size.checked_add(start)).filter(|&end| end <= self.bytes.len() as u64);
            end.ok_or_else(|| format!("its {rows} rows of {columns} numbers at byte {start} end beyond the file"))?;
            Ok(GsdChunk { rows, columns, start, kind })
        };
        GsdEntry { frame, name: name as u16, chunk: chunk() }
    }

    /// The chunks of a frame, by name; those of the first one where the frame has none of that name.
    fn chunks(&self, frame: u64) -> Vec<(&str, TextResult<GsdChunk>)> {
        let mut chunks: Vec<(&str, TextResult<GsdChunk>)> = Vec::new();
        for wanted in [frame, 0] {
            for entry in (0..self.entries).map(|i| self.entry(i)).filter(|e| e.frame == wanted) {
                let Some(name) = self.names.get(usize::from(entry.name)) else { continue };
                if chunks.iter().all(|f| f.0 != name) {
                    chunks.push((name, entry.chunk));
                }
            }
        }
        chunks
    }

    /// Fields of particles that other frames have, and frame `chosen`, which has `fields`, has not.
    fn absent(&self, chosen: u64, fields: &[AtomField]) -> Vec<AbsentField> {
        let absent = |(number, name): (usize, &String)| {
            let name = name.strip_prefix("particles/").filter(|name| !NO_FIELDS.contains(name))?;
            if fields.iter().any(|f| f.0.name == name) {
                return None;
            }
            let mut has = vec![false; self.frames as usize];
            let named_entries = (0..self.entries).map(|i| self.entry(i)).filter(|e| usize::from(e.name) == number);
            named_entries.for_each(|e| has[e.frame as usize] = true);
            (has.contains(&true) && !has[chosen as usize]).then(|| AbsentField::new(name, chosen, &has))
        };
        self.names.iter().enumerate().filter_map(absent).collect()
    }
}

/// Chunks of particles that are no fields of theirs.
const NO_FIELDS: [&str; 4] = ["N", "types", "type_shapes", "position"];

fn open(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    refuse(path, FORMAT.title)?;
    let broken = |message: String| Error::input_with(path, message, "the file is damaged or cut short: copy it again");
    let file = GsdFile::read(Bytes::from_filled_file(path)?).map_err(broken)?;
    if file.frames == 0 {
        return Err(broken("the file has no frames".into()));
    }
    let chosen = frames::number(path, choice.frame, file.frames)?;
    let chunks = file.chunks(chosen);
    // Damage counts where a chunk is needed: logged quantities, which are not, may be broken.
    let chunk = |name: &str| match chunks.iter().find(|c| c.0 == name) {
        None => Ok(None),
        Some((_, Ok(chunk))) => Ok(Some(*chunk)),
        Some((_, Err(message))) => Err(broken(format!("frame {chosen}: {name}: {message}"))),
    };
    let bytes = &file.bytes[..];
    let first = |name: &str| Ok::<_, Error>(chunk(name)?.and_then(|c| c.number(bytes, 0)));
    let rows =
        first("particles/N")?.ok_or_else(|| broken(format!("frame {chosen} states no number of particles")))? as u64;
    let Some(position) = chunk("particles/position")?.filter(|c| (c.rows, c.columns) == (rows, 3)) else {
        return Err(broken(format!("frame {chosen} has no positions of its {rows} particles")));
    };
    let mut fields: Vec<AtomField> = vec![field("position", &position)];
    for (name, chunk) in &chunks {
        let Some(name) = name.strip_prefix("particles/").filter(|name| !NO_FIELDS.contains(name)) else {
            continue;
        };
        // Chunks of the first frame count where they have as many rows.
        match chunk {
            Ok(chunk) if chunk.rows == rows && chunk.columns > 0 => fields.push(field(name, chunk)),
            Ok(_) => {}
            Err(message) => return Err(broken(format!("frame {chosen}: {name}: {message}"))),
        }
    }
    // The schema's default is three dimensions; in two, z does not repeat.
    let dimensions = first("configuration/dimensions")?.unwrap_or(3.0);
    let mut notes = vec!["the format states no units: the simulation's own are reduced".to_string()];
    let absent = file.absent(chosen, &fields);
    notes.extend(absent.iter().map(|field| field.why.clone()));
    if choice.frame.is_none() && file.frames > 1 {
        notes.push(ChosenFrame::<()>::note_of_the_last(file.frames));
    }
    let step = first("configuration/step")?.unwrap_or(0.0) as i64;
    let frames = TrajectoryFrames { count: file.frames, chosen, step: Some(step) };
    let meta = SnapshotMeta {
        cell: chunk("configuration/box")?.and_then(|c| cell(bytes, &c, dimensions)),
        epoch: frames.epoch(),
        ..named(path)
    };
    let description =
        Description { frames: Some(frames), absent, notes, ..Description::new(FORMAT.title, paths, meta) };
    let mut atoms = AtomSpecies::all(fields, rows);
    if atoms.mass == SpeciesMass::Unknown {
        // The schema's default mass is 1.
        atoms.mass = SpeciesMass::Each(1.0);
    }
    let species = match chunk("particles/types")?.map(|c| types(bytes, &c)).filter(|names| names.len() > 1) {
        None => vec![atoms],
        Some(names) => {
            // Without them all particles are of type 0, the schema's default.
            let type_ids = chunk("particles/typeid")?.filter(|c| (c.rows, c.columns) == (rows, 1));
            memory::require("the types of the particles", 4 * rows)?;
            let number = |row| type_ids.and_then(|c| c.number(bytes, row)).unwrap_or(0.0) as u32;
            atoms.by_type(&(0..rows).map(number).collect::<Vec<u32>>(), &names)
        }
    };
    let snapshot = AtomSnapshot::new(description, file.bytes.clone(), species);
    Ok(Box::new(snapshot.with_unwrapped(choice)?))
}

fn field(name: &str, chunk: &GsdChunk) -> AtomField {
    (array(name, chunk.kind, chunk.columns, chunk.start, false), None)
}

/// Names of types, one a row of letters.
fn types(bytes: &[u8], chunk: &GsdChunk) -> Vec<(String, Vec<String>)> {
    let width = (u64::from(chunk.columns) * chunk.kind.bytes()) as usize;
    let all = &bytes[chunk.start as usize..][..chunk.rows as usize * width];
    let name = |row: &[u8]| String::from_utf8_lossy(row.split(|&b| b == 0).next().unwrap_or_default()).into_owned();
    // One more than can be told apart, so that `by_type` sees that there are too many.
    let names = all.chunks(width.max(1)).take(crate::text::table::MOST_SPECIES + 1).map(name);
    names.map(|name| (name.clone(), vec![name.to_lowercase()])).collect()
}

/// Lx, Ly, Lz and the tilt factors xy, xz, yz of a cell about 0.
fn cell(bytes: &[u8], chunk: &GsdChunk, dimensions: f64) -> Option<Cell> {
    let mut values = [0.0; 6];
    for (index, value) in (0..).zip(&mut values) {
        *value = chunk.number(bytes, index)?;
        if chunk.kind == NumberType::F32 {
            *value = widened(*value as f32);
        }
    }
    let [x, y, z, xy, xz, yz] = values;
    let vectors = [[x, 0.0, 0.0], [xy * y, y, 0.0], [xz * z, yz * z, z]];
    let origin = [0, 1, 2].map(|k| -0.5 * (vectors[0][k] + vectors[1][k] + vectors[2][k]));
    Cell::stated(origin, vectors, [true, true, dimensions != 2.0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{fault, fixture, vectors};

    const GOOD: &[u8] = include_bytes!("../tests/fixtures/hoomd.gsd");

    #[test]
    fn frames_take_what_they_lack_from_the_first() {
        for (chosen, frame) in [(Some(0), 0), (None, 2)] {
            let snapshot = fixture("fixtures/hoomd.gsd", chosen);
            let d = snapshot.description();
            let frames = d.frames.unwrap();
            assert_eq!((frames.count, frames.chosen, frames.step), (3, frame, Some(10 * frame as i64)));
            assert_eq!(d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(), [("A", 25), ("B", 25)]);
            assert_eq!(d.species[1].mass, SpeciesMass::Field("mass".into()));
            let cell = d.meta.cell.unwrap();
            assert_eq!((cell.origin, cell.periodic), ([-18.75, -12.5, -12.5], [true; 3]));
            assert_eq!(vectors(&*snapshot, 1, "velocity")[0], [3.0, 4.0, 5.0].map(|v| v / 8.0 - 5.0));
            assert!((vectors(&*snapshot, 0, "position")[0][0] - 2.259_993 - 0.25 * frame as f64).abs() < 1e-5);
        }
    }

    #[test]
    fn broken_trajectories_are_refused() {
        let with = |at: usize, value: u64| {
            let mut bytes = GOOD.to_vec();
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
            fault(&bytes)
        };
        assert!(with(16, u64::MAX).contains("its index of 18446744073709551615 entries lies beyond the file"));
        assert!(with(32, 1 << 60).contains("list of names"));
        assert!(fault(&GOOD[..300]).contains("lies beyond the file"));
        let index = u64::from_le_bytes(GOOD[8..16].try_into().unwrap()) as usize;
        let position = (0..20)
            .rev()
            .map(|i| index + 32 * i)
            .find(|&at| u64::from_le_bytes(GOOD[at + 8..at + 16].try_into().unwrap()) == 50 && GOOD[at + 24] == 3);
        let at = position.unwrap();
        let error = with(at + 8, 1 << 50);
        assert!(error.contains("frame 2: particles/position: its 1125899906842624 rows of 3 numbers"), "{error}");
        assert!(with(index, 1 << 40).contains("entries for"), "{}", with(index, 1 << 40));
    }
}
