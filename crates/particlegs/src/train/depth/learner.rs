//! The Gaussians of the optical-depth law as parameters that are moved.
//!
//! A step is taken in each Gaussian's own frame: with the covariance L L^T its mean moves by L v,
//! its factor becomes L B (B lower triangular, exp of a number on the diagonal), its count is
//! multiplied by exp of a number. One rate then suits Gaussians of all sizes and shapes.

use super::adjoint::{OfGaussian, full};
use super::curve::Curve;
use super::raster::Tape;
use crate::Result;
use crate::math::Sym3;
use crate::model::{Mixture, VizMapper};
use crate::particles::Bounds;
use crate::picture::Plane;
use crate::splat::Look;
use crate::train::adam::{Adam, Averages};
use crate::train::learner::{Learner, Moment, NotFinite, Shot, Stepped};
use crate::train::loss::Loss;
use crate::train::state::State;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Rates of the groups of parameters, relative to the rate of the step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rates {
    /// Means, in standard deviations.
    pub place: f64,
    /// Shapes, in logarithms of radii.
    pub shape: f64,
    /// Logarithms of counts.
    pub count: f64,
}

/// How Gaussians of the optical-depth law are trained.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthConfig {
    /// Rate of Adam's step, in standard deviations and logarithms.
    pub rate: f64,
    /// The last step's rate over the first's; between them a half cosine.
    pub last_rate: f64,
    /// Steps over which the rate rises to its full value.
    pub warm_up: u64,
    /// Relative rates of the groups.
    pub rates: Rates,
    /// Share of ln(count / count at the start) taken back each step, times the rate: pictures do not
    /// hold the mass of saturated cores.
    pub count_pull: f64,
    /// Decay of Adam's mean gradient.
    pub beta1: f64,
    /// Decay of Adam's mean squared gradient.
    pub beta2: f64,
}

impl Default for DepthConfig {
    fn default() -> Self {
        DepthConfig {
            rate: 0.03,
            last_rate: 0.05,
            warm_up: 20,
            rates: Rates { place: 1.0, shape: 1.0, count: 0.1 },
            count_pull: 0.0,
            beta1: 0.9,
            beta2: 0.99,
        }
    }
}

impl DepthConfig {
    /// Checks every number.
    ///
    /// # Errors
    /// [`crate::Error::Argument`].
    pub fn check(&self) -> Result<()> {
        let positive = |v: f64| v > 0.0 && v <= 1.0;
        let share = |v: f64| (0.0..1.0).contains(&v);
        let rates = [self.rates.place, self.rates.shape, self.rates.count, self.count_pull];
        if positive(self.rate)
            && positive(self.last_rate)
            && share(self.beta1)
            && share(self.beta2)
            && rates.iter().all(|r| (0.0..=100.0).contains(r))
        {
            Ok(())
        } else {
            Err(crate::Error::argument(
                "training: optical_depth: rate and last_rate must be within 0 to 1, betas below 1, relative rates 0 to 100",
            ))
        }
    }
}

/// Parameters and what Adam remembers of them.
pub(crate) struct DepthLearner {
    config: DepthConfig,
    look: Look,
    bounds: Bounds,
    /// Particles: what the counts sum to.
    total: f64,
    mean: [Vec<f64>; 3],
    /// Rows of the lower factor of the covariance: 00, 10, 11, 20, 21, 22.
    factor: [Vec<f64>; 6],
    log_count: Vec<f64>,
    /// At the start.
    first_log_count: Vec<f64>,
    /// Of place (3 a Gaussian), shape (6) and count (1).
    averages: [Averages; 3],
    #[cfg(test)]
    pub poison: Option<usize>,
}

/// Gradients in the Gaussians' own frames.
struct Own {
    place: Vec<f32>,
    shape: Vec<f32>,
    count: Vec<f32>,
    not_finite: Option<NotFinite>,
}

