//! The Fourier transform of a field, only the modes that are asked for, and xi(r) from them.
//!
//! Real rows along z, then y, plane by plane, then x, each pass keeping the low modes alone: the
//! transform of 512^3 cells up to a quarter of the grid's Nyquist frequency holds 34 MB beside the
//! field. The transforms are scalar f64: the same bits on every machine.

use super::spectrum::{SpectrumOptions, TransformPair, visit_plane};
use super::{Domain, Field};
use particlegs_core::context::Context;
use particlegs_core::{Result, parallel};
use realfft::num_complex::Complex64;
use realfft::{RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Transform of delta: (1 / cells) sum delta exp(-i k x), for modes of |m_a| <= most[a] on each axis
/// (z: 0 to most, its negative half being the conjugate).
#[derive(Clone, Debug)]
pub struct Modes {
    /// Largest mode number of each axis.
    pub most: [usize; 3],
    /// Values: x slowest; x and y from -most to most, z from 0.
    pub value: Vec<Complex64>,
}

impl Modes {
    /// No modes yet.
    pub fn zero(most: [usize; 3]) -> Self {
        Modes { most, value: vec![Complex64::default(); (2 * most[0] + 1) * (2 * most[1] + 1) * (most[2] + 1)] }
    }

    /// Bytes of modes up to `most`.
    pub fn bytes(most: [usize; 3]) -> u64 {
        16 * ((2 * most[0] as u64 + 1) * (2 * most[1] as u64 + 1) * (most[2] as u64 + 1))
    }

    /// Modes along y and z.
    pub(super) fn plane(&self) -> (usize, usize) {
        (2 * self.most[1] + 1, self.most[2] + 1)
    }
}

/// Bytes that [`transform`] takes beside the field.
pub fn transform_bytes(cells: [usize; 3], most: [usize; 3]) -> u64 {
    16 * (cells[0] as u64 * (2 * most[1] as u64 + 1) * (most[2] as u64 + 1)) + Modes::bytes(most)
}

/// Place of mode `m` (from -most) in a transform of `n`.
fn place(m: i64, n: usize) -> usize {
    m.rem_euclid(n as i64) as usize
}

/// The modes of a field's delta, in units of the mean `mean` of a cell, up to `most`, each at most half the cells of
/// its axis.
pub fn transform(field: &Field, mean: f64, most: [usize; 3], context: &Context<'_>) -> Result<Modes> {
    let n = field.grid.cells;
    assert!((0..3).all(|k| most[k] <= n[k] / 2), "modes that the grid has");
    particlegs_files::memory::require("a Fourier transform", transform_bytes(n, most))?;
    let mut modes = Modes::zero(most);
    if mean <= 0.0 {
        return Ok(modes);
    }
    let (columns, depth) = modes.plane();
    let plan = TransformPlan {
        n,
        most,
        z: RealFftPlanner::new().plan_fft_forward(n[2]),
        y: FftPlanner::new().plan_fft_forward(n[1]),
        per_mean: 1.0 / mean,
        scale: 1.0 / field.mass.len() as f64,
    };
    // Planes of x, transformed along z and y.
    let mut planes = vec![Complex64::default(); n[0] * columns * depth];
    let scratch = parallel::Scratch::default();
    let parts = planes.chunks_mut(columns * depth).zip(field.mass.chunks(n[1] * n[2]));
    parallel::try_for_each(parts, |(out, cells)| {
        context.check()?;
        scratch.with(|scratch| plan.plane(cells, out, scratch));
        context.advance(cells.len() as u64);
        Ok(())
    })?;
    along_x(&planes, &mut modes, n[0], context)?;
    Ok(modes)
}

struct TransformPlan {
    n: [usize; 3],
    most: [usize; 3],
    z: Arc<dyn RealToComplex<f64>>,
    y: Arc<dyn Fft<f64>>,
    per_mean: f64,
    scale: f64,
}

#[derive(Default)]
struct TransformScratch {
    row: Vec<f64>,
    half: Vec<Complex64>,
    columns: Vec<Complex64>,
    work: Vec<Complex64>,
}

impl TransformPlan {
    /// One plane: rows to half-spectra, kept transposed, then columns.
    fn plane(&self, cells: &[f32], out: &mut [Complex64], s: &mut TransformScratch) {
        let [_, ny, nz] = self.n;
        let depth = self.most[2] + 1;
        s.row.resize(nz, 0.0);
        s.half.resize(nz / 2 + 1, Complex64::default());
        s.columns.resize(depth * ny, Complex64::default());
        let need = self.z.get_scratch_len().max(self.y.get_inplace_scratch_len());
        s.work.resize(need, Complex64::default());
        for j in 0..ny {
            for (r, v) in s.row.iter_mut().zip(&cells[j * nz..(j + 1) * nz]) {
                *r = (f64::from(*v) * self.per_mean - 1.0) * self.scale;
            }
            let work = &mut s.work[..self.z.get_scratch_len()];
            self.z.process_with_scratch(&mut s.row, &mut s.half, work).expect("buffers of the plan's length");
            for c in 0..depth {
                // Transposed, so that one call transforms all columns along y.
                s.columns[c * ny + j] = s.half[c];
            }
        }
        self.y.process_with_scratch(&mut s.columns, &mut s.work[..self.y.get_inplace_scratch_len()]);
        let most = self.most[1] as i64;
        for m in -most..=most {
            for c in 0..depth {
                out[(m + most) as usize * depth + c] = s.columns[c * ny + place(m, ny)];
            }
        }
    }
}

/// The last pass: columns along x, a row of z modes at a time.
fn along_x(planes: &[Complex64], modes: &mut Modes, nx: usize, context: &Context<'_>) -> Result<()> {
    let (columns, depth) = modes.plane();
    let most = modes.most[0] as i64;
    let plan = FftPlanner::new().plan_fft_forward(nx);
    let mode_columns = parallel::try_map_range(columns, |j| {
        context.check()?;
        let mut run = vec![Complex64::default(); depth * nx];
        for i in 0..nx {
            for c in 0..depth {
                run[c * nx + i] = planes[(i * columns + j) * depth + c];
            }
        }
        plan.process(&mut run);
        let mut low_modes = Vec::with_capacity((2 * most as usize + 1) * depth);
        for m in -most..=most {
            low_modes.extend((0..depth).map(|c| run[c * nx + place(m, nx)]));
        }
        Ok(low_modes)
    })?;
    for (j, low_modes) in mode_columns.iter().enumerate() {
        for (i, row) in low_modes.chunks(depth).enumerate() {
            let at = (i * columns + j) * depth;
            modes.value[at..at + depth].copy_from_slice(row);
        }
    }
    Ok(())
}

/// The field of some modes at the centres of a grid's cells: sum over both halves of value exp(i k x), x slowest.
pub(super) fn field_of_modes(modes: &Modes, cells: [usize; 3]) -> Vec<f32> {
    let [nx, ny, nz] = cells;
    let [columns, depth] = [modes.plane().0, modes.plane().1];
    let [most_x, most_y] = [modes.most[0] as i64, modes.most[1] as i64];
    let (along_x, along_y) = {
        let mut planner = FftPlanner::new();
        (planner.plan_fft_inverse(nx), planner.plan_fft_inverse(ny))
    };
    let along_z = RealFftPlanner::<f64>::new().plan_fft_inverse(nz);
    // Columns of x, one after the other.
    let mut lines = vec![Complex64::default(); columns * depth * nx];
    for m in -most_x..=most_x {
        let plane = &modes.value[(m + most_x) as usize * columns * depth..][..columns * depth];
        plane.iter().enumerate().for_each(|(at, v)| lines[at * nx + place(m, nx)] = *v);
    }
    along_x.process(&mut lines);
    let mut field = vec![0.0; nx * ny * nz];
    let (mut plane, mut row) = (vec![Complex64::default(); depth * ny], vec![0.0; nz]);
    for i in 0..nx {
        plane.fill(Complex64::default());
        for m in -most_y..=most_y {
            for c in 0..depth {
                plane[c * ny + place(m, ny)] = lines[((m + most_y) as usize * depth + c) * nx + i];
            }
        }
        along_y.process(&mut plane);
        for j in 0..ny {
            let mut half = along_z.make_input_vec();
            (0..depth).for_each(|c| half[c] = plane[c * ny + j]);
            // Real fields have real modes here, but for rounding.
            half[0].im = 0.0;
            along_z.process(&mut half, &mut row).expect("buffers of the plan's length");
            let out = &mut field[(i * ny + j) * nz..][..nz];
            out.iter_mut().zip(&row).for_each(|(o, v)| *o = *v as f32);
        }
    }
    field
}

/// xi(r) from |delta_k|^2, in bins of pi / k_max from there on.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct XiByTransform {
    /// Edges of the bins, world units: one more than bins.
    pub edges: Vec<f64>,
    /// xi in each bin, truth and other.
    pub xi: [Vec<f64>; 2],
}

