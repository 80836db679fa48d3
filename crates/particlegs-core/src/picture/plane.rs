//! Pictures as plain arrays, row by row from the top.

use super::colormap::{Colormap, DensityColors};
use crate::context::Context;
use crate::memory::filled;
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

/// `1920x1080`.
impl std::str::FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let fail =
            || format!("`{text}` is not a picture size: give WIDTHxHEIGHT, such as 1920x1080, each from 1 to 32768");
        let (w, h) = text.split_once(['x', 'X']).ok_or_else(fail)?;
        let side = |t: &str| t.trim().parse::<usize>().ok().filter(|n| (1..=32_768).contains(n)).ok_or_else(fail);
        Ok(Size { width: side(w)?, height: side(h)? })
    }
}

/// A plane of floats (optical depth, surface density; values of a field as f64), top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<T = f32> {
    /// Size in pixels.
    pub size: Size,
    /// `size.pixels()` values.
    pub data: Vec<T>,
}

impl Plane {
    /// All zero.
    pub fn zeros(size: Size) -> Self {
        Plane { size, data: vec![0.0; size.pixels()] }
    }

    /// A surface density in colours: of `map`, by its logarithm over `range`, by default [`Plane::log_range`].
    pub fn colored(&self, map: Colormap, range: Option<[f64; 2]>) -> Rgb8 {
        let range = range.or_else(|| self.log_range()).unwrap_or(Self::EMPTY_RANGE);
        DensityColors::new(map, false, range).image(self)
    }

    /// The range of colours where all pixels are empty.
    pub const EMPTY_RANGE: [f64; 2] = [1.0, 10.0];

    /// The range of colours of a density: from the 5th to the 99.5th percentile of its occupied pixels. Pixels four
    /// decades below that, as in the tails of Gaussians, do not count as occupied. `None` where every pixel is empty.
    pub fn log_range(&self) -> Option<[f64; 2]> {
        let mut lit: Vec<f32> = self.data.iter().copied().filter(|v| *v > 0.0 && v.is_finite()).collect();
        let top = percentile(&mut lit, 99.5)?;
        lit.retain(|v| f64::from(*v) >= top * 1e-4);
        let [lo, hi] = [percentile(&mut lit, 5.0)?, percentile(&mut lit, 99.5)?];
        // A flat plane still gets a scale.
        Some(if hi / lo < 1.5 { [lo / 1.5, hi * 1.5] } else { [lo, hi] })
    }

    /// The range of colours of a density that is seen first, without knowing what it is of: from the 5th to the 99.5th
    /// percentile of the pixels that hold all but a thousandth of the mass, of two decades at least, so that what is
    /// nearly uniform is neither black nor white. Values are told apart to a hundredth. `None` where every pixel is
    /// empty.
    pub fn first_range(&self) -> Option<[f64; 2]> {
        const LEAST: f64 = 100.0;
        // Pixels and their sum, by the upper half of a float.
        let mut bins = vec![(0u64, 0.0f64); 1 << 15];
        for v in self.data.iter().filter(|v| **v > 0.0 && v.is_finite()) {
            let bin = &mut bins[(v.to_bits() >> 16) as usize];
            *bin = (bin.0 + 1, bin.1 + f64::from(*v));
        }
        // The faintest pixels are left out as long as they hold less than a thousandth of the sum.
        let mut tail = 1e-3 * bins.iter().map(|b| b.1).sum::<f64>();
        let first = bins.iter().position(|b| {
            tail -= b.1;
            tail < 0.0
        })?;
        let occupied: u64 = bins[first..].iter().map(|b| b.0).sum();
        let at = |percent: f64| {
            let mut below = (occupied.saturating_sub(1) as f64 * percent / 100.0) as u64;
            let place = (first..bins.len()).find(|i| match below.checked_sub(bins[*i].0) {
                Some(rest) => {
                    below = rest;
                    false
                }
                None => true,
            })?;
            // The middle of the bin, of which only the upper half of the bits is known.
            Some(f64::from(f32::from_bits((place as u32) << 16 | 0x8000)))
        };
        let [lo, hi] = [at(5.0)?, at(99.5)?];
        // Most of what is nearly uniform lies close to its highest: there is more room above.
        let wider = libm::cbrt((LEAST * lo / hi).max(1.0));
        Some([lo / wider, hi * wider * wider])
    }
}

/// The value below which so many percent of all lie, in an order of their own afterwards.
fn percentile(values: &mut [f32], percent: f64) -> Option<f64> {
    let place = (values.len().checked_sub(1)? as f64 * percent / 100.0) as usize;
    Some(f64::from(*values.select_nth_unstable_by(place, f32::total_cmp).1))
}

