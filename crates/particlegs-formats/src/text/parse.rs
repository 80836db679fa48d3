//! Rows of numbers, parsed line by line.

use super::lines::without_end;
use super::number::number_at;
use super::split::{FixedColumns, Separator, first_byte, is_blank, number, number_with, shown, tokens};
use crate::ascii::whole_bits;
use particlegs_core::space::PeriodicCell;

/// The lines that are rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowRule {
    All,
    /// All but empty ones and those that begin so.
    Uncommented(u8),
    /// Those that begin with one of these.
    Records(&'static [&'static [u8]]),
}

#[derive(Clone, Debug)]
pub struct TableLayout {
    pub separator: Separator,
    pub columns: Vec<String>,
    pub rows: RowRule,
    /// Whether a comma stands for the decimal point.
    pub comma: bool,
    /// The species that a value of the key column means: itself, or a name for several.
    pub species: fn(&[u8]) -> &[u8],
}

/// Every value is a species of its own.
pub fn itself(value: &[u8]) -> &[u8] {
    value
}

impl TableLayout {
    /// Whether the line at the beginning of `text` holds a row.
    #[inline]
    pub fn is_row(&self, text: &[u8]) -> bool {
        match self.rows {
            RowRule::All => true,
            RowRule::Uncommented(comment) => first_byte(text).is_some_and(|b| b != comment),
            RowRule::Records(names) => names.iter().any(|name| text.starts_with(name)),
        }
    }

    /// The value in `column`, where the line goes so far.
    #[inline]
    pub fn value<'a>(&self, line: &'a [u8], column: usize) -> Option<&'a [u8]> {
        match self.separator {
            Separator::Blanks => {}
            Separator::Byte(_) => return tokens(line, self.separator).get(column).copied(),
            Separator::Fixed(columns) => return columns.value(first_line(line).0, column),
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

#[inline(always)]
fn past_blanks(text: &[u8], mut at: usize) -> usize {
    while at < text.len() && is_blank(text[at]) {
        at += 1;
    }
    at
}

/// Past the bytes of a token: line ends and other control characters end it, as blanks do.
#[inline(always)]
fn past_token(text: &[u8], mut at: usize) -> usize {
    while at < text.len() && text[at] > b' ' {
        at += 1;
    }
    at
}

/// The first line of a text without its end, and how many bytes it takes.
#[inline]
fn first_line(text: &[u8]) -> (&[u8], usize) {
    let length = line_length(text);
    (without_end(&text[..length]), length)
}

#[inline]
fn line_length(text: &[u8]) -> usize {
    memchr::memchr(b'\n', text).map_or(text.len(), |n| n + 1)
}

/// A cell about which positions are stated in units of its vectors.
#[derive(Clone, Copy, Debug)]
pub struct Scaling {
    pub origin: [f64; 3],
    pub vectors: [[f64; 3]; 3],
}

impl Scaling {
    fn place(&self, scaled: [f64; 3]) -> [f64; 3] {
        let v = &self.vectors;
        std::array::from_fn(|k| self.origin[k] + scaled[0] * v[0][k] + scaled[1] * v[1][k] + scaled[2] * v[2][k])
    }
}

#[derive(Clone, Debug)]
pub struct RowPlan {
    /// The columns read, ascending, each once.
    wanted: Vec<usize>,
    /// Indices among them of x, y, z and the weight.
    slots: [usize; 4],
    weighted: bool,
    scaling: Option<Scaling>,
    cell: Option<PeriodicCell>,
    /// Columns whose whole numbers are wanted as their bits.
    whole: Vec<usize>,
    /// Only rows whose value in this column is this one.
    key: Option<(usize, Vec<u8>)>,
    /// Positions are taken about this point.
    origin: [f64; 3],
}

impl RowPlan {
    /// Reads positions from three columns, and weights, of all species.
    pub fn new(positions: [usize; 3], weight: Option<usize>, scaling: Option<Scaling>) -> Self {
        let all: Vec<usize> = positions.into_iter().chain(weight).collect();
        let mut wanted = all.clone();
        wanted.sort_unstable();
        wanted.dedup();
        let mut slots = [0; 4];
        for (slot, column) in slots.iter_mut().zip(&all) {
            *slot = wanted.binary_search(column).unwrap_or(0);
        }
        let (weighted, whole, origin) = (weight.is_some(), Vec::new(), [0.0; 3]);
        RowPlan { wanted, slots, weighted, scaling, whole, cell: None, key: None, origin }
    }

    pub fn wrapped(mut self, cell: Option<PeriodicCell>) -> Self {
        self.cell = cell;
        self
    }

    /// The same with the bits of the whole numbers in `columns`.
    pub fn with_bits_of(mut self, columns: Vec<usize>) -> Self {
        self.whole = columns;
        self
    }

    pub fn about(mut self, origin: [f64; 3]) -> Self {
        self.origin = origin;
        self
    }

    /// The same of rows whose value in a column is this one, or of all.
    pub fn with_key(mut self, key: Option<(usize, Vec<u8>)>) -> Self {
        self.key = key;
        self
    }

    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    pub fn has_weights(&self) -> bool {
        self.weighted
    }
}

fn whole(token: &[u8]) -> Option<u64> {
    whole_bits(std::str::from_utf8(token).ok()?)
}

/// Whether bytes are equal. Keys are a byte or two: a call to compare them would cost more than they do.
#[inline(always)]
pub fn same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b)
}

