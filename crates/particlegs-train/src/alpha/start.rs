//! Where training starts: particles at random as published, a mixture of the optical-depth law, or a
//! model of this law.

use super::config::AlphaConfig;
use super::learner::AlphaLearner;
use super::nearest::mean_square_of_three;
use super::parameters::{AlphaParameters, GaussianParameters, SH0, quaternion};
use super::steps::Gaussians;
use crate::subject::TrainingSubject;
use particlegs_core::camera::Normalisation;
use particlegs_core::math::{Purpose, Random, Sym3, each_axis};
use particlegs_core::model::{Mixture, Model, VizMapper};
use particlegs_core::splat::opacity_integral;
use particlegs_core::{Error, Result};
use std::collections::BTreeSet;

/// Opacity at first (3DGS, `create_from_pcd`).
const FIRST_OPACITY: f64 = 0.1;

/// Squared distances are taken as no smaller (3DGS).
const LEAST_SQUARE: f64 = 1e-7;

/// Opacities that start from depths lie between these: below, a Gaussian could not be seen and so
/// not be trained; above, it would stop all that is behind it.
const OPACITIES: [f64; 2] = [0.02, 0.95];

/// What a learner must know of its snapshot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingScale {
    /// The training frame.
    pub frame: Normalisation,
    /// Default radius, world units.
    pub radius: f64,
    /// Default opacity.
    pub opacity: f64,
    /// Particles that the Gaussians stand for.
    pub particles: u64,
    /// Of all draws.
    pub seed: u64,
}

impl AlphaLearner {
    /// `number` particles at random, each a round Gaussian as large as its three nearest neighbours
    /// among them are far, white, of opacity 0.1 (docs/law/published.md, "Training").
    pub(crate) fn from_particles(
        subject: &dyn TrainingSubject,
        number: usize,
        ground: TrainingScale,
        config: AlphaConfig,
    ) -> Result<Self> {
        if subject.is_empty() || number == 0 {
            return Err(Error::argument("training starts from one particle at least"));
        }
        let f = &ground.frame;
        let points: Vec<[f64; 3]> = sample(subject.len(), number, ground.seed)
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
        Self::new(parameters, None, ground, config)
    }

    /// The Gaussians of an optical-depth mixture. Particles have the default radius there, so the
    /// covariance grows by its square; the opacity is `1 - exp(-tau)` with tau the depth at the peak at
    /// default radius and opacity, for a Gaussian of the same volume that is round, between 0.02 and
    /// 0.95; white.
    pub(crate) fn from_mixture(mixture: &Mixture, ground: TrainingScale, config: AlphaConfig) -> Result<Self> {
        let r2 = ground.radius * ground.radius;
        let mut parameters = AlphaParameters::default();
        for i in 0..mixture.len() {
            let cov = mixture.cov_of(i).add(&Sym3::scaled_identity(r2));
            let area = cov.det().cbrt();
            let tau = mixture.count[i] * opacity_integral(ground.opacity) * r2 / (2.0 * std::f64::consts::PI * area);
            let opacity = (-(-tau).exp_m1()).clamp(OPACITIES[0], OPACITIES[1]);
            parameters.push(&one(&ground.frame, mixture.mean_of(i), &cov, opacity, 1.0));
        }
        Self::new(parameters, None, ground, config)
    }

    /// The Gaussians and the network of a model of this law, as they are; the network gets the
    /// configured ranges.
    pub(crate) fn from_model(model: &Model, ground: TrainingScale, config: AlphaConfig) -> Result<Self> {
        let mut parameters = AlphaParameters::default();
        model.blocks().try_for_each(|b| push_all(&mut parameters, &b.gaussians, &ground.frame))?;
        Self::new(parameters, model.vizmapper().map(|v| VizMapper::clone(v)), ground, config)
    }

    fn new(
        parameters: AlphaParameters,
        mapper: Option<VizMapper>,
        ground: TrainingScale,
        config: AlphaConfig,
    ) -> Result<Self> {
        if parameters.is_empty() {
            return Err(Error::argument("training starts from one Gaussian at least"));
        }
        if let Some((i, group)) = super::pass::faults(&parameters, &AlphaParameters::default()).first() {
            return Err(Error::argument(format!("Gaussian {i}: its {} is not finite", group.name())));
        }
        let mapper = config.vizmapper.then(|| match mapper {
            Some(m) => VizMapper { ranges: config.ranges, ..m },
            None => VizMapper::new(config.ranges, ground.seed),
        });
        Ok(Self::of(parameters, mapper, ground, config))
    }
}

impl Gaussians {
    /// Those of a mixture of this law as they are, and its network where it has one, before the first step.
    pub fn of_mixture(mixture: &Mixture, ground: TrainingScale) -> Result<Self> {
        let mut parameters = AlphaParameters::default();
        push_all(&mut parameters, mixture, &ground.frame)?;
        let network = mixture.law.alpha_blend().and_then(|own| own.vizmapper.as_deref().cloned());
        Ok(Gaussians::new(parameters, network, ground))
    }
}

/// Adds the Gaussians of a mixture of this law.
fn push_all(parameters: &mut AlphaParameters, m: &Mixture, frame: &Normalisation) -> Result<()> {
    let own = m.law.alpha_blend().ok_or_else(|| Error::argument("the model is not of the alpha-blend law"))?;
    for i in 0..m.len() {
        parameters.push(&one(frame, m.mean_of(i), &m.cov_of(i), own.opacity[i], own.grey[i]));
    }
    Ok(())
}

/// A Gaussian in world units as parameters.
fn one(frame: &Normalisation, mean: [f64; 3], cov: &Sym3, opacity: f64, grey: f64) -> GaussianParameters {
    let e = cov.scale(frame.scale * frame.scale).eigen();
    let mut axes = e.vectors;
    let [a, b, c] = axes;
    let triple =
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    if triple < 0.0 {
        axes[2] = c.map(|v| -v);
    }
    GaussianParameters {
        position: each_axis(|k| (mean[k] - frame.center[k]) * frame.scale),
        // Not the maximum of the two: a value that is not a number must be seen.
        log_scale: e.values.map(|v| if v < LEAST_SQUARE { LEAST_SQUARE } else { v }.ln() * 0.5),
        rotation: quaternion(axes),
        logit: logit(opacity.clamp(1e-6, 1.0 - 1e-6)),
        feature: feature(grey),
    }
}

fn logit(opacity: f64) -> f64 {
    (opacity / (1.0 - opacity)).ln()
}

fn feature(grey: f64) -> f64 {
    (grey - 0.5) / SH0
}

/// `number` different of `n`, in ascending order (Floyd's algorithm).
fn sample(n: usize, number: usize, seed: u64) -> Vec<usize> {
    let number = number.min(n);
    let mut chosen = BTreeSet::new();
    for (draw, last) in (n - number..n).enumerate() {
        let at = (Random::of(Purpose::AlphaStart, seed, draw as u64).uniform() * (last + 1) as f64) as usize;
        if !chosen.insert(at.min(last)) {
            chosen.insert(last);
        }
    }
    chosen.into_iter().collect()
}
