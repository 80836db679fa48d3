//! Planes of halved resolution. The sum is linear, so a Gaussian whose smaller sigma on the picture
//! is wide is drawn on a coarser plane, where it covers fewer pixels; the planes are summed from
//! coarse to fine.

use crate::parallel;
use crate::picture::Size;
use fearless_simd::Level as SimdLevel;

/// Pixels drawn beyond each edge of a plane, for the interpolation to the next finer one.
pub const PAD: usize = 8;
/// Rows of a band: one task draws one band of one plane.
pub const BAND: usize = 32;
/// On the coarser planes a Gaussian's smaller sigma is at least this many pixels.
pub const SHARPEST: f64 = 1.3;
/// The same for maps of fields, whose quotients would show ripples of 1e-3 where a wide Gaussian fades.
pub const SHARPEST_FIELD: f64 = 2.0;
/// No plane has fewer pixels than this in a direction.
const SMALLEST: usize = 8;

/// The shape of one plane.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    /// Pixels across and down, without the pad.
    pub size: Size,
    /// Floats from row to row: the pads and room for a whole vector past the end.
    pub stride: usize,
    /// Rows with the pads.
    pub rows: usize,
    /// The number of its first band among the bands of all planes.
    pub first_band: usize,
}

impl Level {
    fn new(size: Size, first_band: usize) -> Level {
        let stride = (size.width + 2 * PAD).next_multiple_of(8) + 8;
        Level { size, stride, rows: size.height + 2 * PAD, first_band }
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.rows.div_ceil(BAND)
    }
}

/// The planes of a picture, finest first.
pub fn levels(size: Size) -> Vec<Level> {
    let mut levels = vec![Level::new(size, 0)];
    loop {
        let last = levels[levels.len() - 1];
        let half = Size { width: last.size.width.div_ceil(2), height: last.size.height.div_ceil(2) };
        if half.width.min(half.height) < SMALLEST {
            return levels;
        }
        levels.push(Level::new(half, last.first_band + last.bands()));
    }
}

/// Adds coarse planes to the next finer ones, interpolated between their pixels by `taps`; `levels` are theirs. Each row
/// of the first plane is followed by that of the next ones.
pub fn add_up(simd: SimdLevel, levels: [&Level; 2], taps: &[f32; 8], coarse: &[f32], fine: &mut [f32]) {
    let [from, to] = levels;
    let planes = fine.len() / (to.stride * to.rows);
    parallel::for_each_chunk_with(
        fine,
        planes * to.stride,
        || vec![0.0f32; planes * from.stride],
        |line, row, fine| {
            fearless_simd::dispatch!(simd, _simd => {
                add_down(coarse, from, row, taps, line);
                for (line, fine) in line.chunks_exact(from.stride).zip(fine.chunks_exact_mut(to.stride)) {
                    add_across(line, taps, fine, to);
                }
            });
        },
    );
}

/// A row between coarse ones, into `line`.
#[inline(always)]
fn add_down(coarse: &[f32], level: &Level, row: usize, filter: &[f32; 8], line: &mut [f32]) {
    let stride = line.len();
    let [r0, r1, r2, r3, r4, r5, r6, r7] = taps(row).map(|r| {
        let r = r.min(level.rows - 1);
        &coarse[r * stride..(r + 1) * stride]
    });
    let mut w = *filter;
    // Even rows lie a quarter of a pixel before a coarse one and odd rows behind it: the taps are mirrored.
    if row.is_multiple_of(2) {
        w.reverse();
    }
    for i in 0..stride {
        let outer = (w[0] * r0[i] + w[7] * r7[i]) + (w[1] * r1[i] + w[6] * r6[i]);
        line[i] = outer + ((w[2] * r2[i] + w[5] * r5[i]) + (w[3] * r3[i] + w[4] * r4[i]));
    }
}

/// Adds a row of coarse pixels to one of fine pixels.
#[inline(always)]
fn add_across(line: &[f32], w: &[f32; 8], fine: &mut [f32], fine_level: &Level) {
    // Fine pixels 2 i - PAD and its neighbour lie a quarter of a coarse pixel either side of i.
    let pairs = (fine_level.size.width + 2 * PAD).div_ceil(2);
    let first = PAD - PAD / 2;
    let from = |k: usize| &line[first + k - 4..][..pairs];
    let l: [&[f32]; 9] = std::array::from_fn(from);
    let fine = &mut fine[..2 * pairs];
    for i in 0..pairs {
        let left = ((w[7] * l[0][i] + w[0] * l[7][i]) + (w[6] * l[1][i] + w[1] * l[6][i]))
            + ((w[5] * l[2][i] + w[2] * l[5][i]) + (w[4] * l[3][i] + w[3] * l[4][i]));
        let right = ((w[0] * l[1][i] + w[7] * l[8][i]) + (w[1] * l[2][i] + w[6] * l[7][i]))
            + ((w[2] * l[3][i] + w[5] * l[6][i]) + (w[3] * l[4][i] + w[4] * l[5][i]));
        fine[2 * i] += left;
        fine[2 * i + 1] += right;
    }
}

