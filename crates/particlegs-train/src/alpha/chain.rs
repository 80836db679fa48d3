//! From a footprint's sums over pixels to the gradient with its Gaussian's parameters.

use super::parameters::{GaussianParameters, SH0};
use super::raster::PixelSums;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::render::alpha::Eye;
use particlegs_core::render::alpha::network::Adaptation;
use particlegs_core::render::alpha::project::{FootprintShape, LEAST_RATIO, shape};

/// Changes of the loss with one Gaussian's parameters, and with how it was adapted.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slopes {
    pub position: [f64; 3],
    pub log_scale: [f64; 3],
    pub rotation: [f64; 4],
    pub logit: f64,
    pub feature: f64,
    /// With the factor on its scales.
    pub scale: f64,
    /// With the factor on the odds of its opacity.
    pub odds: f64,
    /// Size of the change with the centre on the picture, in half pictures (3DGS, densification).
    pub screen: f64,
}

/// The chain rule through opacity, footprint, covariance and place.
pub(super) fn chain(eye: &Eye, one: &GaussianParameters, adapted: &Adaptation, sums: &PixelSums) -> Slopes {
    let g = one.gaussian(adapted);
    let Some(p) = shape(eye, &g.seen(eye).gaussian) else { return Slopes::default() };
    let [sum, sx, sy, sxx, sxy, syy, grey] = sums.map(f64::from);
    let [xx, xy, yy] = p.wide.map(|v| v / p.wide_det);
    // The inverse of the footprint's covariance.
    let [a, b, c] = [yy, -xy, xx];
    let at = [a * sx + b * sy, b * sx + c * sy];
    let sharp = footprint(&p, [a, b, c], [sxx, sxy, syy], sum);
    let (seen, with_cov) = through_eye(eye, &p, &g.cov, at, sharp);
    let mut out = Slopes {
        position: each_axis(|k| (0..3).map(|r| eye.axes[r][k] * seen[r]).sum()),
        // d ln opacity = (1 - opacity) d logit, and the odds enter the logit by their logarithm.
        logit: sum * (1.0 - g.opacity),
        odds: sum * (1.0 - g.opacity) / adapted.odds,
        // A grey level that is cut at black does not move.
        feature: if 0.5 + SH0 * one.feature > 0.0 { SH0 * grey } else { 0.0 },
        screen: (at[0] * eye.half[0]).hypot(at[1] * eye.half[1]),
        ..Slopes::default()
    };
    scales_and_rotation(one, adapted.scale, &with_cov, &mut out);
    out
}

/// Changes with the covariance of the footprint before widening: xx, xy (both of the pair) and yy.
/// `inverse` is that of the widened one, `second` the sums of h times dx^2, dx dy, dy^2.
fn footprint(p: &FootprintShape, inverse: [f64; 3], second: [f64; 3], sum: f64) -> [f64; 3] {
    let [a, b, c] = inverse;
    // With the inverse, as a symmetric matrix: -h/2 d d^T.
    let [g0, g1, g2] = second.map(|v| -0.5 * v);
    // -K G K.
    let (r00, r01) = (a * g0 + b * g1, a * g1 + b * g2);
    let (r10, r11) = (b * g0 + c * g1, b * g1 + c * g2);
    let mut out = [-(r00 * a + r01 * b), -2.0 * (r00 * b + r01 * c), -(r10 * b + r11 * c)];
    if p.sharp_det > LEAST_RATIO * p.wide_det {
        // The logarithm of the compensation is half of ln det - ln det'.
        let half = 0.5 * sum;
        let log_det = |m: [f64; 3], det: f64| [m[2] / det, -2.0 * m[1] / det, m[0] / det];
        let (before, after) = (log_det(p.sharp, p.sharp_det), log_det(p.wide, p.wide_det));
        for k in 0..3 {
            out[k] += half * (before[k] - after[k]);
        }
    }
    out
}

/// Rows of J A: what a step of the place does to the centre in pixels, at first order.
fn jacobian(eye: &Eye, depth: f64, slope: [f64; 2]) -> [[f64; 3]; 2] {
    let unit = eye.focal / depth;
    let [right, down, forward] = eye.axes;
    let row = |axis: [f64; 3], slope: f64| each_axis(|k| unit * (axis[k] - slope * forward[k]));
    [row(right, slope[0]), row(down, slope[1])]
}

