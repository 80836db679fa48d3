//! Footprints sorted to the planes and bands that draw them.

use super::project::{Footprint, FootprintBlock};
use super::raster::pyramid::{BAND, Level, PAD, SHARPEST};
use super::raster::{ROUND, exp2};
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};
use std::f32::consts::PI;

/// Depth that a cut may drop at its edge: below what 8 bits show, however many overlap.
pub const FAINTEST: f64 = 1e-4;
/// A footprint ends between these many sigma (squared); the mass outside is put back.
const NEAREST_CUT: f64 = 9.0;
const FARTHEST_CUT: f64 = 22.0;
/// exp(-9 / 2): what lies outside the nearest cut.
const NEAREST_SHARE: f64 = 0.011_108_996_538_242_306;
/// The cut of footprints that are so small that the pixel grid shows, what lies outside (exp(-10)), and what small is
/// (variance).
const SMALL_CUT: f64 = 20.0;
const SMALL_SHARE: f64 = 4.539_992_976_248_485e-5;
pub(super) const SMALL: f64 = 0.45;

/// A footprint as the raster wants it, in the pixels of its plane (pad included): 32 bytes, as a GPU reads
/// them. At (dx, dy) pixels from the centre it adds `peak 2^p`, p = `down dy^2 + along (dx - slope dy)^2`,
/// where p is not below `end`.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct RasterSplat {
    /// Centre, pixels from the left; pixel centres have whole coordinates.
    pub x: f32,
    /// Centre, pixels from the top.
    pub y: f32,
    /// Shift of the row's centre from row to row, pixels.
    pub slope: f32,
    /// -log2(e) / (2 sigma^2) along a row, 1/pixels^2.
    pub along: f32,
    /// The same down the rows.
    pub down: f32,
    /// The exponent (power of two) at which it ends.
    pub end: f32,
    /// Optical depth (or mass a pixel) at the centre.
    pub peak: f32,
    /// Half of its height in rows.
    pub half: f32,
}

/// The strokes of a run of Gaussians, by band.
#[derive(Debug, Default)]
pub struct StrokeBins {
    /// Strokes in the order of their bands, then of their Gaussians.
    pub strokes: Vec<RasterSplat>,
    /// The first stroke of each band, and the end.
    pub starts: Vec<u32>,
}

/// Gathers strokes of a run of Gaussians, then sorts them.
pub struct Binner<'a> {
    levels: &'a [Level],
    found: Vec<(u32, RasterSplat)>,
}

impl<'a> Binner<'a> {
    /// For the planes of a picture.
    pub fn new(levels: &'a [Level], room: usize) -> Self {
        Binner { levels, found: Vec::with_capacity(room) }
    }

    /// Strokes so far, once for every band.
    pub fn strokes(&self) -> usize {
        self.found.len()
    }

    /// Adds footprints, each to every band that it touches.
    pub fn add(&mut self, footprints: &[Footprint]) {
        for f in footprints {
            if let Some(placed) = place(self.levels, f) {
                self.add_placed(&placed);
            }
        }
    }

    /// The same for Gaussian `k` of a block, which is in one piece.
    #[inline(always)]
    pub(super) fn add_whole(&mut self, block: &FootprintBlock, k: usize) {
        let (f, shape, lattice) = block.footprint(k);
        let choice = (cut(shape.peak, shape.smaller), suited(self.levels, shape.smaller, SHARPEST));
        if let Some(placed) = shape.place(self.levels, &f, choice, || lattice) {
            self.add_placed(&placed);
        }
    }

    /// Adds a stroke to every band that it touches.
    #[inline]
    pub fn add_placed(&mut self, placed: &PlacedFootprint) {
        let shape = &self.levels[placed.level];
        let (y, half) = (f64::from(placed.stroke.y), f64::from(placed.stroke.half));
        let first = (y - half).max(0.0) as usize / BAND;
        let last = (y + half).min((shape.rows - 1) as f64) as usize / BAND;
        for band in first..=last {
            self.found.push(((shape.first_band + band) as u32, placed.stroke));
        }
    }

    /// Sorts by band, keeping the order within each.
    pub fn finish(self) -> StrokeBins {
        let bands = self.levels.iter().map(Level::bands).sum::<usize>();
        let mut starts = vec![0u32; bands + 1];
        for (band, _) in &self.found {
            starts[*band as usize + 1] += 1;
        }
        for b in 0..bands {
            starts[b + 1] += starts[b];
        }
        // A counting sort: stable, so that sums are added in the order of the Gaussians whatever the threads.
        let mut next = starts.clone();
        let mut splats = vec![RasterSplat::default(); self.found.len()];
        for (band, splat) in self.found {
            let place = &mut next[band as usize];
            splats[*place as usize] = splat;
            *place += 1;
        }
        StrokeBins { strokes: splats, starts }
    }
}

