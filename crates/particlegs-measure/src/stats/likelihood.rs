//! Likelihood of particles under a model: of particles that the fit has not seen, a measure that sees needles and holes
//! where pictures and spectra do not.

use super::comparison_job::ComparisonJob;
use super::neighbours::sample;
use super::points::PointGrid;
use super::presentation::*;
use super::subject::mixtures;
use super::{Domain, Subject};
use particlegs_core::context::Context;
use particlegs_core::math::{Purpose, Sym3, each_axis};
use particlegs_core::model::{FieldMoments, Mixture, Model};
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{Neighbours, Particles, places_of};
use std::f64::consts::TAU;

/// Particles that are scored, at most: the mean's standard error is 0.02 bits of N-body data.
const SAMPLE: usize = 30_000;
/// Share of a uniform density: where a model has nothing a particle costs 10 bits, not infinitely many.
const UNIFORM: f64 = 0.001;
/// Standard deviations along its longest axis that a Gaussian reaches.
const REACH: f64 = 6.0;
/// A needle's longest axis over its middle one, more than.
const NEEDLE: f64 = 5.0;
/// The neighbour that a kernel estimate reaches to.
const KERNEL_NEIGHBOURS: usize = 16;
/// Points whose density is summed at once: 8 bytes each for every run of Gaussians.
const AT_ONCE: usize = 1 << 17;
/// Points whose field is summed at once.
const FIELDS_AT_ONCE: usize = 1 << 14;
/// Runs of Gaussians that are summed apart, so that sums do not depend on threads.
const RUNS: usize = 64;

/// Mean log2(p / uniform) of particles, with p = 0.999 of the model's density + 0.001 uniform.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Likelihood {
    /// Bits a particle: 0 = no better than a uniform density. Where the model was fitted to the same particles the
    /// figure flatters it.
    pub bits: f64,
    /// Its standard error, of the sample alone.
    pub error: f64,
    /// Number of particles that were scored.
    pub sampled: u64,
    /// Share of them to which the model gives a density below a thousandth of the uniform one.
    pub missed: f64,
    /// Volume of the box, world units cubed: what bits are relative to.
    pub volume: f64,
    /// Gaussians of the model.
    pub gaussians: u64,
    /// Share of them whose longest axis is more than five times the middle one.
    pub needles: f64,
}

/// Scores a random sample of `particles` under `model`, in `domain`. Masses are not looked at: p is the density of
/// numbers.
pub fn likelihood(
    model: &Model,
    particles: &Particles,
    domain: &Domain,
    seed: u64,
    context: &Context<'_>,
) -> Result<Likelihood> {
    let mixtures: Vec<&Mixture> = model.layers.iter().flat_map(|l| l.content.iter().map(|b| &b.gaussians)).collect();
    let total: f64 = mixtures.iter().map(|m| m.count.iter().sum::<f64>()).sum();
    if total <= 0.0 || particles.is_empty() {
        return Err(Error::input("likelihood", "there are no particles to score"));
    }
    context.begin("likelihood", RUNS as u64);
    let indices = sample(particles.len(), SAMPLE, Purpose::LikelihoodSample, seed);
    let places: Vec<[f64; 3]> = indices.iter().map(|i| domain.local(particles.position(*i as usize))).collect();
    // With a side of 0 the number of points decides on the size of the cells.
    let points = PointGrid::new(&places, domain, 0.0)?;
    let (n, volume) = (points.position.len(), domain.volume());
    let gaussians: Vec<GaussianDensity> =
        mixtures.iter().flat_map(|m| (0..m.len()).map(|i| GaussianDensity::new(m, i, m.count[i], domain))).collect();
    let densities = densities(&gaussians, &points, context)?;
    context.end();
    // Relative to uniform.
    let ratios: Vec<f64> = densities.iter().map(|d| volume / total * d).collect();
    // Where the model has nothing a particle costs log2(1 / 0.001): one in a hole does not make the mean infinite.
    let bits: Vec<f64> = ratios.iter().map(|r| libm::log2((1.0 - UNIFORM) * r + UNIFORM)).collect();
    let mean = bits.iter().sum::<f64>() / n as f64;
    let variance = bits.iter().map(|b| (b - mean) * (b - mean)).sum::<f64>() / n as f64;
    let share = |number: usize, whole: usize| number as f64 / whole.max(1) as f64;
    Ok(Likelihood {
        bits: mean,
        error: (variance / n as f64).sqrt(),
        sampled: n as u64,
        missed: share(ratios.iter().filter(|r| **r < UNIFORM).count(), n),
        volume,
        gaussians: gaussians.len() as u64,
        needles: share(gaussians.iter().filter(|g| g.needle).count(), gaussians.len()),
    })
}

