//! Rows of numbers, parsed line by line.

use super::lines::of_block;
use super::split::{Separator, is_blank, leading_number, number, shown, tokens};

/// How the lines of a table are taken apart.
#[derive(Clone, Debug)]
pub struct Layout {
    /// What stands between columns.
    pub separator: Separator,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Where set: lines that begin so, and empty ones, are no rows.
    pub comment: Option<u8>,
}

impl Layout {
    /// Does `line` hold a row?
    pub fn is_row(&self, line: &[u8]) -> bool {
        match self.comment {
            None => true,
            Some(comment) => line.iter().find(|b| !is_blank(**b)).is_some_and(|&b| b != comment),
        }
    }

    /// The value in `column`, where the line goes so far.
    pub fn value<'a>(&self, line: &'a [u8], column: usize) -> Option<&'a [u8]> {
        if self.separator != Separator::Blanks {
            return tokens(line, self.separator).get(column).copied();
        }
        let mut at = 0;
        for _ in 0..column {
            at = past_token(line, past_blanks(line, at));
        }
        let from = past_blanks(line, at);
        let end = past_token(line, from);
        (end > from).then(|| &line[from..end])
    }
}

fn past_blanks(line: &[u8], mut at: usize) -> usize {
    while at < line.len() && is_blank(line[at]) {
        at += 1;
    }
    at
}

fn past_token(line: &[u8], mut at: usize) -> usize {
    while at < line.len() && !is_blank(line[at]) {
        at += 1;
    }
    at
}

/// A cell about which positions are stated in units of its vectors.
#[derive(Clone, Copy, Debug)]
pub struct Scaling {
    /// Its lowest corner.
    pub origin: [f64; 3],
    /// Its vectors.
    pub vectors: [[f64; 3]; 3],
}

impl Scaling {
    fn place(&self, scaled: [f64; 3]) -> [f64; 3] {
        let v = &self.vectors;
        std::array::from_fn(|k| self.origin[k] + scaled[0] * v[0][k] + scaled[1] * v[1][k] + scaled[2] * v[2][k])
    }
}

/// What is read of each row.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The columns read, ascending, each once.
    wanted: Vec<usize>,
    /// Which of them are x, y, z and the weight.
    slots: Vec<usize>,
    /// Positions in units of a cell.
    scaling: Option<Scaling>,
    /// Only rows whose value in this column is this one.
    key: Option<(usize, Vec<u8>)>,
    /// Positions are taken about this point.
    origin: [f64; 3],
}

impl Plan {
    /// Reads positions from three columns, and weights.
    pub fn new(
        positions: [usize; 3],
        weight: Option<usize>,
        scaling: Option<Scaling>,
        key: Option<(usize, Vec<u8>)>,
    ) -> Self {
        let all: Vec<usize> = positions.into_iter().chain(weight).collect();
        let mut wanted = all.clone();
        wanted.sort_unstable();
        wanted.dedup();
        let slots = all.iter().filter_map(|c| wanted.binary_search(c).ok()).collect();
        Plan { wanted, slots, scaling, key, origin: [0.0; 3] }
    }

    /// The same about `origin`.
    pub fn about(mut self, origin: [f64; 3]) -> Self {
        self.origin = origin;
        self
    }

    /// The same of all species.
    pub fn of_all(mut self) -> Self {
        self.key = None;
        self
    }

    /// The point that positions are taken about.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Are there weights?
    pub fn has_weights(&self) -> bool {
        self.slots.len() > 3
    }
}

/// Columns of particles: x, y, z about an origin, weights.
pub type Columns = [Vec<f32>; 4];

/// A line that cannot be read.
#[derive(Debug)]
pub struct Fault {
    /// Its number.
    pub line: u64,
    /// What is wrong.
    pub what: String,
}

/// Parses rows, those before `skip` and beyond `room` left out.
pub struct Parser<'a> {
    /// How lines are taken apart.
    pub layout: &'a Layout,
    /// What is read.
    pub plan: &'a Plan,
    /// Rows to pass over.
    pub skip: u64,
    /// Rows still wanted.
    pub room: usize,
}

