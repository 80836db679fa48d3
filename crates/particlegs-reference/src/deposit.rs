//! The optical depth that one splat adds to a plane: `-ln(1 - m)` with m its opacity averaged
//! over each pixel, cut at three standard deviations (docs/law/depth.md).

use fearless_simd::{Level, Simd, dispatch};
use particlegs_core::splat::{CUT_SIGMA, LARGEST_MEAN_ALPHA, erf};

/// A splat in pixels, rows upward: centre and how far one deviation of u and of v moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PixelSplat {
    pub x: f32,
    pub y: f32,
    /// `[a, b, c, d]`: u moves by (a, c), v by (b, d).
    pub axes: [f32; 4],
}

impl PixelSplat {
    /// Standard deviations along x and y.
    #[inline]
    pub fn sigma(&self) -> [f32; 2] {
        let [a, b, c, d] = self.axes;
        // Squares of float32 do not overflow in f64.
        let length = |a: f32, b: f32| (f64::from(a) * f64::from(a) + f64::from(b) * f64::from(b)).sqrt() as f32;
        if b == 0.0 && c == 0.0 { [a, d] } else { [length(a, b), length(c, d)] }
    }

    /// The reach of the square of three deviations along x and y.
    #[inline]
    pub fn reach(&self) -> [f32; 2] {
        let [a, b, c, d] = self.axes;
        [CUT * (a.abs() + b.abs()), CUT * (c.abs() + d.abs())]
    }

    /// The same splat where a pixel is `1 / scale` of the old ones.
    pub fn scaled(&self, scale: f32) -> PixelSplat {
        PixelSplat { x: self.x * scale, y: self.y * scale, axes: self.axes.map(|v| v * scale) }
    }
}

const CUT: f32 = CUT_SIGMA as f32;

/// From this deviation on (pixels) the mean over a pixel is its centre's value and a curvature term.
const SMOOTH_SIGMA: f32 = 4.0;

/// Splats up to this deviation (pixels) reach two pixels along an axis at most.
pub(super) const SMALL_SIGMA: f32 = 1.0 / (2.0 * CUT);

/// Below this opacity `-ln(1 - m)` is a short series.
const SERIES_OPACITY: f32 = 0.1;

/// Lines of a row that a rotated splat is summed on where its opacity makes the square's upper and
/// lower edges visible (a step of `opacity e^-4.5`).
const CUT_LINES: i32 = 16;

/// Intervals of the table of the Gaussian's integral from -3 to +3.
const STEPS: usize = 4096;

pub(super) struct RowRun<'a> {
    pub data: &'a mut [f32],
    pub width: usize,
    /// The pixel coordinates of `data[0]`'s lower left corner.
    pub corner: [i32; 2],
    /// Pixels of the picture in one of these, squared: 1, or 4^-level on coarser planes.
    pub fine_area: f32,
}

pub(super) struct Depositor {
    opacity: f32,
    integral: Vec<f32>,
}

/// Working rows of one task.
#[derive(Default)]
pub(super) struct Profiles {
    x: Vec<f32>,
    y: Vec<f32>,
}

impl Depositor {
    pub fn new(opacity: f64) -> Self {
        let root = (0.5 * std::f64::consts::PI).sqrt();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        // The table has one entry beyond the last: interpolation reads it at the very end.
        let at = |k: usize| CUT_SIGMA * (2.0 * k as f64 / STEPS as f64 - 1.0);
        let integral =
            (0..=STEPS + 1).map(|k| (root * (erf(at(k.min(STEPS)) * half) + erf(CUT_SIGMA * half))) as f32).collect();
        Depositor { opacity: opacity as f32, integral }
    }

    /// The integral of exp(-t^2/2) from -3 to `e`, clamped to the cut.
    #[inline(always)]
    fn integral(&self, e: f32) -> f32 {
        let t = (e.clamp(-CUT, CUT) + CUT) * (STEPS as f32 / (2.0 * CUT));
        let k = t as usize;
        let (a, b) = (self.integral[k], self.integral[k + 1]);
        a + (t - k as f32) * (b - a)
    }