impl DepthLearner {
    /// From a mixture with covariances that have an inverse; `look` is the targets'.
    pub fn new(mixture: &Mixture, bounds: Bounds, look: Look, config: DepthConfig) -> Self {
        let m = mixture.len();
        let mut factor: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::with_capacity(m));
        for i in 0..m {
            factor.iter_mut().zip(lower(&mixture.cov_of(i))).for_each(|(f, v)| f.push(v));
        }
        let log_count: Vec<f64> = mixture.count.iter().map(|c| c.max(1e-6).ln()).collect();
        DepthLearner {
            config,
            look,
            bounds,
            total: mixture.count.iter().sum(),
            mean: mixture.mean.clone(),
            factor,
            first_log_count: log_count.clone(),
            log_count,
            averages: [3, 6, 1].map(|k| Averages::zeros(k * m)),
            #[cfg(test)]
            poison: None,
        }
    }

    fn factor_of(&self, i: usize) -> [f64; 6] {
        std::array::from_fn(|k| self.factor[k][i])
    }

    /// The Gaussians as they are.
    fn gaussians(&self) -> Mixture {
        let m = self.log_count.len();
        let mut cov: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::with_capacity(m));
        for i in 0..m {
            let [a, b, c, d, e, f] = self.factor_of(i);
            let s = [a * a, a * b, a * d, b * b + c * c, b * d + c * e, d * d + e * e + f * f];
            cov.iter_mut().zip(s).for_each(|(c, v)| c.push(v));
        }
        let count = self.log_count.iter().map(|c| c.exp()).collect();
        Mixture { mean: self.mean.clone(), cov, count, mass: None, shade: None }
    }

    /// Brightness of a shot and the gradient of the loss with its depth.
    fn backward(&self, mixture: &Mixture, shot: &Shot<'_>, loss: &Loss) -> Result<(f64, Vec<OfGaussian>)> {
        let tape = Tape::draw(mixture, &self.bounds, shot.view, &shot.crop)?;
        let curve = Curve::new(self.look, shot.view.opacity, shot.view.radius_pixels(shot.crop.full));
        let size = tape.tau.size;
        let (drawn, slope): (Vec<f32>, Vec<f32>) =
            tape.tau.data.par_iter().with_min_len(4096).map(|&t| curve.at(t)).unzip();
        let mut valued = loss.of(&Plane { size, data: drawn }, shot.target);
        valued.gradient.data.par_iter_mut().zip(&slope).for_each(|(g, s)| *g *= s);
        Ok((valued.value, tape.gradient(mixture, valued.gradient)))
    }

    /// Gradients turned into the Gaussians' own frames; what is not finite counts as zero.
    fn own(&self, world: &[OfGaussian]) -> Own {
        let m = world.len();
        let mut own = Own {
            place: Vec::with_capacity(3 * m),
            shape: Vec::with_capacity(6 * m),
            count: Vec::with_capacity(m),
            not_finite: None,
        };
        for (i, g) in world.iter().enumerate() {
            if !g.is_finite() {
                let group = if g.mean.iter().any(|v| !v.is_finite()) {
                    "position"
                } else if g.cov.iter().any(|v| !v.is_finite()) {
                    "covariance"
                } else {
                    "count"
                };
                own.not_finite.get_or_insert(NotFinite { group, gaussian: i, count: 0 }).count += 1;
                own.place.extend([0.0; 3]);
                own.shape.extend([0.0; 6]);
                own.count.push(0.0);
                continue;
            }
            let l = self.factor_of(i);
            let [a, b, c, d, e, f] = l;
            let [x, y, z] = g.mean;
            own.place.extend([a * x + b * y + d * z, c * y + e * z, f * z].map(|v| v as f32));
            let cov = congruent(&l, &full(&g.cov));
            own.shape.extend(cov.map(|v| (2.0 * v) as f32));
            own.count.push((g.count * self.log_count[i].exp()) as f32);
        }
        own
    }

    /// The rate of a step.
    fn rate(&self, at: &Moment) -> f64 {
        let c = &self.config;
        let warm = ((at.iteration + 1) as f64 / (c.warm_up.max(1)) as f64).min(1.0);
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * at.done.min(1.0)).cos());
        c.rate * warm * (c.last_rate + (1.0 - c.last_rate) * cosine)
    }

    fn update(&mut self, own: &Own, rate: f64) {
        let m = self.log_count.len();
        let c = &self.config;
        let adam = Adam { beta1: c.beta1 as f32, beta2: c.beta2 as f32, epsilon: 1e-15 };
        let [place, shape, count] = &mut self.averages;
        let mut by = [vec![0.0f32; 3 * m], vec![0.0f32; 6 * m], vec![0.0f32; m]];
        adam.step(&mut by[0], &own.place, place, rate * c.rates.place);
        adam.step(&mut by[1], &own.shape, shape, rate * c.rates.shape);
        adam.step(&mut by[2], &own.count, count, rate * c.rates.count);
        let pull = rate * c.count_pull;
        for i in 0..m {
            let [a, b, c, d, e, f] = self.factor_of(i);
            let v: [f64; 3] = std::array::from_fn(|k| f64::from(by[0][3 * i + k]));
            let moved = [a * v[0], b * v[0] + c * v[1], d * v[0] + e * v[1] + f * v[2]];
            (0..3).for_each(|k| self.mean[k][i] += moved[k]);
            let s: [f64; 6] = std::array::from_fn(|k| f64::from(by[1][6 * i + k]));
            let (p, q, r) = (s[0].exp(), s[2].exp(), s[5].exp());
            let new = [a * p, b * p + c * s[1], c * q, d * p + e * s[1] + f * s[3], e * q + f * s[4], f * r];
            (0..6).for_each(|k| self.factor[k][i] = new[k]);
            let away = self.log_count[i] - self.first_log_count[i];
            self.log_count[i] += f64::from(by[2][i]) - pull * away;
        }
        // The particles stay as many as they are.
        let shift = (self.total / self.log_count.iter().map(|c| c.exp()).sum::<f64>()).ln();
        self.log_count.iter_mut().for_each(|c| *c += shift);
    }
}