/// Columns of particles: x, y, z about an origin, weights.
pub type ParticleColumns<T = f32> = [Vec<T>; 4];

pub trait TableNumber: Copy + Send {
    fn about(value: f64, origin: f64) -> Self;
}

impl TableNumber for f32 {
    fn about(value: f64, origin: f64) -> f32 {
        (value - origin) as f32
    }
}

impl TableNumber for f64 {
    fn about(value: f64, _: f64) -> f64 {
        value
    }
}

#[derive(Debug)]
pub struct LineError {
    pub line: u64,
    pub what: String,
}

/// Parses rows, those before `skip` and beyond `room` left out.
pub struct RowParser<'a> {
    pub layout: &'a TableLayout,
    pub plan: &'a RowPlan,
    /// Rows to pass over.
    pub skip: u64,
    /// Rows still wanted.
    pub room: usize,
}

impl RowParser<'_> {
    /// Appends the rows of `block`, whose first line has number `line`, to `out`; bytes and lines
    /// that were used up.
    pub fn block<T: TableNumber>(
        &mut self,
        block: &[u8],
        line: u64,
        out: &mut ParticleColumns<T>,
    ) -> Result<(usize, u64), LineError> {
        let (mut at, mut lines) = (0, 0);
        while at < block.len() && self.room > 0 {
            let text = &block[at..];
            let mut length = None;
            if self.layout.is_row(text) && self.is_chosen(text) {
                if self.skip > 0 {
                    self.skip -= 1;
                } else {
                    length = self.row(text, out);
                    if length.is_none() {
                        return Err(self.fault(first_line(text).0, line + lines));
                    }
                    self.room -= 1;
                }
            }
            at += length.unwrap_or_else(|| line_length(text));
            lines += 1;
        }
        Ok((at, lines))
    }

    #[inline(always)]
    fn is_chosen(&self, text: &[u8]) -> bool {
        match &self.plan.key {
            None => true,
            Some((column, key)) => {
                self.layout.value(text, *column).is_some_and(|value| same((self.layout.species)(value), key))
            }
        }
    }

    /// Reads the row at the beginning of `text`; how many bytes its line takes.
    #[inline(always)]
    fn row<T: TableNumber>(&self, text: &[u8], out: &mut ParticleColumns<T>) -> Option<usize> {
        let mut values = [0.0; 4];
        let length = match self.layout.separator {
            // Decimal commas are rare: only the slow way knows them.
            _ if self.layout.comma => None,
            Separator::Blanks => self.blanks(text, &mut values),
            Separator::Byte(byte) => self.bytes(text, byte, &mut values),
            Separator::Fixed(columns) => self.fixed(text, columns, &mut values),
        };
        let length = length.or_else(|| self.slowly(text, &mut values))?;
        if !self.plan.whole.is_empty() {
            self.bits(text, &mut values)?;
        }
        // The masks show the compiler that no index is out of bounds.
        let slots = &self.plan.slots;
        let mut position = [values[slots[0] & 3], values[slots[1] & 3], values[slots[2] & 3]];
        if let Some(scaling) = &self.plan.scaling {
            position = scaling.place(position);
        }
        if let Some(cell) = self.plan.cell {
            position = cell.image(position);
        }
        for k in 0..3 {
            out[k].push(T::about(position[k], self.plan.origin[k]));
        }
        if self.plan.weighted {
            out[3].push(T::about(values[slots[3] & 3], 0.0));
        }
        Some(length)
    }

    /// The wanted values of a line of values between blanks, where all is as it should be. The line's
    /// end is found on the way.
    #[inline(always)]
    fn blanks(&self, text: &[u8], values: &mut [f64; 4]) -> Option<usize> {
        let (mut at, mut column) = (0, 0);
        for (value, &want) in values.iter_mut().zip(&self.plan.wanted) {
            while column < want {
                at = past_token(text, past_blanks(text, at));
                column += 1;
            }
            at = past_blanks(text, at);
            *value = number_at(text, &mut at)?;
            if at < text.len() && text[at] > b' ' {
                return None;
            }
            column += 1;
        }
        let columns = self.layout.columns.len();
        let end = past_blanks(text, at);
        if column == columns && text.get(end) == Some(&b'\n') {
            return Some(end + 1);
        }
        // A token begins after each blank that no blank follows.
        let (rest, length) = first_line(&text[at..]);
        let more = rest.windows(2).filter(|w| is_blank(w[0]) & !is_blank(w[1])).count();
        (column + more == columns).then_some(at + length)
    }

    /// The same for values with one byte between.
    #[inline(always)]
    fn bytes(&self, text: &[u8], separator: u8, values: &mut [f64; 4]) -> Option<usize> {
        let (line, length) = first_line(text);
        let is_room = |byte: u8| is_blank(byte) && byte != separator;
        let (mut at, mut column) = (0, 0);
        for (value, &want) in values.iter_mut().zip(&self.plan.wanted) {
            while column < want {
                at += memchr::memchr(separator, &line[at..])? + 1;
                column += 1;
            }
            while at < line.len() && is_room(line[at]) {
                at += 1;
            }
            *value = number_at(line, &mut at)?;
            while at < line.len() && is_room(line[at]) {
                at += 1;
            }
            if at < line.len() && line[at] != separator {
                return None;
            }
        }
        let more = line[at..].iter().filter(|&&b| b == separator).count();
        (column + 1 + more == self.layout.columns.len()).then_some(length)
    }

    /// The same of values that have their own bytes of the line.
    fn fixed(&self, text: &[u8], columns: FixedColumns, values: &mut [f64; 4]) -> Option<usize> {
        let (line, length) = first_line(text);
        for (value, &want) in values.iter_mut().zip(&self.plan.wanted) {
            *value = number(columns.value(line, want)?)?;
        }
        Some(length)
    }

    /// The bits of values that are whole numbers of 64 bits.
    fn bits(&self, text: &[u8], values: &mut [f64; 4]) -> Option<()> {
        let all = tokens(first_line(text).0, self.layout.separator);
        for (value, want) in values.iter_mut().zip(&self.plan.wanted).filter(|(_, want)| self.plan.whole.contains(want))
        {
            *value = f64::from_bits(whole(all.get(*want)?)?);
        }
        Some(())
    }

    /// Values that are quoted, or written as Fortran does, or with a decimal comma.
    #[cold]
    fn slowly(&self, text: &[u8], values: &mut [f64; 4]) -> Option<usize> {
        let (line, length) = first_line(text);
        let all = tokens(line, self.layout.separator);
        if all.len() != self.layout.columns.len() {
            return None;
        }
        for (value, &want) in values.iter_mut().zip(&self.plan.wanted) {
            *value = number_with(all[want], self.layout.comma)?;
        }
        Some(length)
    }

    #[cold]
    fn fault(&self, line: &[u8], number_of_line: u64) -> LineError {
        let all = tokens(line, self.layout.separator);
        let (have, expected) = (all.len(), self.layout.columns.len());
        let wrong = self.plan.wanted.iter().find(|&&c| c < have && number_with(all[c], self.layout.comma).is_none());
        let message = match wrong {
            Some(&c) => format!("column {} (`{}`): {} is not a number", c + 1, self.layout.columns[c], shown(all[c])),
            None if self.plan.whole.iter().any(|&c| all.get(c).is_some_and(|t| whole(t).is_none())) => {
                "has a number that is not an integer, unlike the lines before".into()
            }
            None if have == 0 || all == [b""] => format!("is empty; expected {expected} columns"),
            None => format!("has {have} column{}; expected {expected}", if have == 1 { "" } else { "s" }),
        };
        LineError { line: number_of_line, what: message }
    }
}