    /// Adds small aligned splats `[x, y, sigma_x, sigma_y]`: two by two pixels at most.
    pub fn add_small(&self, splats: &[[f32; 4]], rows: &mut RowRun<'_>) {
        let whole = self.integral[STEPS];
        let height = (rows.data.len() / rows.width) as i32;
        // First pixel, its share and the next one's.
        let split = |center: f32, sigma: f32, first: i32| {
            // A small splat that is drawn begins a pixel before the picture at most: from -1 on this is the floor.
            let pixel = ((center - CUT * sigma + 1.0) as i32 - 1) as f32;
            // Most lie in one pixel, and need no look into the table.
            let is_in_one = center + CUT * sigma <= pixel + 1.0;
            let below = if is_in_one { whole } else { self.integral((pixel + 1.0 - center) / sigma) };
            (pixel as i32 - first, [sigma * below, sigma * (whole - below)])
        };
        for &[x, y, sx, sy] in splats {
            let (column, across) = split(x, sx, rows.corner[0]);
            let (row, up) = split(y, sy, rows.corner[1]);
            for (j, up) in up.into_iter().enumerate() {
                let row = row + j as i32;
                if up <= 0.0 || row < 0 || row >= height {
                    continue;
                }
                for (i, across) in across.into_iter().enumerate() {
                    let column = column + i as i32;
                    if across > 0.0 && column >= 0 && (column as usize) < rows.width {
                        let t = &mut rows.data[row as usize * rows.width + column as usize];
                        *t += self.depth(self.opacity * up * across);
                    }
                }
            }
        }
    }

    /// `-ln(1 - m)`.
    #[inline(always)]
    fn depth(&self, m: f32) -> f32 {
        if self.opacity <= SERIES_OPACITY {
            minus_ln_series(m)
        } else {
            minus_ln(1.0 - m.min(LARGEST_MEAN_ALPHA as f32))
        }
    }

    /// Adds a run of splats (already in the rows' pixels) to rows.
    pub fn add(
        &self,
        level: Level,
        splats: impl Iterator<Item = PixelSplat>,
        rows: &mut RowRun<'_>,
        profiles: &mut Profiles,
    ) {
        dispatch!(level, simd => self.add_kernel(simd, splats, rows, profiles));
    }

    #[inline(always)]
    fn add_kernel<S: Simd>(
        &self,
        _simd: S,
        splats: impl Iterator<Item = PixelSplat>,
        rows: &mut RowRun<'_>,
        profiles: &mut Profiles,
    ) {
        for splat in splats {
            let Some(window) = RowWindow::new(&splat, rows) else { continue };
            let [sx, sy] = splat.sigma();
            // A splat along the axes is the product of two profiles; a turned one is not, and has its own rows.
            if splat.axes[1] == 0.0 && splat.axes[2] == 0.0 {
                let area = rows.fine_area;
                self.profile(splat.x, sx, window.columns, area, &mut profiles.x);
                self.profile(splat.y, sy, window.rows, area, &mut profiles.y);
                for (k, row) in (window.rows[0]..window.rows[1]).enumerate() {
                    add_row(rows.row(row, window.columns), &profiles.x, self.opacity * profiles.y[k], self.opacity);
                }
            } else if sx.min(sy) >= SMOOTH_SIGMA {
                self.add_rotated_smooth(&splat, &window, rows, &mut profiles.x);
            } else {
                self.add_rotated(&splat, &window, rows, &mut profiles.x);
            }
        }
    }

    /// Means of exp(-u^2/2) over pixels `range`, cut at three deviations.
    #[inline(always)]
    fn profile(&self, center: f32, sigma: f32, range: [i32; 2], fine_area: f32, out: &mut Vec<f32>) {
        let inverse = 1.0 / sigma;
        out.clear();
        if sigma < SMOOTH_SIGMA {
            // One look into the table a pixel: the upper edge of one is the lower edge of the next.
            let mut below = self.integral((range[0] as f32 - center) * inverse);
            out.extend((range[0]..range[1]).map(|i| {
                let above = self.integral(((i + 1) as f32 - center) * inverse);
                let mean = sigma * (above - below);
                below = above;
                mean
            }));
            return;
        }
        let curvature = fine_area * inverse * inverse / 24.0;
        let (low, high) = (center - CUT * sigma, center + CUT * sigma);
        out.resize((range[1] - range[0]) as usize, 0.0);
        for (k, value) in out.iter_mut().enumerate() {
            let left = (range[0] + k as i32) as f32;
            // The covered part of the pixel and its middle.
            let (a, b) = (left.max(low), (left + 1.0).min(high));
            let u = (0.5 * (a + b) - center) * inverse;
            *value = (b - a).max(0.0) * gaussian(u * u) * (1.0 + curvature * (u * u - 1.0));
        }
    }

