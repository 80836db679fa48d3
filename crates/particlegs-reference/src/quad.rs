//! A splat's quad on the screen: which pixel centres it covers and what its alpha is there, as
//! llvmpipe rasterises and interpolates (docs/law/splat.md, "Coverage").

use super::project::NdcSplat;
use fearless_simd::{Simd, f32x8, i32x8, prelude::*};
use particlegs_core::picture::Size;
use particlegs_core::splat::CUT_SIGMA;

/// Vertices snap to 1/256 of a pixel.
const SUBPIXEL: f32 = 256.0;

/// Window coordinate (pixel centres at integers plus a half) to snapped units, centres at multiples
/// of 256.
#[inline(always)]
pub(super) fn snap(window: f32) -> i32 {
    ((window - 0.5) * SUBPIXEL).round_ties_even() as i32
}

/// 1.5 * 2^23: what is added to it is rounded to a whole number, ties to even, without a call.
const ROUNDER: f32 = 12_582_912.0;
/// The largest magnitude for which it does that.
const ROUNDS: f32 = 4_194_304.0;

/// Corners farther out lie millions of pixels outside the picture; so near, products of differences fit 64 bits.
const FARTHEST: f32 = 1_073_741_000.0;

/// [`snap`] where code is not compiled for instructions that round.
#[inline(always)]
fn snap_one(window: f32) -> i32 {
    let x = (window - 0.5) * SUBPIXEL;
    if x.abs() < ROUNDS { whole(x) } else { x.round_ties_even().clamp(-FARTHEST, FARTHEST) as i32 }
}

/// The nearest whole number of a number below [`ROUNDS`].
#[inline(always)]
fn whole(x: f32) -> i32 {
    (x + ROUNDER).to_bits() as i32 - ROUNDER.to_bits() as i32
}

/// First pixel whose centre is at or right of a snapped coordinate.
#[inline(always)]
pub(super) fn first_pixel(snapped: i32) -> i32 {
    (snapped >> 8) + i32::from(snapped & 255 != 0)
}

/// `a + d x + e y`, the plane of an interpolated value over a triangle.
#[derive(Clone, Copy, Debug, Default)]
struct LinearPlane {
    at_origin: f32,
    dx: f32,
    dy: f32,
}

/// The planes of u and v over one of the quad's two triangles.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct QuadPlanes {
    u: LinearPlane,
    v: LinearPlane,
}

/// A quad: rows of pixels counted from the bottom, as in VTK's framebuffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quad {
    /// Snapped corners (-,-), (+,-), (-,+), (+,+) in (u, v).
    corner: [[i32; 2]; 4],
    aligned: bool,
    /// Covered columns (of the bounding box where rotated), clamped to the picture.
    pub columns: [i32; 2],
    /// Covered rows, likewise.
    pub rows: [i32; 2],
    window: [[f32; 2]; 4],
}

const CUT: f32 = CUT_SIGMA as f32;
/// (u, v) of the corners, in the order of VTK's triangle strip.
const OFFSETS: [[f32; 2]; 4] = [[-CUT, -CUT], [CUT, -CUT], [-CUT, CUT], [CUT, CUT]];

impl Quad {
    /// The quad of a splat, or `None` where it covers no pixel centre.
    #[inline(always)]
    pub fn new(s: &NdcSplat, size: Size) -> Option<Quad> {
        if s.is_aligned() { Self::straight(s, size) } else { Self::turned(s, size) }
    }

    /// A splat whose u is along x and v along y: as [`Quad::turned`] finds it, with half the work.
    #[inline(always)]
    fn straight(s: &NdcSplat, size: Size) -> Option<Quad> {
        let (sx, sy) = (0.5 * size.width as f32, 0.5 * size.height as f32);
        let [a, _, _, d] = s.axes;
        let x = [-CUT, CUT].map(|u| (s.x + a * u) * sx + sx);
        let y = [-CUT, CUT].map(|v| (s.y + d * v) * sy + sy);
        let ([left, right], [bottom, top]) = (x.map(snap_one), y.map(snap_one));
        let columns = [first_pixel(left).max(0), first_pixel(right).min(size.width as i32)];
        let rows = [first_pixel(bottom).max(0), first_pixel(top).min(size.height as i32)];
        (columns[0] < columns[1] && rows[0] < rows[1]).then_some(Quad {
            corner: [[left, bottom], [right, bottom], [left, top], [right, top]],
            aligned: true,
            columns,
            rows,
            window: [[x[0], y[0]], [x[1], y[0]], [x[0], y[1]], [x[1], y[1]]],
        })
    }