impl Likelihood {
    /// Bits a particle of a random sample of `particles`, the same as a model is scored by, under an adaptive kernel
    /// estimate on `fitted` particles: a cubic spline to the 16th neighbour, of 8 to 32 the best on N-body data. It
    /// keeps every particle; a model of fewer numbers that comes near has lost little.
    pub fn kernel_bits(
        fitted: &Particles,
        particles: &Particles,
        domain: &Domain,
        seed: u64,
        context: &Context<'_>,
    ) -> Result<f64> {
        particlegs_files::memory::require("a tree of neighbours", fitted.len() as u64 * 14)?;
        let places = places_of(particles, domain, &sample(particles.len(), SAMPLE, Purpose::LikelihoodSample, seed));
        let tree = Neighbours::new(fitted, domain);
        let volume = domain.volume() / fitted.len() as f64;
        let parts = parallel::try_map(places.chunks(1024), |run| {
            context.check()?;
            // No density is infinite: as many at one place are a millionth of a spacing apart.
            let ratio = |x: &[f32; 3]| (tree.density(*x, KERNEL_NEIGHBOURS) * volume).min(1e18);
            Ok::<f64, Error>(run.iter().map(|x| libm::log2((1.0 - UNIFORM) * ratio(x) + UNIFORM)).sum())
        })?;
        Ok(parts.iter().sum::<f64>() / places.len().max(1) as f64)
    }
}

/// The density of a model's mixture at `places` of the world, in this domain, where it repeats with its images:
/// mass a volume in the model's units, or particles where no mass is known. Nothing is averaged. Beyond six standard
/// deviations along its longest axis a Gaussian adds nothing.
pub fn density_at(domain: &Domain, model: &Model, places: &[[f64; 3]], context: &Context<'_>) -> Result<Vec<f64>> {
    if let Some(i) = places.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
        return Err(Error::argument(format!("point {i} is not finite")));
    }
    model.check_density(|_| true)?;
    let mut gaussians = Vec::with_capacity(model.gaussians());
    for (unit, m) in mixtures(model) {
        gaussians.extend((0..m.len()).map(|i| GaussianDensity::new(m, i, unit * m.mass_of(i), domain)));
    }
    context.begin("density", (places.len().div_ceil(AT_ONCE) * RUNS) as u64);
    let mut all = vec![0.0; places.len()];
    for (places, all) in places.chunks(AT_ONCE).zip(all.chunks_mut(AT_ONCE)) {
        let local: Vec<[f64; 3]> = places.iter().map(|p| domain.local(*p)).collect();
        let points = PointGrid::new(&local, domain, 0.0)?;
        let densities = densities(&gaussians, &points, context)?;
        points.index.iter().zip(densities).for_each(|(i, density)| all[*i as usize] = density);
    }
    context.end();
    Ok(all)
}

/// A field at points: NaN where no Gaussian that has it reaches.
#[derive(Clone, Debug, PartialEq)]
pub struct MeanAndDispersion<T = f64> {
    /// Means weighted by the Gaussians' densities, a column for each component, in the field's unit.
    pub mean: Vec<Vec<T>>,
    /// Root mean squares of single particles' differences from them; of a logarithmic field of decimal logarithms
    /// (dex).
    pub dispersion: Vec<Vec<T>>,
}

/// The mixtures of a model that have a field, the mass that a weight of 1 stands for in each (1 where values are over
/// weights), and the field.
pub(super) fn field_parts<'a>(model: &'a Model, name: &str) -> Result<Vec<(f64, &'a Mixture, &'a FieldMoments)>> {
    let unit = |mass: f64| if is_sum(model, name) { 1.0 } else { mass };
    let parts: Vec<_> = mixtures(model).filter_map(|(mass, m)| Some((unit(mass), m, m.fields.get(name)?))).collect();
    match parts.is_empty() {
        true => Err(Error::argument(format!("the model has no field `{name}`"))),
        false => Ok(parts),
    }
}

