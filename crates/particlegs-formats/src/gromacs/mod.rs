//! Trajectories of GROMACS: XTC (compressed positions) and TRR (positions, velocities, forces), big-endian numbers in XDR.
//! Frames are found by their headers alone.

mod coding;
pub mod trr;
pub mod xtc;

use crate::atoms::widened;
use particlegs_core::model::{Dimension, Unit, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_files::input::open_file;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// A file that is read here and there.
struct XdrFile {
    path: PathBuf,
    file: File,
    length: u64,
    /// Bytes that were read last, and where they begin.
    window: Vec<u8>,
    start: u64,
}

/// Bytes that are read at once where frames are small.
const WINDOW: u64 = 1 << 16;

impl XdrFile {
    fn open(path: &Path) -> Result<XdrFile> {
        let (file, length) = open_file(path)?;
        Ok(XdrFile { path: path.to_path_buf(), file, length, window: Vec::new(), start: 0 })
    }

    /// Bytes from `at` on, fewer at the end of the file.
    fn bytes(&mut self, at: u64, count: u64) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let read =
            self.file.seek(SeekFrom::Start(at)).and_then(|_| (&mut self.file).take(count).read_to_end(&mut bytes));
        read.map(|_| bytes).map_err(|e| Error::io(&self.path, e))
    }

    /// The same of a header.
    fn head(&mut self, at: u64, count: u64) -> Result<&[u8]> {
        let end = self.start + self.window.len() as u64;
        if at < self.start || (at + count).min(self.length) > end {
            // Headers of small frames lie close together; between large frames a window would be read for nothing.
            let is_near = at.checked_sub(self.start).is_some_and(|ahead| ahead <= WINDOW);
            self.window = self.bytes(at, if is_near { WINDOW } else { count })?;
            self.start = at;
        }
        let from = (at - self.start) as usize;
        Ok(&self.window[from.min(self.window.len())..self.window.len().min(from + count as usize)])
    }

    /// The error for frame `number`, which begins at byte `at`.
    fn error(&self, number: u64, at: u64, reason: &str) -> Error {
        let message = format!("frame {number}, at byte {at}: {reason}");
        Error::input_with(&self.path, message, "the file is damaged or cut short: copy it again")
    }

    /// Checks that a frame of `size` bytes ends within the file, and gives its end.
    fn end(&self, number: u64, at: u64, size: u64) -> Result<u64> {
        let end = at.checked_add(size).filter(|&end| end <= self.length);
        end.ok_or_else(|| self.error(number, at, &format!("it needs {size} bytes, but {} are left", self.length - at)))
    }
}

/// Big-endian numbers of a header, one after the other.
struct XdrNumbers<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl XdrNumbers<'_> {
    fn word(&mut self) -> Option<[u8; 4]> {
        let word = self.bytes.get(self.at..self.at + 4)?.try_into().ok()?;
        self.at += 4;
        Some(word)
    }

    fn int(&mut self) -> Option<i32> {
        self.word().map(i32::from_be_bytes)
    }

    /// A number that must not be negative.
    fn count(&mut self) -> Option<u64> {
        self.int().and_then(|n| u64::try_from(n).ok())
    }

    fn float(&mut self) -> Option<f64> {
        self.word().map(|w| widened(f32::from_be_bytes(w)))
    }

    fn double(&mut self) -> Option<f64> {
        let (high, low) = (self.word()?, self.word()?);
        Some(f64::from_bits(u64::from(u32::from_be_bytes(high)) << 32 | u64::from(u32::from_be_bytes(low))))
    }

    /// Three vectors of numbers of `bytes` bytes.
    fn cell(&mut self, bytes: u64) -> Option<[[f64; 3]; 3]> {
        let mut vectors = [[0.0; 3]; 3];
        for value in vectors.iter_mut().flatten() {
            *value = if bytes == 8 { self.double()? } else { self.float()? };
        }
        Some(vectors)
    }
}

fn periodic(vectors: [[f64; 3]; 3]) -> Option<Cell> {
    Cell::stated([0.0; 3], vectors, [true; 3])
}

fn units() -> Units {
    Units { time: Some(Unit::parse("ps", Dimension::Time)), ..Units::new(Some("nm"), None, None) }
}

#[cfg(test)]
mod tests {
    use crate::Choice;
    use crate::testing::{fault, fixture, vectors};

    const WATER: &[u8] = include_bytes!("../../tests/data/molecules/water.xtc");
    const F64: &[u8] = include_bytes!("../../tests/fixtures/f64.trr");

    fn water(frame: u64, atom: u64) -> [f64; 3] {
        let molecule = atom / 3;
        let centre = [molecule * 7919 % 3000, molecule * 104_729 % 3000, molecule * 1_299_709 % 3000];
        let offset = [[0, 0, 0], [95, 10, -20], [-30, 80, 55]][atom as usize % 3];
        [0, 1, 2].map(|k| (centre[k] as i64 + offset[k] + 5 * frame as i64) as f64 / 1000.0)
    }