    /// A rotated splat: exact along x on a few lines of every row.
    #[inline(always)]
    fn add_rotated(&self, splat: &PixelSplat, window: &RowWindow, rows: &mut RowRun<'_>, sum: &mut Vec<f32>) {
        let form = RotatedForm::new(splat);
        // Faint splats show no edges: the less one changes within a row, the fewer lines it needs.
        let lines = if self.opacity > SERIES_OPACITY {
            CUT_LINES
        } else {
            (12.0 / splat.sigma()[1]).ceil().clamp(2.0, CUT_LINES as f32) as i32
        };
        // On a line the splat is a Gaussian of deviation `sigma` about a centre that moves with y.
        let sigma = 1.0 / form.xx.sqrt();
        for row in window.rows[0]..window.rows[1] {
            sum.clear();
            sum.resize((window.columns[1] - window.columns[0]) as usize, 0.0);
            for line in 0..lines {
                let dy = row as f32 + (line as f32 + 0.5) / lines as f32 - splat.y;
                let [low, high] = form.cut(dy);
                if low >= high {
                    continue;
                }
                let middle = -form.xy * dy / form.xx;
                let height = gaussian((form.yy - form.xy * form.xy / form.xx) * dy * dy) * sigma / lines as f32;
                let at = |dx: f32| self.integral((dx.clamp(low, high) - middle) / sigma);
                let mut below = at(window.columns[0] as f32 - splat.x);
                for (k, total) in sum.iter_mut().enumerate() {
                    let above = at((window.columns[0] + k as i32 + 1) as f32 - splat.x);
                    *total += height * (above - below);
                    below = above;
                }
            }
            add_row(rows.row(row, window.columns), sum, self.opacity, self.opacity);
        }
    }

    /// A large rotated splat: centres and a curvature term.
    #[inline(always)]
    fn add_rotated_smooth(&self, splat: &PixelSplat, window: &RowWindow, rows: &mut RowRun<'_>, sum: &mut Vec<f32>) {
        let form = RotatedForm::new(splat);
        let curvature = rows.fine_area / 24.0;
        let trace = form.xx + form.yy;
        for row in window.rows[0]..window.rows[1] {
            sum.clear();
            sum.resize((window.columns[1] - window.columns[0]) as usize, 0.0);
            let bottom = row as f32 - splat.y;
            let [low, high] = form.sides(bottom + 0.5);
            for (k, mean) in sum.iter_mut().enumerate() {
                let left = (window.columns[0] + k as i32) as f32 - splat.x;
                // The covered part of the pixel: the steep edges cut its middle row, the flat ones
                // its middle column.
                let [down, up] = form.ends(left + 0.5);
                let (x0, x1) = (left.max(low), (left + 1.0).min(high));
                let (y0, y1) = (bottom.max(down), (bottom + 1.0).min(up));
                let (dx, dy) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
                let (gx, gy) = (form.xx * dx + form.xy * dy, form.xy * dx + form.yy * dy);
                let bend = 1.0 + curvature * (gx * gx + gy * gy - trace);
                let area = (x1 - x0).max(0.0) * (y1 - y0).max(0.0);
                *mean = area * gaussian((dx * gx + dy * gy).max(0.0)) * bend;
            }
            add_row(rows.row(row, window.columns), sum, self.opacity, self.opacity);
        }
    }
}

/// The inverse covariance of a rotated splat and its four edges.
struct RotatedForm {
    xx: f32,
    xy: f32,
    yy: f32,
    /// `|dx - slope dy| <= half` for the steep pair of edges, then for the flat pair.
    along_x: [[f32; 2]; 2],
    /// `|dy - slope dx| <= half` for the flat pair.
    along_y: [f32; 2],
}

impl RotatedForm {
    fn new(splat: &PixelSplat) -> Self {
        let [a, b, c, d] = splat.axes;
        let s = 1.0 / (a * d - b * c);
        // (u, v) = inverse (dx, dy).
        let [u, v] = [[d * s, -b * s], [-c * s, a * s]];
        let dot = |i: usize, j: usize| u[i] * u[j] + v[i] * v[j];
        // Large splats cut steep edges along rows and flat ones along columns, so that no slope is huge.
        let (steep, flat) = if u[0].abs() * v[1].abs() >= u[1].abs() * v[0].abs() { (u, v) } else { (v, u) };
        // An edge along an axis cuts either all of a line or nothing of it.
        let solid = |p: f32| if p.abs() < 1e-12 { 1e-12 } else { p };
        let limit = |e: [f32; 2], i: usize| [-e[1 - i] / solid(e[i]), CUT / solid(e[i]).abs()];
        let along_x = [limit(steep, 0), limit(flat, 0)];
        RotatedForm { xx: dot(0, 0), xy: dot(0, 1), yy: dot(1, 1), along_x, along_y: limit(flat, 1) }
    }

    /// The interval of dx inside the square at a dy.
    #[inline(always)]
    fn cut(&self, dy: f32) -> [f32; 2] {
        let [[s0, h0], [s1, h1]] = self.along_x;
        [(s0 * dy - h0).max(s1 * dy - h1), (s0 * dy + h0).min(s1 * dy + h1)]
    }