    fn turned(s: &NdcSplat, size: Size) -> Option<Quad> {
        let (sx, sy) = (0.5 * size.width as f32, 0.5 * size.height as f32);
        let [a, b, c, d] = s.axes;
        let window = OFFSETS.map(|[u, v]| [(s.x + (a * u + b * v)) * sx + sx, (s.y + (c * u + d * v)) * sy + sy]);
        let corner = window.map(|[x, y]| [snap_one(x), snap_one(y)]);
        let span = |k: usize, most: usize| {
            let lo = corner.iter().map(|p| p[k]).min().unwrap_or(0);
            let hi = corner.iter().map(|p| p[k]).max().unwrap_or(0);
            [first_pixel(lo).max(0), first_pixel(hi).min(most as i32)]
        };
        let (mut columns, mut rows) = (span(0, size.width), span(1, size.height));
        // Which of the box's pixels are in, the edges tell; the far side may be one of them.
        columns[1] = (columns[1] + 1).min(size.width as i32);
        rows[1] = (rows[1] + 1).min(size.height as i32);
        (columns[0] < columns[1] && rows[0] < rows[1]).then_some(Quad { corner, aligned: false, columns, rows, window })
    }

    /// The splat surely covers one pixel alone.
    #[inline]
    pub fn is_one_pixel(&self) -> bool {
        self.aligned && self.columns[1] - self.columns[0] == 1 && self.rows[1] - self.rows[0] == 1
    }

    /// Covered columns of a row, half-open.
    #[inline]
    pub fn columns_of(&self, row: i32) -> [i32; 2] {
        if self.aligned {
            return self.columns;
        }
        let inside = |column: i32| self.covers(column, row);
        let Some(first) = (self.columns[0]..self.columns[1]).find(|&c| inside(c)) else { return [0, 0] };
        let end = (first..self.columns[1]).find(|&c| !inside(c)).unwrap_or(self.columns[1]);
        [first, end]
    }

    /// Whether a pixel centre is inside a rotated quad. Left and bottom edges are in.
    #[inline]
    fn covers(&self, column: i32, row: i32) -> bool {
        let mut p = [self.corner[0], self.corner[1], self.corner[3], self.corner[2]];
        // A mirrored quad runs clockwise, which would reverse the signs below.
        if cross(p[0], p[1], p[2]) < 0 {
            p.swap(1, 3);
        }
        let at = [column << 8, row << 8];
        (0..4).all(|k| {
            let (from, to) = (p[k], p[(k + 1) % 4]);
            let e = cross(from, to, at);
            e > 0 || (e == 0 && (to[1] < from[1] || (to[1] == from[1] && to[0] > from[0])))
        })
    }

    /// The planes of one of the strip's two triangles, below or above the diagonal.
    #[inline(always)]
    pub fn planes(&self, triangle: usize) -> QuadPlanes {
        // The order matters to float32: the first vertex is the one that planes start from.
        self.planes_of(if triangle == 0 { [1, 2, 0] } else { [1, 3, 2] })
    }

    /// Alphas of covered columns of a row, from `columns[0]` on, into `out`, which is longer by a block of [`WIDE`].
    #[inline(always)]
    pub fn alphas<S: Simd>(&self, simd: S, planes: &[QuadPlanes; 2], row: i32, columns: [i32; 2], out: &mut [f32]) {
        let [a, b] = [self.corner[1], self.corner[2]];
        // From pixel to pixel the edge between the triangles changes by the same number.
        let (mut edge, step) = (cross(a, b, [columns[0] << 8, row << 8]), (i64::from(a[1]) - i64::from(b[1])) << 8);
        let mut from = columns[0];
        while from < columns[1] {
            let is_second = edge <= 0;
            // Along a row the diagonal is crossed once.
            let mut to = from;
            while to < columns[1] && (edge <= 0) == is_second {
                (to, edge) = (to + 1, edge + step);
            }
            let planes = &planes[usize::from(is_second)];
            for start in (from..to).step_by(WIDE) {
                let at = (start - columns[0]) as usize;
                // What is beyond the end is written again, or not read.
                planes.gaussians(simd, start, row).store_slice(&mut out[at..at + WIDE]);
            }
            from = to;
        }
    }

