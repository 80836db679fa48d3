//! From a scene's Gaussians to those of a view: into the training frame, bent for its radius and
//! opacity.

use super::network::{Adaptation, Network, Setting, inputs, outputs};
use super::project::{Eye, Gaussian, GreyCameraGaussian};
use crate::camera::{Normalisation, View};
use crate::context::{Context, Level};
use crate::math::{Sym3, each_axis};
use crate::model::{LawKind, Mixture, Model, VizMapper};
use crate::{Error, Result, parallel};

const RUN: usize = 4096;

/// Opacities are kept this far from 0 and 1, where logits are infinite.
const EDGE: f64 = 1e-9;

/// Determinants (training frame) are taken as no smaller than this, scales of 1e-12, where their
/// logarithm is wanted.
const LEAST_DET: f64 = 1e-72;

/// Settings of an alpha-blend scene beside its Gaussians.
#[derive(Clone, Copy, Debug)]
pub struct Blend<'a> {
    /// Its network, if any.
    pub vizmapper: Option<&'a VizMapper>,
    /// The training frame.
    pub frame: Normalisation,
    /// Default radius, world units.
    pub radius: f64,
    /// Default opacity.
    pub opacity: f64,
}

/// A Gaussian in the training frame, not yet bent for a radius and an opacity, and what the network reads of it.
#[derive(Clone, Copy, Debug)]
pub struct UnadaptedGaussian {
    /// Its opacity is kept a little off 0 and 1.
    pub gaussian: Gaussian,
    /// Mean of the natural logarithms of its three scales.
    pub log_scale: f64,
    /// Logit of its opacity.
    pub logit: f64,
}

impl<'a> Blend<'a> {
    /// That of a model, where its law is this one.
    pub fn from_model(model: &'a Model) -> Option<Self> {
        let m = &model.metadata;
        (m.law == LawKind::AlphaBlend).then(|| Blend {
            vizmapper: model.vizmapper().map(|v| &**v),
            frame: Normalisation::new(&m.bounds),
            radius: m.default_radius,
            opacity: m.default_opacity,
        })
    }

    /// The view's radius and opacity over the defaults, for the network.
    pub fn setting(&self, view: &View) -> Setting {
        Setting { radius: view.radius / self.radius, opacity: view.opacity / self.opacity }
    }

    /// The Gaussians as they look in a view, relative to its eye.
    pub fn gaussians(
        &self,
        parts: &[(&Mixture, f64)],
        view: &View,
        eye: &Eye,
        context: &Context<'_>,
    ) -> Result<Vec<GreyCameraGaussian>> {
        let setting = self.setting(view);
        let network = self.vizmapper.map(|v| (Network::new(v), v.ranges));
        let runs = parts
            .iter()
            .scan(0, |first, (m, _)| {
                *first += m.len();
                Some((*m, *first - m.len()))
            })
            .flat_map(|(m, first)| (0..m.len()).step_by(RUN).map(move |start| (m, first, start)));
        let gaussians = parallel::try_map(runs, |(m, first, start)| {
            self.run(context.simd(), m, start..m.len().min(start + RUN), setting, network.as_ref())
                .map(|gaussians| gaussians.iter().map(|g| g.seen(eye)).collect::<Vec<_>>())
                .map_err(|(i, message)| Error::argument(format!("Gaussian {}: {message}", first + i)))
        })?;
        Ok(gaussians.into_iter().flatten().collect())
    }

