//! Places of a table's rows in a file, and the number of each species. Of files of several frames every frame is found, and
//! the table of one is kept.

use super::content::{TextContent, TextPosition};
use super::lines::{LineReader, of_block};
use super::parse::{RowRule, TableLayout, same};
use crate::TrajectoryFrames;
use crate::frames::choose;
use particlegs_core::{Error, Result, parallel};

/// Most species that a column of types may tell apart.
pub const MOST_SPECIES: usize = 64;
/// A place is kept every so many bytes, or more in long files.
const STRETCH: u64 = 1 << 18;
/// Places kept, at most.
const STRETCHES: u64 = 1 << 16;
/// First bytes of the rows that are kept for a look at them.
const HEAD: usize = 1 << 16;

#[derive(Clone, Debug, PartialEq)]
pub struct SpeciesRows {
    /// The value of the table's key column, where rows are told apart by one.
    pub key: Option<Vec<u8>>,
    pub count: u64,
}

pub struct TextTable {
    pub content: TextContent,
    pub layout: TableLayout,
    /// Column by which rows are told apart, where there are at least two species.
    pub key: Option<usize>,
    pub kinds: Vec<SpeciesRows>,
    /// The first rows, at least one.
    pub head: Vec<u8>,
    pub start: TextPosition,
    pub end: TextPosition,
    /// Places on the way, the first at the start; none in compressed files.
    pub stretches: Vec<TextPosition>,
    /// Rows of each species before each stretch.
    pub before: Vec<Vec<u64>>,
    /// The values that the key column has: one or more than can be told apart.
    pub keys: Vec<Vec<u8>>,
}

pub struct TableBuilder<'a> {
    content: &'a TextContent,
    layout: TableLayout,
    key: Option<usize>,
    step: u64,
    start: TextPosition,
    end: TextPosition,
    head: Vec<u8>,
    stretches: Vec<TextPosition>,
    tally: RowTally,
}

/// Rows counted, by the value of the key column.
#[derive(Default)]
struct RowTally {
    counts: Vec<(Vec<u8>, u64)>,
    rows: u64,
    /// The value seen last is often the next one.
    last: usize,
}

impl RowTally {
    fn add(
        &mut self,
        content: &TextContent,
        layout: &TableLayout,
        key: Option<usize>,
        line: u64,
        block: &[u8],
    ) -> Result<()> {
        for (number, (text, _)) in (line..).zip(of_block(block)) {
            if !layout.is_row(text) {
                continue;
            }
            self.rows += 1;
            if let Some(column) = key {
                let value = layout.value(text, column).ok_or_else(|| {
                    let message = format!("line {number} has no column {} (`{}`)", column + 1, layout.columns[column]);
                    Error::input(content.path(), message)
                })?;
                self.count((layout.species)(value), 1);
            }
        }
        Ok(())
    }

    fn count(&mut self, value: &[u8], rows: u64) {
        if self.counts.get(self.last).is_none_or(|(v, _)| !same(v, value)) {
            let index = self.counts.iter().position(|(v, _)| same(v, value));
            self.last = index.unwrap_or(self.counts.len());
            if index.is_none() {
                if self.counts.len() > MOST_SPECIES {
                    return; // Too many already; the rest is not needed.
                }
                self.counts.push((value.to_vec(), 0));
            }
        }
        self.counts[self.last].1 += rows;
    }
}

impl<'a> TableBuilder<'a> {
    /// A table whose rows begin at `start`; species by the values of column `key`.
    pub fn new(content: &'a TextContent, layout: TableLayout, key: Option<usize>, start: TextPosition) -> Self {
        let length = std::fs::metadata(content.path()).map_or(0, |m| m.len());
        let step = STRETCH.max(length / STRETCHES);
        let (head, stretches, tally) = Default::default();
        TableBuilder { content, layout, key, step, start, end: start, head, stretches, tally }
    }

    /// From now on, lines that begin so are no rows.
    pub fn has_comments(&mut self, comment: u8) {
        self.layout.rows = RowRule::Uncommented(comment);
    }

