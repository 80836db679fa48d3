//! The planes of a picture while strokes are drawn on them, band by band of rows.

pub mod pyramid;

use self::pyramid::{BAND, Level as PlaneLevel, PAD};
use super::bin::{RasterSplat, StrokeBins};
use super::scratch::Scratch;
use crate::context::Context;
use crate::picture::{PlaneRows, Size};
use crate::{Result, parallel};
use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, f32x8};

/// A band of a plane: whole rows, pad included.
pub struct Band<'a> {
    /// The rows' floats.
    pub data: &'a mut [f32],
    /// Floats from row to row.
    pub stride: usize,
    /// Pixels of a row that exist (pad included).
    pub width: usize,
    /// The number of the first row.
    pub first: usize,
}

/// Adds strokes to a band, in their order.
pub fn draw(level: Level, band: &mut Band, splats: &[RasterSplat]) {
    fearless_simd::dispatch!(level, simd => draw_all(simd, band, splats));
}

#[inline(always)]
fn draw_all<S: Simd>(simd: S, band: &mut Band, splats: &[RasterSplat]) {
    let rows = band.data.len() / band.stride;
    let lanes = f32x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    for s in splats {
        let y = s.y - band.first as f32;
        let top = (y - s.half).ceil().max(0.0) as usize;
        let bottom = (y + s.half).floor().min(rows as f32 - 1.0);
        // Compared as a float, since the cast below would make row 0 of what ends above the band.
        if bottom < 0.0 {
            continue;
        }
        let inverse = 1.0 / s.along;
        for row in top..=bottom as usize {
            let dy = row as f32 - y;
            let fall = s.down * (dy * dy);
            // Powers are negative: what `fall` leaves of `end`, over `along`, is the square of the row's half width.
            let left_over = (s.end - fall) * inverse;
            if left_over < 0.0 {
                continue;
            }
            let half = left_over.sqrt();
            let center = s.x + s.slope * dy;
            let from = (center - half).ceil().max(0.0);
            let to = (center + half).floor().min(band.width as f32 - 1.0);
            if to < from {
                continue;
            }
            let start = row * band.stride + from as usize;
            let count = (to - from) as usize + 1;
            // Whole vectors: the pad takes what reaches beyond, and the end of the footprint makes it 0.
            let pixels = &mut band.data[start..start + count.next_multiple_of(8)];
            let mut dx = lanes + (from - center);
            for eight in pixels.chunks_exact_mut(8) {
                let power = dx * dx * s.along + fall;
                let value = exp2(power) * s.peak;
                // Also drops what exp2 makes of powers far below the end.
                let value = power.simd_ge(s.end).select(value, f32x8::splat(simd, 0.0));
                (f32x8::from_slice(simd, eight) + value).store_slice(eight);
                dx += 8.0;
            }
        }
    }
}

/// 2^x for x in [-120, 0], to 3e-6: the whole part goes to the exponent, a polynomial takes the
/// rest. Below, the exponent wraps and the result means nothing.
#[inline(always)]
pub fn exp2<S: Simd>(x: f32x8<S>) -> f32x8<S> {
    // 1.5 * 2^23: adding it leaves the nearest whole number in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let shifted = x + ROUND;
    let f = x - (shifted - ROUND);
    let p = f * 0.009_570_1 + 0.055_917_86;
    let p = p * f + 0.240_247_45;
    let p = p * f + 0.693_121_8;
    let p = p * f + 0.999_999_3;
    f32x8::from_bits(p.to_bits() + (shifted.to_bits() << 23))
}

/// Strokes drawn between two looks at whether to stop.
const CHECK: usize = 4096;

/// Planes of a picture, finest first.
pub(super) struct RasterCanvas<'a> {
    pub levels: Vec<PlaneLevel>,
    planes: &'a mut [Vec<f32>],
}

impl<'a> RasterCanvas<'a> {
    pub fn new(size: Size, scratch: &'a mut Scratch, context: &Context<'_>) -> Result<Self> {
        let levels = pyramid::levels(size);
        let lengths = levels.iter().map(|l| l.stride * l.rows);
        context.require_memory("a picture", 4 * lengths.clone().sum::<usize>() as u64)?;
        let planes = scratch.planes(lengths, context)?;
        for (plane, l) in planes.iter_mut().zip(&levels) {
            parallel::for_each_chunk(plane, l.stride * BAND, |_, band| band.fill(0.0));
        }
        Ok(RasterCanvas { levels, planes })
    }

    /// Adds strokes, in their order.
    pub fn draw(&mut self, bins: &[StrokeBins], context: &Context<'_>) -> Result<()> {
        let simd = context.simd();
        let bands = self.levels.iter().zip(&mut *self.planes).flat_map(|(level, plane)| {
            plane.chunks_mut(level.stride * BAND).enumerate().map(move |(b, data)| (level, b, data))
        });
        parallel::try_for_each(bands, |(level, b, data)| {
            let mut band = Band { data, stride: level.stride, width: level.size.width + 2 * PAD, first: b * BAND };
            let number = level.first_band + b;
            for bin in bins {
                for splats in bin.strokes[bin.starts[number] as usize..bin.starts[number + 1] as usize].chunks(CHECK) {
                    context.check()?;
                    draw(simd, &mut band, splats);
                }
            }
            Ok(())
        })
    }

    /// The planes summed, without the pad. The interpolation may undershoot: see [`clip`].
    pub fn finish(self, context: &Context<'_>) -> PlaneRows<'a> {
        for l in (1..self.levels.len()).rev() {
            let (finer, coarser) = self.planes.split_at_mut(l);
            let levels = [&self.levels[l], &self.levels[l - 1]];
            pyramid::add_up(context.simd(), levels, &coarser[0], &mut finer[l - 1]);
        }
        let PlaneLevel { size, stride, .. } = self.levels[0];
        PlaneRows { size, stride, data: &mut self.planes[0][PAD * stride + PAD..] }
    }
}

/// Depth and density are never negative.
pub(super) fn clip(mut rows: PlaneRows<'_>) -> PlaneRows<'_> {
    rows.each(|_, row| row.iter_mut().for_each(|v| *v = v.max(0.0)));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_asked_for_before_it_is_taken() {
        let size = Size { width: 1 << 24, height: 1 << 24 };
        let error = RasterCanvas::new(size, &mut Scratch::default(), &Context::SILENT.with_memory(&|| Some(1 << 30)))
            .map(drop)
            .unwrap_err();
        assert!(matches!(error, crate::Error::Memory { .. }));
    }
}