    /// Positions that another program packed, in any order and in runs of neighbours.
    #[test]
    fn packed_positions_are_those_that_were_written() {
        for (chosen, frame) in [(Some(0), 0), (None, 1)] {
            let snapshot = fixture("data/molecules/water.xtc", chosen);
            let d = snapshot.description();
            let frames = d.frames.unwrap();
            assert_eq!((frames.count, frames.chosen, d.species[0].count), (2, frame, 300));
            assert_eq!(d.meta.epoch.time, Some(0.5 * frame as f64));
            assert!(d.notes.iter().any(|n| n.contains("rounded to 0.001 nm")), "{:?}", d.notes);
            for (atom, seen) in (0..).zip(vectors(&*snapshot, 0, "pos")) {
                let wanted = water(frame, atom);
                assert!((0..3).all(|k| (seen[k] - wanted[k]).abs() < 1e-6), "{atom}: {seen:?} {wanted:?}");
            }
        }
        let few = fixture("data/molecules/few.xtc", None);
        assert!((vectors(&*few, 0, "pos")[0][0] - 2.259_993).abs() < 1e-5);
    }

    #[test]
    fn velocities_cells_and_times_are_read() {
        for (name, cell) in [("f64.trr", [0.0, 0.0, 25.0]), ("mdanalysis.trr", [12.5, 12.5, 17.677_67])] {
            let snapshot = fixture(&format!("fixtures/{name}"), Some(0));
            let meta = &snapshot.description().meta;
            let last = meta.cell.unwrap().vectors[2];
            assert!((0..3).all(|k| (last[k] - cell[k]).abs() < 1e-5), "{last:?}");
            for (i, seen) in vectors(&*snapshot, 0, "velocity").into_iter().enumerate() {
                let wanted = [0, 1, 2].map(|k| (3 * i + k) as f64 / 8.0 - 5.0);
                assert!((0..3).all(|k| (seen[k] - wanted[k]).abs() < 1e-5), "{name} {i}: {seen:?} {wanted:?}");
            }
        }
        let last = fixture("fixtures/mdanalysis.trr", None);
        let d = last.description();
        assert_eq!((d.frames.unwrap().step, d.meta.epoch.time, d.frames.unwrap().count), (Some(20), Some(1.0), 3));
        assert_eq!((d.meta.units.length_text(), &d.meta.units.time.as_ref().unwrap().text[..]), (Some("nm"), "ps"));
    }

    #[test]
    fn atoms_beyond_a_cell_are_wrapped_or_kept() {
        let mut far = WATER.to_vec();
        // A cell of 0.5 nm, in the last frame.
        let frame = far.len() / 2;
        for vector in 0..3 {
            far[frame + 16 + 16 * vector..][..4].copy_from_slice(&0.5f32.to_be_bytes());
        }
        let file = crate::testing::scratch(&far);
        for keep_unwrapped in [false, true] {
            let choice = Choice { keep_unwrapped, ..Choice::default() };
            let snapshot = choice.open(&[file.path().to_path_buf()]).unwrap();
            assert_eq!(snapshot.description().meta.cell.is_none(), keep_unwrapped);
            let wraps = vectors(&*snapshot, 0, "pos").iter().flatten().all(|&v| v <= 0.500_001);
            assert_eq!(wraps, !keep_unwrapped);
        }
    }

    #[test]
    fn broken_trajectories_are_refused() {
        let cut = fault(&WATER[..WATER.len() - 9]);
        assert!(cut.contains("frame 1, at byte 1124: it needs"), "{cut}");
        let with = |bytes: &[u8], at: usize, value: u32| {
            let mut bytes = bytes.to_vec();
            bytes[at..at + 4].copy_from_slice(&value.to_be_bytes());
            fault(&bytes)
        };
        let frame = WATER.len() / 2;
        assert!(with(WATER, frame, 7).contains("does not begin as a frame does"));
        assert!(with(WATER, frame + 4, 301).contains("301 atoms and 300"));
        assert!(with(WATER, frame + 56, 0).contains("the precision 0 is invalid"));
        assert!(with(WATER, frame + 60, 0x7000_0000).contains("coordinates range from 1879048192"));
        assert!(with(WATER, frame + 84, 80).contains("no small size 80"));
        let few = [&WATER[frame..frame + 88], &8u32.to_be_bytes(), &[0; 8]].concat();
        assert!(fault(&few).contains("8 bytes cannot hold 300 atoms"), "{}", fault(&few));
        assert!(with(F64, 4 + 4 + 4 + 12 + 28, 50).contains("do not fit arrays"));
        assert!(fault(&F64[..F64.len() - 1]).contains("it needs 2564 bytes, but 2563 are left"));
        assert!(fault(&crate::testing::gzip(WATER)).contains("compressed with gzip"));
    }
}
