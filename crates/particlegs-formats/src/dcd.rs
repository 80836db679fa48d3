//! Trajectories of CHARMM, NAMD, X-PLOR and LAMMPS (DCD): Fortran records of f32 in either byte order, frames of one size,
//! and no names.

use crate::atoms::{AtomSnapshot, AtomSpecies, cell_of, widened};
use crate::columns::ColumnarField;
use crate::compression::refuse;
use crate::format::FileHead;
use crate::frames::{self, ChosenFrame, with_last_frame};
use crate::numbers::{Bytes, NumberType};
use crate::snapshot::{named, only};
use crate::topology::snapshot::NO_NAMES;
use crate::{Choice, Description, Format, Snapshot, TextResult, TrajectoryFrames};
use particlegs_pipeline::model::{Dimension, Epoch, Unit, Units};
use particlegs_pipeline::particles::SnapshotMeta;
use particlegs_pipeline::space::Cell;
use particlegs_pipeline::{Error, Result};
use std::path::PathBuf;

pub const FORMAT: Format = Format { name: "dcd", title: "CHARMM or NAMD trajectory (DCD)", detect, open };

/// AKMA's unit of time in ps: that of Angstrom, kcal/mol and atomic mass units.
const AKMA: f64 = 0.048_888_21;
/// Bytes of the header's record, of the cell's, and of the header's numbers.
const HEADER: u64 = 84;
const CELL: u64 = 48;

fn detect(head: &FileHead) -> bool {
    FortranRecords::of(&head.content).is_some()
}

/// How records are framed: their length before and behind them, in 4 bytes or 8.
#[derive(Clone, Copy)]
struct FortranRecords {
    marker: u64,
    big_endian: bool,
}

impl FortranRecords {
    /// By the first record, whose length and name are known.
    fn of(bytes: &[u8]) -> Option<FortranRecords> {
        let all =
            [4, 8].into_iter().flat_map(|marker| [false, true].map(|big_endian| FortranRecords { marker, big_endian }));
        all.into_iter().find(|r| {
            let name = r.marker as usize;
            r.length(bytes, 0) == Some(HEADER) && bytes.get(name..name + 4) == Some(b"CORD")
        })
    }

    fn number(self, kind: NumberType, bytes: &[u8], at: u64) -> Option<f64> {
        let at = usize::try_from(at).ok()?;
        let own = bytes.get(at..at.checked_add(kind.bytes() as usize)?)?;
        Some(kind.get(own, self.big_endian))
    }

    fn length(self, bytes: &[u8], at: u64) -> Option<u64> {
        let kind = if self.marker == 4 { NumberType::U32 } else { NumberType::U64 };
        self.number(kind, bytes, at).map(|n| n as u64)
    }

    /// The first byte of what the record at byte `at` holds, its length, and where the next one begins.
    fn record(self, bytes: &[u8], at: u64) -> TextResult<[u64; 3]> {
        let length = self.length(bytes, at).ok_or("the file ends where a record should begin")?;
        let first = at + self.marker;
        let end = first.checked_add(length).filter(|&end| end < bytes.len() as u64);
        let again = end.and_then(|end| self.length(bytes, end));
        match (end, again) {
            (Some(end), Some(again)) if again == length => Ok([first, length, end + self.marker]),
            _ => Err(format!("the record of {length} bytes at byte {at} is damaged or cut off")),
        }
    }
}

struct DcdHeader {
    records: FortranRecords,
    atoms: u64,
    has_cell: bool,
    /// FortranRecords of a frame beside those of the cell, x, y and z.
    more: u64,
    /// Step of the first frame, steps between frames, time between steps.
    first: i64,
    every: i64,
    step: f64,
    /// Did LAMMPS write it, in units that it does not state?
    is_lammps: bool,
    /// Where frames begin.
    start: u64,
}

impl DcdHeader {
    fn read(bytes: &[u8]) -> TextResult<DcdHeader> {
        let records = FortranRecords::of(bytes).ok_or("it does not begin with a record `CORD`")?;
        let [numbers, _, titles] = records.record(bytes, 0)?;
        let number = |kind, k: u64| records.number(kind, bytes, numbers + 4 + 4 * k).unwrap_or(0.0);
        let whole = |k| number(NumberType::I32, k) as i64;
        // X-PLOR states no version, and the step in f64.
        let is_charmm = whole(19) != 0;
        let [title, length, atoms] = records.record(bytes, titles)?;
        let title = &bytes[title as usize..(title + length) as usize];
        let [at, length, start] = records.record(bytes, atoms)?;
        let count = records.number(NumberType::I32, bytes, at).filter(|&n| length == 4 && n >= 0.0);
        let atoms = count.ok_or("it does not state a number of atoms")? as u64;
        if whole(8) != 0 {
            return Err(format!("{} atoms are fixed and stored once, which this program does not read", whole(8)));
        }
        Ok(DcdHeader {
            records,
            atoms,
            has_cell: is_charmm && whole(10) != 0,
            more: u64::from(is_charmm && whole(11) != 0),
            first: whole(1),
            every: whole(2),
            step: if is_charmm { widened(number(NumberType::F32, 9) as f32) } else { number(NumberType::F64, 9) },
            is_lammps: memchr::memmem::find(title, b"LAMMPS").is_some(),
            start,
        })
    }

