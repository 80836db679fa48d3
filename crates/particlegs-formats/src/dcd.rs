//! Trajectories of CHARMM, NAMD, X-PLOR and LAMMPS (DCD): Fortran records of f32 in either byte order, frames of one size,
//! of which later ones may lack fixed atoms, and no names.

use crate::atoms::{AtomSnapshot, AtomSpecies, cell_of, widened};
use crate::columns::ColumnarField;
use crate::compression::refuse;
use crate::format::FileHead;
use crate::frames::{self, ChosenFrame, with_last_frame};
use crate::numbers::{Bytes, NumberType};
use crate::single_file::{named, only};
use crate::topology::NO_NAMES;
use crate::{Choice, Description, Format, Snapshot, TextResult, TrajectoryFrames};
use particlegs_core::model::{Dimension, Epoch, Unit, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_files::memory;
use particlegs_particles::SnapshotMeta;
use std::path::PathBuf;
use std::sync::Arc;

pub const FORMAT: Format = Format { name: "dcd", title: "CHARMM or NAMD trajectory (DCD)", detect, open };

/// AKMA's unit of time in ps: that of Angstrom, kcal/mol and atomic mass units.
const AKMA: f64 = 0.048_888_21;
/// Bytes of the header's record, of the cell's, and of the header's numbers.
const HEADER: u64 = 84;
const CELL: u64 = 48;

fn detect(head: &FileHead) -> bool {
    FortranRecords::of(&head.content).is_some()
}

/// The frames of records: their length before and behind them, in 4 bytes or 8.
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
        let number_bytes = bytes.get(at..at.checked_add(kind.bytes() as usize)?)?;
        Some(kind.get(number_bytes, self.big_endian))
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

    /// The `count` ascending numbers of atoms, from 1 to `most`, that the record at byte `at` holds; here from 0.
    fn atoms(self, bytes: &[u8], at: u64, [count, most]: [u64; 2]) -> TextResult<Vec<u32>> {
        let [first, length, _] = self.record(bytes, at)?;
        let number = |k: u64| self.number(NumberType::U32, bytes, first + 4 * k).map_or(0, |n| n as u64);
        let ascend = (0..count).all(|k| number(k) > if k == 0 { 0 } else { number(k - 1) });
        if length != 4 * count || !ascend || count > 0 && number(count - 1) > most {
            return Err(format!("the record at byte {at} does not name the {count} atoms that move"));
        }
        Ok((0..count).map(|k| number(k) as u32 - 1).collect())
    }
}