    pub fn add(&mut self, place: TextPosition, block: &[u8]) -> Result<()> {
        if self.head.len() < HEAD {
            // The first row whatever its length, then as many as fit.
            let mut rows = of_block(block).map(|(_, length)| length);
            let mut length = rows.next().unwrap_or(0);
            while length < HEAD {
                match rows.next() {
                    Some(more) => length += more,
                    None => break,
                }
            }
            self.head.extend_from_slice(&block[..length]);
        }
        if self.content.is_seekable() {
            if self.stretches.last().is_none_or(|s| place.offset - s.offset >= self.step) {
                self.stretches.push(place);
            }
        } else {
            self.tally.add(self.content, &self.layout, self.key, place.line, block)?;
        }
        Ok(())
    }

    pub fn until(mut self, end: TextPosition) -> Self {
        self.end = end;
        self
    }

    /// The table, all rows taken in. Those of plain files are looked at only here.
    pub fn finish(mut self) -> Result<TextTable> {
        // Where every line is a row, the places' own numbers tell how many there are.
        let counts_lines = self.key.is_none() && self.layout.rows == RowRule::All;
        let tallies: Vec<RowTally> = if !self.content.is_seekable() {
            vec![std::mem::take(&mut self.tally)]
        } else if counts_lines {
            (0..self.stretches.len()).map(|i| RowTally { rows: self.lines_of(i), ..RowTally::default() }).collect()
        } else {
            parallel::try_map_range(self.stretches.len(), |i| self.tally(i))?
        };
        Ok(self.table(tallies))
    }

    fn stretch_end(&self, index: usize) -> TextPosition {
        self.stretches.get(index + 1).copied().unwrap_or(self.end)
    }

    fn lines_of(&self, index: usize) -> u64 {
        self.stretch_end(index).line - self.stretches[index].line
    }

    fn tally(&self, index: usize) -> Result<RowTally> {
        let mut tally = RowTally::default();
        let mut lines = LineReader::open(self.content, self.stretches[index], Some(self.stretch_end(index).offset))?;
        lines.pass(u64::MAX, |place, block| tally.add(self.content, &self.layout, self.key, place.line, block))?;
        Ok(tally)
    }

    fn table(self, tallies: Vec<RowTally>) -> TextTable {
        let mut all = RowTally::default();
        for tally in &tallies {
            tally.counts.iter().for_each(|(value, count)| all.count(value, *count));
            all.rows += tally.rows;
        }
        // Numbered types stand by their numbers, not in the order of their first rows.
        if all.counts.iter().all(|(value, _)| integer(value).is_some()) {
            all.counts.sort_by_key(|(value, _)| integer(value));
        }
        let keys: Vec<Vec<u8>> = all.counts.iter().map(|(value, _)| value.clone()).collect();
        let key = self.key.filter(|_| (2..=MOST_SPECIES).contains(&keys.len()));
        let kinds: Vec<SpeciesRows> = match key {
            Some(_) => all.counts.into_iter().map(|(key, count)| SpeciesRows { key: Some(key), count }).collect(),
            None => vec![SpeciesRows { key: None, count: all.rows }],
        };
        let before = kinds.iter().map(|kind| {
            let mut sum = 0;
            let rows = tallies.iter().map(|tally| match &kind.key {
                None => tally.rows,
                Some(key) => tally.counts.iter().find(|(value, _)| value == key).map_or(0, |(_, count)| *count),
            });
            rows.map(|rows| {
                sum += rows;
                sum - rows
            })
            .collect()
        });
        let before = if self.content.is_seekable() { before.collect() } else { Vec::new() };
        let TableBuilder { content, layout, head, stretches, start, end, .. } = self;
        TextTable { content: content.clone(), layout, key, kinds, head, start, end, stretches, before, keys }
    }
}

impl TextTable {
    /// Gives every row, in order.
    pub fn for_each_row(&self, mut each: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
        let mut lines = LineReader::open(&self.content, self.start, Some(self.end.offset))?;
        let rows = lines.pass(u64::MAX, |_, block| {
            of_block(block).map(|(line, _)| line).filter(|line| self.layout.is_row(line)).try_for_each(&mut each)
        });
        rows.map(drop)
    }
}

fn integer(value: &[u8]) -> Option<i64> {
    std::str::from_utf8(value).ok()?.parse().ok()
}

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
    let open = || LineReader::open(content, TextPosition::START, None);
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
