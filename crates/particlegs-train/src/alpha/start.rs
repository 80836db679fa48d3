//! The start of training: particles at random as published, a mixture of the optical-depth law, or a
//! model of this law.

use super::config::AlphaConfig;
use super::learner::AlphaLearner;
use super::parameters::{AlphaParameters, GaussianParameters, Gaussians, LEAST_SQUARE, TrainingScale, feature, logit};
use super::steps::AlphaCpuSteps;
use crate::accelerator::TrainingSubject;
use particlegs_core::math::{Purpose, Random, Sym3, each_axis};
use particlegs_core::model::{Mixture, Model, VizMapper};
use particlegs_core::splat::opacity_integral;
use particlegs_core::{Error, Result, parallel};
use std::collections::BTreeSet;

/// Opacity at first (3DGS, `create_from_pcd`).
const FIRST_OPACITY: f64 = 0.1;

/// Opacities that start from depths lie between these: below, a Gaussian could not be seen and so
/// not be trained; above, it would stop all that is behind it.
const OPACITIES: [f64; 2] = [0.02, 0.95];

impl AlphaLearner {
    /// `number` particles at random, each a round Gaussian as large as its three nearest neighbours
    /// among them are far, white, of opacity 0.1 (docs/law/published.md, "Training").
    pub(crate) fn from_particles(
        subject: &dyn TrainingSubject,
        number: usize,
        scale: TrainingScale,
        config: AlphaConfig,
    ) -> Result<Self> {
        if subject.is_empty() || number == 0 {
            return Err(Error::argument("training needs at least one particle and one Gaussian to start from"));
        }
        let f = &scale.frame;
        let points: Vec<[f64; 3]> = sample(subject.len(), number, scale.seed)
            .into_iter()
            .map(|i| {
                let p = subject.position(i);
                each_axis(|k| (p[k] - f.center[k]) * f.scale)
            })
            .collect();
        let mut parameters = AlphaParameters::default();
        for (position, square) in points.iter().zip(mean_square_of_three(&points)) {
            parameters.push(&GaussianParameters {
                position: *position,
                log_scale: [0.5 * square.max(LEAST_SQUARE).ln(); 3],
                rotation: [1.0, 0.0, 0.0, 0.0],
                logit: logit(FIRST_OPACITY),
                feature: feature(1.0),
            });
        }
        Self::new(parameters, None, scale, config)
    }

    /// The Gaussians of an optical-depth mixture. Particles have the default radius there, so the
    /// covariance grows by its square; the opacity is `1 - exp(-tau)` with tau the depth at the peak at
    /// default radius and opacity, for a Gaussian of the same volume that is round, between 0.02 and
    /// 0.95; white.
    pub(crate) fn from_mixture(mixture: &Mixture, scale: TrainingScale, config: AlphaConfig) -> Result<Self> {
        let r2 = scale.radius * scale.radius;
        let mut parameters = AlphaParameters::default();
        for i in 0..mixture.len() {
            let cov = mixture.cov_of(i).add(&Sym3::scaled_identity(r2));
            // The variance of a round Gaussian of the same volume, in any direction.
            let area = cov.det().cbrt();
            let tau = mixture.count[i] * opacity_integral(scale.opacity) * r2 / (2.0 * std::f64::consts::PI * area);
            let opacity = (-(-tau).exp_m1()).clamp(OPACITIES[0], OPACITIES[1]);
            parameters.push(&GaussianParameters::from_world(&scale.frame, mixture.mean_of(i), &cov, opacity, 1.0));
        }
        Self::new(parameters, None, scale, config)
    }

    /// The Gaussians and the network of a model of this law, as they are; the network gets the
    /// configured ranges.
    pub(crate) fn from_model(model: &Model, scale: TrainingScale, config: AlphaConfig) -> Result<Self> {
        let mut parameters = AlphaParameters::default();
        model.blocks().try_for_each(|b| parameters.push_mixture(&b.gaussians, &scale.frame))?;
        Self::new(parameters, model.vizmapper().map(|v| VizMapper::clone(v)), scale, config)
    }