/// Whether a field of a model is a sum, such as a charge.
pub(super) fn is_sum(model: &Model, name: &str) -> bool {
    model.metadata.fields.iter().any(|q| q.name == name && q.extensive)
}

/// Mean and dispersion of a field of a model (of a sum, such as a charge, its density) at `places` of the world, in
/// this domain, where it repeats with its images (docs/law/fields.md, "At a place").
pub fn field_at(
    domain: &Domain,
    model: &Model,
    name: &str,
    places: &[[f64; 3]],
    context: &Context<'_>,
) -> Result<MeanAndDispersion> {
    if let Some(i) = places.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
        return Err(Error::argument(format!("point {i} is not finite")));
    }
    let (parts, is_sum) = (field_parts(model, name)?, is_sum(model, name));
    let components = parts[0].2.components();
    let logarithmic = parts[0].2.excess.is_some();
    // Sums at a point: density; mean and square of each component; of a logarithmic field, a scalar, the values.
    let width = 1 + 2 * components + usize::from(logarithmic);
    // Moments of a logarithmic field are of natural logarithms, dispersions are given in dex (docs/law/fields.md).
    let unit = if logarithmic { std::f64::consts::LN_10 } else { 1.0 };
    let gaussians: Vec<(GaussianDensity, &FieldMoments, usize)> = parts
        .iter()
        .flat_map(|&(unit, m, f)| {
            (0..m.len()).map(move |i| (GaussianDensity::new(m, i, unit * m.mass_of(i), domain), f, i))
        })
        .collect();
    let empty = vec![vec![f64::NAN; places.len()]; components];
    let mut out = MeanAndDispersion { mean: empty.clone(), dispersion: empty };
    let local: Vec<[f64; 3]> = places.iter().map(|p| domain.local(*p)).collect();
    // Every run of Gaussians has sums of its own at all points: few points at once bound the memory.
    for (first, local) in (0..).step_by(FIELDS_AT_ONCE).zip(local.chunks(FIELDS_AT_ONCE)) {
        let points = PointGrid::new(local, domain, 0.0)?;
        let runs = parallel::try_map(gaussians.chunks(gaussians.len().div_ceil(RUNS).max(1)), |run| {
            context.check()?;
            let mut sums = vec![0.0; width * local.len()];
            for (gaussian, field, i) in run {
                gaussian.visit(&points, |point, d, density| {
                    let sums = &mut sums[width * point..][..width];
                    sums[0] += density;
                    for k in 0..components {
                        // A Gaussian's field is normal about a mean that is linear in the place (docs/law/fields.md).
                        let mean = field.mean_at(k, *i, d);
                        sums[1 + 2 * k] += density * mean;
                        sums[2 + 2 * k] += density * (mean * mean + field.variance(k, *i));
                    }
                    if logarithmic {
                        sums[3] += density * field.value_at(0, *i, d);
                    }
                });
            }
            Ok::<_, Error>(sums)
        })?;
        for (at, index) in points.index.iter().enumerate() {
            // Runs are as many whatever the threads and added up in their order: threads change no bit.
            let sum = |k: usize| runs.iter().map(|r| r[width * at + k]).sum::<f64>();
            let density = sum(0);
            for k in (0..components).filter(|_| density > 0.0) {
                let mean = sum(1 + 2 * k) / density;
                let place = first + *index as usize;
                // Of a sum the mean is per weight: times the density of weights it is the amount per volume.
                if is_sum {
                    out.mean[k][place] = density * mean;
                    continue;
                }
                out.mean[k][place] = if logarithmic { sum(3) / density } else { mean };
                // The spread between Gaussians counts, too; rounding may leave less than nothing of it.
                out.dispersion[k][place] = (sum(2 + 2 * k) / density - mean * mean).max(0.0).sqrt() / unit;
            }
        }
    }
    Ok(out)
}

