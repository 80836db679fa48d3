//! The law written plainly, in f64, for tests: every Gaussian at every pixel, integrated along
//! depth on a fine grid with nothing approximated but the grids.

use super::lens::Lens;
use super::scene::Scene;
use crate::camera::{Projection, View};
use crate::picture::Size;

/// Grid points in depth for a Gaussian.
const DEPTHS: usize = 1200;

/// Optical depth at every pixel.
pub fn optical_depth(scene: &Scene, view: &View, size: Size) -> Vec<f64> {
    let lens = Lens::optical(view, size, &scene.bounds).unwrap();
    let perspective = matches!(view.camera.projection, Projection::Perspective { .. });
    let mut picture = Picture { lens, perspective, size, tau: vec![0.0; size.pixels()] };
    for (m, _) in &scene.parts {
        for i in 0..m.len() {
            picture.add(m.mean_of(i), m.cov_of(i).rows(), m.count[i]);
        }
    }
    let Picture { lens, mut tau, .. } = picture;
    for j in 0..size.height {
        for i in 0..size.width {
            if perspective {
                let (x, y) = ((i as f64 - lens.center[0]) / lens.focal, (j as f64 - lens.center[1]) / lens.focal);
                tau[j * size.width + i] *= (1.0 + x * x).sqrt() * (1.0 + y * y).sqrt();
            }
        }
    }
    tau
}

/// What has been drawn.
struct Picture {
    lens: Lens,
    /// Else the lines of sight are parallel.
    perspective: bool,
    size: Size,
    /// Integrals of the density along depth, before the lengths of the lines of sight are put in.
    tau: Vec<f64>,
}

impl Picture {
    fn add(&mut self, mean: [f64; 3], cov: [[f64; 3]; 3], count: f64) {
        let (lens, size, perspective) = (&self.lens, self.size, self.perspective);
        let a = lens.axes;
        let v: [f64; 3] = std::array::from_fn(|k| mean[k] - lens.position[k]);
        let m: [f64; 3] = std::array::from_fn(|r| (0..3).map(|k| a[r][k] * v[k]).sum());
        let s: [[f64; 3]; 3] = std::array::from_fn(|r| {
            std::array::from_fn(|c| (0..3).map(|k| (0..3).map(|l| a[r][k] * cov[k][l] * a[c][l]).sum::<f64>()).sum())
        });
        let zz = s[2][2];
        let points: Vec<(f64, f64)> = if zz > 1e-14 * (s[0][0] + s[1][1]) {
            let sd = zz.sqrt();
            let (lo, hi) = ((m[2] - 8.0 * sd).max(lens.range[0]), (m[2] + 8.0 * sd).min(lens.range[1]));
            // Even steps of the logarithm of depth in perspective, of depth itself without.
            let (from, to) = if perspective { (lo.ln(), hi.ln()) } else { (lo, hi) };
            let step = (to - from).max(0.0) / DEPTHS as f64;
            (0..DEPTHS)
                .map(|k| {
                    let v = from + step * (k as f64 + 0.5);
                    let (depth, width) = if perspective { (v.exp(), v.exp() * step) } else { (v, step) };
                    let u = (depth - m[2]) / sd;
                    (depth, (-0.5 * u * u).exp() * width / (sd * (2.0 * std::f64::consts::PI).sqrt()))
                })
                .collect()
        } else {
            vec![(m[2], 1.0)]
        };
        // The pixel grid's own error is divided out, Gaussian by Gaussian, as the renderer does.
        let mut own = vec![0.0; self.tau.len()];
        let (mut wanted, mut found) = (0.0, 0.0);
        for (depth, share) in points {
            if depth < lens.range[0] || depth > lens.range[1] || share < 1e-14 {
                continue;
            }
            let (gx, gy) = if zz > 1e-14 * (s[0][0] + s[1][1]) { (s[0][2] / zz, s[1][2] / zz) } else { (0.0, 0.0) };
            let (x, y) = (m[0] + gx * (depth - m[2]), m[1] + gy * (depth - m[2]));
            let scale = if perspective { lens.focal / depth } else { lens.focal };
            let (tx, ty) = if perspective { (x / depth, y / depth) } else { (0.0, 0.0) };
            let r2 = lens.radius2;
            let xx = scale * scale * (s[0][0] - gx * s[0][2] + r2 * (1.0 + tx * tx)) + 1.0 / 12.0;
            let xy = scale * scale * (s[0][1] - gx * s[1][2] + r2 * tx * ty);
            let yy = scale * scale * (s[1][1] - gy * s[1][2] + r2 * (1.0 + ty * ty)) + 1.0 / 12.0;
            let (px, py) = (lens.center[0] + scale * x, lens.center[1] + scale * y);
            let det = xx * yy - xy * xy;
            let weight = count * share * lens.unit / if perspective { depth * depth } else { 1.0 };
            let f = super::project::Footprint { mean: [px, py], cov: [xx, xy, yy], sum: weight };
            let peak = weight / (2.0 * std::f64::consts::PI * det.sqrt());
            wanted += weight;
            found += weight * super::bins::lattice_sum(&f);
            for j in 0..size.height {
                let dy = j as f64 - py;
                if dy * dy > 80.0 * yy {
                    continue;
                }
                for i in 0..size.width {
                    let dx = i as f64 - px;
                    let q = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det;
                    own[j * size.width + i] += peak * (-0.5 * q).exp();
                }
            }
        }
        if found > 0.0 {
            self.tau.iter_mut().zip(&own).for_each(|(t, v)| *t += v * wanted / found);
        }
    }
}
