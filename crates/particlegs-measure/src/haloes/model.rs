//! Haloes of a model: the Gaussians among which they are found, and their masses by integration over all of them.

use super::overdensity::Overdensity;
use super::sphere::DensitySphere;
use crate::stats::{EnclosedMass, GaussianSpheres};
use particlegs_core::context::Context;
use particlegs_core::math::Ball;
use particlegs_core::model::{Block, Mixture, Model};
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::Domain;
use std::f64::consts::TAU;

/// Least density at a Gaussian's mean, of all Gaussians together, over the mean of the box: half of the density at
/// which particles are linked at a fifth of their spacing ([`LINKING`]). Haloes on nbody128 are as good with 8 or 20.
const LEAST_DENSITY: f64 = 40.0;
const LINKING: f64 = 0.2;

/// The model, to be linked at `linking` mean spacings, without particles of Gaussians whose means lie where it is thin.
/// `None` = all stay: where particles are of several types or masses, which tell zooms, and where none is dense.
pub fn dense_part(
    m: &Model,
    spheres: &GaussianSpheres,
    (domain, linking): (&Domain, f64),
    context: &Context<'_>,
) -> Result<Option<Model>> {
    let [layer] = &m.layers[..] else { return Ok(None) };
    if layer.mass.is_weighted() {
        return Ok(None);
    }
    let unit = layer.mass.unit_or_one();
    // Longer links join particles where it is thinner.
    let least = LEAST_DENSITY * (LINKING / linking).powi(3).min(1.0) * unit * layer.count() as f64 / domain.volume();
    let mut part = m.clone();
    context.begin("dense Gaussians", m.gaussians() as u64);
    for Block { count, mass, gaussians, .. } in part.layers.iter_mut().flat_map(|l| &mut l.content) {
        let is_dense = |g: &Mixture, i: usize| {
            context.check()?;
            context.advance(1);
            // Most are dense enough alone.
            let alone = unit * g.count[i] / (TAU.powi(3) * g.cov_of(i).det()).sqrt();
            Ok::<_, Error>(alone >= least || spheres.is_dense(domain.local(g.mean_of(i)), least, context)?)
        };
        let dense = parallel::try_map_range(gaussians.len(), |i| is_dense(gaussians, i))?;
        gaussians.count.iter_mut().zip(dense).filter(|(_, dense)| !dense).for_each(|(count, _)| *count = 0.0);
        let total: f64 = gaussians.count.iter().sum();
        (*count, *mass) = (total as u64, total);
    }
    context.end();
    Ok((part.layers[0].count() > 0).then_some(part))
}

/// Steps of the logarithm of the radius in which masses are integrated, and the most of them.
const CURVE_STEP: f64 = 0.3;
const MOST_STEPS: f64 = 32.0;
/// Reach of the curve beyond the spheres of drawn particles, as a factor, at first; and the most curves, each further.
const CURVE_REACH: f64 = 1.2;
const CURVES: usize = 4;
/// Numbers of densities.
pub const SPHERES: usize = Overdensity::ALL.len();

/// A sphere, and the error of its mass, of a model.
#[derive(Clone, Copy)]
pub struct HaloSphere {
    pub sphere: DensitySphere,
    pub error: f64,
}

/// Logarithms of masses inside spheres, and of radii: between them, a parabola through the three nearest.
struct MassCurve {
    /// Logarithm of the first radius, and the distance of each from the last.
    first: f64,
    step: f64,
    /// Logarithms of the masses.
    masses: Vec<f64>,
    inside: Vec<EnclosedMass>,
}

impl MassCurve {
    /// By integration over Gaussians, from one radius to another, outside the balls `excluded`.
    fn new(
        model: &GaussianSpheres,
        (center, excluded): ([f64; 3], &[Ball]),
        ends: [f64; 2],
        context: &Context<'_>,
    ) -> Result<MassCurve> {
        let [first, last] = ends.map(libm::log);
        let number = ((last - first) / CURVE_STEP).ceil().clamp(2.0, MOST_STEPS);
        let step = (last - first) / number;
        let radii: Vec<f64> = (0..=number as usize).map(|i| libm::exp(first + step * i as f64)).collect();
        let inside = model.enclosed(center, &radii, excluded, context)?;
        let masses = inside.iter().map(|inside| libm::log(inside.mass.max(f64::MIN_POSITIVE))).collect();
        Ok(MassCurve { first, step, masses, inside })
    }

