//! The entropy coder: rANS with 32-bit states, 16-bit words, 15-bit probabilities, two states in
//! turn (docs/format.md, section 8).

pub(crate) const PROBABILITY_BITS: u32 = 15;
const LOW: u32 = 1 << 16;

/// An encoder or decoder of values: the encoder records, the decoder reads. One walk over the content
/// serves both, so that they cannot differ.
pub(crate) trait Coder {
    /// The slot that the decoder's next interval holds; the encoder has its value instead.
    fn slot(&self) -> Option<u32>;

    /// Codes the interval from `start` of `size`; the decoder's holds its slot.
    fn interval(&mut self, start: u32, size: u32);

    /// Whether more has been read than there is. (A writer has no end.)
    fn exhausted(&self) -> bool {
        false
    }

    /// A level of a walk is done.
    fn end_of_level(&mut self) {}

    /// A value in `0 .. n` that is as likely as any other; `n` in 1 ..= 2^12.
    #[inline(always)]
    fn uniform(&mut self, n: u32, value: u32) -> u32 {
        let inverse = inverse(n);
        // ceil(k 2^15 / n), without dividing.
        let start = |k: u32| ((u64::from((k << PROBABILITY_BITS) + n - 1) * inverse) >> INVERSE_BITS) as u32;
        let k = self.slot().map_or(value, |slot| (slot * n) >> PROBABILITY_BITS);
        self.interval(start(k), start(k + 1) - start(k));
        k
    }

    /// `bits` (0 to 15) plain bits.
    #[inline(always)]
    fn bits(&mut self, bits: u32, value: u32) -> u32 {
        if bits == 0 {
            return 0;
        }
        let shift = PROBABILITY_BITS - bits;
        let value = self.slot().map_or(value, |slot| slot >> shift);
        self.interval(value << shift, 1 << shift);
        value
    }

    /// Any number of plain bits up to 60, the lowest 15 first.
    #[inline(always)]
    fn long_bits(&mut self, bits: u32, value: u64) -> u64 {
        let mut out = 0;
        let mut done = 0;
        while done < bits {
            let n = (bits - done).min(PROBABILITY_BITS);
            let part = (value >> done) as u32 & ((1 << n) - 1);
            out |= u64::from(self.bits(n, part)) << done;
            done += n;
        }
        out
    }
}

/// Inverses are in units of 2^-40: with them x / n is exact for x < 2^28 and n <= 2^12.
const INVERSE_BITS: u32 = 40;
const INVERSES: [u64; 1025] = {
    let mut table = [0; 1025];
    let mut n = 1;
    while n < table.len() {
        table[n] = (1 << INVERSE_BITS) / n as u64 + 1;
        n += 1;
    }
    table
};

/// 2^40 / n, rounded up (or one more).
#[inline(always)]
fn inverse(n: u32) -> u64 {
    match INVERSES.get(n as usize) {
        Some(&inverse) => inverse,
        None => (1 << INVERSE_BITS) / u64::from(n) + 1,
    }
}

/// Records intervals; [`RansWriter::finish`] codes them last to first, as rANS asks for.
#[derive(Default)]
pub(crate) struct RansWriter {
    intervals: Vec<(u16, u16)>,
    /// Ends of the levels of a walk, in intervals.
    levels: Vec<usize>,
}

impl Coder for RansWriter {
    fn end_of_level(&mut self) {
        self.levels.push(self.intervals.len());
    }

    #[inline(always)]
    fn slot(&self) -> Option<u32> {
        None
    }

    #[inline(always)]
    fn interval(&mut self, start: u32, size: u32) {
        debug_assert!(size >= 1 && start + size <= 1 << PROBABILITY_BITS);
        self.intervals.push((start as u16, size as u16));
    }
}

impl RansWriter {
    /// Bits that the recorded probabilities ask for.
    #[cfg(test)]
    pub(crate) fn entropy_bits(&self) -> f64 {
        self.intervals.iter().map(|i| f64::from(PROBABILITY_BITS) - libm::log2(f64::from(i.1))).sum()
    }

    /// Number of intervals that were recorded by the end of each level.
    pub(crate) fn levels(&self) -> &[usize] {
        &self.levels
    }

    pub(crate) fn len(&self) -> usize {
        self.intervals.len()
    }

    pub(crate) fn finish(&self) -> Vec<u8> {
        self.stream(0..self.len())
    }

