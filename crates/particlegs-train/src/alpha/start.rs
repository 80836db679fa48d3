//! The start of training: particles at random as published, a mixture of the optical-depth law, or a
//! model of this law.

use super::config::AlphaConfig;
use super::learner::AlphaLearner;
use super::nearest::mean_square_of_three;
use super::parameters::{AlphaParameters, GaussianParameters, LEAST_SQUARE, feature, logit};
use super::state::{Gaussians, TrainingScale};
use super::steps::AlphaCpuSteps;
use crate::subject::TrainingSubject;
use particlegs_core::math::{Purpose, Random, Sym3, each_axis};
use particlegs_core::model::{Mixture, Model, VizMapper};
use particlegs_core::splat::opacity_integral;
use particlegs_core::{Error, Result};
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
        if !chosen.insert(at.min(last)) {
            chosen.insert(last);
        }
    }
    chosen.into_iter().collect()
}
