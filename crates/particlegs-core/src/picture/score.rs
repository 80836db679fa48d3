//! PSNR and structural similarity of one 8-bit picture against another (docs/law/scores.md). Sums of squared differences
//! are whole numbers, so PSNR does not depend on the order of summation.
//!
//! Structural similarity is that of scikit-image's `structural_similarity` by default: 7x7
//! uniform window, K1 0.01, K2 0.03, sample covariance, data range 1, borders cropped by 3.
//! Window sums of 8-bit levels are whole numbers, so the formula is evaluated on exact sums.

use super::Gray8;
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

const WINDOW: usize = 7;
const N: f64 = (WINDOW * WINDOW) as f64;
/// (K1 x data range)^2 and (K2 x data range)^2.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;
/// The same in the units of the sums below: squares of window sums of levels.
const C1_SUMS: f64 = C1 * (N * 255.0) * (N * 255.0);
const C2_SUMS: f64 = C2 * N * (N - 1.0) * 255.0 * 255.0;
/// Output rows in one step of parallel work.
const BAND: usize = 32;

/// Mean structural similarity of two pictures of one size. `None` where a side is shorter than 7.
pub fn ssim(a: &Gray8, b: &Gray8) -> Option<f64> {
    assert_eq!(a.size, b.size, "pictures of one size");
    let (width, height) = (a.size.width, a.size.height);
    if width < WINDOW || height < WINDOW {
        return None;
    }
    let (columns, rows) = (width + 1 - WINDOW, height + 1 - WINDOW);
    let bands: Vec<Vec<f64>> =
        parallel::map_range(rows.div_ceil(BAND), |k| band(a, b, k * BAND..rows.min((k + 1) * BAND)));
    Some(bands.iter().flatten().sum::<f64>() / (columns * rows) as f64)
}

/// Running sums down the columns: of a, of b, of a^2 + b^2 and of ab over 7 rows.
struct ColumnSums {
    a: Vec<i32>,
    b: Vec<i32>,
    squares: Vec<i32>,
    products: Vec<i32>,
}

impl ColumnSums {
    fn new(width: usize) -> Self {
        let zeros = || vec![0; width];
        ColumnSums { a: zeros(), b: zeros(), squares: zeros(), products: zeros() }
    }

    /// Adds (`sign` 1) or takes away (-1) a row.
    fn row(&mut self, a: &[u8], b: &[u8], sign: i32) {
        let sums = self.a.iter_mut().zip(&mut self.b).zip(self.squares.iter_mut().zip(&mut self.products));
        for (((sa, sb), (squares, products)), (&a, &b)) in sums.zip(a.iter().zip(b)) {
            let (a, b) = (i32::from(a), i32::from(b));
            *sa += sign * a;
            *sb += sign * b;
            *squares += sign * (a * a + b * b);
            *products += sign * a * b;
        }
    }

    /// Sum of the similarity over one row of windows.
    fn similarity(&self, row: &mut WindowRow) -> f64 {
        let columns = [&self.a, &self.b, &self.squares, &self.products];
        columns.into_iter().zip(&mut row.sums).for_each(|(column, sums)| window_sums(column, sums));
        let [a, b, squares, products] = &row.sums;
        // Many at a time, then added in their order.
        let sums = a.iter().zip(b).zip(squares.iter().zip(products));
        for (out, ((&a, &b), (&squares, &products))) in row.similarity.iter_mut().zip(sums) {
            *out = window_similarity(a, b, squares, products);
        }
        row.similarity.iter().sum()
    }
}

struct WindowRow {
    /// Sums over each window, of what [`ColumnSums`] has.
    sums: [Vec<i32>; 4],
    similarity: Vec<f64>,
}

impl WindowRow {
    fn new(windows: usize) -> Self {
        WindowRow { sums: [0; 4].map(|_| vec![0; windows]), similarity: vec![0.0; windows] }
    }
}