    #[inline(always)]
    fn planes_of(&self, t: [usize; 3]) -> QuadPlanes {
        let v = t.map(|i| self.window[i]);
        let dxy01 = [v[0][0] - v[1][0], v[0][1] - v[1][1]];
        let dxy20 = [v[2][0] - v[0][0], v[2][1] - v[0][1]];
        let ooa = 1.0 / (dxy01[0] * dxy20[1] - dxy01[1] * dxy20[0]);
        let d01 = dxy01.map(|d| d * ooa);
        let d20 = dxy20.map(|d| d * ooa);
        // Planes are taken at whole columns and rows, which stand for centres at a half.
        let center = [v[0][0] - 0.5, v[0][1] - 0.5];
        let plane = |k: usize| {
            let a = t.map(|i| OFFSETS[i][k]);
            let (da01, da20) = (a[0] - a[1], a[2] - a[0]);
            let dx = da01 * d20[1] - da20 * d01[1];
            let dy = da20 * d01[0] - da01 * d20[0];
            LinearPlane { at_origin: a[0] - (dx * center[0] + dy * center[1]), dx, dy }
        };
        QuadPlanes { u: plane(0), v: plane(1) }
    }

    /// The triangle, 0 or 1, that a covered pixel centre lies in.
    #[inline]
    pub fn triangle(&self, column: i32, row: i32) -> usize {
        // The first triangle's third edge, from corner 1 to corner 2, is a right or upper one.
        let e = cross(self.corner[1], self.corner[2], [column << 8, row << 8]);
        usize::from(e <= 0)
    }
}

#[inline(always)]
fn cross(a: [i32; 2], b: [i32; 2], c: [i32; 2]) -> i64 {
    let d = |k: usize, p: [i32; 2]| i64::from(p[k]) - i64::from(a[k]);
    d(0, b) * d(1, c) - d(1, b) * d(0, c)
}

/// Pixels whose alphas are computed side by side.
pub(super) const WIDE: usize = 8;

impl QuadPlanes {
    /// `exp(-(u^2 + v^2)/2)` at a pixel.
    #[inline(always)]
    pub fn gaussian(&self, column: i32, row: i32) -> f32 {
        let (x, y) = (column as f32, row as f32);
        let at = |p: &LinearPlane| fma(p.dy, y, fma(p.dx, x, p.at_origin));
        let (u, v) = (at(&self.u), at(&self.v));
        exp2(std::f32::consts::LOG2_E * (-0.5 * (u * u + v * v)))
    }

    /// [`Self::gaussian`] of a row's pixels from `column` on, to the last bit.
    #[inline(always)]
    fn gaussians<S: Simd>(&self, simd: S, column: i32, row: i32) -> f32x8<S> {
        let x = f32x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) + column as f32;
        let y = f32x8::splat(simd, row as f32);
        let (u, v) = (self.u.at_wide(simd, x, y), self.v.at_wide(simd, x, y));
        exp2_wide(simd, std::f32::consts::LOG2_E * (-0.5 * (u * u + v * v)))
    }
}

impl LinearPlane {
    #[inline(always)]
    fn at_wide<S: Simd>(&self, simd: S, x: f32x8<S>, y: f32x8<S>) -> f32x8<S> {
        let along = fma_wide(simd, f32x8::splat(simd, self.dx), x, f32x8::splat(simd, self.at_origin));
        fma_wide(simd, f32x8::splat(simd, self.dy), y, along)
    }
}

/// A fused multiply-add by way of f64, the same on every machine.
#[inline(always)]
fn fma(a: f32, b: f32, c: f32) -> f32 {
    (f64::from(a) * f64::from(b) + f64::from(c)) as f32
}

