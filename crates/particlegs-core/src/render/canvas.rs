//! The planes of a picture while strokes are drawn on them.

use super::bins::Bins;
use super::pyramid::{self, BAND, Level, PAD};
use super::raster::{self, Band};
use super::scratch;
use crate::Result;
use crate::memory::require;
use crate::picture::{Plane, Size};
use crate::progress::Progress;
use rayon::prelude::*;

/// Strokes drawn between two looks at whether to stop.
const CHECK: usize = 4096;
/// Bytes a pixel that a look takes beside the depth: levels as f32 and the picture.
const BYTES_OF_LOOK: u64 = 5;

/// Planes of a picture, finest first.
pub struct Canvas {
    /// Their shapes.
    pub levels: Vec<Level>,
    planes: Vec<Vec<f32>>,
}

impl Canvas {
    /// Blank planes.
    ///
    /// # Errors
    /// [`crate::Error::Memory`].
    pub fn new(size: Size) -> Result<Self> {
        let levels = pyramid::levels(size);
        let floats: usize = levels.iter().map(|l| l.stride * l.rows).sum();
        let pixels = size.pixels() as u64;
        // The depth is a plane of its own, but of the largest pictures; a look comes after the planes.
        let depth = if scratch::keeps(size.pixels()) { 4 * pixels } else { 0 };
        require("a picture", (4 * floats as u64 + depth).max((4 + BYTES_OF_LOOK) * pixels))?;
        let blank = |l: &Level| {
            let mut plane = scratch::take(l.stride * l.rows)?;
            plane.par_chunks_mut(l.stride * BAND).for_each(|band| band.fill(0.0));
            Ok(plane)
        };
        let planes = levels.iter().map(blank).collect::<Result<_>>()?;
        Ok(Canvas { levels, planes })
    }

    /// Adds strokes, in their order.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn draw(&mut self, bins: &[Bins], progress: &dyn Progress) -> Result<()> {
        let bands: Vec<(&Level, usize, &mut [f32])> = self
            .levels
            .iter()
            .zip(&mut self.planes)
            .flat_map(|(level, plane)| {
                plane.chunks_mut(level.stride * BAND).enumerate().map(move |(b, data)| (level, b, data))
            })
            .collect();
        bands.into_par_iter().with_max_len(1).try_for_each(|(level, b, data)| {
            let mut band = Band { data, stride: level.stride, width: level.size.width + 2 * PAD, first: b * BAND };
            let number = level.first_band + b;
            for bin in bins {
                for strokes in bin.strokes[bin.starts[number] as usize..bin.starts[number + 1] as usize].chunks(CHECK) {
                    progress.check()?;
                    raster::draw(&mut band, strokes);
                }
            }
            Ok(())
        })
    }

    /// The planes summed, without the pad.
    ///
    /// # Errors
    /// [`crate::Error::Memory`].
    pub fn finish(mut self) -> Result<Plane> {
        for l in (1..self.levels.len()).rev() {
            let (finer, coarser) = self.planes.split_at_mut(l);
            pyramid::add_up(&coarser[0], &self.levels[l], &mut finer[l - 1], &self.levels[l - 1]);
        }
        self.planes.drain(1..).for_each(scratch::give);
        let plane = self.planes.swap_remove(0);
        if scratch::keeps(self.levels[0].size.pixels()) {
            crop(plane, &self.levels[0])
        } else {
            Ok(crop_in_place(plane, &self.levels[0]))
        }
    }
}

/// Where a row of the picture begins in the plane with its pad.
fn start(row: usize, level: &Level) -> usize {
    (row + PAD) * level.stride + PAD
}

/// The picture without the pad. The interpolation may undershoot; depth is never negative.
fn crop(plane: Vec<f32>, level: &Level) -> Result<Plane> {
    let Size { width, height } = level.size;
    let mut out = Plane { size: level.size, data: scratch::take(width * height)? };
    out.data.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        for (o, v) in out.iter_mut().zip(&plane[start(row, level)..][..width]) {
            *o = v.max(0.0);
        }
    });
    scratch::give(plane);
    Ok(out)
}

/// The same without a second plane, for pictures of which two may not fit: rows move down.
fn crop_in_place(mut plane: Vec<f32>, level: &Level) -> Plane {
    let Size { width, height } = level.size;
    for row in 0..height {
        let from = start(row, level);
        plane.copy_within(from..from + width, row * width);
    }
    plane.truncate(width * height);
    plane.par_iter_mut().for_each(|v| *v = v.max(0.0));
    Plane { size: level.size, data: plane }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_pictures_are_cropped_where_they_lie() {
        let level = pyramid::levels(Size { width: 37, height: 21 })[0];
        let plane: Vec<f32> = (0..level.stride * level.rows).map(|i| ((i * 7919) % 101) as f32 - 20.0).collect();
        let [a, b] = [crop(plane.clone(), &level).unwrap(), crop_in_place(plane, &level)];
        assert_eq!(a, b);
        assert!(a.data.iter().any(|v| *v > 0.0));
    }

    #[test]
    fn memory_is_asked_for_before_it_is_taken() {
        if crate::memory::available_bytes().is_some() {
            let error = Canvas::new(Size { width: 1 << 24, height: 1 << 24 }).map(drop).unwrap_err();
            assert_eq!(error.exit_code(), 7);
        }
    }
}
