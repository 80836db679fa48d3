//! Options of training under the alpha-blend law.

use particlegs_core::model::VizRanges;
use particlegs_core::{Error, Result};

/// Hyper-parameters; the default is the published single-block recipe (docs/law/published.md). When to
/// densify stands in [`crate::Densify`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlphaConfig {
    /// Whether the network that follows radius and opacity is trained. Without it Gaussians stay the same.
    pub vizmapper: bool,
    pub ranges: VizRanges,
    pub vizmapper_rate: f64,
    /// Largest norm of the network's gradient; 0 = any.
    pub vizmapper_clip: f64,
    /// Weight of mean((s - f_r)^2 + (o - f_a)^2), which holds the network to the identity.
    pub identity: f64,
    /// Adam's rate for positions at the first step, times `extent`.
    pub position_rate: f64,
    /// The same at step `position_rate_steps` and after; exponential between.
    pub position_rate_end: f64,
    /// Steps between the two.
    pub position_rate_steps: u64,
    /// Adam's rate for log-scales.
    pub scale_rate: f64,
    pub rotation_rate: f64,
    /// Adam's rate for logits of opacity.
    pub opacity_rate: f64,
    /// Adam's rate for grey levels, as degree 0 of spherical harmonics.
    pub feature_rate: f64,
    /// Size of the scene in the training frame: 1.1 times the farthest camera's distance.
    pub extent: f64,
    /// The iteration after which Gaussians may be added.
    pub densify_from: u64,
    /// Gaussians with a scale above this share of `extent` are split, others cloned.
    pub percent_dense: f64,
    /// Gaussians with a lower opacity are pruned whenever some are added; 0 = none.
    pub least_opacity: f64,
    /// Iterations from one reset of opacities, to max(0.01, 1.33 `least_opacity`), to the next; 0 = never.
    pub reset_every: u64,
    /// Gaussians at most: beyond, only those with the largest gradients are added; `None` (0 in a file) = as
    /// many as [`crate::Defaults::gaussians`] says.
    #[serde(with = "crate::config::zero_is_none")]
    pub most_gaussians: Option<u64>,
}

impl Default for AlphaConfig {
    fn default() -> Self {
        AlphaConfig {
            vizmapper: true,
            ranges: VizRanges::TRAINING,
            vizmapper_rate: 1e-4,
            vizmapper_clip: 1.0,
            identity: 0.01,
            position_rate: 1.6e-4,
            position_rate_end: 1.6e-6,
            position_rate_steps: 50_000,
            scale_rate: 5e-3,
            rotation_rate: 1e-3,
            opacity_rate: 2.5e-2,
            feature_rate: 2.5e-3,
            extent: 4.4,
            densify_from: 500,
            percent_dense: 0.01,
            least_opacity: 0.01,
            reset_every: 3000,
            most_gaussians: None,
        }
    }
}

impl AlphaConfig {
    /// Of the published fine-tuning: wider ranges, no reset, no pruning, nothing that holds the
    /// network, densification from the first iteration.
    pub fn fine_tuning() -> Self {
        AlphaConfig {
            ranges: VizRanges::FINE_TUNING,
            identity: 0.0,
            densify_from: 1,
            least_opacity: 0.0,
            reset_every: 0,
            ..AlphaConfig::default()
        }
    }

    pub fn check(&self) -> Result<()> {
        let fail = |message: &str| Err(Error::argument(format!("training: alpha_blend: {message}")));
        let rates = [
            self.position_rate,
            self.position_rate_end,
            self.scale_rate,
            self.rotation_rate,
            self.opacity_rate,
            self.feature_rate,
            self.vizmapper_rate,
        ];
        if !rates.iter().all(|r| (0.0..=1.0).contains(r)) {
            return fail("all rates must be 0 to 1");
        }
        let share = |v: f64| (0.0..1.0).contains(&v);
        let VizRanges { scale, opacity, floor } = self.ranges;
        if !(share(scale) && share(opacity) && floor > 0.0 && floor <= 1.0) {
            return fail("ranges: use scale and opacity from 0 to below 1, and floor above 0 up to 1");
        }
        if !(self.extent > 0.0 && self.extent.is_finite()) {
            return fail("extent must be positive");
        }
        let weights = [self.vizmapper_clip, self.identity, self.percent_dense];
        if !(share(self.least_opacity) && weights.iter().all(|v| *v >= 0.0 && v.is_finite())) {
            return fail(
                "least_opacity must be below 1; it, vizmapper_clip, identity and percent_dense must not be negative",
            );
        }
        Ok(())
    }

    /// Adam's rate for positions at the step of that number, counted from 1.
    pub(crate) fn position_rate_at(&self, step: u64) -> f64 {
        let t = (step as f64 / self.position_rate_steps.max(1) as f64).min(1.0);
        // A rate of 0 has no logarithm; the smallest positive number moves nothing either.
        let [from, to] = [self.position_rate, self.position_rate_end].map(|r| r.max(f64::MIN_POSITIVE).ln());
        self.extent * (from + (to - from) * t).exp()
    }

    /// Rescales the numbers that count steps by `steps`.
    pub(crate) fn schedule(&mut self, steps: impl Fn(u64) -> u64) {
        let counts = [&mut self.position_rate_steps, &mut self.densify_from, &mut self.reset_every];
        counts.into_iter().for_each(|count| *count = steps(*count));
    }

    /// The largest opacity after a reset.
    pub(super) fn reset_opacity(&self) -> f64 {
        (1.33 * self.least_opacity).max(0.01)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_rates() {
        let c = AlphaConfig::default();
        assert!((c.position_rate_at(25_000) / 4.4 - 1.6e-5).abs() < 1e-12);
        assert!((c.position_rate_at(90_000) / 4.4 - 1.6e-6).abs() < 1e-12);
        assert!((c.reset_opacity() - 0.0133).abs() < 1e-12);
        c.check().unwrap();
        AlphaConfig::fine_tuning().check().unwrap();
        let fault = AlphaConfig { extent: f64::NAN, ..c }.check().unwrap_err().to_string();
        assert_eq!(fault, "training: alpha_blend: extent must be positive");
        let text = serde_json::to_string(&c).unwrap();
        assert_eq!(serde_json::from_str::<AlphaConfig>(&text).unwrap(), c);
        assert_eq!(serde_json::from_str::<AlphaConfig>("{}").unwrap(), c);
        assert!(serde_json::from_str::<AlphaConfig>(r#"{"rate": 1}"#).is_err());
    }
}