#[inline(always)]
fn fma_wide<S: Simd>(simd: S, a: f32x8<S>, b: f32x8<S>, c: f32x8<S>) -> f32x8<S> {
    // Functions, here and above, since closures are compiled without the vectors of their surroundings.
    let ((a, a2), (b, b2), (c, c2)) = (simd.widen_f32x8(a), simd.widen_f32x8(b), simd.widen_f32x8(c));
    simd.narrow_f64x4(a * b + c, a2 * b2 + c2)
}

/// Coefficients of 2^x in [0, 1).
const POWERS_OF_2: [f32; 6] = [1.0, 0.693_153_1, 0.240_153_62, 0.055_826_318, 0.008_989_34, 0.001_877_576_7];
const LEAST_EXPONENT: f32 = -126.99999;

/// [`exp2`] of eight numbers.
#[inline(always)]
fn exp2_wide<S: Simd>(simd: S, x: f32x8<S>) -> f32x8<S> {
    let x = x.max(LEAST_EXPONENT);
    let floor = x.floor();
    let f = x - floor;
    let f2 = f * f;
    let even = fma_wide(simd, f2, f32x8::splat(simd, POWERS_OF_2[4]), f32x8::splat(simd, POWERS_OF_2[2]));
    let even = fma_wide(simd, f2, even, f32x8::splat(simd, POWERS_OF_2[0]));
    let odd = fma_wide(simd, f2, f32x8::splat(simd, POWERS_OF_2[5]), f32x8::splat(simd, POWERS_OF_2[3]));
    let odd = fma_wide(simd, f2, odd, f32x8::splat(simd, POWERS_OF_2[1]));
    let scale: i32x8<S> = (simd.cvt_i32_f32x8(floor) + 127) << 23;
    fma_wide(simd, odd, f, even) * scale.bitcast::<f32x8<S>>()
}

/// Mesa's 2^x for x <= 0: integer part by exponent, fraction by a quintic.
#[inline(always)]
fn exp2(x: f32) -> f32 {
    let x = x.max(LEAST_EXPONENT);
    // `floor` without a call: the nearest whole number, and one less where that is above.
    let near = (x + ROUNDER) - ROUNDER;
    let floor = if near > x { near - 1.0 } else { near };
    let f = x - floor;
    let f2 = f * f;
    let even = fma(f2, fma(f2, POWERS_OF_2[4], POWERS_OF_2[2]), POWERS_OF_2[0]);
    let odd = fma(f2, fma(f2, POWERS_OF_2[5], POWERS_OF_2[3]), POWERS_OF_2[1]);
    fma(odd, f, even) * f32::from_bits(((whole(floor) + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    /// Corners beyond all bounds, in opposite ones: products of their differences fit.
    #[test]
    fn corners_as_far_as_numbers_go_cover_what_lies_between() {
        let far = [f32::MAX, -f32::MAX].map(snap_one);
        assert_eq!(far, [FARTHEST as i32, -FARTHEST as i32]);
        let corner = [[far[1], far[1]], [far[0], far[1]], [far[1], far[0]], [far[0], far[0]]];
        let (columns, rows, window) = ([0, 8], [0, 8], [[0.0; 2]; 4]);
        let quad = Quad { corner, aligned: false, columns, rows, window };
        assert_eq!(quad.columns_of(3), [0, 8]);
        assert_eq!([[-1, 0], [0, 0], [7, 7]].map(|[x, y]| quad.triangle(x, y)), [0, 1, 1]);
    }

    #[test]
    fn eight_pixels_at_once_are_as_one_by_one() {
        let plane = |k: f32| LinearPlane { at_origin: -3.1 * k, dx: 0.071 * k, dy: -0.013 / k };
        for scale in [0.01, 0.3, 1.0, 7.0, 500.0] {
            let planes = QuadPlanes { u: plane(scale), v: plane(1.0 / scale) };
            for (column, row) in [(0, 0), (37, 5), (1911, 1079), (16_000, 3)] {
                let one_by_one: [f32; WIDE] = std::array::from_fn(|i| planes.gaussian(column + i as i32, row));
                for level in [Level::new(), Level::baseline()] {
                    let together = dispatch!(level, simd => <[f32; WIDE]>::from(planes.gaussians(simd, column, row)));
                    assert_eq!(together.map(f32::to_bits), one_by_one.map(f32::to_bits), "{scale} {column} {row}");
                }
            }
        }
    }
}
