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
    let (mut low, mut high) = extremes(depth);
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

fn extremes(depth: &[f32]) -> (f32, f32) {
    // Window depths lie in [0, 1]: the fold begins with an empty range.
    depth.iter().fold((1.0, -1.0), |(lo, hi), &z| (if z < lo { z } else { lo }, if z > hi { z } else { hi }))
}

struct Peel {
    front: u32,
    back: u32,
    next: [f32; 2],
}

fn peel_once(depth: &[f32], alpha: &[f32], front: u32, [low, high]: [f32; 2]) -> Peel {
    const E: f32 = DEPTH_TOLERANCE;
    let mut out = Peel { front: 0, back: 0, next: [1.0, -1.0] };
    let through = 1.0 - to_float(front);
    for (&z, &a) in depth.iter().zip(alpha) {
        if z > low + E && z < high - E {
            // Strictly between: a candidate of the next peel; the front shows through.
            out.next = [if z < out.next[0] { z } else { out.next[0] }, if z > out.next[1] { z } else { out.next[1] }];
            out.front = out.front.max(front);
        } else if z < low - E || z > high + E {
            // It was peeled before: the front stays as it is.
            out.front = out.front.max(front);
        } else if a > 0.0 {
            if z >= low - E && z <= low + E {
                out.front = out.front.max(to_byte(through * a + to_float(front)));
            } else {
                out.front = out.front.max(front);
                out.back = out.back.max(to_byte(a));
            }
        }
    }
    out
}
