//! The alpha-blend law as something to be trained.

use super::config::AlphaConfig;
use super::parameters::{GROUPS, Group, Parameters};
use super::pass::{Mapper, Pass, faults};
use super::start::Ground;
use crate::adam::{Adam, Averages};
use crate::learner::{Learner, Moment, NotFinite, Shot, Stepped};
use crate::loss::Loss;
use crate::state::State;
use particlegs_core::Result;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::vizmapper::{Network, Setting};
use particlegs_core::model::{AlphaBlend, Law, Mixture, VIZMAPPER_PARAMETERS, VizMapper};
use particlegs_core::picture::Plane;
use particlegs_core::render::alpha::{CutOffs, Eye};
use std::sync::Arc;

/// 3DGS's Adam.
const ADAM: Adam = Adam { beta1: 0.9, beta2: 0.999, epsilon: 1e-15 };

/// PyTorch's default, which the network has.
const NETWORK_ADAM: Adam = Adam { beta1: 0.9, beta2: 0.999, epsilon: 1e-8 };

/// Gaussians of the alpha-blend law in training.
pub(crate) struct AlphaLearner {
    pub(super) config: AlphaConfig,
    pub(super) ground: Ground,
    pub(super) parameters: Parameters,
    pub(super) averages: [Averages; GROUPS],
    pub(super) mapper: Option<VizMapper>,
    pub(super) mapper_averages: Averages,
    /// Of each Gaussian since the last densification: sizes of the changes with its centre on the
    /// picture, and in how many pictures it was seen.
    pub(super) screen: Vec<[f32; 2]>,
    /// A gradient to be spoilt in the next step: group, Gaussian, number.
    #[cfg(test)]
    pub(super) spoil: Option<(Group, usize, f32)>,
}

impl AlphaLearner {
    /// Before the first step.
    pub(super) fn of(parameters: Parameters, mapper: Option<VizMapper>, ground: Ground, config: AlphaConfig) -> Self {
        let n = parameters.len();
        AlphaLearner {
            averages: Group::ALL.map(|g| Averages::zeros(n * g.width())),
            mapper_averages: Averages::zeros(if mapper.is_some() { VIZMAPPER_PARAMETERS } else { 0 }),
            screen: vec![[0.0; 2]; n],
            config,
            ground,
            parameters,
            mapper,
            #[cfg(test)]
            spoil: None,
        }
    }

    /// Adam's rate of a group in a step, counted from 1.
    fn rate(&self, group: Group, step: u64) -> f64 {
        match group {
            Group::Position => self.config.position_rate_at(step),
            Group::Scale => self.config.scale_rate,
            Group::Rotation => self.config.rotation_rate,
            Group::Opacity => self.config.opacity_rate,
            Group::Feature => self.config.feature_rate,
        }
    }

    /// Moves all Gaussians but those of `still`.
    fn descend(&mut self, gradient: &Parameters, still: &[(usize, Group)], step: u64) {
        for g in Group::ALL {
            let (rate, w) = (self.rate(g, step), g.width());
            let (values, averages) = (&mut self.parameters.0[g as usize], &mut self.averages[g as usize]);
            let rows = |v: &[f32]| still.iter().flat_map(|(i, _)| v[i * w..(i + 1) * w].to_vec()).collect::<Vec<f32>>();
            let kept = [rows(values), rows(&averages.first), rows(&averages.second)];
            ADAM.step(values, &gradient.0[g as usize], averages, rate);
            for (column, kept) in [values, &mut averages.first, &mut averages.second].into_iter().zip(&kept) {
                for ((i, _), kept) in still.iter().zip(kept.chunks(w)) {
                    column[i * w..(i + 1) * w].copy_from_slice(kept);
                }
            }
        }
    }

    /// Moves the network, its gradient cut to the largest norm. Is the gradient finite?
    fn descend_network(&mut self, mut gradient: Vec<f32>) -> bool {
        let Some(mapper) = &mut self.mapper else { return true };
        let norm = gradient.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        if !norm.is_finite() {
            return false;
        }
        let clip = self.config.vizmapper_clip;
        if clip > 0.0 && norm > clip {
            gradient.iter_mut().for_each(|v| *v *= (clip / norm) as f32);
        }
        NETWORK_ADAM.step(&mut mapper.parameters, &gradient, &mut self.mapper_averages, self.config.vizmapper_rate);
        true
    }
}

/// Brightness as it is shown, and the change with what was blended from that with what is shown.
fn shown(drawn: &Plane) -> Plane {
    Plane { size: drawn.size, data: drawn.data.iter().map(|b| b.clamp(0.0, 1.0)).collect() }
}