struct DcdHeader {
    records: FortranRecords,
    atoms: u64,
    has_cell: bool,
    /// Records of a frame beside those of the cell, x, y and z.
    more: u64,
    /// Step of the first frame, steps between frames, time between steps.
    first: i64,
    every: i64,
    step: f64,
    /// Whether LAMMPS wrote it, in units that it does not state.
    is_lammps: bool,
    /// The atoms that move, where some are fixed: later frames than the first hold these alone.
    free: Option<Vec<u32>>,
    /// First byte of the first frame.
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
        let free = match u64::try_from(whole(8)).ok().and_then(|fixed| atoms.checked_sub(fixed)) {
            None => return Err(format!("of {atoms} atoms {} are fixed", whole(8))),
            Some(free) if free == atoms => None,
            Some(free) => Some(records.atoms(bytes, start, [free, atoms])?),
        };
        let start = if free.is_some() { records.record(bytes, start)?[2] } else { start };
        Ok(DcdHeader {
            records,
            atoms,
            has_cell: is_charmm && whole(10) != 0,
            // CHARMM's fourth dimension is one record more of each frame.
            more: u64::from(is_charmm && whole(11) != 0),
            first: whole(1),
            every: whole(2),
            step: if is_charmm { widened(number(NumberType::F32, 9) as f32) } else { number(NumberType::F64, 9) },
            is_lammps: memchr::memmem::find(title, b"LAMMPS").is_some(),
            free,
            start,
        })
    }

    /// Atoms that a frame holds.
    fn atoms_of(&self, frame: u64) -> u64 {
        self.free.as_ref().filter(|_| frame > 0).map_or(self.atoms, |free| free.len() as u64)
    }

    /// Bytes of a record of one of its coordinates.
    fn axis(&self, frame: u64) -> u64 {
        4 * self.atoms_of(frame) + 2 * self.records.marker
    }

    fn cell_bytes(&self) -> u64 {
        if self.has_cell { CELL + 2 * self.records.marker } else { 0 }
    }

    fn frame_bytes(&self, frame: u64) -> u64 {
        self.cell_bytes() + (3 + self.more) * self.axis(frame)
    }

    /// First byte of a frame.
    fn place(&self, frame: u64) -> u64 {
        // Frame 0 holds all atoms, and may be longer than those behind it.
        let later = |later: u64| self.frame_bytes(0) + (later - 1) * self.frame_bytes(1);
        self.start + if frame == 0 { 0 } else { later(frame) }
    }

    /// The number of whole frames in `length` bytes, and the bytes left.
    fn frames_in(&self, length: u64) -> [u64; 2] {
        match length.checked_sub(self.frame_bytes(0)) {
            None => [0, length],
            Some(later) => [1 + later / self.frame_bytes(1), later % self.frame_bytes(1)],
        }
    }

    /// Checks the records of a frame.
    fn check(&self, bytes: &[u8], frame: u64) -> TextResult<()> {
        let mut next = self.place(frame);
        let lengths = [CELL].into_iter().filter(|_| self.has_cell).chain([4 * self.atoms_of(frame); 3]);
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
        // A diagonal matrix passes for lengths and cosines of 0, which mean the same cell.
        if angles.iter().all(|v| (-1.0..=1.0).contains(v)) {
            return cell_of([a, b, c], angles.map(|v| if v == 0.0 { 90.0 } else { v.acos().to_degrees() }));
        }
        // Lengths are never negative and angles never above 180 degrees: such numbers are a matrix.
        if all.iter().any(|v| *v < 0.0) || angles.iter().any(|v| *v > 180.0) {
            let [xx, xy, yy, xz, yz, zz] = all;
            return Cell::stated([0.0; 3], [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], [true; 3]);
        }
        cell_of([a, b, c], angles)
    }

    /// The first byte of coordinate `k` of a frame.
    fn coordinate(&self, frame: u64, k: u64) -> u64 {
        self.place(frame) + self.cell_bytes() + self.records.marker + k * self.axis(frame)
    }

    /// Positions of the atoms that move over those of the first frame, in a file's bytes; each coordinate of all behind
    /// the one before.
    fn with_fixed(&self, bytes: &[u8], frame: u64, free: &[u32]) -> Result<Vec<u8>> {
        memory::require("the positions of this frame", 12 * self.atoms)?;
        let mut out = Vec::with_capacity(12 * self.atoms as usize);
        for k in 0..3 {
            let (first, moved) = (self.coordinate(0, k) as usize, self.coordinate(frame, k) as usize);
            let start = out.len();
            out.extend_from_slice(&bytes[first..first + 4 * self.atoms as usize]);
            for (number, &atom) in free.iter().enumerate() {
                let to = start + 4 * atom as usize;
                out[to..to + 4].copy_from_slice(&bytes[moved + 4 * number..][..4]);
            }
        }
        Ok(out)
    }

    /// Positions whose coordinates begin at byte `base` and `base_step` bytes further on.
    fn positions(&self, [base, base_step]: [u64; 2]) -> ColumnarField {
        ColumnarField {
            name: "pos".into(),
            kind_name: NumberType::F32.name().into(),
            kind: Some(NumberType::F32),
            big_endian: self.records.big_endian,
            components: 3,
            base,
            base_step,
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
    let broken = |message: String| Error::input_with(path, message, "the file is damaged or cut short: copy it again");
    let header = DcdHeader::read(&bytes).map_err(broken)?;
    let length = bytes.len() as u64 - header.start;
    let [count, left] = header.frames_in(length);
    let mut notes = vec![NO_NAMES.to_string()];
    if header.is_lammps {
        notes.push("LAMMPS wrote the file and states neither its units nor the time".into());
    }
    // A run that was killed, or that still writes, leaves part of a frame behind the whole ones.
    if left > 0 {
        let message = format!("frame {count} is cut off: it has {left} of {} bytes", header.frame_bytes(count));
        // Which frame is the last is not clear then: only one counted from the front is read.
        if choice.frame.is_none_or(|frame| frame < 0 || frame as u64 >= count) {
            return Err(with_last_frame(broken(message), count));
        }
        notes.push(message);
    }
    if count == 0 {
        return Err(broken("the file has no frames".into()));
    }
    let chosen = frames::number(path, choice.frame, count)?;
    if choice.frame.is_none() && count > 1 {
        notes.push(ChosenFrame::<()>::note_of_the_last(count));
    }
    // Only frames that are read are checked: a pass over all would read the whole file.
    header.check(&bytes, chosen).map_err(|message| broken(format!("frame {chosen}: {message}")))?;
    // Later frames lack the fixed atoms, whose positions stand in frame 0 alone.
    let merged_frame = match header.free.as_ref().filter(|_| chosen > 0) {
        None => None,
        Some(free) => {
            header.check(&bytes, 0).map_err(|message| broken(format!("frame 0: {message}")))?;
            Some(header.with_fixed(&bytes, chosen, free)?)
        }
    };
    // The header has the first frame's step (NPRIV) and the steps between frames (NSAVC).
    let step = header.every.checked_mul(chosen as i64).and_then(|steps| steps.checked_add(header.first));
    // LAMMPS writes a time step of the run's own units, which the file does not state.
    let time = step
        .map(|step| rounded(step as f64 * header.step * AKMA))
        .filter(|t| !header.is_lammps && header.step > 0.0 && t.is_finite());
    let frames = TrajectoryFrames { count, chosen, step };
    let unit = (!header.is_lammps).then_some("Angstrom");
    let units = Units { time: Some(Unit::parse("ps", Dimension::Time)), ..Units::new(unit, None, None) };
    let meta = SnapshotMeta {
        cell: if header.has_cell { header.cell(&bytes, header.place(chosen)) } else { None },
        units,
        epoch: Epoch { time, ..frames.epoch() },
        ..named(path)
    };
    let description = Description {
        frames: Some(frames),
        notes,
        ..Description::new(
            format!("{}, {}-endian", FORMAT.title, if header.records.big_endian { "big" } else { "little" }),
            paths,
            meta,
        )
    };
    // In a merged frame no markers of records stand between the coordinates.
    let (bytes, place) = match merged_frame {
        None => (bytes, [header.coordinate(chosen, 0), header.axis(chosen)]),
        Some(merged_frame) => (Bytes::Owned(Arc::new(merged_frame)), [0, 4 * header.atoms]),
    };
    let atoms = AtomSpecies::all(vec![(header.positions(place), unit)], header.atoms);
    Ok(Box::new(AtomSnapshot::new(description, bytes, vec![atoms]).with_unwrapped(choice)?))
}

#[cfg(test)]
mod tests {
    use crate::testing::{fault, fixture, open_bytes};

    const NAMD: &[u8] = include_bytes!("../tests/fixtures/mdanalysis.dcd");

    #[test]
    fn frames_cells_and_times_are_read() {
        for (chosen, frame) in [(Some(0), 0), (Some(1), 1), (None, 2)] {
            let snapshot = fixture("fixtures/mdanalysis.dcd", chosen);
            let d = snapshot.description();
            let frames = d.frames.unwrap();
            assert_eq!((frames.count, frames.chosen, frames.step), (3, frame, Some(10 * frame as i64)));
            assert_eq!(d.meta.epoch.time, Some(0.5 * frame as f64));
            assert_eq!(d.meta.units.length_text(), Some("Angstrom"));
        }
        let mut lammps = NAMD.to_vec();
        // The title of the file, behind the first record and its own number of lines.
        lammps[100..106].copy_from_slice(b"LAMMPS");
        let by_lammps = open_bytes("a.dcd", &lammps).unwrap();
        let meta = &by_lammps.description().meta;
        assert_eq!((meta.units.length_text(), meta.epoch.time, meta.epoch.step), (None, None, Some(20)));
        let angles = |name: &str| fixture(name, None).description().meta.cell.unwrap().vectors[1];
        assert_eq!(angles("fixtures/be_cosines.dcd"), [0.0, 25.0, 0.0]);
    }

    #[test]
    fn broken_trajectories_are_refused() {
        let cut = fault(&NAMD[..NAMD.len() - 9]);
        assert!(cut.contains("frame 2 is cut off: it has"), "{cut}");
        let mut many = NAMD.to_vec();
        let atoms = many.windows(4).skip(100).position(|w| w == 50u32.to_le_bytes()).unwrap() + 100;
        many[atoms..atoms + 4].copy_from_slice(&2_000_000_000u32.to_le_bytes());
        assert!(fault(&many).contains("frame 0 is cut off"), "{}", fault(&many));
        let mut fixed = NAMD.to_vec();
        fixed[4 + 4 + 32] = 3;
        assert!(fault(&fixed).contains("does not name the 47 atoms that move"), "{}", fault(&fixed));
        let mut wrong = NAMD.to_vec();
        let last = wrong.len() - 4;
        wrong[last] ^= 1;
        assert!(fault(&wrong).contains("frame 2: the record of 200 bytes"), "{}", fault(&wrong));
    }

    /// A file as CHARMM writes it: atoms 2 and 4 of 5 move, and later frames hold them alone.
    #[test]
    fn fixed_atoms_are_those_of_the_first_frame() {
        let record = |content: Vec<u8>| {
            let length = (content.len() as u32).to_le_bytes();
            [&length[..], &content, &length].concat()
        };
        let words = |numbers: &[i32]| record(numbers.iter().flat_map(|n| n.to_le_bytes()).collect());
        let axis = |values: &[f32]| record(values.iter().flat_map(|v| v.to_le_bytes()).collect());
        let mut control = [0i32; 20];
        (control[0], control[2], control[8], control[19]) = (3, 1, 3, 24);
        let numbers = control.iter().flat_map(|n| n.to_le_bytes());
        let head = record(b"CORD".iter().copied().chain(numbers).collect());
        let title = record([&1u32.to_le_bytes()[..], &[b' '; 80]].concat());
        let file = |free: &[i32], later: &[f32]| {
            let frame = |values: &[f32]| [axis(values), axis(values), axis(&vec![7.0; values.len()])].concat();
            [
                head.clone(),
                title.clone(),
                words(&[5]),
                words(free),
                frame(&[0.0, 1.0, 2.0, 3.0, 4.0]),
                frame(later),
                frame(&[-3.0, -4.0]),
            ]
            .concat()
        };
        let whole = file(&[2, 4], &[-1.0, -2.0]);
        for (frame, x) in
            [(0, [0.0, 1.0, 2.0, 3.0, 4.0]), (1, [0.0, -1.0, 2.0, -2.0, 4.0]), (-1, [0.0, -3.0, 2.0, -4.0, 4.0])]
        {
            let path = crate::testing::scratch(&whole);
            let choice = crate::Choice { frame: Some(frame), ..crate::Choice::default() };
            let snapshot = choice.open(&[path.path().into()]).unwrap();
            assert_eq!(crate::testing::vectors(&*snapshot, 0, "pos"), x.map(|x| [x, x, 7.0]), "{frame}");
            assert_eq!(snapshot.description().frames.unwrap().count, 3);
        }
        for (broken, why) in [
            (file(&[2, 6], &[-1.0, -2.0]), "does not name the 2 atoms that move"),
            (file(&[4, 2], &[-1.0, -2.0]), "does not name the 2 atoms that move"),
            (file(&[2], &[-1.0, -2.0]), "does not name the 2 atoms that move"),
            (file(&[2, 4], &[-1.0]), "is cut off: it has"),
            (whole[..whole.len() - 1].to_vec(), "frame 2 is cut off: it has 47 of 48 bytes"),
        ] {
            assert!(fault(&broken).contains(why), "{why}: {}", fault(&broken));
        }
    }
}
