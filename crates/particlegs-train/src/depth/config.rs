//! Options of training under the optical-depth law.

use particlegs_core::{Error, Result};
use serde::{Deserialize, Serialize};

/// Rates of the groups of parameters, relative to the rate of the step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthRates {
    /// Means, in standard deviations.
    pub place: f64,
    /// Shapes, in logarithms of radii.
    pub shape: f64,
    pub count: f64,
}

/// Hyper-parameters of training under the optical-depth law.
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
    pub rates: DepthRates,
    /// Neighbouring Gaussians, at most, whose counts keep their sum: pictures move mass between
    /// neighbours, not across the box; 0 = all.
    pub kept_among: u64,
    /// Share of ln(count / count at the start) taken back each step, times the rate: pictures do not
    /// hold the mass of saturated cores.
    pub count_pull: f64,
    /// Share of the Gaussians that density control moves at a time: the quietest are merged into a
    /// neighbour, the loudest are halved; 0 = none. When is said by the stages.
    pub relocate: f64,
    /// Steps from one coding to the next: between them steps are taken from the decoded Gaussians, so
    /// that they learn what rounding does; 0 = never.
    pub code_every: u64,
    /// Share of the run after which that begins.
    pub code_from: f64,
    /// Share of the run after which the precision stays, and the coder's choices with it (at least
    /// `code_from`); 1 = never.
    pub settle_from: f64,
    /// Share of the way back to what was decoded that Gaussians are then taken at each coding.
    pub settle: f64,
    /// Share of the group's mean gradient that is added to each one's own in Adam's division:
    /// parameters that pictures hardly depend on then hardly move, instead of wandering.
    pub calm: f64,
    /// Steps over which the Gaussians that are scored and kept are averaged, at most a tenth of those
    /// done; 1 = not.
    pub average: f64,
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
            rates: DepthRates { place: 1.0, shape: 1.0, count: 1.0 },
            kept_among: 48,
            count_pull: 0.0,
            average: 300.0,
            calm: 0.5,
            relocate: 0.005,
            code_every: 20,
            code_from: 0.2,
            settle_from: 0.5,
            settle: 0.04,
            beta1: 0.9,
            beta2: 0.999,
        }
    }
}

impl DepthConfig {
    pub fn check(&self) -> Result<()> {
        let r = &self.rates;
        let within = |v: f64, low: f64, high: f64| (low..=high).contains(&v);
        let checks = [
            ("rate must be above 0 and at most 1", self.rate > 0.0 && self.rate <= 1.0),
            ("last_rate must be above 0 and at most 1", self.last_rate > 0.0 && self.last_rate <= 1.0),
            ("all rates must be 0 to 100", [r.place, r.shape, r.count].iter().all(|v| within(*v, 0.0, 100.0))),
            ("count_pull must be 0 to 100", within(self.count_pull, 0.0, 100.0)),
            ("relocate must be 0 to 0.25", within(self.relocate, 0.0, 0.25)),
            ("code_from must be 0 to 1", within(self.code_from, 0.0, 1.0)),
            (
                "settle_from and settle must be 0 to 1",
                [self.settle_from, self.settle].iter().all(|s| within(*s, 0.0, 1.0)),
            ),
            ("calm must be 0 to 1000", within(self.calm, 0.0, 1e3)),
            ("average must be 1 to 1e9", within(self.average, 1.0, 1e9)),
            (
                "beta1 and beta2 must be at least 0 and below 1",
                [self.beta1, self.beta2].iter().all(|b| (0.0..1.0).contains(b)),
            ),
        ];
        match checks.iter().find(|c| !c.1) {
            Some((message, _)) => Err(Error::argument(format!("training: optical_depth: {message}"))),
            None => Ok(()),
        }
    }
}