/// A footprint that touches the picture, on the plane that suits it.
#[derive(Clone, Copy, Debug)]
pub struct PlacedFootprint {
    /// The plane.
    pub level: usize,
    /// Its pixels over the picture's.
    pub scale: f64,
    /// Whether the sum over the pixel grid is made exact, as that of small footprints is.
    pub small: bool,
    /// The stroke on that plane.
    pub stroke: RasterSplat,
}

/// Finds a footprint's plane and stroke; `None` where it does not touch the picture.
#[inline]
pub fn place(levels: &[Level], f: &Footprint) -> Option<PlacedFootprint> {
    place_by(levels, f, |peak, smaller| (cut(peak, smaller), suited(levels, smaller, SHARPEST)))
}

/// The same, where `choice` gives the cut (squared sigmas) and the plane with its scale, of the peak and the smaller variance.
#[inline(always)]
pub(super) fn place_by(
    levels: &[Level],
    f: &Footprint,
    choice: impl FnOnce(f64, f64) -> (f64, (usize, f64)),
) -> Option<PlacedFootprint> {
    // A generous look, before the plane and the cut are known; the exact one follows.
    let reach = FARTHEST_CUT.sqrt() + 3.0;
    let far = |at: f32, variance: f64, pixels: usize| {
        let beyond = (-f64::from(at)).max(f64::from(at) - pixels as f64) - (2 * PAD) as f64;
        beyond > 0.0 && beyond * beyond > reach * reach * variance
    };
    let (size, shape) = (levels[0].size, FootprintForm::new(f));
    if far(f.mean[0], shape.across, size.width) || far(f.mean[1], f64::from(f.down), size.height) {
        return None;
    }
    shape.place(levels, f, choice(shape.peak, shape.smaller), || lattice_sum(f.mean.map(f64::from), f.cov()))
}

/// What a footprint's stroke follows from wherever it is: without a branch, so that loops over many become vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct FootprintForm {
    /// Variance of x.
    pub across: f64,
    /// Value at the centre, before its sum over the pixel grid is made exact.
    pub peak: f64,
    /// The smaller variance.
    pub smaller: f64,
}

impl FootprintForm {
    /// In f64: wide enough for every product.
    #[inline(always)]
    pub fn new(f: &Footprint) -> Self {
        let [xx, _, yy] = f.cov();
        let det = f64::from(f.across) * yy;
        let half_sum = 0.5 * (xx + yy);
        FootprintForm {
            across: xx,
            peak: f64::from(f.sum) / (2.0 * std::f64::consts::PI * det.sqrt()),
            // The smaller eigenvalue, as a quotient: half the sum less the root would cancel for needles.
            smaller: det / (half_sum + (half_sum * half_sum - det).max(0.0).sqrt()),
        }
    }

    /// The stroke on the plane of the number `level`, ending at `cut2` squared sigmas; `None` where it does not touch the
    /// picture. `lattice` is the sum of a small one over the pixel grid.
    #[inline(always)]
    pub fn place(
        &self,
        levels: &[Level],
        f: &Footprint,
        (cut2, (level, scale)): (f64, (usize, f64)),
        lattice: impl FnOnce() -> f64,
    ) -> Option<PlacedFootprint> {
        // In f64: pixel coordinates keep their digits on the way to the plane's.
        let ([at_x, at_y], [xx, yy, across]) =
            (f.mean.map(f64::from), [self.across, f64::from(f.down), f64::from(f.across)]);
        if !(across * yy > 0.0 && f.sum > 0.0) {
            return None;
        }
        let (reach_x, reach_y) = ((cut2 * xx).sqrt(), (cut2 * yy).sqrt());
        let shape = &levels[level];
        let pad = PAD as f64;
        // Planes share their edges, not their pixel centres, which lie half a pixel inside.
        let x = (at_x + 0.5) * scale - 0.5 + pad;
        let y = (at_y + 0.5) * scale - 0.5 + pad;
        let (half_x, half_y) = (reach_x * scale, reach_y * scale);
        let right = (shape.size.width + 2 * PAD - 1) as f64;
        let bottom = (shape.rows - 1) as f64;
        let outside = x + half_x < 0.0 || x - half_x > right || y + half_y < 0.0 || y - half_y > bottom;
        // Not the negation: what is not a number stays out.
        if outside || !(x.is_finite() && y.is_finite() && self.peak.is_finite()) {
            return None;
        }
        // What the cut takes away is put back; these two are the most frequent.
        let share_inside = match cut2 {
            NEAREST_CUT => 1.0 - NEAREST_SHARE,
            SMALL_CUT => 1.0 - SMALL_SHARE,
            _ => 1.0 - libm::exp(-0.5 * cut2),
        };
        // Samples of wide footprints sum to 1 already: only small ones alias on the grid (docs/law/depth.md).
        let small = self.smaller < SMALL;
        let lattice = if small { lattice() } else { 1.0 };
        const HALF_LOG2_E: f64 = 0.5 * std::f64::consts::LOG2_E;
        let unscale2 = 1.0 / (scale * scale);
        let splat = RasterSplat {
            x: x as f32,
            y: y as f32,
            slope: f.lean,
            along: (-HALF_LOG2_E / across * unscale2) as f32,
            down: (-HALF_LOG2_E / yy * unscale2) as f32,
            end: (-HALF_LOG2_E * cut2) as f32,
            peak: (self.peak / (share_inside * lattice)) as f32,
            half: half_y as f32,
        };
        Some(PlacedFootprint { level, scale, small, stroke: splat })
    }
}

