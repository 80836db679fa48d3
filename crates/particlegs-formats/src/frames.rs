//! Files of several frames: every frame is found, one is kept.

use crate::TrajectoryFrames;
use crate::snapshot::no_frame;
use particlegs_pipeline::{Error, Hint, Result};
use std::path::Path;

pub struct ChosenFrame<T> {
    pub frame: T,
    /// Its number, from 0.
    pub number: u64,
    /// How many there are.
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

/// Finds all frames of the file `path` and keeps frame `chosen`, or the last. `next` gives the frame of the number that it
/// is called with, which follows the one before, `None` at the end.
pub fn choose<T>(
    path: &Path,
    chosen: Option<u64>,
    mut next: impl FnMut(u64) -> Result<Option<T>>,
) -> Result<ChosenFrame<T>> {
    let mut kept = None;
    let mut notes = Vec::new();
    let mut count = 0;
    loop {
        match next(count) {
            Ok(None) => break,
            Ok(Some(frame)) => {
                if chosen.is_none_or(|c| c == count) {
                    kept = Some((frame, count));
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
    let Some((frame, number)) = kept else {
        return Err(match count {
            0 => Error::input(path, "the file has no frames"),
            count => no_frame(path, chosen.unwrap_or(0), count),
        });
    };
    if chosen.is_none() && count > 1 {
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
