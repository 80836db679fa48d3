//! The law as a reader would write it: f64, pixel by pixel, every Gaussian.

use super::plan::CutOffs;
use super::project::{Eye, Gaussian};
use crate::math::each_axis;

type Matrix3 = [[f64; 3]; 3];

fn product(a: Matrix3, b: Matrix3) -> Matrix3 {
    each_axis(|i| each_axis(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: Matrix3) -> Matrix3 {
    each_axis(|i| each_axis(|j| a[j][i]))
}

/// Camera coordinates: right, down, depth.
fn see(eye: &Eye, p: [f64; 3]) -> [f64; 3] {
    eye.axes.map(|a| (0..3).map(|k| a[k] * (p[k] - eye.position[k])).sum())
}

/// Centre, inverse covariance xx, xy, yy and alpha at the centre of a footprint; `None` = not drawn.
pub fn footprint(eye: &Eye, g: &Gaussian) -> Option<([f64; 2], [f64; 3], f64)> {
    let [x, y, z] = see(eye, g.mean);
    if z <= eye.range[0] || z > eye.range[1] {
        return None;
    }
    let (u, v) = ((x / z).clamp(-eye.guard[0], eye.guard[0]), (y / z).clamp(-eye.guard[1], eye.guard[1]));
    let f = eye.focal;
    let jacobian = [[f / z, 0.0, -f * u / z], [0.0, f / z, -f * v / z], [0.0; 3]];
    let t = product(jacobian, eye.axes);
    let s = product(product(t, g.cov.rows()), transposed(t));
    let before = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    let (a, b, c) = (s[0][0] + 1.0, s[0][1], s[1][1] + 1.0);
    let det = a * c - b * b;
    let compensation = (before / det).max(2.5e-5).sqrt();
    let at = [f * x / z + eye.center[0], f * y / z + eye.center[1]];
    Some((at, [c / det, -b / det, a / det], g.opacity * compensation))
}

/// Brightness of every pixel.
pub fn blend(eye: &Eye, gaussians: &[Gaussian], cut: &CutOffs) -> Vec<f64> {
    let mut order: Vec<usize> = (0..gaussians.len()).collect();
    order.sort_by(|&a, &b| see(eye, gaussians[a].mean)[2].total_cmp(&see(eye, gaussians[b].mean)[2]));
    let seen: Vec<_> =
        order.iter().filter_map(|&i| footprint(eye, &gaussians[i]).map(|f| (f, gaussians[i].grey))).collect();
    let mut out = Vec::with_capacity(eye.size.pixels());
    for row in 0..eye.size.height {
        for column in 0..eye.size.width {
            let (mut sum, mut left) = (0.0, 1.0);
            for ((at, inverse, peak), grey) in &seen {
                let (dx, dy) = (column as f64 - at[0], row as f64 - at[1]);
                let q = inverse[0] * dx * dx + 2.0 * inverse[1] * dx * dy + inverse[2] * dy * dy;
                let alpha = peak * (-0.5 * q).exp();
                if alpha < cut.least_alpha.into() {
                    continue;
                }
                let alpha = alpha.min(cut.most_alpha.into());
                let next = left * (1.0 - alpha);
                if next < cut.least_transmittance.into() {
                    break;
                }
                sum += grey * alpha * left;
                left = next;
            }
            out.push(sum);
        }
    }
    out
}