/// Changes with the place as seen (right, down, depth), and with the adapted covariance, as rows of
/// a symmetric matrix.
fn through_eye(eye: &Eye, p: &FootprintShape, cov: &Sym3, at: [f64; 2], sharp: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let [x, y, depth] = p.seen;
    let [(u, u_cut), (v, v_cut)] = p.slope;
    let rows = jacobian(eye, depth, [u, v]);
    // H J A, with H the symmetric matrix of `sharp`.
    let h = [[sharp[0], 0.5 * sharp[1]], [0.5 * sharp[1], sharp[2]]];
    let hj: [[f64; 3]; 2] = h.map(|h| each_axis(|k| h[0] * rows[0][k] + h[1] * rows[1][k]));
    let with_cov = each_axis(|i| each_axis(|j| rows[0][i] * hj[0][j] + rows[1][i] * hj[1][j]));
    let with_rows = hj.map(|r| cov.apply(r).map(|v| 2.0 * v));
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let unit = eye.focal / depth;
    let forward = eye.axes[2];
    // Both rows are in proportion to focal / depth, and move with the slopes.
    let with_depth = -(dot(with_rows[0], rows[0]) + dot(with_rows[1], rows[1])) / depth;
    // A slope that is held at the guard band does not move with the place.
    let with_slope = |row: [f64; 3], cut: bool| if cut { 0.0 } else { -unit * dot(row, forward) / depth };
    let [gu, gv] = [with_slope(with_rows[0], u_cut), with_slope(with_rows[1], v_cut)];
    let seen =
        [unit * at[0] + gu, unit * at[1] + gv, with_depth - unit * (at[0] * x + at[1] * y) / depth - gu * u - gv * v];
    (seen, with_cov)
}

/// Changes with scales and rotation, from those with the covariance.
fn scales_and_rotation(one: &GaussianParameters, factor: f64, with_cov: &[[f64; 3]; 3], out: &mut Slopes) {
    let root = one.root().map(|r| r.map(|v| factor * v));
    let with_root: [[f64; 3]; 3] =
        each_axis(|i| each_axis(|k| 2.0 * (0..3).map(|j| with_cov[i][j] * root[j][k]).sum::<f64>()));
    // A column of the root is in proportion to its scale.
    out.log_scale = each_axis(|k| (0..3).map(|i| with_root[i][k] * root[i][k]).sum());
    out.scale = out.log_scale.iter().sum::<f64>() / factor;
    let norm = one.rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
    let q = one.rotation.map(|v| v / norm);
    let s = one.log_scale.map(|v| factor * v.exp());
    let with_q = with_quaternion(q, |i, k| with_root[i][k] * s[k]);
    // Length does not matter: what points along it goes.
    let along: f64 = (0..4).map(|k| with_q[k] * q[k]).sum();
    out.rotation = std::array::from_fn(|k| (with_q[k] - along * q[k]) / norm);
}

/// Changes with a quaternion's numbers, from those with its matrix.
fn with_quaternion([w, x, y, z]: [f64; 4], d: impl Fn(usize, usize) -> f64) -> [f64; 4] {
    // Off the diagonal the matrix has 2 (x y - w z) and 2 (x y + w z): w goes with differences, the rest with sums.
    let pair = |i: usize, j: usize| (d(i, j) + d(j, i), d(j, i) - d(i, j));
    let ((s01, a01), (s02, a02), (s12, a12)) = (pair(0, 1), pair(0, 2), pair(1, 2));
    let (d0, d1, d2) = (d(0, 0), d(1, 1), d(2, 2));
    [
        2.0 * (z * a01 - y * a02 + x * a12),
        2.0 * (y * s01 + z * s02 + w * a12 - 2.0 * x * (d1 + d2)),
        2.0 * (x * s01 + z * s12 - w * a02 - 2.0 * y * (d0 + d2)),
        2.0 * (x * s02 + y * s12 + w * a01 - 2.0 * z * (d0 + d1)),
    ]
}
