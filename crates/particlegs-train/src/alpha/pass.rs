//! One picture forward and back: the gradient with every parameter.

use super::chain::{Slopes, chain};
use super::parameters::{AlphaParameters, GaussianParameters, ParameterGroup};
use super::{network, raster};
use particlegs_core::context::{Context, Level};
use particlegs_core::model::VizRanges;
use particlegs_core::picture::Plane;
use particlegs_core::render::alpha::network::{Adaptation, Network, Setting, inputs, outputs};
use particlegs_core::render::alpha::raster::blend;
use particlegs_core::render::alpha::{CutOffs, Eye, Plan};
use particlegs_core::{Result, parallel};

const RUN: usize = 2048;

/// The network, laid out, and its ranges.
pub(super) struct LoadedNetwork {
    pub network: Network,
    pub ranges: VizRanges,
    /// Weight of what holds it to the identity.
    pub identity: f64,
}

/// A picture drawn, and all that its gradient needs.
pub(super) struct ForwardPass<'a> {
    eye: &'a Eye,
    parameters: &'a AlphaParameters,
    mapper: Option<&'a LoadedNetwork>,
    setting: Setting,
    inputs: Vec<[f32; 4]>,
    adapted: Vec<Adaptation>,
    plan: Plan,
    /// Brightness, not cut to [0, 1].
    pub drawn: Plane,
    simd: Level,
}

pub(super) struct Gradient {
    pub parameters: AlphaParameters,
    pub network: Option<Vec<f32>>,
    /// Gaussians that are seen, and the size of the change with their centres on the picture.
    pub screen: Vec<(u32, f32)>,
}

/// Whether all of a Gaussian's numbers are finite.
fn fine(one: &GaussianParameters) -> bool {
    // One test is enough: a sum is not finite if one of its numbers is not.
    let sum = one.position.iter().sum::<f64>() + one.rotation.iter().sum::<f64>() + one.mean_log_scale();
    (sum + one.logit + one.feature).is_finite()
}

impl<'a> ForwardPass<'a> {
    /// Draws. Gaussians with numbers that are not finite are left out.
    pub fn new(
        eye: &'a Eye,
        parameters: &'a AlphaParameters,
        mapper: Option<&'a LoadedNetwork>,
        setting: Setting,
        cut: CutOffs,
        context: &Context<'_>,
    ) -> Result<Self> {
        let simd = context.simd();
        let n = parameters.len();
        let mut network_inputs = vec![[0f32; 4]; if mapper.is_some() { n } else { 0 }];
        let mut adapted = vec![Adaptation::STATIC; n];
        if let Some(mapper) = mapper {
            let runs = network_inputs.chunks_mut(RUN).zip(adapted.chunks_mut(RUN)).enumerate();
            parallel::for_each(runs, |(c, (run_inputs, adapted))| {
                for (k, input) in run_inputs.iter_mut().enumerate() {
                    let one = parameters.get(c * RUN + k);
                    // Zero times what is not a number is none either: it must not enter the sums.
                    *input = if fine(&one) { inputs(setting, one.mean_log_scale(), one.logit) } else { [0.0; 4] };
                }
                let mut out = vec![[0f32; 2]; run_inputs.len()];
                outputs(simd, &mapper.network, run_inputs, &mut out);
                adapted.iter_mut().zip(out).for_each(|(a, out)| *a = mapper.ranges.adapt(setting, out));
            });
        }
        let gaussian = |i: usize| {
            let one = parameters.get(i);
            fine(&one).then(|| one.gaussian(&adapted[i]).seen(eye))
        };
        let plan = Plan::new(eye, n, gaussian, cut, context)?;
        let drawn = blend(&plan, eye.size, context)?;
        Ok(ForwardPass { eye, parameters, mapper, setting, inputs: network_inputs, adapted, plan, drawn, simd })
    }