fn window_sums(column: &[i32], out: &mut [i32]) {
    let n = out.len();
    let c: [&[i32]; WINDOW] = std::array::from_fn(|k| &column[k..k + n]);
    for (x, out) in out.iter_mut().enumerate() {
        *out = c.iter().map(|c| c[x]).sum();
    }
}

/// The similarity of one window from its sums of levels, squares (of both) and products.
fn window_similarity(a: i32, b: i32, squares: i32, products: i32) -> f64 {
    const COUNT: i32 = (WINDOW * WINDOW) as i32;
    // All below 2^31: 49 x 49 x 255^2 is 1.6e8, and twice that.
    let ab = f64::from(a * b);
    let means = f64::from(a * a + b * b);
    let covariance = f64::from(COUNT * products - a * b);
    let variances = f64::from(COUNT * squares - a * a - b * b);
    ((2.0 * ab + C1_SUMS) * (2.0 * covariance + C2_SUMS)) / ((means + C1_SUMS) * (variances + C2_SUMS))
}

/// Sums of the similarity over the output rows `rows`.
fn band(a: &Gray8, b: &Gray8, rows: std::ops::Range<usize>) -> Vec<f64> {
    let width = a.size.width;
    let row = |y: usize| y * width..(y + 1) * width;
    let (mut sums, mut windows) = (ColumnSums::new(width), WindowRow::new(width + 1 - WINDOW));
    for y in rows.start..rows.start + WINDOW - 1 {
        sums.row(&a.data[row(y)], &b.data[row(y)], 1);
    }
    rows.map(|y| {
        let last = y + WINDOW - 1;
        sums.row(&a.data[row(last)], &b.data[row(last)], 1);
        let similarity = sums.similarity(&mut windows);
        sums.row(&a.data[row(y)], &b.data[row(y)], -1);
        similarity
    })
    .collect()
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

    /// The generated pictures of the fixtures, in whole-number arithmetic so that Python makes the same.
    fn pattern(kind: usize, width: usize, height: usize) -> Gray8 {
        let level = |x: usize, y: usize| match kind {
            0 => (x * 7 + y * 13) % 256,
            1 => (x * 7 + y * 13 + (x * y) % 17) % 256,
            2 => (x * x + 3 * y * y + x * y) % 256,
            3 => 255 * ((x / 5 + y / 4) % 2),
            _ => (x * 2654435761 + y * 40503 + (x * y) % 251) / 7 % 6,
        };
        let data = (0..width * height).map(|i| level(i % width, i / width) as u8).collect();
        Gray8 { size: Size { width, height }, data }
    }

    /// scikit-image 0.26's values, by
    /// `structural_similarity(a / 255, b / 255, data_range=1.0)` of the same patterns in int64:
    /// `[x*7+y*13, x*7+y*13+x*y%17, x*x+3*y*y+x*y, 255*((x//5+y//4)%2), (x*2654435761+y*40503+x*y%251)//7%6]`, mod 256.
    const FIXTURES: [(usize, usize, usize, usize, f64); 7] = [
        (0, 1, 64, 48, 0.8265029224346909),
        (0, 2, 64, 48, 0.012102402130249074),
        (2, 3, 33, 71, -0.005117548356711478),
        (3, 0, 7, 7, 0.13369073649926916),
        (4, 4, 7, 100, 1.0),
        (4, 3, 90, 41, 0.00011850714372401199),
        (4, 2, 129, 65, 0.0004971394149220294),
    ];

    #[test]
    fn equals_scikit_image() {
        for (a, b, width, height, expected) in FIXTURES {
            let got = ssim(&pattern(a, width, height), &pattern(b, width, height)).unwrap();
            assert!((got - expected).abs() < 1e-9, "{a} {b} {width}x{height}: {got} for {expected}");
        }
    }

    #[test]
    fn identical_pictures_are_one_and_small_ones_nothing() {
        let a = pattern(2, 50, 40);
        assert_eq!(ssim(&a, &a), Some(1.0));
        assert_eq!(ssim(&pattern(0, 6, 40), &pattern(1, 6, 40)), None);
    }
}
