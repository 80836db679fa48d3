//! A plane and coarser ones above it, each of half the resolution, cut into bands of rows.

use super::deposit::RowRun;
use particlegs_core::parallel;
use particlegs_core::picture::{Plane, Size};

/// Rows of a band.
const BAND_ROWS: usize = 32;

/// Pixels around a coarse plane that interpolation reads beyond the picture.
const PAD: usize = 4;

/// Cubic interpolation a quarter of a pixel from a centre, nearest centre third.
const TAPS: [f32; 4] = [-5.0 / 128.0, 35.0 / 128.0, 105.0 / 128.0, -7.0 / 128.0];

/// One plane: pixels of `2^shift` picture pixels, rows upward.
#[derive(Clone, Copy, Debug)]
pub(super) struct PyramidLevel {
    pub shift: u32,
    /// `2^-shift`.
    pub scale: f32,
    width: usize,
    height: usize,
    pad: usize,
    first_band: usize,
}

impl PyramidLevel {
    fn bands(&self) -> usize {
        self.height.div_ceil(BAND_ROWS)
    }
}

pub(super) struct Pyramid {
    size: Size,
    levels: Vec<PyramidLevel>,
    data: Vec<Vec<f32>>,
}

impl Pyramid {
    /// Planes of level 0 (the picture's) to `deepest`, all zero.
    pub fn new(size: Size, deepest: usize) -> Self {
        let mut levels = Vec::new();
        let mut first_band = 0;
        for shift in 0..=deepest as u32 {
            let pad = if shift == 0 { 0 } else { PAD };
            let side = |n: usize| n.div_ceil(1 << shift) + 2 * pad;
            let level = PyramidLevel {
                shift,
                scale: 0.5f32.powi(shift as i32),
                width: side(size.width),
                height: side(size.height),
                pad,
                first_band,
            };
            first_band += level.bands();
            levels.push(level);
        }
        let data = levels.iter().map(|l| vec![0.0; l.width * l.height]).collect();
        Pyramid { size, levels, data }
    }

    pub fn bands(&self) -> usize {
        self.levels.iter().map(PyramidLevel::bands).sum()
    }

    /// The bands, half-open, of a plane that a splat at picture row `y` reaches.
    #[inline]
    pub fn bands_of(&self, level: usize, y: f32, reach: f32) -> [usize; 2] {
        let l = &self.levels[level];
        // Cut at 0 a cast is the floor, and quicker.
        let row = |y: f32| ((y * l.scale + l.pad as f32).max(0.0) as i32).min(l.height as i32 - 1);
        let band = |y: f32| row(y) as usize / BAND_ROWS;
        [l.first_band + band(y - reach), l.first_band + band(y + reach) + 1]
    }

    /// Every band with its number, its plane and its rows.
    pub fn bands_mut(&mut self) -> Vec<(usize, PyramidLevel, RowRun<'_>)> {
        let mut all = Vec::with_capacity(self.bands());
        for (level, data) in self.levels.iter().zip(&mut self.data) {
            for (k, rows) in data.chunks_mut(BAND_ROWS * level.width).enumerate() {
                let corner = [-(level.pad as i32), (k * BAND_ROWS) as i32 - level.pad as i32];
                let fine_area = level.scale * level.scale;
                all.push((level.first_band + k, *level, RowRun { data: rows, width: level.width, corner, fine_area }));
            }
        }
        all
    }

    /// Coarse planes interpolated up and added; the picture's plane, top row first.
    pub fn collapse(mut self) -> Plane {
        // From the coarsest down, so that each plane holds all that are coarser.
        for l in (1..self.levels.len()).rev() {
            let coarse = std::mem::take(&mut self.data[l]);
            add_upsampled(&coarse, &self.levels[l], &mut self.data[l - 1], &self.levels[l - 1]);
        }
        let upward = std::mem::take(&mut self.data[0]);
        let mut data = Vec::with_capacity(upward.len());
        upward.chunks_exact(self.size.width).rev().for_each(|row| data.extend_from_slice(row));
        Plane { size: self.size, data }
    }
}

/// The four coarse indices and weights that a fine index is interpolated from.
#[inline(always)]
fn taps(index: usize, fine: &PyramidLevel, coarse: &PyramidLevel) -> (usize, [f32; 4]) {
    let at = index as i32 - fine.pad as i32;
    let center = at.div_euclid(2) + coarse.pad as i32;
    // A fine centre lies a quarter of a coarse pixel before or behind the coarse centre.
    if at.rem_euclid(2) == 0 {
        (center as usize - 2, TAPS)
    } else {
        (center as usize - 1, [TAPS[3], TAPS[2], TAPS[1], TAPS[0]])
    }
}

fn add_upsampled(coarse: &[f32], from: &PyramidLevel, fine: &mut [f32], to: &PyramidLevel) {
    parallel::for_each_chunk_with(fine, to.width, Vec::new, |line: &mut Vec<f32>, y, out| {
        let (first, w) = taps(y, to, from);
        let row = |k: usize| &coarse[(first + k) * from.width..(first + k + 1) * from.width];
        let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
        line.clear();
        line.extend((0..from.width).map(|x| w[0] * r0[x] + w[1] * r1[x] + w[2] * r2[x] + w[3] * r3[x]));
        for (x, value) in out.iter_mut().enumerate() {
            let (first, w) = taps(x, to, from);
            let sum = w[0] * line[first] + w[1] * line[first + 1] + w[2] * line[first + 2] + w[3] * line[first + 3];
            // Overshoot beside a sharp end would be a negative depth.
            *value = (*value + sum).max(0.0);
        }
    });
}
