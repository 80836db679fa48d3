//! Files of several frames: every frame is found, one is kept.

use super::content::TextContent;
use super::lines::LineReader;
use super::table::{TableBuilder, TextTable};
use crate::TrajectoryFrames;
use crate::frames::choose;
use particlegs_core::{Error, Result};

pub struct TextFrame<'c, H> {
    pub head: H,
    pub rows: Option<TableBuilder<'c>>,
    /// Its step, as the file numbers it.
    pub step: Option<i64>,
}

pub struct FrameScan<H> {
    pub head: H,
    pub table: TextTable,
    /// Number of frames, and the one chosen.
    pub frames: TrajectoryFrames,
    pub notes: Vec<String>,
}

/// Finds all frames of `content` and keeps frame `chosen`, or the last. `next` reads the frame that
/// begins at the next line (`None` at the end), and its rows where its last argument says so. The
/// second one is the frame's number, 0 again where it begins anew.
pub fn scan<'c, H>(
    content: &'c TextContent,
    chosen: Option<i64>,
    mut next: impl FnMut(&mut LineReader<'c>, u64, bool) -> Result<Option<TextFrame<'c, H>>>,
) -> Result<FrameScan<H>> {
    let open = || LineReader::open(content, super::content::TextPosition::START, None);
    let mut lines = open()?;
    let chosen_frame = choose(content.path(), chosen, |number, is_wanted| {
        if number == 0 {
            lines = open()?;
        }
        next(&mut lines, number, is_wanted)
    })?;
    let frames = chosen_frame.frames(chosen_frame.frame.step);
    let mut notes = chosen_frame.notes;
    if lines.ends_open() {
        notes.push("the last line has no newline: the file may be cut off there".into());
    }
    let rows = chosen_frame.frame.rows.ok_or_else(|| Error::input(content.path(), "the file has no frames"))?;
    Ok(FrameScan { head: chosen_frame.frame.head, table: rows.finish()?, frames, notes })
}