impl Learner for DepthLearner {
    fn step(&mut self, shot: &Shot<'_>, loss: &Loss, at: &Moment) -> Result<Stepped> {
        let mixture = self.gaussians();
        #[allow(unused_mut)]
        let (value, mut world) = self.backward(&mixture, shot, loss)?;
        #[cfg(test)]
        if let Some(g) = self.poison.and_then(|i| world.get_mut(i)) {
            g.cov[1] = f64::NAN;
        }
        let own = self.own(&world);
        self.update(&own, self.rate(at));
        Ok(Stepped { loss: value, not_finite: own.not_finite })
    }

    fn control(&mut self, _at: &Moment) {}

    fn len(&self) -> usize {
        self.log_count.len()
    }

    fn mixture(&self) -> (Mixture, Option<VizMapper>) {
        (self.gaussians(), None)
    }

    fn state(&self) -> State {
        let mut state = State::default();
        let axes = self.mean.iter().enumerate().map(|(k, c)| (format!("mean {k}"), c));
        let factor = self.factor.iter().enumerate().map(|(k, c)| (format!("factor {k}"), c));
        let counts = [("log count", &self.log_count), ("first log count", &self.first_log_count)];
        let counts = counts.map(|(n, c)| (n.to_string(), c));
        state.numbers.extend(axes.chain(factor).chain(counts).map(|(n, c)| (n, c.clone())));
        for (name, a) in GROUPS.iter().zip(&self.averages) {
            state.columns.insert(format!("{name} first"), a.first.clone());
            state.columns.insert(format!("{name} second"), a.second.clone());
            state.numbers.insert(format!("{name} steps"), vec![a.steps as f64]);
        }
        state
    }

    fn restore(&mut self, state: &State) -> std::result::Result<(), String> {
        let m = state.numbers.get("log count").map_or(0, Vec::len);
        for k in 0..3 {
            self.mean[k] = state.doubles(&format!("mean {k}"), m)?.to_vec();
        }
        for k in 0..6 {
            self.factor[k] = state.doubles(&format!("factor {k}"), m)?.to_vec();
        }
        self.log_count = state.doubles("log count", m)?.to_vec();
        self.first_log_count = state.doubles("first log count", m)?.to_vec();
        for ((name, a), k) in GROUPS.iter().zip(&mut self.averages).zip([3, 6, 1]) {
            a.first = state.column(&format!("{name} first"), k * m)?.to_vec();
            a.second = state.column(&format!("{name} second"), k * m)?.to_vec();
            a.steps = state.doubles(&format!("{name} steps"), 1)?[0] as u64;
        }
        Ok(())
    }
}

const GROUPS: [&str; 3] = ["place", "shape", "count"];

/// The lower triangular factor of a covariance; directions without extent get 1e-6 of the largest.
fn lower(cov: &Sym3) -> [f64; 6] {
    let largest = cov.0[0].max(cov.0[3]).max(cov.0[5]).max(f64::MIN_POSITIVE);
    let least = 1e-12 * largest;
    let [xx, xy, xz, yy, yz, zz] = cov.0;
    let a = xx.max(least).sqrt();
    let (b, d) = (xy / a, xz / a);
    let c = (yy - b * b).max(least).sqrt();
    let e = (yz - b * d) / c;
    let f = (zz - d * d - e * e).max(least).sqrt();
    [a, b, c, d, e, f]
}

/// The lower triangle of L^T G L.
fn congruent(l: &[f64; 6], g: &[[f64; 3]; 3]) -> [f64; 6] {
    let [a, b, c, d, e, f] = *l;
    let columns = [[a, b, d], [0.0, c, e], [0.0, 0.0, f]];
    let at = |i: usize, j: usize| -> f64 {
        (0..3).map(|r| columns[i][r] * (0..3).map(|k| g[r][k] * columns[j][k]).sum::<f64>()).sum()
    };
    [at(0, 0), at(1, 0), at(1, 1), at(2, 0), at(2, 1), at(2, 2)]
}
