//! The planes of a picture while strokes are drawn on them.

use super::Band;
use super::pyramid::{self, BAND, Level, PAD};
use crate::context::Context;
use crate::picture::{PlaneRows, Size};
use crate::render::bin::StrokeBins;
use crate::render::scratch::Scratch;
use crate::{Result, parallel};

/// Strokes drawn between two looks at whether to stop.
const CHECK: usize = 4096;

/// Planes of a picture, finest first.
pub(in crate::render) struct RasterCanvas<'a> {
    pub levels: Vec<Level>,
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
                    super::draw(simd, &mut band, splats);
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
        let Level { size, stride, .. } = self.levels[0];
        PlaneRows { size, stride, data: &mut self.planes[0][PAD * stride + PAD..] }
    }
}

/// Depth and density are never negative.
pub(in crate::render) fn clip(mut rows: PlaneRows<'_>) -> PlaneRows<'_> {
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