/// xi of both fields in bins of r, from |delta_k|^2 with the shot noise subtracted.
///
/// The mean of exp(i k d) over the directions of d is sin(kr) / (kr), and over a shell of r the
/// difference of 3 (sin kr - kr cos kr) / k^3 at its edges over that of r^3: exact sums over the
/// modes, without a second transform. Bins narrower than about pi / k_max hold ringing.
pub(super) fn xi_of_modes(
    pair: &TransformPair,
    domain: &Domain,
    o: &SpectrumOptions,
    edges: &[f64],
    context: &Context<'_>,
) -> Result<[Vec<f64>; 2]> {
    let [a, b] = &pair.modes;
    let bins = edges.len().saturating_sub(1);
    let noise = pair.shot_noise.map(|n| n / domain.volume());
    let planes = parallel::try_map_range(2 * a.most[0] + 1, |i| {
        let mut sum = vec![[0.0; 2]; bins];
        visit_plane(a, domain, i, o.k_max, context, |at, _, k, weight| {
            let w = weight as f64;
            let power = [w * (a.value[at].norm_sqr() - noise[0]), w * (b.value[at].norm_sqr() - noise[1])];
            let mut below = primitive(k, edges[0]);
            for bin in 0..bins {
                let up_to = primitive(k, edges[bin + 1]);
                let share = up_to - below;
                below = up_to;
                sum[bin][0] += share * power[0];
                sum[bin][1] += share * power[1];
            }
        })?;
        Ok(sum)
    })?;
    let mut sum = vec![[0.0; 2]; bins];
    for p in planes {
        sum.iter_mut().zip(p).for_each(|(s, v)| (0..2).for_each(|t| s[t] += v[t]));
    }
    let xi_of = |t: usize| (0..bins).map(|i| sum[i][t] / (edges[i + 1].powi(3) - edges[i].powi(3))).collect();
    Ok([xi_of(0), xi_of(1)])
}