    fn new(
        parameters: AlphaParameters,
        mapper: Option<VizMapper>,
        scale: TrainingScale,
        config: AlphaConfig,
    ) -> Result<Self> {
        if parameters.is_empty() {
            return Err(Error::argument("training needs at least one Gaussian to start from"));
        }
        if let Some((i, group)) = super::pass::faults(&parameters, &AlphaParameters::default()).first() {
            return Err(Error::argument(format!("Gaussian {i}: its {} is not finite", group.name())));
        }
        let mapper = config.vizmapper.then(|| match mapper {
            Some(m) => VizMapper { ranges: config.ranges, ..m },
            None => VizMapper::new(config.ranges, scale.seed),
        });
        let gaussians = Gaussians::new(parameters, mapper, scale);
        Ok(AlphaLearner { config, gaussians, steps: Box::new(AlphaCpuSteps::default()) })
    }
}

/// `number` different of `n`, in ascending order (Floyd's algorithm).
fn sample(n: usize, number: usize, seed: u64) -> Vec<usize> {
    let number = number.min(n);
    let mut chosen = BTreeSet::new();
    for (draw, last) in (n - number..n).enumerate() {
        let at = (Random::from_purpose(Purpose::AlphaStart, seed, draw as u64).uniform() * (last + 1) as f64) as usize;
        // `uniform` is below 1, but its product can still round up to `last + 1`.
        if !chosen.insert(at.min(last)) {
            chosen.insert(last);
        }
    }
    chosen.into_iter().collect()
}

/// Points in a leaf of the k-d tree, which lies in the order of its points.
const LEAF: usize = 8;

/// The mean squared distance of every point to its three nearest others (3DGS, `distCUDA2`); of
/// fewer points, to those there are.
fn mean_square_of_three(points: &[[f64; 3]]) -> Vec<f64> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    arrange(points, &mut order, 0);
    parallel::map_range(points.len(), |i| {
        let mut best = [f64::INFINITY; 3];
        search(points, &order, 0, points[i], i as u32, &mut best);
        let squares: Vec<f64> = best.into_iter().filter(|d| d.is_finite()).collect();
        if squares.is_empty() { 0.0 } else { squares.iter().sum::<f64>() / squares.len() as f64 }
    })
}

/// The middle of every part divides it along its axis; axes take turns.
fn arrange(points: &[[f64; 3]], order: &mut [u32], axis: usize) {
    if order.len() <= LEAF {
        return;
    }
    let middle = order.len() / 2;
    let key = |i: &u32| points[*i as usize][axis];
    order.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let (low, high) = order.split_at_mut(middle);
    parallel::join(|| arrange(points, low, (axis + 1) % 3), || arrange(points, &mut high[1..], (axis + 1) % 3));
}

fn search(points: &[[f64; 3]], order: &[u32], axis: usize, at: [f64; 3], own_index: u32, best: &mut [f64; 3]) {
    if order.len() <= LEAF {
        order.iter().for_each(|i| consider(points, *i, at, own_index, best));
        return;
    }
    let middle = order.len() / 2;
    consider(points, order[middle], at, own_index, best);
    let beyond = at[axis] - points[order[middle] as usize][axis];
    let (low, high) = (&order[..middle], &order[middle + 1..]);
    let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
    search(points, near, (axis + 1) % 3, at, own_index, best);
    // If the dividing plane is farther away than the third best, so is everything behind it.
    if beyond * beyond < best[2] {
        search(points, far, (axis + 1) % 3, at, own_index, best);
    }
}

fn consider(points: &[[f64; 3]], i: u32, at: [f64; 3], own_index: u32, best: &mut [f64; 3]) {
    if i != own_index {
        let p = points[i as usize];
        let d = (0..3).map(|k| (p[k] - at[k]).powi(2)).sum::<f64>();
        if d < best[2] {
            best[2] = d;
            best.sort_by(f64::total_cmp);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    #[test]
    fn agrees_with_all_pairs() {
        let points: Vec<[f64; 3]> = (0..500)
            .map(|i| {
                let mut r = Random::new(1, 2, i);
                // Some coincide, some share a coordinate.
                [0; 3].map(|_| if i % 3 == 0 { (4.0 * r.uniform()).floor() } else { 4.0 * r.uniform() })
            })
            .collect();
        for (i, mean_square) in mean_square_of_three(&points).into_iter().enumerate() {
            let mut all: Vec<f64> = (0..points.len())
                .filter(|j| *j != i)
                .map(|j| (0..3).map(|k| (points[j][k] - points[i][k]).powi(2)).sum())
                .collect();
            all.sort_by(f64::total_cmp);
            assert!((mean_square - (all[0] + all[1] + all[2]) / 3.0).abs() < 1e-12);
        }
        assert_eq!(mean_square_of_three(&[[1.0; 3]]), [0.0]);
    }
}
