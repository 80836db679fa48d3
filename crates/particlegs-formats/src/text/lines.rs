//! The lines of a stream, a window at a time, in bounded memory.

use super::content::{TextContent, TextPosition};
use particlegs_core::{Error, Result};
use std::io::Read;

/// Longest line accepted, in bytes: what is longer is no table of particles.
pub const LINE_LIMIT: usize = 1 << 20;
const WINDOW: usize = 1 << 18;
/// Bytes in which newlines are counted before one of them is looked for.
const STRIDE: usize = 1 << 14;

pub struct LineReader<'a> {
    content: &'a TextContent,
    source: Box<dyn Read>,
    buffer: Vec<u8>,
    /// Whole lines lie in `start..whole`, the beginning of the next one in `whole..filled`.
    start: usize,
    whole: usize,
    filled: usize,
    ended: bool,
    /// Whether the last line has no end.
    open: bool,
    place: TextPosition,
}

impl<'a> LineReader<'a> {
    /// Lines from `place` on, to byte `end` where it is given.
    pub fn open(content: &'a TextContent, place: TextPosition, end: Option<u64>) -> Result<Self> {
        let (source, buffer) = (content.stream(place.offset, end)?, vec![0; WINDOW]);
        Ok(LineReader { content, source, buffer, start: 0, whole: 0, filled: 0, ended: false, open: false, place })
    }

    pub fn place(&self) -> TextPosition {
        self.place
    }

    /// Whether the content ended without a newline.
    pub fn ends_open(&self) -> bool {
        self.open
    }

    /// Reads on until there is a whole line; false at the end.
    fn fill(&mut self) -> Result<bool> {
        if self.start < self.whole {
            return Ok(true);
        }
        // The beginning of a line moves to the front; only a line that fills all of it makes the buffer grow.
        self.buffer.copy_within(self.start..self.filled, 0);
        self.filled -= self.start;
        (self.start, self.whole) = (0, 0);
        while !self.ended {
            if self.filled == self.buffer.len() {
                if self.filled > LINE_LIMIT {
                    let line = self.place.line;
                    return Err(self.error(format!("line {line} is longer than {LINE_LIMIT} bytes")));
                }
                self.buffer.resize(2 * self.filled, 0);
            }
            let from = self.filled;
            self.read_window()?;
            if let Some(last) = memchr::memrchr(b'\n', &self.buffer[from..self.filled]) {
                self.whole = from + last + 1;
                return self.check(from).map(|()| true);
            }
        }
        self.whole = self.filled;
        self.open |= self.filled > 0;
        self.check(0).map(|()| self.filled > 0)
    }

    /// Reads until the buffer is full or the stream ends.
    fn read_window(&mut self) -> Result<()> {
        while self.filled < self.buffer.len() {
            match self.source.read(&mut self.buffer[self.filled..]) {
                Ok(0) => {
                    self.ended = true;
                    break;
                }
                Ok(n) => self.filled += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(self.content.error(self.place.offset + self.filled as u64, e)),
            }
        }
        Ok(())
    }

    /// Refuses a first line that is too long: it ends in the window that begins at `from`, or with the content.
    fn check(&self, from: usize) -> Result<()> {
        let first = memchr::memchr(b'\n', &self.buffer[from..self.filled]).map_or(self.filled, |n| from + n);
        if first > LINE_LIMIT {
            return Err(self.error(format!("line {} is longer than {LINE_LIMIT} bytes", self.place.line)));
        }
        Ok(())
    }

    fn error(&self, text: String) -> Error {
        Error::input_with(self.content.path(), text, "this is not a table of particles, or its line ends are missing")
    }

    fn take(&mut self, bytes: usize, lines: u64) -> &[u8] {
        let from = self.start;
        self.start += bytes;
        self.place.offset += bytes as u64;
        self.place.line += lines;
        &self.buffer[from..from + bytes]
    }

    pub fn line(&mut self) -> Result<Option<&[u8]>> {
        if !self.fill()? {
            return Ok(None);
        }
        let rest = &self.buffer[self.start..self.whole];
        let length = memchr::memchr(b'\n', rest).map_or(rest.len(), |n| n + 1);
        Ok(Some(without_end(self.take(length, 1))))
    }

    /// The next line, without its end and without going past it.
    pub fn peek(&mut self) -> Result<Option<&[u8]>> {
        if !self.fill()? {
            return Ok(None);
        }
        let rest = &self.buffer[self.start..self.whole];
        let length = memchr::memchr(b'\n', rest).map_or(rest.len(), |n| n + 1);
        Ok(Some(without_end(&rest[..length])))
    }

    /// Whole lines, as many as are at hand; nothing at the end.
    pub fn block(&mut self) -> Result<Option<&[u8]>> {
        Ok(if self.fill()? { Some(&self.buffer[self.start..self.whole]) } else { None })
    }

    /// Goes past the first `bytes` of the last block, which are so many lines.
    pub fn consume(&mut self, bytes: usize, lines: u64) {
        self.take(bytes, lines);
    }

    /// Goes past `count` lines, giving them to `each` in blocks, and says how many there were.
    pub fn pass(&mut self, count: u64, mut each: impl FnMut(TextPosition, &[u8]) -> Result<()>) -> Result<u64> {
        let mut left = count;
        while left > 0 && self.fill()? {
            let place = self.place;
            let (bytes, lines) = first_lines(&self.buffer[self.start..self.whole], left);
            each(place, self.take(bytes, lines))?;
            left -= lines;
        }
        Ok(count - left)
    }
}

/// Bytes of the first `limit` lines of a block, and how many lines they are.
fn first_lines(block: &[u8], limit: u64) -> (usize, u64) {
    let mut lines = 0;
    let mut from = 0;
    while from < block.len() {
        let stride = &block[from..block.len().min(from + STRIDE)];
        let ends = memchr::memchr_iter(b'\n', stride).count() as u64;
        // Counting is fast: only the last stride is searched for the end of a line.
        if lines + ends >= limit {
            let last = memchr::memchr_iter(b'\n', stride).nth((limit - lines - 1) as usize);
            return (from + last.unwrap_or(0) + 1, limit);
        }
        lines += ends;
        from += stride.len();
    }
    let open = block.last().is_some_and(|&b| b != b'\n');
    (block.len(), lines + u64::from(open))
}

pub fn without_end(line: &[u8]) -> &[u8] {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    line.strip_suffix(b"\r").unwrap_or(line)
}

/// The lines of a block: each one's bytes without its end, and how many bytes it takes with it.
pub fn of_block(block: &[u8]) -> impl Iterator<Item = (&[u8], usize)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let rest = &block[at..];
        let length = match memchr::memchr(b'\n', rest) {
            Some(n) => n + 1,
            None if rest.is_empty() => return None,
            None => rest.len(),
        };
        at += length;
        Some((without_end(&rest[..length]), length))
    })
}
