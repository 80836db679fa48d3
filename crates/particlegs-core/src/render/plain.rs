//! For tests, in f64: the law written plainly, every Gaussian at every pixel, integrated along depth on a fine
//! grid with nothing approximated but the grids; and the stages' formulas in moments, unrounded between them.

use super::bin::{PlacedFootprint, RasterSplat, SMALL, cut as cut_of, lattice_sum, suited};
use super::lens::Lens;
use super::project::slices::{ClipClass, clip_class, cut, misses, whole};
use super::project::{CameraGaussian, DepthMoments};
use super::raster::pyramid::{Level, PAD, SHARPEST};
use super::scene::Scene;
use crate::camera::{Projection, View};
use crate::math::each_axis;
use crate::model::Mixture;
use crate::picture::Size;
use crate::splat::PIXEL_VARIANCE;

/// Grid points in depth for a Gaussian.
const DEPTHS: usize = 1200;

/// Optical depth at every pixel.
pub fn optical_depth(scene: &Scene, view: &View, size: Size) -> Vec<f64> {
    let lens = Lens::optical(view, size, &scene.bounds).unwrap();
    let perspective = matches!(view.camera.projection, Projection::Perspective { .. });
    let mut picture = PlainPicture { lens, perspective, size, tau: vec![0.0; size.pixels()] };
    for (m, _) in &scene.parts {
        for i in 0..m.len() {
            picture.add(m.mean_of(i), m.cov_of(i).rows(), m.count[i]);
        }
    }
    let PlainPicture { lens, mut tau, .. } = picture;
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

/// A picture while Gaussians are added to it.
struct PlainPicture {
    lens: Lens,
    /// Else the lines of sight are parallel.
    perspective: bool,
    size: Size,
    /// Integrals of the density along depth, before the lengths of the lines of sight are put in.
    tau: Vec<f64>,
}

impl PlainPicture {
    fn add(&mut self, mean: [f64; 3], cov: [[f64; 3]; 3], count: f64) {
        let (lens, size, perspective) = (&self.lens, self.size, self.perspective);
        let a = lens.axes;
        let v: [f64; 3] = each_axis(|k| mean[k] - lens.position[k]);
        let m: [f64; 3] = each_axis(|r| (0..3).map(|k| a[r][k] * v[k]).sum());
        let s: [[f64; 3]; 3] = each_axis(|r| {
            each_axis(|c| (0..3).map(|k| (0..3).map(|l| a[r][k] * cov[k][l] * a[c][l]).sum::<f64>()).sum())
        });
        let zz = s[2][2];
        // A Gaussian without a spread of depth counts at one depth, as its regression on depth would divide by zero.
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
        let mut gaussian_depth = vec![0.0; self.tau.len()];
        let (mut exact_sum, mut grid_sum) = (0.0, 0.0);
        for (depth, share) in points {
            if depth < lens.range[0] || depth > lens.range[1] || share < 1e-14 {
                continue;
            }
            let (gx, gy) = if zz > 1e-14 * (s[0][0] + s[1][1]) { (s[0][2] / zz, s[1][2] / zz) } else { (0.0, 0.0) };
            let (x, y) = (m[0] + gx * (depth - m[2]), m[1] + gy * (depth - m[2]));
            let scale = if perspective { lens.focal / depth } else { lens.focal };
            let (tx, ty) = if perspective { (x / depth, y / depth) } else { (0.0, 0.0) };
            // Splats grow towards the picture's corners (docs/law/splat.md, "Shape"); 1/12 is the pixel's own variance.
            let r2 = lens.radius2;
            let xx = scale * scale * (s[0][0] - gx * s[0][2] + r2 * (1.0 + tx * tx)) + 1.0 / 12.0;
            let xy = scale * scale * (s[0][1] - gx * s[1][2] + r2 * tx * ty);
            let yy = scale * scale * (s[1][1] - gy * s[1][2] + r2 * (1.0 + ty * ty)) + 1.0 / 12.0;
            let (px, py) = (lens.center[0] + scale * x, lens.center[1] + scale * y);
            let det = xx * yy - xy * xy;
            let weight = count * share * lens.unit / if perspective { depth * depth } else { 1.0 };
            let peak = weight / (2.0 * std::f64::consts::PI * det.sqrt());
            exact_sum += weight;
            grid_sum += weight * lattice_sum([px, py], [xx, xy, yy]);
            for j in 0..size.height {
                let dy = j as f64 - py;
                // exp(-40) is below the last digit of the peak in f64.
                if dy * dy > 80.0 * yy {
                    continue;
                }
                for i in 0..size.width {
                    let dx = i as f64 - px;
                    let q = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det;
                    gaussian_depth[j * size.width + i] += peak * (-0.5 * q).exp();
                }
            }
        }
        if grid_sum > 0.0 {
            self.tau.iter_mut().zip(&gaussian_depth).for_each(|(t, v)| *t += v * exact_sum / grid_sum);
        }
    }
}

/// A Gaussian, or a piece of one, on the picture plane.
#[derive(Clone, Copy, Debug)]
pub struct PlainFootprint {
    /// Mean, pixels.
    pub mean: [f64; 2],
    /// Covariance xx, xy, yy with the pixel's own variance.
    pub cov: [f64; 3],
    /// Its sum over pixels.
    pub sum: f64,
}

/// The footprints of a mixture's Gaussian: the twin of `CameraGaussian::from_mixture` and `project`.
pub fn footprints(lens: &Lens, m: &Mixture, i: usize, weight: f64) -> Vec<PlainFootprint> {
    let a = lens.axes;
    let v: [f64; 3] = each_axis(|k| m.mean[k][i] - lens.position[k]);
    let mean = a.map(|a| a[0] * v[0] + a[1] * v[1] + a[2] * v[2]);
    let rows = a.map(|r| m.cov_of(i).apply(r));
    let cov: [[f64; 3]; 3] = a.map(|a| rows.map(|r| a[0] * r[0] + a[1] * r[1] + a[2] * r[2]));
    let (depth, variance) = (mean[2], cov[2][2]);
    let mut footprints = Vec::new();
    let mut add = |m: DepthMoments| footprints.push(footprint(lens, mean, &cov, lens.unit * weight, &m));
    match clip_class(lens, depth, variance) {
        ClipClass::Outside => {}
        ClipClass::Cut if CameraGaussian::from_mixture(lens, m, i, weight).is_some_and(|g| misses(lens, &g)) => {}
        ClipClass::Whole => add(whole(lens, depth, variance)),
        ClipClass::Cut => cut(lens, depth, variance, add),
    }
    footprints
}

fn footprint(lens: &Lens, [x, y, d]: [f64; 3], cov: &[[f64; 3]; 3], weight: f64, m: &DepthMoments) -> PlainFootprint {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = *cov;
    let inverse = if zz > 1e-14 * (xx + yy) { 1.0 / zz } else { 0.0 };
    let along = [xz * inverse, yz * inverse];
    let rest = [(xx - along[0] * xz).max(0.0), xy - along[0] * yz, (yy - along[1] * yz).max(0.0)];
    let carried = [x - along[0] * d, y - along[1] * d];
    let (base, slope) = if lens.perspective { (along, carried) } else { (carried, along) };
    let t = [base[0] + slope[0] * m.mean, base[1] + slope[1] * m.mean];
    let (scale2, tilt) = if lens.perspective { (m.square, t) } else { (1.0, [0.0; 2]) };
    let f2 = lens.focal * lens.focal;
    let term = |rest: f64, i: usize, j: usize| {
        let round = lens.radius2 * (if i == j { 1.0 } else { 0.0 } + tilt[i] * tilt[j]);
        f2 * (scale2 * (rest + round) + slope[i] * slope[j] * m.variance)
    };
    PlainFootprint {
        mean: [0, 1].map(|k| lens.center[k] + lens.focal * t[k]),
        cov: [term(rest[0], 0, 0) + PIXEL_VARIANCE, term(rest[1], 0, 1), term(rest[2], 1, 1) + PIXEL_VARIANCE],
        sum: weight * m.weight,
    }
}

/// A footprint's plane and stroke, whether it touches the picture or not: the twin of `bin::place`.
pub fn place(levels: &[Level], f: &PlainFootprint) -> PlacedFootprint {
    let [xx, xy, yy] = f.cov;
    let det = xx * yy - xy * xy;
    let half_sum = 0.5 * (xx + yy);
    let smaller = det / (half_sum + (half_sum * half_sum - det).max(0.0).sqrt());
    let peak = f.sum / (2.0 * std::f64::consts::PI * det.sqrt());
    let cut2 = cut_of(peak, smaller);
    let (level, scale) = suited(levels, smaller, SHARPEST);
    let small = smaller < SMALL;
    let lattice = if small { lattice_sum(f.mean, f.cov) } else { 1.0 };
    let half_log2 = 0.5 * std::f64::consts::LOG2_E;
    let [x, y] = f.mean.map(|v| ((v + 0.5) * scale - 0.5 + PAD as f64) as f32);
    let splat = RasterSplat {
        x,
        y,
        slope: (xy / yy) as f32,
        along: (-half_log2 * yy / det / (scale * scale)) as f32,
        down: (-half_log2 / yy / (scale * scale)) as f32,
        end: (-half_log2 * cut2) as f32,
        peak: (peak / (1.0 - libm::exp(-0.5 * cut2)) / lattice) as f32,
        half: ((cut2 * yy).sqrt() * scale) as f32,
    };
    PlacedFootprint { level, scale, small, stroke: splat }
}
