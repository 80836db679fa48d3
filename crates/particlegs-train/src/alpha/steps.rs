//! A step: a picture drawn, its loss, the gradient of that, and Adam. On the processor here; a device's are its own.

use super::parameters::{AlphaParameters, GROUPS, Gaussians, ParameterGroup};
use super::pass::{ForwardPass, LoadedNetwork, faults};
use crate::adam::Adam;
use crate::learner::{NonFiniteGradient, StepReport, TrainingSample};
use crate::loss::Loss;
use particlegs_core::Result;
use particlegs_core::picture::Plane;
use particlegs_core::render::alpha::CutOffs;
use particlegs_core::render::alpha::network::Network;

/// 3DGS's Adam.
const ADAM: Adam = Adam { beta1: 0.9, beta2: 0.999, epsilon: 1e-15 };

/// PyTorch's default, which the network has.
const NETWORK_ADAM: Adam = Adam { beta1: 0.9, beta2: 0.999, epsilon: 1e-8 };

/// The size of a step: rates, and the network's limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepSize {
    /// Adam's rates, a group each.
    pub rates: [f64; GROUPS],
    pub network: f64,
    /// Largest norm of the network's gradient; 0 = any.
    pub clip: f64,
    /// Weight of what holds the network to the identity.
    pub identity: f64,
}

pub trait AlphaStepper {
    /// Draws the sample, takes the loss, and moves all parameters down its gradient. Gaussians with gradients that
    /// are not finite stay as they are, and are named. Moved parameters may lie elsewhere until they are
    /// [fetched](AlphaStepper::fetch).
    fn step(
        &mut self,
        gaussians: &mut Gaussians,
        sample: &TrainingSample<'_>,
        loss: &Loss,
        size: &StepSize,
    ) -> Result<StepReport>;

    /// Brings everything up to date with the steps taken.
    fn fetch(&mut self, _gaussians: &mut Gaussians) -> Result<()> {
        Ok(())
    }

    /// Others than steps changed them, in number too.
    fn changed(&mut self) {}
}

#[derive(Default)]
pub struct AlphaCpuSteps {
    /// A gradient to be spoilt in the next step: group, Gaussian, number.
    #[cfg(test)]
    pub(super) spoil: Option<(ParameterGroup, usize, f32)>,
}

impl Gaussians {
    /// Moves all Gaussians but those of `still`.
    fn descend(&mut self, gradient: &AlphaParameters, still: &[(usize, ParameterGroup)], size: &StepSize) {
        for g in ParameterGroup::ALL {
            let (rate, w) = (size.rates[g as usize], g.width());
            let (values, averages) = (&mut self.parameters.0[g as usize], &mut self.averages[g as usize]);
            let rows = |v: &[f32]| still.iter().flat_map(|(i, _)| v[i * w..(i + 1) * w].to_vec()).collect::<Vec<f32>>();
            // Adam runs over whole columns: the rows that stay are put back after it.
            let originals = [rows(values), rows(&averages.first), rows(&averages.second)];
            ADAM.step(values, &gradient.0[g as usize], averages, rate);
            for (column, original) in [values, &mut averages.first, &mut averages.second].into_iter().zip(&originals) {
                for ((i, _), row) in still.iter().zip(original.chunks(w)) {
                    column[i * w..(i + 1) * w].copy_from_slice(row);
                }
            }
        }
    }

    /// Moves the network, its gradient cut to the largest norm; returns whether the gradient is finite.
    fn descend_network(&mut self, mut gradient: Vec<f32>, size: &StepSize) -> bool {
        let Some(mapper) = &mut self.mapper else { return true };
        let norm = gradient.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        if !norm.is_finite() {
            return false;
        }
        let clip = size.clip;
        if clip > 0.0 && norm > clip {
            gradient.iter_mut().for_each(|v| *v *= (clip / norm) as f32);
        }
        NETWORK_ADAM.step(&mut mapper.parameters, &gradient, &mut self.mapper_averages, size.network);
        true
    }
}

/// Brightness as it is shown: cut to [0, 1].
fn shown(drawn: &Plane) -> Plane {
    Plane { size: drawn.size, data: drawn.data.iter().map(|b| b.clamp(0.0, 1.0)).collect() }
}

impl AlphaStepper for AlphaCpuSteps {
    fn step(
        &mut self,
        gaussians: &mut Gaussians,
        sample: &TrainingSample<'_>,
        loss: &Loss,
        size: &StepSize,
    ) -> Result<StepReport> {
        let (eye, setting) = (gaussians.eye(sample)?, gaussians.setting(sample));
        let mapper = gaussians.mapper.as_ref().map(|m| LoadedNetwork {
            network: Network::new(m),
            ranges: m.ranges,
            identity: size.identity,
        });
        let pass = ForwardPass::new(
            &eye,
            &gaussians.parameters,
            mapper.as_ref(),
            setting,
            CutOffs::PUBLISHED,
            sample.context,
        )?;
        let mut valued = loss.evaluate(&shown(&pass.drawn), sample.target, sample.context.simd());
        // Brightness beyond white is cut: nothing there moves it.
        let beyond = valued.gradient.data.iter_mut().zip(&pass.drawn.data);
        beyond.filter(|(_, b)| **b > 1.0).for_each(|(g, _)| *g = 0.0);
        #[cfg_attr(not(test), allow(unused_mut))]
        let mut gradient = pass.back(&valued.gradient);
        #[cfg(test)]
        if let Some((group, i, v)) = self.spoil.take() {
            gradient.parameters.0[group as usize][i * group.width()] = v;
        }
        // Parameters too: a Gaussian with one that is not finite was not drawn, and its gradient is zero.
        let still = faults(&gaussians.parameters, &gradient.parameters);
        let mut not_finite =
            still.first().map(|(i, g)| NonFiniteGradient { group: g.name(), gaussian: *i, count: still.len() });
        // Density control takes the mean over the pictures that a Gaussian is seen in.
        for (i, size) in &gradient.screen {
            if size.is_finite() {
                let s = &mut gaussians.screen[*i as usize];
                *s = [s[0] + size, s[1] + 1.0];
            }
        }
        gaussians.descend(&gradient.parameters, &still, size);
        if let Some(g) = gradient.network
            && !gaussians.descend_network(g, size)
        {
            not_finite = not_finite.or(Some(NonFiniteGradient { group: "vizmapper", gaussian: 0, count: 1 }));
        }
        // The picture's loss alone: what holds the network to the identity is no measure of it.
        Ok(StepReport { loss: valued.value, not_finite })
    }
}
