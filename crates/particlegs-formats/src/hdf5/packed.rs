//! Numbers that do not fill their bytes as the machine's do: N-bit integers, half floats, SWIFT's lossy floats.

/// Layout of the bits of a number in its bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackedNumber {
    big_endian: bool,
    form: BitLayout,
    /// Whether whole numbers of more than 32 bits are wanted as the bits of one of 64.
    as_stored: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum BitLayout {
    Integer { offset: u32, bits: u32, signed: bool },
    Float { sign: u32, exponent: BitField, mantissa: BitField, bias: i32 },
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct BitField {
    start: u32,
    bits: u32,
}

impl BitField {
    fn get(self, raw: u64) -> u64 {
        raw >> self.start & ((1 << self.bits) - 1)
    }

    fn within(self, bits: u32) -> bool {
        (1..=52).contains(&self.bits) && self.start + self.bits <= bits
    }
}

impl PackedNumber {
    /// From the bytes of a type's description. `None` for the machine's own types; an error, in words, for what is
    /// no number that f64 can hold.
    pub fn from_datatype(datatype: &[u8]) -> Result<Option<PackedNumber>, String> {
        // As the format's specification lays out a type: class, flags, size, first bit and number of bits.
        let word = |at: usize| datatype.get(at..at + 2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]])));
        let byte = |at: usize| datatype.get(at).copied().map(u32::from);
        let read = || Some((byte(0)? & 15, byte(1)?, byte(2)?, word(4)?, word(8)?, word(10)?));
        let Some((class, flags, sign, size, offset, bits)) = read() else { return Err("a damaged type".into()) };
        let odd = || format!("{bits}-bit numbers in {size} bytes");
        if ![1, 2, 4, 8].contains(&size) || bits == 0 || offset + bits > 8 * size || flags & 0x40 != 0 {
            return Err(odd());
        }
        let big_endian = flags & 1 != 0;
        if class == 0 {
            let whole = offset == 0 && bits == 8 * size;
            let form = BitLayout::Integer { offset, bits, signed: flags & 8 != 0 };
            return Ok((!whole).then_some(PackedNumber { big_endian, form, as_stored: false }));
        }
        let read = || Some([byte(12)?, byte(13)?, byte(14)?, byte(15)?, word(16)?, word(18)?]);
        let Some([at, exponent, start, mantissa, low, high]) = read() else { return Err("a damaged type".into()) };
        let (exponent, mantissa) = (BitField { start: at, bits: exponent }, BitField { start, bits: mantissa });
        let plain = match size {
            4 => (sign, exponent.start, exponent.bits, mantissa.bits, low) == (31, 23, 8, 23, 127),
            8 => (sign, exponent.start, exponent.bits, mantissa.bits, low) == (63, 52, 11, 52, 1023),
            _ => false,
        };
        // As in IEEE 754, the leading 1 of the mantissa is not stored.
        let normal = flags & 0x30 == 0x20 && high == 0;
        if plain && normal && offset == 0 && mantissa.start == 0 && bits == 8 * size {
            return Ok(None);
        }
        // What is wider than f64 would be rounded without a word.
        let fits = exponent.within(8 * size) && mantissa.within(8 * size) && sign < 8 * size && exponent.bits <= 11;
        if class != 1 || !normal || !fits || low > 1023 {
            return Err(odd());
        }
        let form = BitLayout::Float { sign, exponent, mantissa, bias: low as i32 };
        Ok(Some(PackedNumber { big_endian, form, as_stored: false }))
    }

    pub fn name(&self) -> String {
        match self.form {
            BitLayout::Integer { bits, signed, .. } => format!("{}{bits}", if signed { 'i' } else { 'u' }),
            BitLayout::Float { exponent, mantissa, .. } => format!("f{}", 1 + exponent.bits + mantissa.bits),
        }
    }

    /// As [`crate::numbers::NumberType::stored`].
    pub fn stored(self, as_stored: bool) -> PackedNumber {
        PackedNumber { as_stored, ..self }
    }

    /// The number in `bytes`, at most eight.
    pub fn get(&self, bytes: &[u8]) -> f64 {
        let mut raw = [0u8; 8];
        raw[..bytes.len()].copy_from_slice(bytes);
        if self.big_endian {
            raw[..bytes.len()].reverse();
        }
        let raw = u64::from_le_bytes(raw);
        match self.form {
            BitLayout::Integer { offset, bits, signed } => {
                // To the top, then down again, with copies of the sign where there is one.
                let top = raw >> offset << (64 - bits);
                let whole = if signed { (top as i64 >> (64 - bits)) as u64 } else { top >> (64 - bits) };
                match (self.as_stored && bits > 32, signed) {
                    (true, _) => f64::from_bits(whole),
                    (_, true) => whole as i64 as f64,
                    _ => whole as f64,
                }
            }
            BitLayout::Float { sign, exponent, mantissa, bias } => {
                let (e, m) = (exponent.get(raw), mantissa.get(raw));
                let fraction = m as f64 / (1u64 << mantissa.bits) as f64;
                let size = if e == (1 << exponent.bits) - 1 {
                    if m == 0 { f64::INFINITY } else { f64::NAN }
                } else if e == 0 {
                    fraction * 2f64.powi(1 - bias)
                } else {
                    (1.0 + fraction) * 2f64.powi(e as i32 - bias)
                };
                if raw >> sign & 1 == 1 { -size } else { size }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn float(size: u8, bits: u8, sign: u8, exponent: [u8; 2], mantissa: u8, bias: u16) -> PackedNumber {
        let [low, high] = bias.to_le_bytes();
        let [at, e] = exponent;
        let bytes = [0x11, 0x20, sign, 0, size, 0, 0, 0, 0, 0, bits, 0, at, e, 0, mantissa, low, high, 0, 0];
        PackedNumber::from_datatype(&bytes).unwrap().unwrap()
    }

    #[test]
    fn half_floats_and_fewer_bits() {
        let half = float(2, 16, 15, [10, 5], 10, 15);
        for (raw, value) in [(0x3c00u16, 1.0), (0xc000, -2.0), (0x3555, 0.333251953125), (1, 2f64.powi(-24))] {
            assert_eq!(half.get(&raw.to_le_bytes()), value);
        }
        assert!(half.get(&0x7c00u16.to_le_bytes()).is_infinite() && half.get(&0x7c01u16.to_le_bytes()).is_nan());
        // A f32 cut to 9 bits of mantissa, as SWIFT has it.
        let cut = float(4, 18, 17, [9, 8], 9, 127);
        assert_eq!((cut.get(&(1.5f32.to_bits() >> 14).to_le_bytes()), cut.name()), (1.5, "f18".into()));
        let bytes = [0x10, 8, 0, 0, 4, 0, 0, 0, 3, 0, 20, 0];
        let integer = PackedNumber::from_datatype(&bytes).unwrap().unwrap();
        assert_eq!(integer.get(&((-5i32 as u32) << 3 & 0x7f_ffff).to_le_bytes()), -5.0);
    }

    #[test]
    fn own_types_are_not_packed_and_broken_ones_are_refused() {
        let f32 = [0x11, 0x20, 31, 0, 4, 0, 0, 0, 0, 0, 32, 0, 23, 8, 0, 23, 127, 0, 0, 0];
        assert_eq!(PackedNumber::from_datatype(&f32), Ok(None));
        assert_eq!(PackedNumber::from_datatype(&[0x10, 8, 0, 0, 8, 0, 0, 0, 0, 0, 64, 0]), Ok(None));
        for at in 0..20 {
            for bit in 0..8 {
                let mut broken = f32;
                broken[at] ^= 1 << bit;
                if let Ok(Some(packed)) = PackedNumber::from_datatype(&broken) {
                    packed.get(&[255; 4]);
                }
            }
            assert!(PackedNumber::from_datatype(&f32[..at]).is_err());
        }
    }
}