    /// A stream of a part of what was recorded: the two states, then 16-bit words in the order in which the decoder
    /// reads them.
    pub(crate) fn stream(&self, range: std::ops::Range<usize>) -> Vec<u8> {
        let intervals = &self.intervals[range];
        let mut words = Vec::with_capacity(intervals.len() / 2 + 4);
        let mut states = [LOW; 2];
        // Last to first: the decoder undoes the encoder's last step first.
        for (i, &(start, frequency)) in intervals.iter().enumerate().rev() {
            let x = &mut states[i & 1];
            let f = u32::from(frequency);
            // The step below would pass 2^32: a word goes out first.
            if u64::from(*x) >= u64::from(f) << (32 - PROBABILITY_BITS) {
                words.push(*x as u16);
                *x >>= 16;
            }
            *x = ((*x / f) << PROBABILITY_BITS) + *x % f + u32::from(start);
        }
        let mut out = Vec::with_capacity(2 * words.len() + 8);
        out.extend(states[0].to_le_bytes());
        out.extend(states[1].to_le_bytes());
        out.extend(words.iter().rev().flat_map(|w| w.to_le_bytes()));
        out
    }
}

/// Reads a stream. After the end it goes on with zeros; [`RansReader::finished`] tells.
pub(crate) struct RansReader<'a> {
    words: &'a [u8],
    next: usize,
    states: [u32; 2],
}

impl<'a> RansReader<'a> {
    /// Takes the two states; `None` where the stream is too short or a state too low.
    pub(crate) fn new(stream: &'a [u8]) -> Option<Self> {
        let (head, words) = stream.split_at_checked(8)?;
        let word = |i: usize| u32::from_le_bytes([head[i], head[i + 1], head[i + 2], head[i + 3]]);
        let states = [word(0), word(4)];
        let sound = states.iter().all(|&s| s >= LOW);
        sound.then_some(RansReader { words, next: 0, states })
    }

    /// Whether both states are where the encoder began.
    pub(crate) fn finished(&self) -> bool {
        !self.exhausted() && self.states == [LOW; 2]
    }

    /// The rest, which has not been read.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.words.get(self.next..).unwrap_or(&[])
    }
}

impl Coder for RansReader<'_> {
    #[inline(always)]
    fn exhausted(&self) -> bool {
        self.next > self.words.len()
    }

    #[inline(always)]
    fn slot(&self) -> Option<u32> {
        Some(self.states[0] & ((1 << PROBABILITY_BITS) - 1))
    }

    #[inline(always)]
    fn interval(&mut self, start: u32, size: u32) {
        let x = self.states[0];
        let slot = x & ((1 << PROBABILITY_BITS) - 1);
        let mut y = size * (x >> PROBABILITY_BITS) + slot - start;
        // The word is looked at whether it is due or not: whether it is cannot be foretold.
        let word = match self.words.get(self.next..self.next + 2) {
            Some(w) => u16::from_le_bytes([w[0], w[1]]),
            None => 0,
        };
        let due = y < LOW;
        self.next += 2 * usize::from(due);
        y = if due { (y << 16) | u32::from(word) } else { y };
        // The states take turns.
        self.states = [self.states[1], y];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    fn walk(c: &mut impl Coder, values: &[(u32, u32)]) -> Vec<u32> {
        values
            .iter()
            .map(|&(n, v)| if n.is_power_of_two() { c.bits(n.trailing_zeros(), v) } else { c.uniform(n, v) })
            .collect()
    }

    #[test]
    fn plain_values_come_back_at_their_entropy() {
        let mut r = Random::new(1, 0, 0);
        let values: Vec<(u32, u32)> = (0..40_000)
            .map(|_| {
                let n = 1 + (r.bits() % 4096) as u32;
                (n, (r.uniform() * f64::from(n)) as u32)
            })
            .collect();
        let mut writer = RansWriter::default();
        walk(&mut writer, &values);
        let entropy: f64 = values.iter().map(|v| f64::from(v.0).log2()).sum::<f64>() / 8.0;
        let stream = writer.finish();
        assert!((stream.len() as f64) < entropy * 1.002 + 16.0, "{} bytes for {entropy}", stream.len());
        let mut reader = RansReader::new(&stream).unwrap();
        let blank: Vec<(u32, u32)> = values.iter().map(|v| (v.0, 0)).collect();
        assert_eq!(walk(&mut reader, &blank), values.iter().map(|v| v.1).collect::<Vec<_>>());
        assert!(reader.finished() && reader.rest().is_empty());
    }

    #[test]
    fn a_short_stream_is_noticed() {
        let mut writer = RansWriter::default();
        walk(&mut writer, &[(1000, 7); 500]);
        let stream = writer.finish();
        let mut reader = RansReader::new(&stream[..stream.len() - 2]).unwrap();
        walk(&mut reader, &[(1000, 0); 500]);
        assert!(reader.exhausted() && !reader.finished());
        assert!(RansReader::new(&stream[..7]).is_none() && RansReader::new(&[0; 8]).is_none());
    }
}
