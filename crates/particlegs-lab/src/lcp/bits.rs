//! Writes and reads bits, the lowest of each byte first.

#[derive(Default)]
pub struct BitWriter {
    bytes: Vec<u8>,
    held: u64,
    bits: u32,
}

impl BitWriter {
    /// Appends the lowest `bits` (56 at most) of a value.
    pub fn put(&mut self, value: u64, bits: u32) {
        self.held |= value << self.bits;
        self.bits += bits;
        while self.bits >= 8 {
            self.bytes.push(self.held as u8);
            self.held >>= 8;
            self.bits -= 8;
        }
    }

    /// Appends the lowest `bits` (64 at most) of a value.
    pub fn put_long(&mut self, value: u64, bits: u32) {
        let low = bits.min(32);
        self.put(value & ((1 << low) - 1), low);
        self.put(value >> low & ((1 << (bits - low)) - 1), bits - low);
    }

    /// The bytes; the last is padded with zeros.
    pub fn finish(mut self) -> Vec<u8> {
        if self.bits > 0 {
            self.bytes.push(self.held as u8);
        }
        self.bytes
    }
}

pub struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> BitReader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        BitReader { bytes, at: 0 }
    }

    /// The next bit; `None` at the end.
    pub fn bit(&mut self) -> Option<bool> {
        let byte = self.bytes.get(self.at / 8)?;
        let bit = byte >> (self.at % 8) & 1 == 1;
        self.at += 1;
        Some(bit)
    }

    /// The next `bits` (64 at most).
    pub fn take(&mut self, bits: u32) -> Option<u64> {
        (0..bits).try_fold(0, |value, i| Some(value | u64::from(self.bit()?) << i))
    }
}