/// The coarsest plane that still shows a variance, where `sharpest` is the least sigma on it, and its scale.
pub(super) fn suited(levels: &[Level], variance: f64, sharpest: f64) -> (usize, f64) {
    let mut level = 0;
    let mut scale = 1.0;
    let mut least = 4.0 * sharpest * sharpest;
    while level + 1 < levels.len() && variance >= least {
        level += 1;
        scale *= 0.5;
        least *= 4.0;
    }
    (level, scale)
}

/// Half of the frequencies that a variance of 1/12 lets through.
#[rustfmt::skip]
const FREQUENCIES: [(f64, f64); 12] = [
    (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0), (2.0, 0.0), (0.0, 2.0),
    (2.0, 1.0), (2.0, -1.0), (1.0, 2.0), (1.0, -2.0), (2.0, 2.0), (2.0, -2.0),
];

/// The end of a footprint, in squared sigmas: where it fades below notice.
#[inline]
pub(super) fn cut(peak: f64, smaller: f64) -> f64 {
    if smaller < SMALL {
        SMALL_CUT
    } else if peak < FAINTEST * 90.0 {
        // exp(9 / 2) = 90: most footprints spare themselves the logarithm.
        NEAREST_CUT
    } else {
        (2.0 * libm::log(peak / FAINTEST)).clamp(NEAREST_CUT, FARTHEST_CUT)
    }
}

/// The sum over all pixels of the normalised footprint sampled at their centres, by Poisson's
/// summation: 1 for wide ones, up to 1.9 for a point at a pixel's centre.
pub fn lattice_sum(mean: [f64; 2], [xx, xy, yy]: [f64; 3]) -> f64 {
    const TWO_PI: f64 = 2.0 * std::f64::consts::PI;
    let mut sum = 1.0;
    for (i, j) in FREQUENCIES {
        let power = -0.5 * TWO_PI * TWO_PI * (i * i * xx + 2.0 * i * j * xy + j * j * yy);
        // Smaller terms are below 2e-6.
        if power > -14.0 {
            sum += 2.0 * libm::exp(power) * libm::cos(TWO_PI * (i * mean[0] + j * mean[1]));
        }
    }
    sum
}

/// [`lattice_sum`] of eight footprints, to 1e-5: of their means, and variances and leans as [`Footprint`] has them.
#[inline(always)]
pub(super) fn lattice_sums<S: Simd>([x, y, down, lean, across]: [f32x8<S>; 5]) -> f32x8<S> {
    let ([x1, x2], [y1, y2]) = (waves(x), waves(y));
    let shape = [down, lean, across];
    let axes = lattice_term(shape, 1.0, 0.0, x1[0]) + lattice_term(shape, 0.0, 1.0, y1[0]);
    let axes = axes + (lattice_term(shape, 2.0, 0.0, x2[0]) + lattice_term(shape, 0.0, 2.0, y2[0]));
    let low = lattice_pair(shape, (1.0, x1), (1.0, y1)) + lattice_pair(shape, (1.0, x1), (2.0, y2));
    let high = lattice_pair(shape, (2.0, x2), (1.0, y1)) + lattice_pair(shape, (2.0, x2), (2.0, y2));
    let half = axes + (low + high);
    half + half + 1.0
}