/// 3 times the integral of r^2 sin(kr) / (kr) up to r.
fn primitive(k: f64, r: f64) -> f64 {
    let x = k * r;
    // The difference below loses all its digits here: its series has them.
    if x < 1e-3 {
        return r * r * r * (1.0 - 0.1 * x * x);
    }
    let (sin, cos) = libm::sincos(x);
    3.0 * (sin - x * cos) / (k * k * k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Grid;
    use crate::stats::density::mean_mass;
    use particlegs_core::context::Context;
    use particlegs_particles::Domain;

    /// Against the sum by hand, on a grid with odd, even and short axes.
    #[test]
    fn modes_are_the_plain_sum() {
        let domain = Domain::upright([0.0; 3], [6.0, 5.0, 8.0], [true; 3]);
        let grid = Grid::stretched(&domain, [6, 5, 8]);
        let mass: Vec<f32> = (0..grid.len()).map(|i| 1.0 + ((i * 37) % 11) as f32).collect();
        let field = Field { grid, mass, outside: 0.0 };
        let mean = mean_mass(&field);
        for most in [[3, 2, 4], [1, 2, 0], [0, 0, 3]] {
            let modes = transform(&field, mean, most, &Context::SILENT).unwrap();
            let (columns, depth) = modes.plane();
            for (at, value) in modes.value.iter().enumerate() {
                let m = [
                    (at / (columns * depth)) as f64 - most[0] as f64,
                    (at / depth % columns) as f64 - most[1] as f64,
                    (at % depth) as f64,
                ];
                let mut plain = Complex64::default();
                for c in 0..grid.len() {
                    let x = [c / 40, c / 8 % 5, c % 8];
                    let phase: f64 = (0..3).map(|k| m[k] * x[k] as f64 / grid.cells[k] as f64).sum();
                    let delta = f64::from(field.mass[c]) / mean - 1.0;
                    plain += Complex64::from_polar(delta / grid.len() as f64, -2.0 * std::f64::consts::PI * phase);
                }
                assert!((plain - value).norm() < 1e-12, "{m:?}: {plain} {value}");
            }
        }
    }
}
