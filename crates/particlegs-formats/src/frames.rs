//! Files of several frames: every frame is found, one is kept.

use crate::TrajectoryFrames;
use particlegs_core::{Error, Hint, Result};
use std::path::Path;

pub struct ChosenFrame<T> {
    pub frame: T,
    /// Its number, from 0.
    pub number: u64,
    /// Number of frames in the file.
    pub count: u64,
    pub notes: Vec<String>,
}

impl<T> ChosenFrame<T> {
    pub fn frames(&self, step: Option<i64>) -> TrajectoryFrames {
        TrajectoryFrames { count: self.count, chosen: self.number, step }
    }

    pub fn note_of_the_last(count: u64) -> String {
        format!("using frame {}, the last of {count} (0 to {})", count - 1, count - 1)
    }
}

/// The number of the frame `chosen`, or of the last, among the `count` that there are.
pub fn number(path: &Path, chosen: Option<i64>, count: u64) -> Result<u64> {
    let chosen = chosen.unwrap_or(-1);
    let number = if chosen < 0 { count.checked_add_signed(chosen) } else { Some(chosen.unsigned_abs()) };
    number.filter(|&number| number < count).ok_or_else(|| no_frame(path, chosen, count))
}

/// The error for a frame that is not among the `count` that there are.
fn no_frame(path: &Path, chosen: i64, count: u64) -> Error {
    let range = match count {
        0 => return Error::input(path, "the file has no frames"),
        1 => "the only frame is 0".into(),
        _ if chosen < 0 => format!("the frames are 0 to {}, or -{count} to -1 from the end", count - 1),
        _ => format!("the frames are 0 to {}", count - 1),
    };
    Error::input(path, format!("there is no frame {chosen}; {range}"))
}

/// Finds all frames of the file `path` and keeps frame `chosen`, or the last. `next` gives the frame of the number that it
/// is called with, `None` at the end: the first one, or that behind the one before. It is told whether the frame is wanted.
pub fn choose<T>(
    path: &Path,
    chosen: Option<i64>,
    mut next: impl FnMut(u64, bool) -> Result<Option<T>>,
) -> Result<ChosenFrame<T>> {
    let is_default = chosen.is_none();
    // Which one is another than the last from the end is known once all are counted.
    let chosen = match chosen {
        None | Some(-1) => None,
        Some(from_end) if from_end < 0 => {
            let mut count = 0;
            while next(count, false).map_err(|e| with_last_frame(e, count))?.is_some() {
                count += 1;
            }
            Some(number(path, chosen, count)?)
        }
        Some(number) => Some(number.unsigned_abs()),
    };
    let mut chosen_frame = None;
    let mut notes = Vec::new();
    let mut count = 0;
    loop {
        let is_wanted = chosen.is_none_or(|c| c == count);
        match next(count, is_wanted) {
            Ok(None) => break,
            Ok(Some(frame)) => {
                if is_wanted {
                    chosen_frame = Some((frame, count));
                }
                count += 1;
            }
            // What comes after the chosen frame does not matter to it.
            Err(e) if chosen.is_some_and(|c| c < count) => {
                notes.push(format!("frame {count} cannot be read ({e}); later frames are not counted"));
                break;
            }
            Err(e) => return Err(with_last_frame(e, count)),
        }
    }
    let Some((frame, number)) = chosen_frame else {
        return Err(no_frame(path, chosen.map_or(-1, |c| c as i64), count));
    };
    if is_default && count > 1 {
        notes.push(ChosenFrame::<T>::note_of_the_last(count));
    }
    Ok(ChosenFrame { frame, number, count, notes })
}

/// The frame before a broken one can be read.
pub fn with_last_frame(error: Error, whole: u64) -> Error {
    match error {
        Error::Input { place, what, hint } if whole > 0 => {
            let last = Hint::default().option("frame", whole - 1).words(" reads the last whole frame");
            Error::Input { place, what, hint: hint.and(last) }
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use crate::Choice;
    use std::path::Path;

    #[test]
    fn frames_count_from_either_end() {
        let trajectories = ["mdanalysis.dcd", "mdanalysis.pdb", "mdanalysis.trr", "mdanalysis.xtc"];
        for name in trajectories.into_iter().chain([
            "byhand.h5md",
            "ase_frames.extxyz",
            "ase.xdatcar",
            "two_frames.dump.gz",
            "hoomd.gsd",
        ]) {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
            let open =
                |frame: i64| Choice { frame: Some(frame), ..Choice::default() }.open(std::slice::from_ref(&path));
            let count = open(0).unwrap().description().frames.unwrap().count as i64;
            assert!(count > 1, "{name}");
            for number in 0..count {
                let [a, b] = [number, number - count].map(|frame| open(frame).unwrap());
                let [a, b] = [a.description(), b.description()];
                assert_eq!((a.frames.unwrap().chosen, a.meta.epoch.time), (number as u64, b.meta.epoch.time), "{name}");
                assert_eq!((b.frames.unwrap().chosen, &a.notes), (number as u64, &b.notes), "{name}");
            }
            let none = |frame: i64| open(frame).map(drop).unwrap_err().to_string();
            let range = format!("the frames are 0 to {}", count - 1);
            assert!(none(count).contains(&format!("there is no frame {count}; {range}")), "{name}: {}", none(count));
            assert!(none(-count - 1).contains(&format!("{range}, or -{count} to -1")), "{name}: {}", none(-count - 1));
        }
    }
}