    fn run(
        &self,
        simd: Level,
        m: &Mixture,
        range: std::ops::Range<usize>,
        setting: Setting,
        network: Option<&(Network, crate::model::VizRanges)>,
    ) -> std::result::Result<Vec<Gaussian>, (usize, String)> {
        let mut network_inputs = Vec::with_capacity(range.len());
        let mut gaussians = range
            .map(|i| {
                let t = self.trained(m, i).map_err(|message| (i, message))?;
                network_inputs.push(inputs(setting, t.log_scale, t.logit));
                Ok(t.gaussian)
            })
            .collect::<std::result::Result<Vec<_>, _>>()?;
        let mut out = vec![[0f32; 2]; network_inputs.len()];
        if let Some((network, _)) = network {
            outputs(simd, network, &network_inputs, &mut out);
        }
        for (g, out) in gaussians.iter_mut().zip(out) {
            let a = network.map_or(Adaptation::STATIC, |(_, ranges)| ranges.adapt(setting, out));
            g.cov = g.cov.scale(a.scale * a.scale);
            g.opacity = a.opacity(logit(g.opacity));
        }
        Ok(gaussians)
    }

    /// Gaussian `i` of a mixture as it was trained.
    ///
    /// # Errors
    /// A text that says what is wrong: a number that is not finite, or a mixture without opacities.
    pub fn trained(&self, m: &Mixture, i: usize) -> std::result::Result<UnadaptedGaussian, String> {
        let law = m.law.alpha_blend().ok_or("the mixture has no opacities, which the alpha-blend law needs")?;
        let scale = self.frame.scale;
        let mean: [f64; 3] = each_axis(|k| (m.mean[k][i] - self.frame.center[k]) * scale);
        let cov = Sym3(m.cov_of(i).0.map(|v| v * scale * scale));
        let (opacity, grey) = (law.opacity[i], law.grey[i]);
        for (name, values) in
            [("mean", &mean[..]), ("covariance", &cov.0[..]), ("opacity", &[opacity]), ("grey level", &[grey])]
        {
            if values.iter().any(|v| !v.is_finite()) {
                return Err(format!("the {name} is not finite"));
            }
        }
        let opacity = opacity.clamp(EDGE, 1.0 - EDGE);
        let log_scale = libm::log(cov.det().max(LEAST_DET)) / 6.0;
        Ok(UnadaptedGaussian { gaussian: Gaussian { mean, cov, opacity, grey }, log_scale, logit: logit(opacity) })
    }
}

impl Model {
    /// An alpha-blend model as its network bends it for a particle radius (world units) and an opacity: without a
    /// network, and drawn so at whatever radius and opacity. A model without a network stays as it is.
    pub fn bent(mut self, radius: f64, opacity: f64, context: &Context<'_>) -> Result<Model> {
        let Some(vizmapper) = self.vizmapper().cloned() else { return Ok(self) };
        let m = &self.metadata;
        let (frame, usual) = (Normalisation::new(&m.bounds), [m.default_radius, m.default_opacity]);
        let blend = Blend { vizmapper: None, frame, radius: usual[0], opacity: usual[1] };
        let setting = Setting { radius: radius / usual[0], opacity: opacity / usual[1] };
        let network = (Network::new(&vizmapper), vizmapper.ranges);
        for m in self.layers.iter_mut().flat_map(|l| &mut l.content).map(|b| &mut b.gaussians) {
            let runs = (0..m.len()).step_by(RUN).map(|start| start..m.len().min(start + RUN));
            let bent = parallel::try_map(runs, |range| {
                context.check()?;
                blend
                    .run(context.simd(), m, range, setting, Some(&network))
                    .map_err(|(i, message)| Error::argument(format!("Gaussian {i}: {message}")))
            })?;
            for (i, g) in bent.into_iter().flatten().enumerate() {
                // From the training frame back to world units.
                (0..6).for_each(|k| m.cov[k][i] = g.cov.0[k] / (frame.scale * frame.scale));
                if let Some(law) = m.law.alpha_blend_mut() {
                    law.opacity[i] = g.opacity;
                }
            }
            if let Some(law) = m.law.alpha_blend_mut() {
                law.vizmapper = None;
            }
        }
        Ok(self)
    }
}

/// ln(o / (1 - o)).
fn logit(opacity: f64) -> f64 {
    libm::log(opacity / (1.0 - opacity))
}