/// A picture in a caller's buffer, top row first.
#[derive(Debug)]
pub struct Pixels<'a, T> {
    size: Size,
    data: &'a mut [T],
}

impl<'a, T> Pixels<'a, T> {
    /// Of `size.pixels()` values.
    pub fn new(size: Size, data: &'a mut [T]) -> Result<Self> {
        match data.len() == size.pixels() {
            true => Ok(Pixels { size, data }),
            false => Err(Error::argument(format!(
                "the buffer has {} values, but the picture is {}x{}",
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
pub(crate) struct PlaneRows<'a> {
    /// Size in pixels.
    pub size: Size,
    /// Values from row to row.
    pub stride: usize,
    /// From the first pixel on: row j begins at `j * stride`.
    pub data: &'a mut [f32],
}

impl PlaneRows<'_> {
    /// Works on every row, with its number.
    pub(crate) fn each(&mut self, work: impl Fn(usize, &mut [f32]) + Send + Sync) {
        let Size { width, height } = self.size;
        parallel::for_each_chunk(self.data, self.stride.max(1), |j, row| {
            if j < height {
                work(j, &mut row[..width]);
            }
        });
    }

    pub(crate) fn to_plane(&self, context: &Context<'_>) -> Result<Plane> {
        let pixels = self.size.pixels();
        context.require_memory("a picture", 4 * pixels as u64)?;
        let mut out = Plane { size: self.size, data: filled("a picture", 0.0, pixels, context)? };
        self.copy_to(&mut out.data);
        Ok(out)
    }

    pub(crate) fn copy_to(&self, out: &mut [f32]) {
        parallel::for_each_chunk(out, self.size.width.max(1), |j, row| row.copy_from_slice(self.row(j)));
    }

    pub(crate) fn row(&self, j: usize) -> &[f32] {
        &self.data[j * self.stride..][..self.size.width]
    }
}

impl Plane {
    pub(crate) fn rows(&mut self) -> PlaneRows<'_> {
        PlaneRows { size: self.size, stride: self.size.width, data: &mut self.data }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!("640x360".parse(), Ok(Size { width: 640, height: 360 }));
        for bad in ["", "640", "0x5", "-1x5", "5x99999", "axb"] {
            assert!(bad.parse::<Size>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_range_is_of_occupied_pixels_without_tails() {
        let range_of = |data: Vec<f32>| Plane { size: Size { width: data.len(), height: 1 }, data }.log_range();
        let occupied: Vec<f32> = (1..=1000).map(|i| i as f32).collect();
        assert_eq!(range_of(occupied.clone()), Some([50.0, 995.0]));
        // Neither what is empty nor what a Gaussian's tail leaves moves it.
        let more = occupied.iter().copied().chain([0.0, f32::NAN, -3.0]).chain([1e-9; 3]).collect();
        assert_eq!(range_of(more), Some([50.0, 995.0]));
        assert_eq!(range_of(vec![0.0; 9]), None);
        assert_eq!(range_of(vec![3.0; 9]), Some([2.0, 4.5]));
    }

    #[test]
    fn the_first_range_leaves_tails_out_and_shows_what_is_uniform_in_the_middle() {
        let range_of = |data: Vec<f32>| Plane { size: Size { width: data.len(), height: 1 }, data }.first_range();
        // A tail of many pixels and little mass, then four decades.
        let tail = (0..5000).map(|i| 1e-9 * (i + 1) as f32);
        let body = (0..10_000).map(|i| 10f32.powf(4.0 * i as f32 / 9999.0));
        let [lo, hi] = range_of(tail.chain(body.clone()).collect()).unwrap();
        // The lowest thousandth of the mass is four in ten of these pixels.
        let sorted: Vec<f32> = body.collect();
        let mass: f64 = sorted.iter().map(|v| f64::from(*v)).sum();
        let mut below = 0.0;
        let first = sorted.iter().position(|v| {
            below += f64::from(*v);
            below > 1e-3 * mass
        });
        let first = first.unwrap();
        let at = |share: f64| f64::from(sorted[first + ((sorted.len() - 1 - first) as f64 * share) as usize]);
        assert!((lo / at(0.05) - 1.0).abs() < 0.02 && (hi / at(0.995) - 1.0).abs() < 0.02, "{lo} {hi}");
        let [lo, hi] = range_of(vec![7.0; 100]).unwrap();
        assert!((hi / lo - 100.0).abs() < 1e-9 && (lo * lo * hi / 343.0 - 1.0).abs() < 0.02, "{lo} {hi}");
        assert_eq!([range_of(vec![0.0; 4]), range_of(vec![f32::NAN, f32::INFINITY])], [None, None]);
    }
}
