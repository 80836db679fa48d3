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
    /// Floats from row to row, of all planes.
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
    let lanes = lanes(simd);
    for s in splats {
        // What the ends of narrow rows spare is less than what it costs to find them.
        if s.within(4.0) {
            draw_box::<S, 1>(simd, band, s);
        } else if s.within(8.0) {
            draw_box::<S, 2>(simd, band, s);
        } else {
            for (row, dy) in s.rows(band) {
                let Some(RowSpan { from, count, aside, fall }) = s.span(dy, band.width) else { continue };
                let start = row * band.stride + from;
                let pixels = &mut band.data[start..start + count.next_multiple_of(8)];
                s.add(simd, pixels, lanes + aside, fall);
            }
        }
    }
}

/// Adds a stroke to the `8 N` pixels about its centre in each of its rows.
#[inline(always)]
fn draw_box<S: Simd, const N: usize>(simd: S, band: &mut Band, s: &RasterSplat) {
    let from = ((s.x - (4 * N) as f32).ceil().max(0.0) as usize).min(band.stride - 8 * N);
    let dx = lanes(simd) + (from as f32 - s.x);
    for (row, dy) in s.rows(band) {
        let start = row * band.stride + from;
        s.add(simd, &mut band.data[start..start + 8 * N], dx - s.slope * dy, s.down * (dy * dy));
    }
}

/// 0 to 7.
#[inline(always)]
pub(super) fn lanes<S: Simd>(simd: S) -> f32x8<S> {
    f32x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
}

/// The pixels of a row that a stroke covers.
pub(super) struct RowSpan {
    /// The first pixel, and their number. Whole vectors may be drawn: the pad takes what reaches beyond, and the end of
    /// the footprint makes it 0.
    pub from: usize,
    pub count: usize,
    /// The first one's place from the row's centre.
    pub aside: f32,
    /// The exponent at the row's centre.
    pub fall: f32,
}

impl RasterSplat {
    /// The rows of a band that it touches, and how far each lies below its centre.
    #[inline(always)]
    pub(super) fn rows(&self, band: &Band) -> impl Iterator<Item = (usize, f32)> + use<> {
        let y = self.y - band.first as f32;
        let top = (y - self.half).ceil().max(0.0) as usize;
        let bottom = (y + self.half).floor().min((band.data.len() / band.stride) as f32 - 1.0);
        // Compared as a float, since the cast would make row 0 of what ends above the band.
        let end = if bottom < 0.0 { top } else { bottom as usize + 1 };
        (top..end).map(move |row| (row, row as f32 - y))
    }

    /// Whether it ends within so many columns of its centre.
    #[inline(always)]
    fn within(&self, columns: f32) -> bool {
        // Its half width squared is `end / along + (slope half)^2`, and `along` is negative.
        let aside = self.slope * self.half;
        self.end > self.along * (columns * columns - aside * aside)
    }

    /// Its pixels in a row of `width`.
    #[inline(always)]
    pub(super) fn span(&self, dy: f32, width: usize) -> Option<RowSpan> {
        let fall = self.down * (dy * dy);
        // Powers are negative: what `fall` leaves of `end`, over `along`, is the square of the row's half width.
        let left_over = (self.end - fall) * (1.0 / self.along);
        if left_over < 0.0 {
            return None;
        }
        let half = left_over.sqrt();
        let center = self.x + self.slope * dy;
        let from = (center - half).ceil().max(0.0);
        let to = (center + half).floor().min(width as f32 - 1.0);
        (to >= from).then(|| RowSpan {
            from: from as usize,
            count: (to - from) as usize + 1,
            aside: from - center,
            fall,
        })
    }

    /// Adds it to a row's pixels, eight at a time, the first of them at `dx` from the row's centre.
    #[inline(always)]
    fn add<S: Simd>(&self, simd: S, pixels: &mut [f32], mut dx: f32x8<S>, fall: f32) {
        for eight in pixels.chunks_exact_mut(8) {
            (f32x8::from_slice(simd, eight) + self.eight(simd, dx, fall)).store_slice(eight);
            dx += 8.0;
        }
    }