/// The sum of Gaussians at points, in the order of [`PointGrid::position`].
fn densities(gaussians: &[GaussianDensity], points: &PointGrid, context: &Context<'_>) -> Result<Vec<f64>> {
    let n = points.position.len();
    let parts = parallel::try_map(gaussians.chunks(gaussians.len().div_ceil(RUNS).max(1)), |run| {
        context.check()?;
        let mut density = vec![0f64; n];
        run.iter().for_each(|gaussian| gaussian.add(points, &mut density));
        context.advance(1);
        Ok::<_, Error>(density)
    })?;
    // In the order of the runs, so that sums do not depend on threads.
    Ok((0..n).map(|i| parts.iter().map(|p| p[i]).sum()).collect())
}

/// A Gaussian as its density is evaluated.
struct GaussianDensity {
    /// Relative to the domain's corner, within it where it repeats.
    mean: [f64; 3],
    inverse: Sym3,
    /// Particles, or mass, a volume at the mean.
    peak: f64,
    reach: f64,
    needle: bool,
}

impl GaussianDensity {
    /// Gaussian `i` of a mixture, of `amount` particles or mass.
    fn new(m: &Mixture, i: usize, amount: f64, domain: &Domain) -> GaussianDensity {
        let mut eigen = m.cov_of(i).eigen();
        // Coded widths may be zero: no narrower than a millionth of the box.
        let least = (1e-6 * domain.longest()).powi(2);
        eigen.values = eigen.values.map(|v| v.max(least));
        let [longest, middle, shortest] = eigen.values;
        eigen.values = eigen.values.map(f64::recip);
        GaussianDensity {
            mean: domain.local(each_axis(|k| m.mean[k][i])),
            inverse: Sym3::from_eigen(&eigen),
            peak: amount / (TAU.powi(3) * longest * middle * shortest).sqrt(),
            reach: REACH * longest.sqrt(),
            needle: longest > NEEDLE * NEEDLE * middle,
        }
    }

    /// Adds its density at the points, that of its images in a box that repeats among it.
    fn add(&self, points: &PointGrid, density: &mut [f64]) {
        self.visit(points, |i, _, value| density[i] += value);
    }

    /// Calls `each` with the points that it reaches, their places from its mean, and its density there.
    fn visit(&self, points: &PointGrid, mut each: impl FnMut(usize, [f64; 3], f64)) {
        points.near(points.cell_of(self.mean), self.reach, |run, shift| {
            for i in run {
                let d = each_axis(|k| points.position[i][k] + shift[k] - self.mean[k]);
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= self.reach * self.reach {
                    each(i, d, self.peak * libm::exp(-0.5 * self.inverse.quadratic(d)));
                }
            }
        });
    }
}

impl ComparisonJob<'_> {
    /// `None` of two models or of two sets of particles.
    pub fn likelihood(&self) -> Result<Option<Likelihood>> {
        let (model, particles) = match self.pair {
            [Subject::Model(m), Subject::Particles(p)] | [Subject::Particles(p), Subject::Model(m)] => (m, p),
            _ => return Ok(None),
        };
        likelihood(model, particles, &self.domain, self.o.seed, self.context).map(Some)
    }
}

