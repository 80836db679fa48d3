//! Fields of a model in the cells of a grid: means weighted by the mass that each Gaussian has in a cell.

use super::deposit::model_planes;
use super::gaussian::{CellQuantity, DepositScratch, Slab};
use super::likelihood::{field_parts, is_sum};
use super::{Grid, MeanAndDispersion};
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, dot, each_axis};
use particlegs_core::model::{FieldMoments, Mixture, Model};
use particlegs_core::{Result, parallel};
use std::f64::consts::LN_10;

/// A Gaussian's field of N components: normal about `mean + slope . d`, d the way from the Gaussian's mean.
struct GaussianField<const N: usize> {
    mean: [f64; N],
    slope: [[f64; 3]; N],
    variance: [f64; N],
    /// Covariance with the place.
    with_place: [[f64; 3]; N],
    /// Of a logarithmic field, the term that turns `mean` and half the variance into the logarithm of the values' mean.
    to_values: Option<f64>,
}

impl<const N: usize> GaussianField<N> {
    /// Of Gaussian `i`, of covariance `cov`, as it is where the place within it is not known: without slopes.
    fn new(f: &FieldMoments, i: usize, cov: &Sym3, reference: [f64; N]) -> Self {
        let slope = |k: usize| each_axis(|d| f.slope[k][d][i]);
        GaussianField {
            mean: std::array::from_fn(|k| f.mean[k][i] - reference[k]),
            slope: [[0.0; 3]; N],
            variance: std::array::from_fn(|k| f.variance(k, i) + cov.quadratic(slope(k))),
            with_place: std::array::from_fn(|k| cov.apply(slope(k))),
            to_values: f.excess.as_ref().map(|e| e[i] + reference[0]),
        }
    }
}

/// Mass, mass times value and mass times the value's square.
#[derive(Clone, Copy)]
struct FieldSum<const N: usize> {
    mass: f64,
    first: [f64; N],
    second: [f64; N],
    /// Mass times the mean of values, where `first` is of logarithms.
    values: f64,
}

impl<const N: usize> Default for FieldSum<N> {
    fn default() -> Self {
        FieldSum { mass: 0.0, first: [0.0; N], second: [0.0; N], values: 0.0 }
    }
}

impl<const N: usize> CellQuantity for GaussianField<N> {
    type Sum = FieldSum<N>;
    /// The images of a wide Gaussian have different values in a cell, so they cannot be folded.
    const WIDEST: f64 = 2.0;

    fn widened(&self, inverse: &Sym3, side: [f64; 3]) -> Self {
        let with_place: [[f64; 3]; N] = self.with_place.map(|c| each_axis(|d| c[d] / side[d]));
        let slope = with_place.map(|c| inverse.apply(c));
        // Without slopes `variance` is that of all its particles.
        let variance = std::array::from_fn(|k| (self.variance[k] - dot(slope[k], with_place[k])).max(0.0));
        GaussianField { mean: self.mean, slope, variance, with_place, to_values: self.to_values }
    }

    fn part(&self, from_mean: [f64; 3], deviation: f64) -> Self {
        let within = deviation * deviation;
        GaussianField {
            mean: std::array::from_fn(|k| self.mean[k] + dot(self.slope[k], from_mean)),
            slope: [[0.0; 3]; N],
            variance: std::array::from_fn(|k| self.variance[k] + within * dot(self.slope[k], self.slope[k])),
            with_place: self.with_place,
            to_values: self.to_values,
        }
    }

    #[inline(always)]
    fn add(&self, sum: &mut FieldSum<N>, mass: f64, from_mean: [f64; 3]) {
        sum.mass += mass;
        for k in 0..N {
            let value = self.mean[k] + dot(self.slope[k], from_mean);
            sum.first[k] += mass * value;
            sum.second[k] += mass * (value * value + self.variance[k]);
        }
        if let Some(to_values) = self.to_values {
            let log = self.mean[0] + dot(self.slope[0], from_mean) + 0.5 * self.variance[0] + to_values;
            sum.values += mass * libm::exp(log);
        }
    }
}

