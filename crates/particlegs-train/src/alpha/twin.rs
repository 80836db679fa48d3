//! The law as a reader would write it, in f64, as a function of every parameter.

use super::parameters::{AlphaParameters, GROUPS, GaussianParameters, ParameterGroup, SH0};
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::VizRanges;
use particlegs_core::render::alpha::network::{Setting, twin::plain as network};
use particlegs_core::render::alpha::plain::blend;
use particlegs_core::render::alpha::{CutOffs, Eye, Gaussian};

#[derive(Clone)]
pub(super) struct DoubleParameters {
    pub columns: [Vec<f64>; GROUPS],
    pub network: Option<Vec<f64>>,
    pub ranges: VizRanges,
    pub identity: f64,
}

impl DoubleParameters {
    pub fn new(p: &AlphaParameters, network: Option<&[f32]>, ranges: VizRanges, identity: f64) -> Self {
        let wide = |v: &[f32]| v.iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
        DoubleParameters { columns: p.0.each_ref().map(|c| wide(c)), network: network.map(wide), ranges, identity }
    }

    /// The sum over pixels of `want` times brightness, and what holds the network.
    pub fn value(&self, eye: &Eye, setting: Setting, cut: &CutOffs, want: &[f64]) -> f64 {
        let n = self.columns[ParameterGroup::Opacity as usize].len();
        let mut penalty = 0.0;
        let gaussians: Vec<Gaussian> = (0..n)
            .map(|i| {
                let at = |g: ParameterGroup, k: usize| self.columns[g as usize][i * g.width() + k];
                let q: [f64; 4] = std::array::from_fn(|k| at(ParameterGroup::Rotation, k));
                let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
                let s: [f64; 3] = each_axis(|k| at(ParameterGroup::Scale, k));
                let logit = at(ParameterGroup::Opacity, 0);
                let (mut scale, mut odds) = (1.0, 1.0);
                if let Some(p) = &self.network {
                    let mean = (s[0] + s[1] + s[2]) / 3.0;
                    let x = [setting.radius - 1.0, setting.opacity - 1.0, (mean + 8.0) / 2.0, (logit + 3.0) / 4.0];
                    let [ds, d_o] = network(p, x);
                    scale = setting.radius * (1.0 + self.ranges.scale * ds);
                    odds = (setting.opacity * (1.0 + self.ranges.opacity * d_o)).max(self.ranges.floor);
                    penalty += (scale - setting.radius).powi(2) + (odds - setting.opacity).powi(2);
                }
                let mut cov = Sym3::default();
                for k in 0..3 {
                    let axis = turned(q.map(|v| v / norm), k);
                    cov = cov.add(&Sym3::outer(axis.map(|v| v * scale * s[k].exp())));
                }
                Gaussian {
                    mean: each_axis(|k| at(ParameterGroup::Position, k)),
                    cov,
                    opacity: 1.0 / (1.0 + (-logit - odds.ln()).exp()),
                    grey: (0.5 + SH0 * at(ParameterGroup::Feature, 0)).max(0.0),
                }
            })
            .collect();
        let picture = blend(eye, &gaussians, cut);
        picture.iter().zip(want).map(|(b, w)| b * w).sum::<f64>() + self.identity * penalty / n as f64
    }
}

/// The unit vector of axis `k` turned by a quaternion: q v q*.
fn turned(q: [f64; 4], k: usize) -> [f64; 3] {
    let mut v = [0.0; 4];
    v[k + 1] = 1.0;
    let times = |a: [f64; 4], b: [f64; 4]| {
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    };
    let r = times(times(q, v), [q[0], -q[1], -q[2], -q[3]]);
    [r[1], r[2], r[3]]
}

/// Parameters of one Gaussian, drawn.
pub(super) fn drawn(seed: u64, i: u64) -> GaussianParameters {
    let mut r = particlegs_core::math::Random::new(seed, 3, i);
    GaussianParameters {
        position: [0; 3].map(|_| 1.2 * r.uniform() - 0.6),
        log_scale: [0; 3].map(|_| -3.0 + r.normal()),
        rotation: [0; 4].map(|_| r.normal()),
        logit: 2.0 * r.normal(),
        feature: r.normal() + 0.5,
    }
}