/// The transpose of [`add_up`] (its edges' repetition apart): what the gradient of the fine plane
/// means for the coarse one. `levels` are the fine plane's and the coarse one's.
pub fn gather_down(simd: SimdLevel, levels: [&Level; 2], fine: &[f32], coarse: &mut [f32]) {
    let [from, to] = levels;
    parallel::for_each_chunk_with(
        &mut coarse[..to.stride * to.rows],
        to.stride,
        || (vec![0.0f32; from.stride], [vec![], vec![]]),
        |(line, halves), row, coarse| {
            fearless_simd::dispatch!(simd, _simd => gather_row(fine, from, row, line, halves, coarse));
        },
    );
}

/// One coarse row: down first, into `line`, then across.
#[inline(always)]
fn gather_row(
    fine: &[f32],
    level: &Level,
    row: usize,
    line: &mut [f32],
    halves: &mut [Vec<f32>; 2],
    coarse: &mut [f32],
) {
    line.fill(0.0);
    for k in row.saturating_sub(8)..=row {
        // Fine rows 2 k and 2 k + 1 take coarse rows k.. and k + 1.. with the taps W, one reversed.
        let even = (row - k < 8).then(|| (2 * k, W[7 - (row - k)]));
        let odd = (row > k).then(|| (2 * k + 1, W[row - k - 1]));
        for (from, w) in [even, odd].into_iter().flatten() {
            if from < level.rows {
                let from = &fine[from * level.stride..(from + 1) * level.stride];
                line.iter_mut().zip(from).for_each(|(l, f)| *l += w * f);
            }
        }
    }
    // The same across: even and odd columns apart, eight zeros before each.
    let width = level.size.width + 2 * PAD;
    for (parity, half) in halves.iter_mut().enumerate() {
        half.clear();
        half.resize(8, 0.0);
        half.extend(line[..width].iter().skip(parity).step_by(2));
        half.resize(coarse.len() + 8, 0.0);
    }
    let n = coarse.len();
    let even: [&[f32]; 8] = std::array::from_fn(|t| &halves[0][8 - t..][..n]);
    let odd: [&[f32]; 8] = std::array::from_fn(|t| &halves[1][7 - t..][..n]);
    for (c, out) in coarse.iter_mut().enumerate() {
        let mut sum = 0.0;
        for t in 0..8 {
            sum += W[7 - t] * even[t][c] + W[t] * odd[t][c];
        }
        *out = sum;
    }
}

/// Interpolation a quarter of a pixel past the fourth sample: the least-squares filter for
/// Gaussians of sigma [`SHARPEST`] and wider, good to 8e-4 of their peak (the cubic: 1.3e-2).
pub const W: [f32; 8] =
    [-0.007_861_4, 0.039_791_2, -0.133_810_6, 0.878_973_1, 0.292_276_3, -0.094_832_3, 0.032_128_4, -0.006_664_7];

/// The same for [`SHARPEST_FIELD`]: good to 2e-4 of the peak, and to 1e-3 of the value where it is a hundredth of that.
pub const FIELD_W: [f32; 8] =
    [-0.002_273_54, 0.021_152_25, -0.107_940_9, 0.865_475_6, 0.281_749_33, -0.072_014_57, 0.015_585_07, -0.001_733_2];

/// The eight coarse rows (with pad) around fine row `row` (with pad).
#[inline(always)]
fn taps(row: usize) -> [usize; 8] {
    let first = row / 2 + PAD - PAD / 2 - if row.is_multiple_of(2) { 4 } else { 3 };
    std::array::from_fn(|k| first + k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    /// <U c, f> = <c, U^T f> where the edges are dark.
    #[test]
    fn gathering_is_the_transpose() {
        let levels = levels(Size { width: 77, height: 50 });
        let mut draw = Random::new(1, 0, 0);
        let mut plane = |l: &Level| {
            let mut p = vec![0.0f32; l.stride * l.rows];
            for row in PAD..l.rows - PAD {
                p[row * l.stride + PAD..][..l.size.width].fill_with(|| draw.normal() as f32);
            }
            p
        };
        let (coarse, fine) = (plane(&levels[1]), plane(&levels[0]));
        let (mut up, mut down) = (vec![0.0; fine.len()], vec![0.0; coarse.len()]);
        let simd = SimdLevel::new();
        add_up(simd, [&levels[1], &levels[0]], &W, &coarse, &mut up);
        gather_down(simd, [&levels[0], &levels[1]], &fine, &mut down);
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(x, y)| f64::from(x * y)).sum::<f64>();
        let (a, b) = (dot(&up, &fine), dot(&coarse, &down));
        assert!((a - b).abs() < 1e-3 * (1.0 + a.abs()), "{a} {b}");
    }
}