/// Mean and dispersion of a field of a model in each cell of a grid, x slowest: means over the cell, weighted by
/// density as [`super::deposit`] integrates it. Of a sum, such as a charge, how much there is in a unit of volume,
/// without a dispersion; dispersions of a logarithmic field are in dex.
pub fn field_in_cells(model: &Model, name: &str, grid: &Grid, context: &Context<'_>) -> Result<MeanAndDispersion> {
    let parts = field_parts(model, name)?;
    let volume = is_sum(model, name).then(|| grid.side.iter().product::<f64>());
    match parts[0].2.components() {
        1 => in_cells::<1>(&parts, volume, grid, context),
        _ => in_cells::<3>(&parts, volume, grid, context),
    }
}

fn in_cells<const N: usize>(
    parts: &[(f64, &Mixture, &FieldMoments)],
    volume: Option<f64>,
    grid: &Grid,
    context: &Context<'_>,
) -> Result<MeanAndDispersion> {
    let (plane, depth) = (grid.cells[1] * grid.cells[2], model_planes(grid));
    // Means and dispersions of all cells, and the sums of the slabs that threads work on at the same time.
    let at_once = parallel::threads().min(grid.cells[0].div_ceil(depth)) * depth * plane;
    let bytes = 16 * N as u64 * grid.len() as u64 + (size_of::<FieldSum<N>>() * at_once) as u64;
    particlegs_files::memory::require("a field on a grid", bytes)?;
    let (reference, logarithmic) = (overall_mean(parts), parts[0].2.excess.is_some());
    // Means stay within the particles' range (docs/law/fields.md, "In the cells of a grid").
    let range: [[f64; 2]; N] = std::array::from_fn(|k| {
        let ends = parts.iter().map(|p| p.2.value_range(k));
        ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], [a, b]| [lo.min(a), hi.max(b)])
    });
    let empty = || vec![vec![f64::NAN; grid.len()]; N];
    let mut out = MeanAndDispersion { mean: empty(), dispersion: empty() };
    // Each task owns some planes of every column.
    let mut slabs: Vec<Vec<&mut [f64]>> = Vec::new();
    slabs.resize_with(grid.cells[0].div_ceil(depth), Vec::new);
    for column in out.mean.iter_mut().chain(&mut out.dispersion) {
        slabs.iter_mut().zip(column.chunks_mut(depth * plane)).for_each(|(slab, run)| slab.push(run));
    }
    parallel::try_for_each(slabs.into_iter().enumerate(), |(number, mut columns)| {
        let cells = columns[0].len();
        let (mut sums, mut splat) = (vec![FieldSum::<N>::default(); cells], DepositScratch::new(context.simd(), 0.0));
        let planes = number * depth..number * depth + cells / plane;
        let mut slab = Slab { grid, planes, cells: &mut sums };
        for (unit, m, f) in parts {
            for i in 0..m.len() {
                // A Gaussian as wide as the box takes milliseconds, so a stop is looked for often.
                if i.is_multiple_of(8) {
                    context.check()?;
                    context.advance((m.len() - i).min(8) as u64);
                }
                let (mean, cov) = grid.upright(m.mean_of(i), m.cov_of(i));
                if slab.may_hold(mean, &cov) {
                    let mut gaussian_field = GaussianField::new(f, i, &m.cov_of(i), reference);
                    // Variances are the same in any axes; the covariance with the place follows the tilted box's edges.
                    gaussian_field.with_place =
                        gaussian_field.with_place.map(|c| grid.tilt.as_ref().map_or(c, |t| t.upright(c)));
                    splat.add_quantity(&mut slab, mean, &cov, (unit * m.mass_of(i), &gaussian_field));
                }
            }
        }
        for (cell, sum) in sums.iter().enumerate().filter(|(_, s)| s.mass > 0.0) {
            for k in 0..N {
                // Sums are about the reference; values of a logarithmic field have it in their exponents already.
                let mean = sum.first[k] / sum.mass;
                let value = if logarithmic { sum.values / sum.mass } else { reference[k] + mean };
                let value = value.clamp(range[k][0], range[k][1]);
                if let Some(volume) = volume {
                    // A sum's mean is per weight: with the weight in the cell it is the amount there.
                    columns[k][cell] = value * sum.mass / volume;
                    continue;
                }
                // The reference does not matter to a variance; near to the mean it keeps the digits of the difference.
                let variance = (sum.second[k] / sum.mass - mean * mean).max(0.0);
                columns[k][cell] = value;
                columns[N + k][cell] = variance.sqrt() / if logarithmic { LN_10 } else { 1.0 };
            }
        }
        Ok::<_, particlegs_core::Error>(())
    })?;
    Ok(out)
}