/// The terms of the frequencies (i, j) and (i, -j), of their waves.
#[inline(always)]
fn lattice_pair<S: Simd>(
    shape: [f32x8<S>; 3],
    (i, [cos_x, sin_x]): (f32, [f32x8<S>; 2]),
    (j, [cos_y, sin_y]): (f32, [f32x8<S>; 2]),
) -> f32x8<S> {
    let (cosines, sines) = (cos_x * cos_y, sin_x * sin_y);
    lattice_term(shape, i, j, cosines - sines) + lattice_term(shape, i, -j, cosines + sines)
}

/// What a frequency adds, half of it, of its wave.
#[inline(always)]
fn lattice_term<S: Simd>([down, lean, across]: [f32x8<S>; 3], i: f32, j: f32, wave: f32x8<S>) -> f32x8<S> {
    const TWO_PI_2: f32 = 2.0 * PI * PI;
    // By the factors of the covariance, whose moments would cancel for needles in f32.
    let turned = lean * i + j;
    let power = (across * (i * i) + down * turned * turned) * -TWO_PI_2;
    power.simd_gt(-14.0).select(exp2(power * std::f32::consts::LOG2_E) * wave, f32x8::splat(wave.simd, 0.0))
}

/// Cosine and sine of 2 pi x and of 4 pi x, |x| < 2^22, to 1e-6.
#[inline(always)]
fn waves<S: Simd>(x: f32x8<S>) -> [[f32x8<S>; 2]; 2] {
    // Of pi times the way to the nearest whole number, by their series; then angles are doubled.
    let x = x - ((x + ROUND) - ROUND);
    let x2 = x * x;
    let sin = ((((x2 * -0.007_370_431 + 0.082_145_89) * x2 - 0.599_264_5) * x2 + 2.550_164) * x2 - 5.167_713) * x2 + PI;
    let cos = ((((x2 * -0.025_806_89 + 0.235_330_63) * x2 - 1.335_262_8) * x2 + 4.058_712) * x2 - 4.934_802) * x2 + 1.0;
    let double = |[cos, sin]: [f32x8<S>; 2]| [1.0 - 2.0 * sin * sin, 2.0 * sin * cos];
    let once = double([cos, sin * x]);
    [once, double(once)]
}

/// The logarithm of [`lattice_sum`]'s change with the mean (x, y) and the covariance (xx, xy, yy).
pub fn lattice_slope(at: [f64; 2], [xx, xy, yy]: [f64; 3]) -> ([f64; 2], [f64; 3]) {
    const TWO_PI: f64 = 2.0 * std::f64::consts::PI;
    let (mut sum, mut mean, mut cov) = (1.0, [0.0; 2], [0.0; 3]);
    for (i, j) in FREQUENCIES {
        let power = -0.5 * TWO_PI * TWO_PI * (i * i * xx + 2.0 * i * j * xy + j * j * yy);
        if power > -14.0 {
            let (sin, cos) = libm::sincos(TWO_PI * (i * at[0] + j * at[1]));
            let size = 2.0 * libm::exp(power);
            sum += size * cos;
            let by_power = -0.5 * TWO_PI * TWO_PI * size * cos;
            for (c, k) in cov.iter_mut().zip([i * i, 2.0 * i * j, j * j]) {
                *c += by_power * k;
            }
            mean[0] -= size * sin * TWO_PI * i;
            mean[1] -= size * sin * TWO_PI * j;
        }
    }
    (mean.map(|v| v / sum), cov.map(|v| v / sum))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    /// Points, blots and needles, at any place within and far from a pixel.
    #[test]
    fn sums_of_eight_are_those_of_each() {
        let simd = fearless_simd::Level::new();
        for trial in 0..2000 {
            let mut r = Random::new(1, 0, trial);
            let mut column = |value: &mut dyn FnMut(&mut Random) -> f64| [0; 8].map(|_| value(&mut r) as f32);
            let place = &mut |r: &mut Random| 3000.0 * r.uniform() - 500.0;
            let variance = &mut |r: &mut Random| 1.0 / 12.0 + libm::exp(12.0 * r.uniform() - 8.0);
            let columns =
                [column(place), column(place), column(variance), column(&mut |r| 3.0 * r.normal()), column(variance)];
            let mut sums = [0.0; 8];
            fearless_simd::dispatch!(simd, simd => {
                lattice_sums(columns.map(|c| f32x8::from_slice(simd, &c))).store_slice(&mut sums);
            });
            for k in 0..8 {
                let [x, y, down, lean, across] = columns.map(|c| c[k]);
                let f = Footprint { mean: [x, y], down, lean, across, sum: 1.0 };
                let exact = lattice_sum([x, y].map(f64::from), f.cov());
                assert!((f64::from(sums[k]) - exact).abs() < 1e-5, "{f:?}: {} {exact}", sums[k]);
            }
        }
    }
}
