//! One pixel's fragments blended: dual depth peeling, then 8-bit alpha blending of what the peels
//! left (docs/law/splat.md, "Blending").

use particlegs_core::splat::{DEPTH_TOLERANCE, PEELS, mul8};

/// The outcome of a pixel's fragments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlendedPixel {
    /// Grey level before FXAA.
    pub level: u8,
    /// Bit k: peel k wrote a visible back layer here.
    pub wrote: u8,
}

/// A float in [0, 1] to 8 bits, as Mesa rounds it: one float32 product, then ties to even.
#[inline(always)]
fn to_byte(x: f32) -> u32 {
    // Next to 2^15 float32 counts in 1/256: the last byte of the sum is 255 x, rounded to even.
    ((x * (255.0 / 256.0)) + 32768.0).to_bits() & 0xff
}

/// An 8-bit texel as a shader reads it.
#[inline(always)]
fn to_float(byte: u32) -> f32 {
    byte as f32 * (1.0 / 255.0)
}

/// Blends fragments given in particle order; `peels` is how many peels are made and `rest` whether
/// what they leave is blended (VTK stops early once a whole peel writes no back layer anywhere).
#[inline(always)]
pub(super) fn blend(depth: &[f32], alpha: &[f32], peels: usize, rest: bool) -> BlendedPixel {
    let (mut front, mut back, mut wrote) = (0u32, 0u32, 0u8);
    if let ([_], [a]) = (depth, alpha) {
        // Alone it is the first peel's front.
        return BlendedPixel {
            level: if peels > 0 && *a > 0.0 { to_byte(to_float(to_byte(*a))) as u8 } else { 0 },
            wrote,
        };
    }
    let [mut low, mut high] = extremes(depth);
    for peel in 0..peels.min(PEELS) {
        let step = peel_once(depth, alpha, front, [low, high]);
        if step.back > 0 {
            back = (step.back + mul8(back, 255 - step.back)).min(255);
            wrote |= 1 << peel;
        }
        front = step.front;
        [low, high] = step.next;
        if low > high {
            // Nothing is left between: further peels find nothing, and there is no rest.
            break;
        }
    }
    if rest && low <= high {
        for (&z, &a) in depth.iter().zip(alpha) {
            // A byte of 0 leaves what is there.
            let q = to_byte(a) * u32::from((z >= low) & (z <= high));
            back = q + mul8(back, 255 - q);
        }
    }
    let (f, b) = (to_float(front), to_float(back));
    BlendedPixel { level: to_byte(f + b * (1.0 - f)) as u8, wrote }
}

/// Window depths lie in [0, 1], where the bits of float32 are ordered as its numbers are: whole numbers have a least and
/// a largest that compile to vectors.
#[inline(always)]
fn ordered(depth: f32) -> i32 {
    // A negative zero is a zero.
    (depth + 0.0).to_bits() as i32
}

/// No depth yet: the least is above the largest.
const NO_DEPTHS: [i32; 2] = [0x3f80_0000, -1];

#[inline(always)]
fn depths([low, high]: [i32; 2]) -> [f32; 2] {
    if high < 0 { [1.0, -1.0] } else { [low, high].map(|bits| f32::from_bits(bits as u32)) }
}

#[inline(always)]
fn extremes(depth: &[f32]) -> [f32; 2] {
    depths(depth.iter().fold(NO_DEPTHS, |[low, high], &z| [low.min(ordered(z)), high.max(ordered(z))]))
}

struct Peel {
    front: u32,
    back: u32,
    next: [f32; 2],
}

#[inline(always)]
fn peel_once(depth: &[f32], alpha: &[f32], front: u32, [low, high]: [f32; 2]) -> Peel {
    const E: f32 = DEPTH_TOLERANCE;
    let (mut new_front, mut back, mut next) = (0i32, 0i32, NO_DEPTHS);
    let through = 1.0 - to_float(front);
    // Without branches, so that it compiles to vectors.
    let pick = |is: bool, value: i32| if is { value } else { 0 };
    for (&z, &a) in depth.iter().zip(alpha) {
        // Strictly between: a candidate of the next peel; the front shows through.
        let is_between = (z > low + E) & (z < high - E);
        // Peeled before: the front stays as it is.
        let is_peeled = !is_between & ((z < low - E) | (z > high + E));
        let is_seen = !is_between & !is_peeled & (a > 0.0);
        let is_front = is_seen & (z >= low - E) & (z <= low + E);
        let bits = ordered(z);
        next[0] = next[0].min(if is_between { bits } else { NO_DEPTHS[0] });
        next[1] = next[1].max(if is_between { bits } else { NO_DEPTHS[1] });
        let blended = to_byte(through * a + to_float(front)) as i32;
        let unchanged = pick(is_between | is_peeled | is_seen, front as i32);
        new_front = new_front.max(if is_front { blended } else { unchanged });
        back = back.max(pick(is_seen & !is_front, to_byte(a) as i32));
    }
    Peel { front: new_front as u32, back: back as u32, next: depths(next) }
}