impl Learner for AlphaLearner {
    fn step(&mut self, shot: &Shot<'_>, loss: &Loss, at: &Moment) -> Result<Stepped> {
        let crop = &shot.crop;
        let eye = Eye::new(shot.view, crop.full, &self.ground.frame)?.part(crop.corner, crop.size);
        let setting =
            Setting { radius: shot.view.radius / self.ground.radius, opacity: shot.view.opacity / self.ground.opacity };
        let mapper = self.mapper.as_ref().map(|m| Mapper {
            network: Network::new(m),
            ranges: m.ranges,
            identity: self.config.identity,
        });
        let pass = Pass::new(&eye, &self.parameters, mapper.as_ref(), setting, CutOffs::PUBLISHED, shot.progress)?;
        let mut valued = loss.of(&shown(&pass.drawn), shot.target, shot.progress.simd());
        // Brightness beyond white is cut: nothing there moves it.
        let beyond = valued.gradient.data.iter_mut().zip(&pass.drawn.data);
        beyond.filter(|(_, b)| **b > 1.0).for_each(|(g, _)| *g = 0.0);
        #[cfg_attr(not(test), allow(unused_mut))]
        let mut gradient = pass.back(&valued.gradient);
        #[cfg(test)]
        if let Some((group, i, v)) = self.spoil.take() {
            gradient.parameters.0[group as usize][i * group.width()] = v;
        }
        let still = faults(&self.parameters, &gradient.parameters);
        let mut not_finite =
            still.first().map(|(i, g)| NotFinite { group: g.name(), gaussian: *i, count: still.len() });
        for (i, size) in &gradient.screen {
            if size.is_finite() {
                let s = &mut self.screen[*i as usize];
                *s = [s[0] + size, s[1] + 1.0];
            }
        }
        self.descend(&gradient.parameters, &still, at.iteration + 1);
        if let Some(g) = gradient.network
            && !self.descend_network(g)
        {
            not_finite = not_finite.or(Some(NotFinite { group: "vizmapper", gaussian: 0, count: 1 }));
        }
        // The picture's loss alone: what holds the network to the identity is no measure of it.
        Ok(Stepped { loss: valued.value, not_finite })
    }

    fn control(&mut self, at: &Moment) -> Result<()> {
        self.densify(at);
        Ok(())
    }

    fn len(&self) -> usize {
        self.parameters.len()
    }

    fn mixture(&self) -> Mixture {
        let mut mixture = Mixture::default();
        let mut law = AlphaBlend { vizmapper: self.mapper.clone().map(Arc::new), ..AlphaBlend::default() };
        let Ground { frame, particles, .. } = self.ground;
        let sum: f64 = (0..self.len()).map(|i| self.parameters.get(i).opacity()).sum();
        for i in 0..self.len() {
            let one = self.parameters.get(i);
            let mean = each_axis(|k| frame.center[k] + one.position[k] / frame.scale);
            let cov = Sym3(one.cov().0.map(|v| v / (frame.scale * frame.scale)));
            let count = particles as f64 * one.opacity() / sum;
            mixture.push(mean, cov, count, count);
            law.opacity.push(one.opacity());
            law.grey.push(one.grey());
        }
        mixture.law = Law::AlphaBlend(law);
        mixture
    }

    fn state(&self) -> State {
        let mut state = State::default();
        let mut column = |name: String, v: &[f32]| state.columns.insert(name, v.to_vec());
        for g in Group::ALL {
            let (name, averages) = (g.name(), &self.averages[g as usize]);
            column(name.to_string(), &self.parameters.0[g as usize]);
            column(format!("{name}.first"), &averages.first);
            column(format!("{name}.second"), &averages.second);
        }
        if let Some(m) = &self.mapper {
            column("vizmapper".into(), &m.parameters);
            column("vizmapper.first".into(), &self.mapper_averages.first);
            column("vizmapper.second".into(), &self.mapper_averages.second);
        }
        column("screen".into(), self.screen.as_flattened());
        let steps = self.averages.iter().chain([&self.mapper_averages]).map(|a| a.steps as f64).collect();
        state.numbers.insert("steps".into(), steps);
        state
    }

    fn restore(&mut self, state: &State) -> std::result::Result<(), String> {
        let n = state.columns.get(Group::Opacity.name()).ok_or("no column `opacity`")?.len();
        let steps = state.doubles("steps", GROUPS + 1)?;
        let averages = |name: &str, len: usize, steps: f64| -> std::result::Result<Averages, String> {
            let first = state.column(&format!("{name}.first"), len)?.to_vec();
            let second = state.column(&format!("{name}.second"), len)?.to_vec();
            Ok(Averages { first, second, steps: steps as u64 })
        };
        let mut parameters = Parameters::default();
        let mut all = Vec::with_capacity(GROUPS);
        for g in Group::ALL {
            let len = n * g.width();
            parameters.0[g as usize] = state.column(g.name(), len)?.to_vec();
            all.push(averages(g.name(), len, steps[g as usize])?);
        }
        let screen = state.column("screen", 2 * n)?;
        let network = match &self.mapper {
            None => None,
            Some(_) => Some((
                state.column("vizmapper", VIZMAPPER_PARAMETERS)?.to_vec(),
                averages("vizmapper", VIZMAPPER_PARAMETERS, steps[GROUPS])?,
            )),
        };
        // All is there: nothing was changed until now.
        let all = all.try_into().map_err(|_| "groups are missing")?;
        if let (Some(m), Some((parameters, averages))) = (&mut self.mapper, network) {
            m.parameters = parameters;
            self.mapper_averages = averages;
        }
        self.screen = screen.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
        self.parameters = parameters;
        self.averages = all;
        Ok(())
    }
}