/// The mean over all, which is subtracted before squares are added up, so that dispersions keep their digits.
fn overall_mean<const N: usize>(parts: &[(f64, &Mixture, &FieldMoments)]) -> [f64; N] {
    let (mut sums, mut total) = ([0.0; N], 0.0);
    for (unit, m, f) in parts {
        for i in 0..m.len() {
            let mass = unit * m.mass_of(i);
            total += mass;
            (0..N).for_each(|k| sums[k] += mass * f.mean[k][i]);
        }
    }
    if total > 0.0 { sums.map(|s| s / total) } else { sums }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Assignment, Subject, deposit};
    use particlegs_core::math::Random;
    use particlegs_particles::Domain;
    use particlegs_particles::testing::{model_of, on_threads};

    /// Gaussians of very different widths with a vector that changes across them.
    fn scene(n: u64, widths: [f64; 2]) -> Model {
        let mut gaussians = Vec::new();
        let mut f = FieldMoments::new(3);
        for i in 0..n {
            let mut r = Random::new(5, 0, i);
            let mut three = || [r.normal(), r.normal(), r.normal()];
            let size = widths[0] + (widths[1] - widths[0]) * i as f64 / n as f64;
            let cov = Sym3::outer(three()).add(&Sym3::outer(three())).add(&Sym3::scaled_identity(0.3));
            gaussians.push((each_axis(|k| 5.0 + three()[k]), cov.scale(size * size), 10.0 + i as f64));
            for k in 0..3 {
                f.mean[k].push(100.0 * k as f64 + 30.0 * three()[0]);
                let slope = three();
                (0..3).for_each(|d| f.slope[k][d].push(10.0 * slope[d] / size));
            }
            let spread = Sym3::outer(three()).add(&Sym3::scaled_identity(1.0)).scale(100.0);
            f.spread.iter_mut().zip(spread.0).for_each(|(column, v)| column.push(v));
        }
        f.range.fill([-1e6, 1e6]);
        let mut model = model_of(&gaussians, [10.0; 3]);
        model.layers[0].content[0].gaussians.fields.set("velocity", f);
        model
    }

    fn grid(cells: usize) -> Grid {
        Grid::new(&Domain::upright([0.0; 3], [10.0; 3], [true; 3]), cells)
    }

    /// Sums over cells of mass times value and of mass times squares, and the same of the Gaussians.
    fn sums(model: &Model, cells: usize) -> [[[f64; 2]; 3]; 2] {
        let grid = grid(cells);
        let density = deposit(Subject::Model(model), &grid, Assignment::Ngp, 0.0, &Context::SILENT).unwrap();
        let field = field_in_cells(model, "velocity", &grid, &Context::SILENT).unwrap();
        let mut all = [[[0.0; 2]; 3]; 2];
        for k in 0..3 {
            for (i, &mass) in density.mass.iter().enumerate().filter(|(i, _)| field.mean[k][*i].is_finite()) {
                let [mass, mean, off] = [f64::from(mass), field.mean[k][i], field.dispersion[k][i]];
                all[0][k][0] += mass * mean;
                all[0][k][1] += mass * (mean * mean + off * off);
            }
            for (unit, m, f) in field_parts(model, "velocity").unwrap() {
                for i in 0..m.len() {
                    let mass = unit * m.mass_of(i);
                    let gaussian_field = GaussianField::<3>::new(f, i, &m.cov_of(i), [0.0; 3]);
                    all[1][k][0] += mass * gaussian_field.mean[k];
                    all[1][k][1] +=
                        mass * (gaussian_field.mean[k] * gaussian_field.mean[k] + gaussian_field.variance[k]);
                }
            }
        }
        all
    }

    #[test]
    fn cells_keep_the_sums_of_a_field() {
        // Wider than a cell; narrower than a tenth of one; from the one to the other.
        for (widths, cells) in [([0.5, 1.0], 32), ([0.001, 0.002], 16), ([0.02, 0.6], 16)] {
            let [in_cells, in_gaussians] = sums(&scene(40, widths), cells);
            let mass: f64 = (0..40).map(|i| 10.0 + f64::from(i)).sum();
            for (sum, expected) in in_cells.iter().zip(&in_gaussians) {
                let deviation = (expected[1] / mass).sqrt();
                let off = (sum[0] - expected[0]).abs() / mass / deviation;
                assert!(off < 1e-5, "{widths:?} {off}");
                let ratio = sum[1] / expected[1];
                assert!((ratio - 1.0).abs() < 1e-3, "{widths:?} {ratio}");
            }
        }
    }

    /// The mean over a small cell is the mean at its centre.
    #[test]
    fn small_cells_have_the_field_of_their_centres() {
        let (model, grid) = (scene(12, [0.8, 1.5]), grid(40));
        let field = field_in_cells(&model, "velocity", &grid, &Context::SILENT).unwrap();
        let centre = |i: usize| [i / 1600, i / 40 % 40, i % 40].map(|k| 0.25 * (k as f64 + 0.5));
        let places: Vec<[f64; 3]> = (0..64_000).map(centre).collect();
        let domain = Domain::upright([0.0; 3], [10.0; 3], [true; 3]);
        let at = super::super::field_at(&domain, &model, "velocity", &places, &Context::SILENT).unwrap();
        let density = super::super::density_at(&domain, &model, &places, &Context::SILENT).unwrap();
        let peak = density.iter().copied().fold(0.0, f64::max);
        for k in 0..3 {
            let (mut off, mut square, mut total) = (0.0, 0.0, 0.0);
            for i in (0..64_000).filter(|i| density[*i] > 1e-3 * peak) {
                let [mean, dispersion] = [field.mean[k][i], field.dispersion[k][i]].map(f64::from);
                off += density[i] * ((mean - at.mean[k][i]).powi(2) + (dispersion - at.dispersion[k][i]).powi(2));
                square += density[i] * (at.mean[k][i].powi(2) + at.dispersion[k][i].powi(2));
                total += density[i];
            }
            assert!(total > 0.0 && (off / square).sqrt() < 0.01, "{}", (off / square).sqrt());
        }
    }

    #[test]
    fn cells_that_nothing_reaches_have_no_value_and_threads_change_none() {
        let (model, grid) = (scene(5, [0.05, 0.1]), grid(16));
        let run = |n| on_threads(n, || field_in_cells(&model, "velocity", &grid, &Context::SILENT).unwrap());
        let (one, two) = (run(1), run(2));
        let bits = |f: &MeanAndDispersion| f.mean.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&one), bits(&two));
        assert!(one.mean[0][0].is_nan() && one.mean[0].iter().any(|v| v.is_finite()));
        let error = field_in_cells(&model, "heat", &grid, &Context::SILENT).unwrap_err();
        assert!(error.to_string().contains("no field `heat`"), "{error}");
    }

    /// A Gaussian as wide as its periodic box reaches itself with other values.
    #[test]
    fn images_of_wide_gaussians_have_values_of_their_own() {
        let mut model = model_of(&[([5.0; 3], Sym3::scaled_identity(9.0), 100.0)], [10.0; 3]);
        let slope = [vec![10.0], vec![0.0], vec![0.0]];
        let f = FieldMoments {
            mean: vec![vec![0.0]],
            slope: vec![slope],
            spread: vec![vec![1.0]],
            range: vec![[-1e3, 1e3]],
            ..FieldMoments::new(1)
        };
        model.layers[0].content[0].gaussians.fields.set("heat", f);
        let grid = grid(20);
        let field = field_in_cells(&model, "heat", &grid, &Context::SILENT).unwrap();
        for i in 0..20 {
            let x = 0.5 * (i as f64 + 0.5) - 5.0;
            let images = [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0].map(|n| x + 10.0 * n);
            let weights = images.map(|x| (-0.5 * x * x / 9.0).exp());
            let sum: f64 = images.iter().zip(weights).map(|(x, w)| 10.0 * x * w).sum();
            let mean = sum / weights.iter().sum::<f64>();
            let cell_mean = field.mean[0][grid.index([i as usize, 10, 10])];
            assert!((cell_mean - mean).abs() < 0.3, "{i}: {cell_mean} {mean}");
        }
    }
}
