//! Pictures as plain arrays, row by row from the top.

use crate::memory::filled;
use crate::progress::Progress;
use crate::{Error, Result, parallel};

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Size {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
}

impl Size {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }
}

/// A plane of floats (optical depth, surface density), top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Size in pixels.
    pub size: Size,
    /// `size.pixels()` values.
    pub data: Vec<f32>,
}

impl Plane {
    /// All zero.
    pub fn zeros(size: Size) -> Self {
        Plane { size, data: vec![0.0; size.pixels()] }
    }

    /// A range of four decades at most that shows nearly all lit pixels: up to the 99.9th percentile, down to the
    /// 1st or a ten-thousandth of the top. `None` where nothing is lit.
    pub fn log_range(&self) -> Option<[f64; 2]> {
        let mut lit: Vec<f32> = self.data.iter().copied().filter(|v| *v > 0.0 && v.is_finite()).collect();
        if lit.is_empty() {
            return None;
        }
        let mut at = |share: f64| {
            let place = ((lit.len() - 1) as f64 * share) as usize;
            f64::from(*lit.select_nth_unstable_by(place, f32::total_cmp).1)
        };
        let hi = at(0.999);
        let lo = at(0.01).max(hi * 1e-4).min(hi);
        // A flat plane still gets a scale.
        Some(if hi / lo < 1.5 { [lo / 1.5, hi * 1.5] } else { [lo, hi] })
    }
}

/// A picture in a caller's buffer, top row first.
#[derive(Debug)]
pub struct Pixels<'a, T> {
    size: Size,
    data: &'a mut [T],
}

impl<'a, T> Pixels<'a, T> {
    /// Of `size.pixels()` values.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a buffer of another length.
    pub fn new(size: Size, data: &'a mut [T]) -> Result<Self> {
        match data.len() == size.pixels() {
            true => Ok(Pixels { size, data }),
            false => Err(Error::argument(format!(
                "a buffer of {} values for a picture of {}x{}",
                data.len(),
                size.width,
                size.height
            ))),
        }
    }

    /// Size in pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The buffer.
    pub fn into_data(self) -> &'a mut [T] {
        self.data
    }
}

/// The rows of a picture in a larger plane.
pub(crate) struct Rows<'a> {
    /// Size in pixels.
    pub size: Size,
    /// Values from row to row.
    pub stride: usize,
    /// From the first pixel on: row j begins at `j * stride`.
    pub data: &'a mut [f32],
}

impl Rows<'_> {
    /// Works on every row, with its number.
    pub(crate) fn each(&mut self, work: impl Fn(usize, &mut [f32]) + Send + Sync) {
        let Size { width, height } = self.size;
        parallel::for_each_chunk(self.data, self.stride.max(1), |j, row| {
            if j < height {
                work(j, &mut row[..width]);
            }
        });
    }

    /// A copy.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub(crate) fn to_plane(&self, progress: &dyn Progress) -> Result<Plane> {
        let pixels = self.size.pixels();
        progress.require_memory("a picture", 4 * pixels as u64)?;
        let mut out = Plane { size: self.size, data: filled("a picture", 0.0, pixels, progress)? };
        self.copy_to(&mut out.data);
        Ok(out)
    }

    /// Copies all pixels.
    pub(crate) fn copy_to(&self, out: &mut [f32]) {
        parallel::for_each_chunk(out, self.size.width.max(1), |j, row| row.copy_from_slice(self.row(j)));
    }

    /// Row `j`.
    pub(crate) fn row(&self, j: usize) -> &[f32] {
        &self.data[j * self.stride..][..self.size.width]
    }
}

impl Plane {
    /// All rows.
    pub(crate) fn rows(&mut self) -> Rows<'_> {
        Rows { size: self.size, stride: self.size.width, data: &mut self.data }
    }
}

/// An 8-bit grey picture, top row first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gray8 {
    /// Size in pixels.
    pub size: Size,
    /// `size.pixels()` levels.
    pub data: Vec<u8>,
}

impl Gray8 {
    /// All black.
    pub fn black(size: Size) -> Self {
        Gray8 { size, data: vec![0; size.pixels()] }
    }
}

/// An 8-bit colour picture, top row first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb8 {
    /// Size in pixels.
    pub size: Size,
    /// `size.pixels()` triples.
    pub data: Vec<[u8; 3]>,
}
