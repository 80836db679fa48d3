//! XTC: positions on a grid of 0.001 nm or finer, compressed, and no names.

use super::coding::{MOST_PER_BYTE, PackedHead, unpack};
use super::{XdrFile, XdrNumbers, periodic, units};
use crate::atoms::{AtomSnapshot, AtomSpecies, array, widened};
use crate::compression::refuse;
use crate::frames::choose;
use crate::numbers::{Bytes, NumberType};
use crate::single_file::{named, only};
use crate::topology::NO_NAMES;
use crate::{Choice, Description, Format, Snapshot, TextResult};
use particlegs_core::Result;
use particlegs_core::model::Epoch;
use particlegs_core::space::Cell;
use particlegs_files::memory;
use particlegs_particles::SnapshotMeta;
use std::path::PathBuf;
use std::sync::Arc;

pub const FORMAT: Format =
    Format { name: "xtc", title: "GROMACS trajectory (XTC)", detect: |h| h.begins(&[&OLD, &NEW]), open };

/// The number that each frame begins with, and the one of frames whose sizes have 64 bits.
const OLD: [u8; 4] = 1995u32.to_be_bytes();
const NEW: [u8; 4] = 2023u32.to_be_bytes();
/// Atoms that are not worth compressing.
const FEW: u64 = 9;
/// Bytes of a frame before its positions, and the most before compressed ones.
const BEFORE: u64 = 56;
const MOST_BEFORE: u64 = 96;

struct XtcFrame {
    atoms: u64,
    step: i32,
    time: f64,
    cell: Option<Cell>,
    /// Header of the packed positions; `None` where they are f32.
    packed: Option<PackedHead>,
    /// Their first byte in the frame, and the number of their bytes.
    start: u64,
    bytes: u64,
}

impl XtcFrame {
    fn parse(bytes: &[u8]) -> TextResult<XtcFrame> {
        let mut numbers = XdrNumbers { bytes, at: 4 };
        let is_new = bytes.starts_with(&NEW);
        if !is_new && !bytes.starts_with(&OLD) {
            return Err("it does not begin as a frame does".into());
        }
        let mut read = || {
            let (atoms, step, time) = (numbers.count()?, numbers.int()?, numbers.float()?);
            let (cell, again) = (periodic(numbers.cell(4)?), numbers.count()?);
            let frame = XtcFrame { atoms, step, time, cell, packed: None, start: BEFORE, bytes: 12 * atoms };
            if atoms <= FEW || again != atoms {
                return Some((frame, again));
            }
            let precision = f32::from_be_bytes(numbers.word()?);
            let mut three = || Some([numbers.int()?, numbers.int()?, numbers.int()?]);
            let (least, most) = (three()?, three()?);
            let small = numbers.count()? as usize;
            let high = if is_new { numbers.count()? } else { 0 };
            let bytes = high << 32 | u64::from(u32::from_be_bytes(numbers.word()?));
            let packed = Some(PackedHead { precision, least, most, small });
            Some((XtcFrame { packed, start: numbers.at as u64, bytes, ..frame }, again))
        };
        let (frame, again) = read().ok_or("its header is cut off or damaged")?;
        match &frame.packed {
            _ if again != frame.atoms => Err(format!("it states {} atoms and {again}", frame.atoms)),
            Some(head) if !(head.precision.is_normal() && head.precision > 0.0) => {
                Err(format!("the precision {} is invalid", head.precision))
            }
            // A damaged count of atoms must not claim more memory than so few bytes can fill.
            Some(_) if frame.atoms > frame.bytes.saturating_mul(MOST_PER_BYTE) => {
                Err(format!("{} bytes cannot hold {} atoms", frame.bytes, frame.atoms))
            }
            _ => Ok(frame),
        }
    }

    /// Positions as little-endian f32.
    fn positions(&self, stored: &[u8]) -> TextResult<Vec<u8>> {
        let mut out = Vec::with_capacity(12 * self.atoms as usize);
        match &self.packed {
            Some(head) => unpack(head, stored, self.atoms as usize, &mut out)?,
            // XDR is big-endian.
            None => stored.chunks_exact(4).for_each(|word| out.extend(word.iter().rev())),
        }
        Ok(out)
    }
}

fn open(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    refuse(path, FORMAT.title)?;
    let mut file = XdrFile::open(path)?;
    let mut next = 0;
    let chosen_frame = choose(path, choice.frame, |number, _| {
        // A frame from the end is found in two passes, each of which begins at number 0.
        next = if number == 0 { 0 } else { next };
        if next >= file.length {
            return Ok(None);
        }
        let at = next;
        let frame = XtcFrame::parse(file.head(at, MOST_BEFORE)?).map_err(|message| file.error(number, at, &message))?;
        // XDR pads opaque bytes to a multiple of four.
        let padded = frame.bytes.checked_next_multiple_of(4).and_then(|bytes| bytes.checked_add(frame.start));
        next = file.end(number, at, padded.unwrap_or(u64::MAX))?;
        Ok(Some((frame, at)))
    })?;
    let frames = chosen_frame.frames(Some(chosen_frame.frame.0.step.into()));
    let (frame, at) = chosen_frame.frame;
    memory::require("the positions of this frame", 12 * frame.atoms + frame.bytes)?;
    let stored = file.bytes(at + frame.start, frame.bytes)?;
    let positions = frame.positions(&stored).map_err(|message| file.error(chosen_frame.number, at, &message))?;
    let mut notes = chosen_frame.notes;
    if let Some(head) = &frame.packed {
        let grid = widened(1.0 / head.precision);
        notes.push(format!("the file stores positions rounded to {grid} nm"));
    }
    notes.push(NO_NAMES.into());
    let meta = SnapshotMeta {
        cell: frame.cell,
        units: units(),
        epoch: Epoch { time: Some(frame.time), ..frames.epoch() },
        ..named(path)
    };
    let description = Description { frames: Some(frames), notes, ..Description::new(FORMAT.title, paths, meta) };
    let fields = vec![(array("pos", NumberType::F32, 3, 0, false), Some("nm"))];
    let atoms = AtomSpecies::all(fields, frame.atoms);
    let snapshot = AtomSnapshot::new(description, Bytes::Owned(Arc::new(positions)), vec![atoms]);
    Ok(Box::new(snapshot.with_unwrapped(choice)?))
}
