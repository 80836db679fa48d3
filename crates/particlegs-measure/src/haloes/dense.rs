//! The part of a model that haloes are found in: Gaussians where it is dense.

use crate::stats::GaussianSpheres;
use particlegs_core::context::Context;
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