    /// Goes back, from the changes of the loss with each pixel's brightness.
    pub fn back(&self, slope: &Plane) -> Gradient {
        let sums = raster::sums(self.simd, &self.plan, &self.drawn, slope);
        let slopes: Vec<Slopes> = parallel::map_range(sums.len(), |k| {
            let i = self.plan.indices[k] as usize;
            chain(self.eye, &self.parameters.get(i), &self.adapted[i], &sums[k])
        });
        let mut out = AlphaParameters::zeros(self.parameters.len());
        let screen = self.plan.indices.iter().zip(&slopes).map(|(i, s)| (*i, s.screen as f32)).collect();
        for (&i, s) in self.plan.indices.iter().zip(&slopes) {
            let i = i as usize;
            let put = |column: &mut Vec<f32>, values: &[f64]| {
                let at = i * values.len();
                column[at..at + values.len()].iter_mut().zip(values).for_each(|(c, v)| *c = *v as f32);
            };
            let [position, scale, rotation, opacity, feature] = &mut out.0;
            put(position, &s.position);
            put(scale, &s.log_scale);
            put(rotation, &s.rotation);
            put(opacity, &[s.logit]);
            put(feature, &[s.feature]);
        }
        let network = self.mapper.map(|mapper| self.back_through(mapper, &slopes, &mut out));
        Gradient { parameters: out, network, screen }
    }

    /// Through the network: its parameters, and what its inputs add to scales and opacities.
    fn back_through(&self, mapper: &LoadedNetwork, slopes: &[Slopes], out: &mut AlphaParameters) -> Vec<f32> {
        let Setting { radius, opacity } = self.setting;
        let ranges = &mapper.ranges;
        let hold = 2.0 * mapper.identity / self.parameters.len().max(1) as f64;
        let wanted = |a: &Adaptation, scale: f64, odds: f64| {
            let scale = scale + hold * (a.scale - radius);
            // The floor does not move with the network.
            let odds = if a.floored { 0.0 } else { odds + hold * (a.odds - opacity) };
            let wanted = [scale * radius * ranges.scale, odds * opacity * ranges.opacity];
            // Gaussians whose gradient is not a number are named elsewhere.
            if wanted.iter().all(|v| v.is_finite()) { wanted.map(|v| v as f32) } else { [0.0; 2] }
        };
        // Gaussians that the picture does not show are held to the identity as well.
        let mut all: Vec<[f32; 2]> = self.adapted.iter().map(|a| wanted(a, 0.0, 0.0)).collect();
        for (&i, s) in self.plan.indices.iter().zip(slopes) {
            all[i as usize] = wanted(&self.adapted[i as usize], s.scale, s.odds);
        }
        let (with_network, with_inputs) = network::slopes(self.simd, &mapper.network, &self.inputs, &all);
        let input_slopes = particlegs_core::render::alpha::network::OWN.map(|[_, half]| 1.0 / half as f32);
        let [_, scale, _, logit, _] = &mut out.0;
        for (i, with) in with_inputs.iter().enumerate() {
            // The network sees the mean of three log-scales: each has a third of its change.
            scale[3 * i..3 * i + 3].iter_mut().for_each(|s| *s += with[0] * input_slopes[0] / 3.0);
            logit[i] += with[1] * input_slopes[1];
        }
        with_network
    }
}

/// Groups and numbers of the Gaussians with parameters or gradients that are not finite: the first
/// group at fault of each, in the order of the Gaussians.
pub(super) fn faults(parameters: &AlphaParameters, gradient: &AlphaParameters) -> Vec<(usize, ParameterGroup)> {
    let mut faults: Vec<(usize, ParameterGroup)> = Vec::new();
    for g in ParameterGroup::ALL {
        for column in [&parameters.0[g as usize], &gradient.0[g as usize]] {
            // One sum tells whether there is anything to look for.
            if !column.iter().map(|v| v * 0.0).sum::<f32>().is_finite() {
                let rows = column.chunks(g.width()).enumerate();
                faults.extend(rows.filter(|(_, r)| r.iter().any(|v| !v.is_finite())).map(|(i, _)| (i, g)));
            }
        }
    }
    faults.sort_by_key(|(i, g)| (*i, *g as usize));
    faults.dedup_by_key(|(i, _)| *i);
    faults
}