    /// Bytes of a record of one coordinate.
    fn axis(&self) -> u64 {
        4 * self.atoms + 2 * self.records.marker
    }

    fn cell_bytes(&self) -> u64 {
        if self.has_cell { CELL + 2 * self.records.marker } else { 0 }
    }

    fn frame_bytes(&self) -> u64 {
        self.cell_bytes() + (3 + self.more) * self.axis()
    }

    /// Checks the records of the frame at byte `at`.
    fn check(&self, bytes: &[u8], at: u64) -> TextResult<()> {
        let mut next = at;
        let lengths = [CELL].into_iter().filter(|_| self.has_cell).chain([4 * self.atoms; 3]);
        for wanted in lengths {
            let [_, length, end] = self.records.record(bytes, next)?;
            if length != wanted {
                return Err(format!("the record at byte {next} has {length} bytes instead of {wanted}"));
            }
            next = end;
        }
        Ok(())
    }

    /// Lengths and angles in one of three ways: as cosines (CHARMM, NAMD), in degrees (VMD, LAMMPS), or the symmetric
    /// matrix of CHARMM since version 25.
    fn cell(&self, bytes: &[u8], at: u64) -> Option<Cell> {
        let number = |k: u64| self.records.number(NumberType::F64, bytes, at + self.records.marker + 8 * k);
        let all = [number(0)?, number(1)?, number(2)?, number(3)?, number(4)?, number(5)?];
        let [a, gamma, b, beta, alpha, c] = all;
        let angles = [alpha, beta, gamma];
        if angles.iter().all(|v| (-1.0..=1.0).contains(v)) {
            return cell_of([a, b, c], angles.map(|v| if v == 0.0 { 90.0 } else { v.acos().to_degrees() }));
        }
        if all.iter().any(|v| *v < 0.0) || angles.iter().any(|v| *v > 180.0) {
            let [xx, xy, yy, xz, yz, zz] = all;
            return Cell::stated([0.0; 3], [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], [true; 3]);
        }
        cell_of([a, b, c], angles)
    }

    fn positions(&self, at: u64) -> ColumnarField {
        ColumnarField {
            name: "pos".into(),
            kind_name: NumberType::F32.name().into(),
            kind: Some(NumberType::F32),
            big_endian: self.records.big_endian,
            components: 3,
            base: at + self.cell_bytes() + self.records.marker,
            base_step: self.axis(),
            stride: 4,
            ..ColumnarField::default()
        }
    }
}

/// In six digits: the time between steps has hardly more.
fn rounded(time: f64) -> f64 {
    format!("{time:.5e}").parse().unwrap_or(time)
}

fn open(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    refuse(path, FORMAT.title)?;
    let bytes = Bytes::from_filled_file(path)?;
    let broken = |what: String| Error::input_with(path, what, "the file is damaged or cut short: copy it again");
    let header = DcdHeader::read(&bytes).map_err(broken)?;
    let length = bytes.len() as u64 - header.start;
    let (count, left) = (length / header.frame_bytes(), length % header.frame_bytes());
    let mut notes = vec![NO_NAMES.to_string()];
    if header.is_lammps {
        notes.push("LAMMPS wrote the file and states neither its units nor the time".into());
    }
    if left > 0 {
        let what = format!("frame {count} is cut off: it has {left} of {} bytes", header.frame_bytes());
        if choice.frame.is_none_or(|frame| frame < 0 || frame as u64 >= count) {
            return Err(with_last_frame(broken(what), count));
        }
        notes.push(what);
    }
    if count == 0 {
        return Err(broken("the file has no frames".into()));
    }
    let chosen = frames::number(path, choice.frame, count)?;
    if choice.frame.is_none() && count > 1 {
        notes.push(ChosenFrame::<()>::note_of_the_last(count));
    }
    let at = header.start + chosen * header.frame_bytes();
    header.check(&bytes, at).map_err(|what| broken(format!("frame {chosen}: {what}")))?;
    let step = header.every.checked_mul(chosen as i64).and_then(|steps| steps.checked_add(header.first));
    let time = step
        .map(|step| rounded(step as f64 * header.step * AKMA))
        .filter(|t| !header.is_lammps && header.step > 0.0 && t.is_finite());
    let frames = TrajectoryFrames { count, chosen, step };
    let unit = (!header.is_lammps).then_some("Angstrom");
    let units = Units { time: Some(Unit::parse("ps", Dimension::Time)), ..Units::new(unit, None, None) };
    let description = Description {
        format: format!("{}, {}-endian", FORMAT.title, if header.records.big_endian { "big" } else { "little" }),
        files: paths.to_vec(),
        meta: SnapshotMeta {
            cell: if header.has_cell { header.cell(&bytes, at) } else { None },
            units,
            epoch: Epoch { time, ..frames.epoch() },
            ..named(path)
        },
        frames: Some(frames),
        notes,
        ..Description::default()
    };
    let atoms = AtomSpecies::all(vec![(header.positions(at), unit)], header.atoms);
    Ok(Box::new(AtomSnapshot::new(description, bytes, vec![atoms]).with_unwrapped(choice)?))
}

#[cfg(test)]
mod tests;