    /// What it adds to eight pixels at `dx` from the row's centre.
    #[inline(always)]
    pub(super) fn eight<S: Simd>(&self, simd: S, dx: f32x8<S>, fall: f32) -> f32x8<S> {
        let power = dx * dx * self.along + fall;
        // Also drops what exp2 makes of powers far below the end.
        power.simd_ge(self.end).select(exp2(power) * self.peak, f32x8::splat(simd, 0.0))
    }
}

/// 1.5 * 2^23: adding it leaves the nearest whole number in the low bits.
pub(super) const ROUND: f32 = 12_582_912.0;

/// 2^x for x in [-120, 0], to 3e-6: the whole part goes to the exponent, a polynomial takes the
/// rest. Below, the exponent wraps and the result means nothing.
#[inline(always)]
pub fn exp2<S: Simd>(x: f32x8<S>) -> f32x8<S> {
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
pub struct RasterCanvas<'a> {
    /// The shape of each.
    pub levels: Vec<PlaneLevel>,
    /// Planes drawn together at each level: a row of each, then the next row.
    number: usize,
    planes: &'a mut [Vec<f32>],
}

impl<'a> RasterCanvas<'a> {
    pub(super) fn new(size: Size, number: usize, scratch: &'a mut Scratch, context: &Context<'_>) -> Result<Self> {
        let levels = pyramid::levels(size);
        let lengths = levels.iter().map(|l| number * l.stride * l.rows);
        context.require_memory("a picture", 4 * lengths.clone().sum::<usize>() as u64)?;
        let planes = scratch.planes(lengths, context)?;
        for (plane, l) in planes.iter_mut().zip(&levels) {
            parallel::for_each_chunk(plane, number * l.stride * BAND, |_, band| band.fill(0.0));
        }
        Ok(RasterCanvas { levels, number, planes })
    }

    /// Adds strokes, in their order.
    pub(super) fn draw(&mut self, bins: &[StrokeBins], context: &Context<'_>) -> Result<()> {
        let simd = context.simd();
        self.draw_bands(|number, mut band| {
            for bin in bins {
                for splats in bin.strokes[bin.starts[number] as usize..bin.starts[number + 1] as usize].chunks(CHECK) {
                    context.check()?;
                    draw(simd, &mut band, splats);
                }
            }
            Ok(())
        })
    }

    /// The sums of each level, with its shape.
    pub fn sums(&mut self) -> impl Iterator<Item = (&PlaneLevel, &mut [f32])> {
        self.levels.iter().zip(self.planes.iter_mut().map(|plane| &mut plane[..]))
    }

    /// Draws each band of all levels, by its number.
    pub(super) fn draw_bands(&mut self, draw: impl Fn(usize, Band) -> Result<()> + Sync) -> Result<()> {
        let number = self.number;
        let bands = self.levels.iter().zip(&mut *self.planes).flat_map(|(level, plane)| {
            plane.chunks_mut(number * level.stride * BAND).enumerate().map(move |(b, data)| (level, b, data))
        });
        parallel::try_for_each(bands, |(level, b, data)| {
            let (stride, width) = (number * level.stride, level.size.width + 2 * PAD);
            draw(level.first_band + b, Band { data, stride, width, first: b * BAND })
        })
    }

    /// The planes summed, without the pad, interpolated by `taps`; rows of the second and further planes follow the
    /// first's. The interpolation may undershoot: see [`clip`].
    pub(super) fn finish(self, taps: &[f32; 8], context: &Context<'_>) -> PlaneRows<'a> {
        for l in (1..self.levels.len()).rev() {
            let (finer, coarser) = self.planes.split_at_mut(l);
            let levels = [&self.levels[l], &self.levels[l - 1]];
            pyramid::add_up(context.simd(), levels, taps, &coarser[0], &mut finer[l - 1]);
        }
        let PlaneLevel { size, stride, .. } = self.levels[0];
        let stride = self.number * stride;
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
        let error =
            RasterCanvas::new(size, 1, &mut Scratch::default(), &Context::SILENT.with_memory(&|| Some(1 << 30)))
                .map(drop)
                .unwrap_err();
        assert!(matches!(error, crate::Error::Memory { .. }));
    }
}