    /// The sphere in which the mass first falls to `per_cube` times the cube of the radius, and the error of its mass.
    fn sphere(&self, per_cube: f64) -> Option<HaloSphere> {
        let excess = |i: usize| self.masses[i] - 3.0 * (self.first + self.step * i as f64) - libm::log(per_cube);
        // Small spheres about a density peak may hold less.
        let above = (1..self.masses.len()).find(|i| excess(*i) < 0.0 && excess(i - 1) >= 0.0)?;
        // The parabola about the middle of the three nodes, in steps.
        let middle = above.min(self.masses.len() - 2);
        let [low, at, high] = [middle - 1, middle, middle + 1].map(excess);
        let (slope, curve) = (0.5 * (high - low), high - 2.0 * at + low);
        let (mut from, mut to) = ((above - 1) as f64 - middle as f64, above as f64 - middle as f64);
        // Forty halvings leave 1e-12 of a step.
        for _ in 0..40 {
            let x = 0.5 * (from + to);
            *(if at + slope * x + 0.5 * curve * x * x < 0.0 { &mut to } else { &mut from }) = x;
        }
        let x = 0.5 * (from + to);
        let radius = libm::exp(self.first + self.step * (middle as f64 + x));
        let [inner, outer] = [self.inside[above - 1], self.inside[above]];
        let variance = inner.variance + (outer.variance - inner.variance) * (x - (above - 1) as f64 + middle as f64);
        // A mass that is larger by a share makes the sphere larger, too.
        let steepness = -(slope + curve * x) / (3.0 * self.step);
        // Where the curve is flat, a small error of the mass would move the sphere without end.
        let error = variance.max(0.0).sqrt() / steepness.max(0.2);
        let mass = per_cube * radius.powi(3);
        let count = (mass * (outer.number / outer.mass)).round() as usize;
        Some(HaloSphere { sphere: DensitySphere { radius, mass, count }, error })
    }
}

/// Spheres of mean densities by integration over Gaussians, near those of drawn particles. They are about a centre, and
/// what lies in the balls beside it, counted from there, is left out.
pub fn integrated(
    model: &GaussianSpheres,
    about: ([f64; 3], &[Ball]),
    counted: [Option<DensitySphere>; SPHERES],
    per_cube: [Option<f64>; SPHERES],
    context: &Context<'_>,
) -> Result<[Option<HaloSphere>; SPHERES]> {
    let radii = || counted.iter().flatten().map(|s| s.radius);
    let (smallest, largest) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
    let mut spheres = [None; SPHERES];
    // Drawn particles scatter, so the sphere of the Gaussians may lie beyond theirs.
    let mut reach = CURVE_REACH;
    for _ in 0..CURVES {
        if largest <= 0.0 {
            break;
        }
        let curve = MassCurve::new(model, about, [smallest / reach, largest * reach], context)?;
        spheres = std::array::from_fn(|k| counted[k].and_then(|_| curve.sphere(per_cube[k]?)));
        if (0..SPHERES).all(|k| spheres[k].is_some() || counted[k].is_none()) {
            break;
        }
        reach *= CURVE_REACH;
    }
    Ok(spheres)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::haloes::{HaloCatalogue, HaloOptions, find_haloes};
    use crate::stats::Subject;
    use particlegs_core::math::{Random, Sym3, each_axis};
    use particlegs_fit::recover::Options as RecoverOptions;
    use particlegs_particles::testing::model_of;

    #[test]
    fn haloes_of_the_dense_part_are_those_of_all_particles() {
        let mut r = Random::new(8, 0, 0);
        let mut anywhere = || each_axis(|_| 10.0 * r.uniform());
        let mut all: Vec<_> = (0..100).map(|_| (anywhere(), Sym3::scaled_identity(1.0), 80.0)).collect();
        let clouds = [([2.0; 3], 2000.0), ([7.0, 2.0, 5.0], 800.0), ([9.9, 8.0, 1.0], 500.0)];
        all.extend(clouds.map(|(center, n)| (center, Sym3::scaled_identity(0.01), n)));
        let model = model_of(&all, [10.0; 3]);
        let domain = Domain::from_model(&model);
        let spheres = GaussianSpheres::new(&model, &domain, 0.0).unwrap();
        let part = |linking| dense_part(&model, &spheres, (&domain, linking), &Context::SILENT).unwrap().unwrap();
        assert_eq!(part(0.2).layers[0].count(), 3300);
        assert_eq!(part(1.0).layers[0].count(), 11_300);
        let particles = RecoverOptions::default().draw(model.clone(), &Context::SILENT).unwrap();
        let haloes_of = |source| find_haloes(source, &HaloOptions::default(), &Context::SILENT).unwrap();
        let (model_haloes, drawn_haloes) =
            (haloes_of(Subject::Model(&model)), haloes_of(Subject::Particles(&particles)));
        let number = |c: &HaloCatalogue, i: usize| c.column("n200m").unwrap()[i];
        for i in 0..clouds.len() {
            let away = domain.shortest_way(each_axis(|k| model_haloes.centers[i][k] - drawn_haloes.centers[i][k]));
            assert!(away.iter().all(|d| d.abs() < 0.1), "{away:?}");
            assert!((number(&model_haloes, i) / number(&drawn_haloes, i) - 1.0).abs() < 0.05);
        }
        assert!(number(&model_haloes, 2) > 400.0 && model_haloes.len() >= 3);
    }
}
