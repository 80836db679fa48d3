//! Gaussians of the alpha-blend law in training: the numbers that steps move, and the scale of their snapshot.

use super::parameters::{AlphaParameters, GROUPS, ParameterGroup};
use crate::adam::Averages;
use crate::learner::TrainingSample;
use particlegs_core::Result;
use particlegs_core::camera::Normalisation;
use particlegs_core::model::{Mixture, VIZMAPPER_PARAMETERS, VizMapper};
use particlegs_core::render::alpha::Eye;
use particlegs_core::render::alpha::network::Setting;

/// Properties of the snapshot that a learner needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingScale {
    pub frame: Normalisation,
    /// Default radius, world units.
    pub radius: f64,
    /// Default opacity.
    pub opacity: f64,
    /// Particles that the Gaussians stand for.
    pub particles: u64,
    pub seed: u64,
}

/// Gaussians in training with their network, and what Adam and density control remember of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussians {
    pub scale: TrainingScale,
    pub parameters: AlphaParameters,
    /// Adam's, a group each.
    pub averages: [Averages; GROUPS],
    pub mapper: Option<VizMapper>,
    pub mapper_averages: Averages,
    /// Of each Gaussian since the last densification: sizes of the changes with its centre on the picture, and in
    /// how many pictures it was seen.
    pub screen: Vec<[f32; 2]>,
}

impl Gaussians {
    /// Before the first step.
    pub(super) fn new(parameters: AlphaParameters, mapper: Option<VizMapper>, scale: TrainingScale) -> Self {
        let n = parameters.len();
        Gaussians {
            scale,
            averages: ParameterGroup::ALL.map(|g| Averages::zeros(n * g.width())),
            mapper_averages: Averages::zeros(if mapper.is_some() { VIZMAPPER_PARAMETERS } else { 0 }),
            screen: vec![[0.0; 2]; n],
            parameters,
            mapper,
        }
    }

    /// The network's setting for a picture: radius and opacity over the defaults.
    pub fn setting(&self, sample: &TrainingSample<'_>) -> Setting {
        let TrainingScale { radius, opacity, .. } = self.scale;
        Setting { radius: sample.view.radius / radius, opacity: sample.view.opacity / opacity }
    }

    /// The camera of a sample in the training frame.
    pub fn eye(&self, sample: &TrainingSample<'_>) -> Result<Eye> {
        Ok(Eye::new(sample.view, sample.crop.full, &self.scale.frame)?.part(sample.crop.corner, sample.crop.size))
    }

    /// Those of a mixture of this law as they are, and its network where it has one, before the first step.
    pub fn from_mixture(mixture: &Mixture, scale: TrainingScale) -> Result<Self> {
        let mut parameters = AlphaParameters::default();
        parameters.push_mixture(mixture, &scale.frame)?;
        let network = mixture.law.alpha_blend().and_then(|law| law.vizmapper.as_deref().cloned());
        Ok(Gaussians::new(parameters, network, scale))
    }
}