impl Parser<'_> {
    /// Appends the rows of `block`, whose first line has number `line`, to `out`; bytes and lines
    /// that were used up.
    ///
    /// # Errors
    /// The first line that is no row of this table.
    pub fn block(&mut self, block: &[u8], line: u64, out: &mut Columns) -> Result<(usize, u64), Fault> {
        let (mut bytes, mut lines) = (0, 0);
        for (text, length) in of_block(block) {
            if self.room == 0 {
                break;
            }
            if self.layout.is_row(text) && self.is_chosen(text) {
                if self.skip > 0 {
                    self.skip -= 1;
                } else {
                    self.row(text, out).ok_or_else(|| self.fault(text, line + lines))?;
                    self.room -= 1;
                }
            }
            bytes += length;
            lines += 1;
        }
        Ok((bytes, lines))
    }

    fn is_chosen(&self, line: &[u8]) -> bool {
        match &self.plan.key {
            None => true,
            Some((column, key)) => self.layout.value(line, *column) == Some(key),
        }
    }

    #[inline]
    fn row(&self, line: &[u8], out: &mut Columns) -> Option<()> {
        let values = match self.layout.separator {
            Separator::Blanks => self.blanks(line),
            Separator::Byte(byte) => self.bytes(line, byte),
        };
        let values = values.or_else(|| self.slowly(line))?;
        let slots = &self.plan.slots;
        let mut position = [values[slots[0]], values[slots[1]], values[slots[2]]];
        if let Some(scaling) = &self.plan.scaling {
            position = scaling.place(position);
        }
        for k in 0..3 {
            out[k].push((position[k] - self.plan.origin[k]) as f32);
        }
        if let Some(&slot) = slots.get(3) {
            out[3].push(values[slot] as f32);
        }
        Some(())
    }

    /// The wanted values of a line of values between blanks, where all is as it should be.
    #[inline]
    fn blanks(&self, line: &[u8]) -> Option<[f64; 4]> {
        let mut values = [0.0; 4];
        let (mut at, mut column) = (0, 0);
        for (value, &want) in values.iter_mut().zip(&self.plan.wanted) {
            while column < want {
                at = past_token(line, past_blanks(line, at));
                column += 1;
            }
            at = past_blanks(line, at);
            let (read, length) = leading_number(&line[at..])?;
            at += length;
            if at < line.len() && !is_blank(line[at]) {
                return None;
            }
            *value = read;
            column += 1;
        }
        // A token begins after each blank that no blank follows.
        let more = line[at..].windows(2).filter(|w| is_blank(w[0]) & !is_blank(w[1])).count();
        (column + more == self.layout.columns.len()).then_some(values)
    }

    /// The same for values with one byte between.
    #[inline]
    fn bytes(&self, line: &[u8], separator: u8) -> Option<[f64; 4]> {
        let mut values = [0.0; 4];
        let (mut at, mut column) = (0, 0);
        for (value, &want) in values.iter_mut().zip(&self.plan.wanted) {
            while column < want {
                at += memchr::memchr(separator, &line[at..])? + 1;
                column += 1;
            }
            while at < line.len() && is_blank(line[at]) && line[at] != separator {
                at += 1;
            }
            let (read, length) = leading_number(&line[at..])?;
            at += length;
            while at < line.len() && is_blank(line[at]) && line[at] != separator {
                at += 1;
            }
            if at < line.len() && line[at] != separator {
                return None;
            }
            *value = read;
        }
        let more = line[at..].iter().filter(|&&b| b == separator).count();
        (column + 1 + more == self.layout.columns.len()).then_some(values)
    }

    /// Values that are quoted, or written as Fortran does.
    #[cold]
    fn slowly(&self, line: &[u8]) -> Option<[f64; 4]> {
        let all = tokens(line, self.layout.separator);
        if all.len() != self.layout.columns.len() {
            return None;
        }
        let mut values = [0.0; 4];
        for (value, &want) in values.iter_mut().zip(&self.plan.wanted) {
            *value = number(all[want])?;
        }
        Some(values)
    }

    /// What is wrong with a line that could not be read.
    #[cold]
    fn fault(&self, line: &[u8], number_of_line: u64) -> Fault {
        let all = tokens(line, self.layout.separator);
        let (have, expected) = (all.len(), self.layout.columns.len());
        let wrong = self.plan.wanted.iter().find(|&&c| c < have && number(all[c]).is_none());
        let what = match wrong {
            Some(&c) => format!("column {} (`{}`): {} is no number", c + 1, self.layout.columns[c], shown(all[c])),
            None if have == 0 || all == [b""] => format!("is empty, where {expected} columns belong"),
            None => format!("has {have} column{}, not {expected}", if have == 1 { "" } else { "s" }),
        };
        Fault { line: number_of_line, what }
    }
}
