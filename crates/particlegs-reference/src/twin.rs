//! The plain f64 twin of the noise-free optical depth: every splat on every pixel (tests only).

use particlegs_core::camera::{Projection, View};
use particlegs_core::picture::{Plane, Size};
use particlegs_core::splat::{CUT_SIGMA, LARGEST_MEAN_ALPHA, erf};
use particlegs_particles::Particles;

/// tau* by the formula of docs/law/depth.md, from f64 cameras. Rotated splats (docs/law/splat.md,
/// "Shape") are averaged over points of a grid in each pixel.
pub(super) fn optical_depth(particles: &Particles, view: &View, size: Size, range: [f64; 2]) -> Plane {
    let frame = view.camera.frame().unwrap();
    let Projection::Perspective { fov_deg } = view.camera.projection else { panic!("perspective") };
    let (w, h) = (size.width as f64, size.height as f64);
    let f = 0.5 * h / libm::tan(0.5 * fov_deg.to_radians());
    let mut tau = vec![0.0f64; size.pixels()];
    for i in 0..particles.len() {
        let [x, y, z] = frame.to_camera(particles.position(i));
        let depth = -z;
        let (tx, ty) = (x / depth, y / depth);
        if depth < range[0] || depth > range[1] || tx.abs() * f > 1.3 * 0.5 * w || ty.abs() * f > 1.3 * 0.5 * h {
            continue;
        }
        let (px, py) = (0.5 * w + f * tx, 0.5 * h + f * ty);
        let s = view.radius * f / depth;
        let (sx, sy) = (s * (1.0 + tx * tx).sqrt(), s * (1.0 + ty * ty).sqrt());
        let c01 = s * s * tx * ty / (0.25 * w * h);
        if c01.abs() <= 1e-6 {
            add_aligned(&mut tau, size, [px, py], [sx, sy], view.opacity);
        } else {
            let device = [(sx / (0.5 * w)).powi(2), (sy / (0.5 * h)).powi(2), c01];
            add_rotated(&mut tau, size, [px, py], device, view.opacity);
        }
    }
    let data = (0..size.height).rev().flat_map(|y| tau[y * size.width..(y + 1) * size.width].to_vec());
    Plane { size, data: data.map(|t| t as f32).collect() }
}

fn reach(center: f64, extent: f64, count: usize) -> std::ops::Range<usize> {
    let first = (center - extent).floor().max(0.0) as usize;
    first..((center + extent).floor() + 1.0).clamp(0.0, count as f64) as usize
}

fn minus_ln(m: f64) -> f64 {
    -libm::log1p(-m.min(LARGEST_MEAN_ALPHA))
}

/// The mean of exp(-u^2/2) over a pixel, cut.
fn share(pixel: usize, center: f64, sigma: f64) -> f64 {
    let edge = |e: f64| ((e - center) / sigma).clamp(-CUT_SIGMA, CUT_SIGMA) * std::f64::consts::FRAC_1_SQRT_2;
    let root = (0.5 * std::f64::consts::PI).sqrt();
    sigma * root * (erf(edge(pixel as f64 + 1.0)) - erf(edge(pixel as f64)))
}

fn add_aligned(tau: &mut [f64], size: Size, [px, py]: [f64; 2], [sx, sy]: [f64; 2], opacity: f64) {
    let columns = reach(px, CUT_SIGMA * sx, size.width);
    let across: Vec<f64> = columns.clone().map(|x| share(x, px, sx)).collect();
    for y in reach(py, CUT_SIGMA * sy, size.height) {
        let up = opacity * share(y, py, sy);
        for (x, a) in columns.clone().zip(&across) {
            tau[y * size.width + x] += minus_ln(up * a);
        }
    }
}

fn add_rotated(tau: &mut [f64], size: Size, [px, py]: [f64; 2], [c00, c11, c01]: [f64; 3], opacity: f64) {
    let (w, h) = (0.5 * size.width as f64, 0.5 * size.height as f64);
    let half = 0.5 * (c00 + c11);
    let term = (half * half - (c00 * c11 - c01 * c01)).sqrt();
    let (s1, s2) = ((half + term).sqrt(), (half - term).sqrt());
    let n = libm::hypot(half + term - c11, c01);
    let (ux, uy) = ((half + term - c11) / n, c01 / n);
    let [a, b, c, d] = [s1 * ux * w, s2 * uy * w, s1 * uy * h, -s2 * ux * h];
    let det = a * d - b * c;
    let fine: usize = if opacity < 0.1 && s2 * w > 4.0 { 4 } else { 16 };
    let (rx, ry) = (CUT_SIGMA * (a.abs() + b.abs()), CUT_SIGMA * (c.abs() + d.abs()));
    for y in reach(py, ry, size.height) {
        for x in reach(px, rx, size.width) {
            let mut sum = 0.0;
            for k in 0..fine * fine {
                let at = |n: usize| (n as f64 + 0.5) / fine as f64;
                let (dx, dy) = (x as f64 + at(k % fine) - px, y as f64 + at(k / fine) - py);
                let (u, v) = ((d * dx - b * dy) / det, (a * dy - c * dx) / det);
                if u.abs() <= CUT_SIGMA && v.abs() <= CUT_SIGMA {
                    sum += libm::exp(-0.5 * (u * u + v * v));
                }
            }
            tau[y * size.width + x] += minus_ln(opacity * sum / (fine * fine) as f64);
        }
    }
}
