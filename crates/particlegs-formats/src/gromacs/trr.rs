//! TRR: positions, velocities and forces in full, in f32 or f64, and no names.

use super::{XdrFile, XdrNumbers, periodic, units};
use crate::atoms::{AtomSnapshot, AtomSpecies, array};
use crate::compression::refuse;
use crate::frames::choose;
use crate::numbers::{Bytes, NumberType};
use crate::single_file::{named, only};
use crate::topology::NO_NAMES;
use crate::{AbsentField, Choice, Description, Format, Snapshot, TextResult};
use particlegs_core::model::Epoch;
use particlegs_core::space::Cell;
use particlegs_core::{Error, Hint, Result};
use particlegs_particles::SnapshotMeta;
use std::path::PathBuf;

pub const FORMAT: Format =
    Format { name: "trr", title: "GROMACS trajectory (TRR)", detect: |h| h.begins(&[&MAGIC]), open };

/// The number that each frame begins with.
const MAGIC: [u8; 4] = 1993u32.to_be_bytes();
/// Most bytes of a frame before its arrays: a name of a dozen letters, 13 numbers, two of 8 bytes, the cell.
const MOST_BEFORE: u64 = 256;
/// Arrays of a frame, in order, and their units.
const ARRAYS: [(&str, &str); 3] = [("pos", "nm"), ("velocity", "nm/ps"), ("force", "kJ/mol/nm")];

struct TrrFrame {
    atoms: u64,
    step: i32,
    time: f64,
    cell: Option<Cell>,
    /// Bytes of a number.
    real: u64,
    /// Bytes before the arrays, and of each.
    before: u64,
    arrays: [u64; 3],
}

impl TrrFrame {
    fn parse(bytes: &[u8]) -> TextResult<TrrFrame> {
        if !bytes.starts_with(&MAGIC) {
            return Err("it does not begin as a frame does".into());
        }
        let cut = || "its header is cut off or damaged".to_string();
        let mut numbers = XdrNumbers { bytes, at: 8 };
        let name = numbers.count().filter(|&n| n <= 64).ok_or_else(cut)?;
        numbers.at += name.next_multiple_of(4) as usize;
        let mut sizes = [0; 13];
        for size in &mut sizes {
            *size = numbers.int().ok_or_else(cut)?;
        }
        let [input, energy, cell, virial, pressure, topology, symbols, x, v, f, atoms, step, _] = sizes;
        let size = |n: i32| u64::try_from(n).map_err(|_| format!("a size of {n} bytes is invalid"));
        let (atoms, arrays) = (size(atoms)?, [size(x)?, size(v)?, size(f)?]);
        let all = arrays.iter().copied().find(|&bytes| bytes > 0);
        // No field states the size of a number: that of the cell tells it, else that of an array.
        let real = if cell > 0 { size(cell)? / 9 } else { all.map_or(4, |all| all / (3 * atoms).max(1)) };
        let whole = |bytes: u64| bytes == 0 || bytes == 3 * atoms * real;
        if ![4, 8].contains(&real) || !arrays.into_iter().all(whole) || ![0, 9 * real].contains(&size(cell)?) {
            return Err(format!("{atoms} atoms do not fit arrays of {arrays:?} bytes"));
        }
        let mut number = || if real == 8 { numbers.double() } else { numbers.float() };
        // Behind the time stands the lambda of free energies.
        let (time, _) = (number().ok_or_else(cut)?, number().ok_or_else(cut)?);
        let ahead = size(input)? + size(energy)?;
        let before = numbers.at as u64 + ahead;
        let behind: u64 = [cell, virial, pressure, topology, symbols].into_iter().map(size).sum::<TextResult<u64>>()?;
        // What no program has written for decades stands before the cell.
        let vectors = if cell > 0 && ahead == 0 { numbers.cell(real).ok_or_else(cut)? } else { [[0.0; 3]; 3] };
        Ok(TrrFrame { atoms, step, time, cell: periodic(vectors), real, before: before + behind, arrays })
    }
}

fn open(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    refuse(path, FORMAT.title)?;
    let mut file = XdrFile::open(path)?;
    let (mut next, mut with_positions) = (0, None);
    let mut has: [Vec<bool>; 2] = Default::default();
    let chosen_frame = choose(path, choice.frame, |number, _| {
        // A frame from the end is found in two passes, each of which begins at number 0.
        if number == 0 {
            (next, has) = (0, Default::default());
        }
        if next >= file.length {
            return Ok(None);
        }
        let at = next;
        let frame = TrrFrame::parse(file.head(at, MOST_BEFORE)?).map_err(|message| file.error(number, at, &message))?;
        next = file.end(number, at, frame.before + frame.arrays.iter().sum::<u64>())?;
        // Velocities and forces may be written at longer intervals than positions.
        (0..2).for_each(|k| has[k].push(frame.arrays[1 + k] > 0));
        with_positions = if frame.arrays[0] > 0 { Some(number) } else { with_positions };
        Ok(Some((frame, at)))
    })?;
    let frames = chosen_frame.frames(Some(chosen_frame.frame.0.step.into()));
    let (frame, at) = chosen_frame.frame;
    if frame.arrays[0] == 0 && frame.atoms > 0 {
        let message = format!("frame {} has no positions", chosen_frame.number);
        let last = with_positions.map(|n| Hint::default().option("frame", n).words(" reads one that has"));
        return Err(Error::input_with(path, message, last.unwrap_or_default()));
    }
    let missing = |k: &usize| frame.arrays[1 + k] == 0 && has[*k].contains(&true);
    let absent = (0..2).filter(missing).map(|k| AbsentField::new(ARRAYS[1 + k].0, chosen_frame.number, &has[k]));
    let absent: Vec<AbsentField> = absent.collect();
    let mut notes = chosen_frame.notes;
    notes.push(NO_NAMES.into());
    notes.extend(absent.iter().map(|field| field.why.clone()));
    let meta = SnapshotMeta {
        cell: frame.cell,
        units: units(),
        epoch: Epoch { time: Some(frame.time), ..frames.epoch() },
        ..named(path)
    };
    let description = Description {
        frames: Some(frames),
        absent,
        notes,
        ..Description::new(format!("{}, f{}", FORMAT.title, 8 * frame.real), paths, meta)
    };
    let kind = if frame.real == 8 { NumberType::F64 } else { NumberType::F32 };
    let mut start = at + frame.before;
    let mut fields = Vec::new();
    for ((name, unit), bytes) in ARRAYS.into_iter().zip(frame.arrays) {
        if bytes > 0 {
            fields.push((array(name, kind, 3, start, true), Some(unit)));
        }
        start += bytes;
    }
    let atoms = AtomSpecies::all(fields, frame.atoms);
    // Only headers were read so far: the arrays are numbers as they lie in the file.
    let snapshot = AtomSnapshot::new(description, Bytes::from_file(path)?, vec![atoms]);
    Ok(Box::new(snapshot.with_unwrapped(choice)?))
}