/// Shows them.
pub(super) fn show(l: &Likelihood, to: &mut Presentation) {
    to.line(
        "likelihood of the particles",
        format!("{:.3} +- {:.3} bits per particle above uniform ({} particles)", l.bits, l.error, l.sampled),
    );
    to.line("needles", format!("{:.2} % of {} Gaussians", 100.0 * l.needles, l.gaussians));
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::Random;
    use particlegs_particles::testing::model_of;

    const BOX: Domain = Domain::upright([0.0; 3], [1.0; 3], [true; 3]);

    /// Particles drawn from a Gaussian of width `s` in a periodic unit box, about its corner.
    fn cloud(n: usize, s: f64, seed: u64) -> Particles {
        let mut r = Random::new(seed, 0, 0);
        let mut column = || (0..n).map(|_| (s * r.normal()).rem_euclid(1.0) as f32).collect::<Vec<f32>>();
        Particles::from_columns(column(), column(), column())
    }

    #[test]
    fn the_truth_scores_its_own_entropy() {
        let s = 0.03;
        let model = model_of(&[([0.0; 3], Sym3::scaled_identity(s * s), 20_000.0)], BOX.length);
        let score = likelihood(&model, &cloud(20_000, s, 3), &BOX, 1, &Context::SILENT).unwrap();
        // Differential entropy of a Gaussian against a unit box, and the uniform share.
        let expected = -1.5 * (TAU * s * s * std::f64::consts::E).log2() + (1.0 - UNIFORM).log2();
        assert!((score.bits - expected).abs() < 4.0 * score.error, "{} {expected} {}", score.bits, score.error);
        assert!(score.error < 0.03 && score.needles == 0.0 && score.missed == 0.0);
    }

    #[test]
    fn a_model_that_misses_costs_ten_bits_and_needles_are_counted() {
        let needle = Sym3([4e-4, 0.0, 0.0, 1e-5, 0.0, 1e-5]);
        let model = model_of(&[([0.5; 3], needle, 1000.0)], BOX.length);
        let score = likelihood(&model, &cloud(1000, 0.03, 3), &BOX, 1, &Context::SILENT).unwrap();
        assert!((score.bits - UNIFORM.log2()).abs() < 0.01 && score.missed == 1.0 && score.needles == 1.0);
    }

    #[test]
    fn the_density_at_points_is_the_sum_of_the_gaussians() {
        let round = Sym3::scaled_identity(0.05f64.powi(2));
        let model = model_of(&[([0.02, 0.5, 0.5], round, 1000.0), ([0.5; 3], round, 500.0)], BOX.length);
        // On the first mean, on the second, across the seam from the first, nowhere near.
        let places = [[0.02, 0.5, 0.5], [0.5; 3], [0.97, 0.5, 0.5], [0.5, 0.0, 0.0]];
        let densities = density_at(&BOX, &model, &places, &Context::SILENT).unwrap();
        let peak = (TAU * 0.05f64.powi(2)).powf(-1.5);
        for (got, want) in densities.iter().zip([1000.0 * peak, 500.0 * peak, 1000.0 * peak * (-0.5f64).exp(), 0.0]) {
            assert!((got - want).abs() <= 1e-9 * peak * 1000.0, "{got} {want}");
        }
        assert!(density_at(&BOX, &model, &[[0.0, f64::NAN, 0.0]], &Context::SILENT).is_err());
        assert!(density_at(&BOX, &model, &[], &Context::SILENT).unwrap().is_empty());
    }

    #[test]
    fn a_field_at_points_is_the_mean_of_the_gaussians_weighted_by_their_densities() {
        let round = Sym3::scaled_identity(0.05f64.powi(2));
        let mut model = model_of(&[([0.02, 0.5, 0.5], round, 1000.0), ([0.1, 0.5, 0.5], round, 500.0)], BOX.length);
        let field = FieldMoments {
            mean: vec![vec![10.0, 40.0]],
            slope: vec![[vec![100.0, 0.0], vec![0.0; 2], vec![0.0; 2]]],
            spread: vec![vec![4.0, 9.0]],
            range: vec![[-1e3, 1e3]],
            ..FieldMoments::new(1)
        };
        model.layers[0].content[0].gaussians.fields.set("heat", field);
        let x = [0.06, 0.5, 0.5];
        let field_values = field_at(&BOX, &model, "heat", &[x, [0.5, 0.0, 0.0]], &Context::SILENT).unwrap();
        // Both means are equally far: two thirds of the particles belong to the first, which has 10 + 100 0.04 there.
        let (mean, square) = ((2.0 * 14.0 + 40.0) / 3.0, (2.0 * (14.0 * 14.0 + 4.0) + 1600.0 + 9.0) / 3.0);
        assert!((field_values.mean[0][0] - mean).abs() < 1e-9, "{}", field_values.mean[0][0]);
        assert!((field_values.dispersion[0][0] - f64::sqrt(square - mean * mean)).abs() < 1e-9);
        assert!(field_values.mean[0][1].is_nan() && field_values.dispersion[0][1].is_nan());
        assert!(field_at(&BOX, &model, "none", &[x], &Context::SILENT).is_err());
    }
}