    /// The interval of dx between the steep edges at a dy.
    #[inline(always)]
    fn sides(&self, dy: f32) -> [f32; 2] {
        let [slope, half] = self.along_x[0];
        [slope * dy - half, slope * dy + half]
    }

    /// The interval of dy between the flat edges at a dx.
    #[inline(always)]
    fn ends(&self, dx: f32) -> [f32; 2] {
        let [slope, half] = self.along_y;
        [slope * dx - half, slope * dx + half]
    }
}

/// The pixels of a run of rows that a splat reaches.
struct RowWindow {
    columns: [i32; 2],
    rows: [i32; 2],
}

impl RowWindow {
    #[inline(always)]
    fn new(splat: &PixelSplat, rows: &RowRun<'_>) -> Option<RowWindow> {
        let [rx, ry] = splat.reach();
        // Casts saturate: a splat far to the right may end at the largest i32.
        let span = |c: f32, r: f32, first: i32, count: usize| {
            [((c - r).floor() as i32).max(first), ((c + r).floor() as i32).saturating_add(1).min(first + count as i32)]
        };
        let columns = span(splat.x, rx, rows.corner[0], rows.width);
        let lines = span(splat.y, ry, rows.corner[1], rows.data.len() / rows.width);
        (columns[0] < columns[1] && lines[0] < lines[1]).then_some(RowWindow { columns, rows: lines })
    }
}

impl RowRun<'_> {
    #[inline(always)]
    fn row(&mut self, row: i32, columns: [i32; 2]) -> &mut [f32] {
        let start = (row - self.corner[1]) as usize * self.width;
        let c = columns.map(|c| (c - self.corner[0]) as usize);
        &mut self.data[start + c[0]..start + c[1]]
    }
}

/// Adds `-ln(1 - height profile)` to a row.
#[inline(always)]
fn add_row(row: &mut [f32], profile: &[f32], height: f32, opacity: f32) {
    if opacity <= SERIES_OPACITY {
        for (t, &p) in row.iter_mut().zip(profile) {
            let m = height * p;
            *t += minus_ln_series(m);
        }
    } else {
        for (t, &p) in row.iter_mut().zip(profile) {
            *t += minus_ln(1.0 - (height * p).min(LARGEST_MEAN_ALPHA as f32));
        }
    }
}

/// `-ln(1 - m)` for small m.
#[inline(always)]
fn minus_ln_series(m: f32) -> f32 {
    m * (1.0 + m * (0.5 + m * (1.0 / 3.0 + m * (0.25 + m * 0.2))))
}

/// `exp(-q/2)` for q >= 0 to about 1e-7.
#[inline(always)]
fn gaussian(q: f32) -> f32 {
    // 2^-126 is the least normal float32: below it the exponent's bits would be wrong.
    let x = (q * (-0.5 * std::f32::consts::LOG2_E)).max(-126.0);
    let whole = x.floor();
    let f = (x - whole) * std::f32::consts::LN_2;
    // exp(f) for f in [0, ln 2): the series to the seventh power.
    let p = 1.0
        + f * (1.0
            + f * (0.5
                + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0 + f * (1.0 / 5040.0)))))));
    // These are the bits of 2^whole.
    p * f32::from_bits(((whole as i32 + 127) as u32) << 23)
}

/// `-ln y` for normal y in (0, 1].
#[inline(always)]
fn minus_ln(y: f32) -> f32 {
    // y = 2^e m with m in [sqrt 1/2, sqrt 2); ln m = 2 artanh((m - 1)/(m + 1)).
    let bits = y.to_bits() as i32;
    // 0x3f3504f3 are the bits of sqrt 1/2.
    let e = (bits - 0x3f35_04f3) >> 23;
    let m = f32::from_bits((bits - (e << 23)) as u32);
    let s = (m - 1.0) / (m + 1.0);
    let s2 = s * s;
    let ln_m = 2.0 * s * (1.0 + s2 * (1.0 / 3.0 + s2 * (0.2 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0)))));
    -(e as f32 * std::f32::consts::LN_2 + ln_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elementary_functions_agree_with_the_library() {
        for k in 0..2000 {
            let q = k as f32 * 0.01;
            assert!((f64::from(gaussian(q)) / (-0.5 * f64::from(q)).exp() - 1.0).abs() < 1e-6, "{q}");
            let y = 1e-6 + k as f32 * 4.99e-4;
            assert!((f64::from(minus_ln(y)) + f64::from(y).ln()).abs() < 2e-6 * (1.0 - f64::from(y).ln()), "{y}");
        }
        let d = Depositor::new(0.05);
        assert!((d.integral(0.3) - (1.253_314_1 * (0.235_822_8 + 0.997_300_2))).abs() < 1e-6);
    }
}
