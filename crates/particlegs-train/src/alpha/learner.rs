//! The alpha-blend law as something to be trained.

use super::config::AlphaConfig;
use super::parameters::{AlphaParameters, GROUPS, Gaussians, ParameterGroup, TrainingScale};
use super::steps::{AlphaStepper, StepSize};
use crate::adam::Averages;
use crate::learner::{Learner, StepInfo, StepReport, TrainingSample};
use crate::loss::Loss;
use crate::state::TrainingState;
use particlegs_core::Result;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::{AlphaBlend, Law, Mixture, VIZMAPPER_PARAMETERS};
use std::sync::Arc;

pub(crate) struct AlphaLearner {
    pub(super) config: AlphaConfig,
    pub(super) gaussians: Gaussians,
    pub(super) steps: Box<dyn AlphaStepper>,
}

impl AlphaLearner {
    /// The same learner with the steps that `steps` gives for its Gaussians.
    pub fn by(self, steps: impl FnOnce(&Gaussians) -> Result<Box<dyn AlphaStepper>>) -> Result<Self> {
        Ok(AlphaLearner { steps: steps(&self.gaussians)?, ..self })
    }

    /// Adam's rate of a group in a step, counted from 1.
    fn rate(&self, group: ParameterGroup, step: u64) -> f64 {
        match group {
            ParameterGroup::Position => self.config.position_rate_at(step),
            ParameterGroup::Scale => self.config.scale_rate,
            ParameterGroup::Rotation => self.config.rotation_rate,
            ParameterGroup::Opacity => self.config.opacity_rate,
            ParameterGroup::Feature => self.config.feature_rate,
        }
    }
}

impl Learner for AlphaLearner {
    fn step(&mut self, sample: &TrainingSample<'_>, loss: &Loss, at: &StepInfo) -> Result<StepReport> {
        let c = &self.config;
        let size = StepSize {
            rates: ParameterGroup::ALL.map(|g| self.rate(g, at.iteration + 1)),
            network: c.vizmapper_rate,
            clip: c.vizmapper_clip,
            identity: c.identity,
        };
        self.steps.step(&mut self.gaussians, sample, loss, &size)
    }

    fn control(&mut self, at: &StepInfo) -> Result<()> {
        if self.due(at) {
            self.steps.fetch(&mut self.gaussians)?;
            self.densify(at);
            self.steps.changed();
        }
        Ok(())
    }

    fn fetch(&mut self) -> Result<()> {
        self.steps.fetch(&mut self.gaussians)
    }

    fn len(&self) -> usize {
        self.gaussians.parameters.len()
    }

    fn mixture(&self) -> Mixture {
        let (mut mixture, gaussians) = (Mixture::default(), &self.gaussians);
        let mut law = AlphaBlend { vizmapper: gaussians.mapper.clone().map(Arc::new), ..AlphaBlend::default() };
        let TrainingScale { frame, particles, .. } = gaussians.scale;
        let sum: f64 = (0..self.len()).map(|i| gaussians.parameters.get(i).opacity()).sum();
        for i in 0..self.len() {
            let one = gaussians.parameters.get(i);
            let mean = each_axis(|k| frame.center[k] + one.position[k] / frame.scale);
            let cov = Sym3(one.cov().0.map(|v| v / (frame.scale * frame.scale)));
            // The law has no counts: particles go by opacity, as in the published recovery (docs/law/published.md).
            let count = particles as f64 * one.opacity() / sum;
            mixture.push(mean, cov, count, count);
            law.opacity.push(one.opacity());
            law.grey.push(one.grey());
        }
        mixture.law = Law::AlphaBlend(law);
        mixture
    }

    fn state(&self) -> TrainingState {
        let (mut state, gaussians) = (TrainingState::default(), &self.gaussians);
        let mut column = |name: String, v: &[f32]| state.columns.insert(name, v.to_vec());
        for g in ParameterGroup::ALL {
            let (name, averages) = (g.name(), &gaussians.averages[g as usize]);
            column(name.to_string(), &gaussians.parameters.0[g as usize]);
            column(format!("{name}.first"), &averages.first);
            column(format!("{name}.second"), &averages.second);
        }
        if let Some(m) = &gaussians.mapper {
            column("vizmapper".into(), &m.parameters);
            column("vizmapper.first".into(), &gaussians.mapper_averages.first);
            column("vizmapper.second".into(), &gaussians.mapper_averages.second);
        }
        column("screen".into(), gaussians.screen.as_flattened());
        let steps = gaussians.averages.iter().chain([&gaussians.mapper_averages]).map(|a| a.steps as f64).collect();
        state.numbers.insert("steps".into(), steps);
        state
    }

    fn restore(&mut self, state: &TrainingState) -> std::result::Result<(), String> {
        let n = state.columns.get(ParameterGroup::Opacity.name()).ok_or("it has no column `opacity`")?.len();
        let steps = state.doubles("steps", GROUPS + 1)?;
        let averages = |name: &str, len: usize, steps: f64| -> std::result::Result<Averages, String> {
            let first = state.column(&format!("{name}.first"), len)?.to_vec();
            let second = state.column(&format!("{name}.second"), len)?.to_vec();
            Ok(Averages { first, second, steps: steps as u64 })
        };
        let mut parameters = AlphaParameters::default();
        let mut all = Vec::with_capacity(GROUPS);
        for g in ParameterGroup::ALL {
            let len = n * g.width();
            parameters.0[g as usize] = state.column(g.name(), len)?.to_vec();
            all.push(averages(g.name(), len, steps[g as usize])?);
        }
        let screen = state.column("screen", 2 * n)?;
        let network = match &self.gaussians.mapper {
            None => None,
            Some(_) => Some((
                state.column("vizmapper", VIZMAPPER_PARAMETERS)?.to_vec(),
                averages("vizmapper", VIZMAPPER_PARAMETERS, steps[GROUPS])?,
            )),
        };
        // All is there: nothing was changed until now.
        let all = all.try_into().map_err(|_| "it lacks parameter groups")?;
        if let (Some(m), Some((parameters, averages))) = (&mut self.gaussians.mapper, network) {
            m.parameters = parameters;
            self.gaussians.mapper_averages = averages;
        }
        self.gaussians.screen = screen.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
        self.gaussians.parameters = parameters;
        self.gaussians.averages = all;
        self.steps.changed();
        Ok(())
    }
}
