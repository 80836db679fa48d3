//! PSNR of one 8-bit picture against another (docs/law/scores.md). Sums of squared differences are
//! whole numbers, so scores do not depend on the order of summation.

use super::{Gray8, ssim};
use crate::parallel;

/// Levels above this (of 255) are lit; a pixel counts in the masked PSNR where either picture is.
pub const MASK_LEVEL: f64 = 2.5;

const STEP: usize = 1 << 16;

/// The scores of one picture against another.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Scores {
    /// dB over all pixels; `None` where the pictures are identical.
    pub psnr: Option<f64>,
    /// dB over lit pixels; `None` where these are identical or none is lit.
    pub masked_psnr: Option<f64>,
    /// Mean structural similarity; `None` where a side is shorter than the window of 7.
    pub ssim: Option<f64>,
}

impl Scores {
    /// All three scores of two pictures of one size.
    pub fn new(a: &Gray8, b: &Gray8) -> Self {
        let sums = LevelSums::new(a, b);
        Scores { psnr: sums.psnr(), masked_psnr: sums.masked_psnr(), ssim: ssim(a, b) }
    }
}

/// -10 log10 of the mean squared difference of values in [0, 1], over all pixels of two pictures
/// of one size. `None` where they are identical.
pub fn psnr(a: &Gray8, b: &Gray8) -> Option<f64> {
    LevelSums::new(a, b).psnr()
}

/// [`psnr`] over the pixels where either picture is brighter than [`MASK_LEVEL`]. `None` where
/// these are identical or there are none.
pub fn masked_psnr(a: &Gray8, b: &Gray8) -> Option<f64> {
    LevelSums::new(a, b).masked_psnr()
}

/// Whether a pixel with these two levels is counted in the masked PSNR.
pub fn is_lit(a: u8, b: u8) -> bool {
    f64::from(a.max(b)) > MASK_LEVEL
}

/// The decibels of a mean squared error of values in [0, 1]; `None` for zero.
pub fn decibels(mean_squared_error: f64) -> Option<f64> {
    (mean_squared_error > 0.0).then(|| -10.0 * libm::log10(mean_squared_error))
}

/// Squared differences in levels, and pixels, whole and lit.
#[derive(Clone, Copy, Default)]
struct LevelSums {
    all: u64,
    pixels: u64,
    lit: u64,
    lit_pixels: u64,
}

impl LevelSums {
    fn new(a: &Gray8, b: &Gray8) -> LevelSums {
        assert_eq!(a.size, b.size, "pictures of one size");
        let runs = a.data.chunks(STEP).zip(b.data.chunks(STEP));
        parallel::map(runs, |(a, b)| Self::from_run(a, b)).into_iter().fold(LevelSums::default(), LevelSums::plus)
    }

    /// 2^16 squares of at most 255^2 stay below 2^32.
    fn from_run(a: &[u8], b: &[u8]) -> LevelSums {
        let (mut all, mut lit, mut lit_pixels) = (0u32, 0u32, 0u32);
        for (&a, &b) in a.iter().zip(b) {
            let d = u32::from(a.abs_diff(b));
            let mask = u32::from(is_lit(a, b));
            all += d * d;
            lit += d * d * mask;
            lit_pixels += mask;
        }
        LevelSums { all: all.into(), pixels: a.len() as u64, lit: lit.into(), lit_pixels: lit_pixels.into() }
    }

    fn plus(self, o: LevelSums) -> LevelSums {
        LevelSums {
            all: self.all + o.all,
            pixels: self.pixels + o.pixels,
            lit: self.lit + o.lit,
            lit_pixels: self.lit_pixels + o.lit_pixels,
        }
    }

    fn psnr(&self) -> Option<f64> {
        mean_square(self.all, self.pixels)
    }

    fn masked_psnr(&self) -> Option<f64> {
        mean_square(self.lit, self.lit_pixels)
    }
}

fn mean_square(sum: u64, pixels: u64) -> Option<f64> {
    if pixels == 0 { None } else { decibels(sum as f64 / (pixels as f64 * 255.0 * 255.0)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Size;

    fn picture(data: &[u8]) -> Gray8 {
        Gray8 { size: Size { width: data.len(), height: 1 }, data: data.to_vec() }
    }

    #[test]
    fn formulas() {
        let (a, b) = (picture(&[0, 0, 3, 2]), picture(&[255, 0, 0, 2]));
        let all = -10.0 * ((1.0 + (3.0f64 / 255.0).powi(2)) / 4.0).log10();
        let lit = -10.0 * ((1.0 + (3.0f64 / 255.0).powi(2)) / 2.0).log10();
        assert!((psnr(&a, &b).unwrap() - all).abs() < 1e-12);
        assert!((masked_psnr(&a, &b).unwrap() - lit).abs() < 1e-12);
    }

    #[test]
    fn nothing_to_compare_has_no_value() {
        let (a, dim) = (picture(&[0, 9, 200]), picture(&[0, 1, 2]));
        assert_eq!(psnr(&a, &a), None);
        assert_eq!(masked_psnr(&a, &a), None);
        assert!(psnr(&dim, &picture(&[0, 0, 0])).is_some());
        assert_eq!(masked_psnr(&dim, &picture(&[0, 0, 0])), None);
    }

    #[test]
    fn the_largest_difference_is_zero_decibels_at_any_size() {
        let size = Size { width: 1000, height: 200 };
        let white = Gray8 { size, data: vec![255; size.pixels()] };
        assert_eq!(psnr(&white, &Gray8::black(size)), Some(0.0));
        assert_eq!(masked_psnr(&white, &Gray8::black(size)), Some(0.0));
    }
}
