//! Compressed positions of XTC: whole numbers on a grid, in bits, atoms that lie near the one before in fewer. After
//! `xdr3dfcoord` of GROMACS's `libxdrf`.

use crate::TextResult;

/// Sizes of small cubes: three coordinates less than `SIZES[n]` fit in n bits.
const SIZES: [u32; 73] = [
    0, 0, 0, 0, 0, 0, 0, 0, 0, 8, 10, 12, 16, 20, 25, 32, 40, 50, 64, 80, 101, 128, 161, 203, 256, 322, 406, 512, 645,
    812, 1024, 1290, 1625, 2048, 2580, 3250, 4096, 5060, 6501, 8192, 10321, 13003, 16384, 20642, 26007, 32768, 41285,
    52015, 65536, 82570, 104031, 131072, 165140, 208063, 262144, 330280, 416127, 524287, 660561, 832255, 1048576,
    1321122, 1664510, 2097152, 2642245, 3329021, 4194304, 5284491, 6658042, 8388607, 10568983, 13316085, 16777216,
];
/// The first of them that is one.
const FIRST: usize = 9;
/// Coordinates of a larger range have bits of their own each.
const LARGEST: u32 = 0xff_ffff;
/// Atoms that a byte may stand for at most: one has two bits, its position and whether others follow.
pub const MOST_PER_BYTE: u64 = 4;

/// The header of compressed positions, before the bits.
pub struct PackedHead {
    pub precision: f32,
    pub least: [i32; 3],
    pub most: [i32; 3],
    pub small: usize,
}

/// The range of the coordinates along each axis, and how many bits a position has.
struct FullPosition {
    least: [i32; 3],
    sizes: [u32; 3],
    /// Of all three together; of each where that is `None`.
    bits: Option<u32>,
}

impl FullPosition {
    fn new(head: &PackedHead) -> TextResult<FullPosition> {
        let mut sizes = [0; 3];
        for (k, size) in sizes.iter_mut().enumerate() {
            let range = i64::from(head.most[k]) - i64::from(head.least[k]) + 1;
            let wrong = || format!("its coordinates range from {} to {}", head.least[k], head.most[k]);
            *size = u32::try_from(range).ok().filter(|&n| n > 0).ok_or_else(wrong)?;
        }
        // One number of mixed radix for all three wastes at most a bit a position.
        let product: u128 = sizes.iter().map(|&n| u128::from(n)).product();
        let bits = sizes.iter().all(|&n| n <= LARGEST).then(|| 128 - product.leading_zeros());
        Ok(FullPosition { least: head.least, sizes, bits })
    }

    fn read(&self, bits: &mut PackedBits<'_>) -> Option<[i32; 3]> {
        let offsets = match self.bits {
            Some(n) => bits.three(n, self.sizes)?,
            None => {
                let mut each = [0; 3];
                for (value, size) in each.iter_mut().zip(self.sizes) {
                    *value = bits.take(32 - size.leading_zeros())? as i32;
                }
                each
            }
        };
        Some([0, 1, 2].map(|k| offsets[k].wrapping_add(self.least[k])))
    }
}

struct PackedBits<'a> {
    bytes: &'a [u8],
    /// Bits that are read ahead: the last `waiting` ones of it.
    ahead: u64,
    waiting: u32,
}

impl PackedBits<'_> {
    /// The next bits as a number, the first one highest; 32 at most.
    #[inline]
    fn take(&mut self, count: u32) -> Option<u32> {
        while self.waiting < count {
            let (&byte, rest) = self.bytes.split_first()?;
            self.bytes = rest;
            self.ahead = self.ahead << 8 | u64::from(byte);
            self.waiting += 8;
        }
        self.waiting -= count;
        Some((self.ahead >> self.waiting & ((1 << count) - 1)) as u32)
    }

    /// Three numbers less than `sizes`, which are one of `count` bits: its bytes come lowest first.
    #[inline]
    fn three(&mut self, count: u32, sizes: [u32; 3]) -> Option<[i32; 3]> {
        let mut number = 0u128;
        let mut read = 0;
        while read < count {
            let step = (count - read).min(8);
            number |= u128::from(self.take(step)?) << read;
            read += step;
        }
        let [_, y, z] = sizes;
        // Most positions fit 64 bits, whose division is faster.
        match u64::try_from(number) {
            Ok(number) => {
                let (rest, z, y) = (number / u64::from(z), number % u64::from(z), u64::from(y));
                Some([(rest / y) as i32, (rest % y) as i32, z as i32])
            }
            Err(_) => {
                let (rest, z, y) = (number / u128::from(z), number % u128::from(z), u128::from(y));
                Some([(rest / y) as i32, (rest % y) as i32, z as i32])
            }
        }
    }
}

/// Appends the positions of `atoms` atoms as little-endian f32, three each.
pub fn unpack(head: &PackedHead, packed: &[u8], atoms: usize, out: &mut Vec<u8>) -> TextResult<()> {
    let full = FullPosition::new(head)?;
    let mut small = head.small;
    // GROMACS multiplies by the inverse, too: a division would give other last bits.
    let step = 1.0 / head.precision;
    let mut bits = PackedBits { bytes: packed, ahead: 0, waiting: 0 };
    let short = || "its compressed positions end early".to_string();
    let size_of = |small: usize| {
        let size = SIZES.get(small).copied().filter(|&size| size > 0);
        size.ok_or_else(|| format!("its compressed positions are damaged: there is no small size {small}"))
    };
    let half = |small: usize| SIZES[small.max(FIRST)] as i32 / 2;
    let mut size = size_of(small)?;
    let (mut middle, mut smaller) = (size as i32 / 2, half(small.saturating_sub(1)));
    let mut push = |position: [i32; 3]| {
        position.iter().for_each(|&v| out.extend_from_slice(&(v as f32 * step).to_le_bytes()));
    };
    let (mut done, mut run) = (0, 0);
    while done < atoms {
        let mut before = full.read(&mut bits).ok_or_else(short)?;
        let mut change = 0;
        // A run's length holds until another is stated.
        if bits.take(1).ok_or_else(short)? == 1 {
            let stated = bits.take(5).ok_or_else(short)? as usize;
            // Five bits: three times the length, and whether the small cube shrinks, stays or grows.
            change = (stated % 3) as isize - 1;
            run = stated / 3;
        }
        // Checked before any is written, so that `out` never holds more than `atoms` positions.
        if run + 1 > atoms - done {
            return Err("its compressed positions are those of more atoms".into());
        }
        done += run + 1;
        // With neighbours, it is written behind the first of them, below.
        if run == 0 {
            push(before);
        }
        for near in 0..run {
            let moved = bits.three(small as u32, [size; 3]).ok_or_else(short)?;
            // Differences are stored above 0, half a small cube too large; damaged ones may wrap around.
            let position = [0, 1, 2].map(|k| moved[k].wrapping_add(before[k]).wrapping_sub(middle));
            if near == 0 {
                // The first two stand the other way round: of water, hydrogens then lie near the oxygen.
                push(position);
                push(before);
            } else {
                push(position);
            }
            before = position;
        }
        small = small.wrapping_add_signed(change);
        match change {
            -1 => {
                middle = smaller;
                smaller = if small > FIRST { half(small - 1) } else { 0 };
            }
            1 => (smaller, middle) = (middle, SIZES.get(small).map_or(0, |&s| s as i32 / 2)),
            _ => {}
        }
        size = size_of(small)?;
    }
    Ok(())
}
