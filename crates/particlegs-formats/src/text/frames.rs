//! Files of several frames: every frame is found, one is kept.

use super::content::TextContent;
use super::lines::LineReader;
use super::table::{TableBuilder, TextTable};
use crate::TrajectoryFrames;
use crate::snapshot::no_frame;
use particlegs_pipeline::{Error, Hint, Result};

pub struct TextFrame<'c, H> {
    pub head: H,
    pub rows: Option<TableBuilder<'c>>,
    /// Its step, as the file numbers it.
    pub step: Option<i64>,
}

pub struct FrameScan<H> {
    pub head: H,
    pub table: TextTable,
    /// How many there are, and which is chosen.
    pub frames: TrajectoryFrames,
    pub notes: Vec<String>,
}

/// Finds all frames of `content` and keeps frame `chosen`, or the last. `next` reads the frame that
/// begins at the next line (`None` at the end), and its rows where its last argument says so. The
/// second one is the frame's number.
pub fn scan<'c, H>(
    content: &'c TextContent,
    chosen: Option<u64>,
    mut next: impl FnMut(&mut LineReader<'c>, u64, bool) -> Result<Option<TextFrame<'c, H>>>,
) -> Result<FrameScan<H>> {
    let mut lines = LineReader::open(content, super::content::TextPosition::START, None)?;
    let mut kept = None;
    let mut notes = Vec::new();
    let mut count = 0;
    loop {
        match next(&mut lines, count, chosen.is_none_or(|c| c == count)) {
            Ok(None) => break,
            Ok(Some(TextFrame { head, rows, step })) => {
                if let Some(rows) = rows {
                    kept = Some((head, rows, TrajectoryFrames { count, chosen: count, step }));
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
    if lines.ends_open() {
        notes.push("the last line has no newline: the file may be cut off there".into());
    }
    let Some((head, rows, frames)) = kept else {
        return Err(match count {
            0 => Error::input(content.path(), "the file has no frames"),
            count => no_frame(content.path(), chosen.unwrap_or(0), count),
        });
    };
    let table = rows.finish()?;
    if chosen.is_none() && count > 1 {
        notes.push(format!("using frame {}, the last of {count} (0 to {})", frames.chosen, count - 1));
    }
    Ok(FrameScan { head, table, frames: TrajectoryFrames { count, ..frames }, notes })
}

/// The frame before a broken one can be read.
fn with_last_frame(error: Error, whole: u64) -> Error {
    match error {
        Error::Input { place, what, hint } if whole > 0 => {
            let last = Hint::default().option("frame", whole - 1).words(" reads the last whole frame");
            Error::Input { place, what, hint: hint.and(last) }
        }
        other => other,
    }
}
