//! The tone curve with its slope: from optical depth to brightness.

use crate::splat::{FxaaMean, Look, Response};

/// Brightness in [0, 1] against optical depth.
pub enum Curve {
    /// 1 - exp(-tau)
    Expected,
    /// ParaView's level curve, with FXAA's mean or without.
    Response(Box<Response>, Option<FxaaMean>),
}

impl Curve {
    /// The curve of a look for an opacity and a splat radius in pixels.
    pub fn new(look: Look, opacity: f64, radius_px: f64) -> Self {
        match look {
            Look::Expected => Curve::Expected,
            Look::ParaviewNoFxaa => Curve::Response(Box::new(Response::new(opacity)), None),
            Look::Paraview => {
                Curve::Response(Box::new(Response::new(opacity)), Some(FxaaMean::new(opacity, radius_px)))
            }
        }
    }

    /// Brightness and its change with depth.
    #[inline]
    pub fn at(&self, tau: f32) -> (f32, f32) {
        match self {
            Curve::Expected => {
                let dark = (-tau).exp();
                (1.0 - dark, dark)
            }
            Curve::Response(response, mean) => {
                let level = |t: f32| response.level(t) * mean.as_ref().map_or(1.0, |m| m.ratio(t)) / 255.0;
                // The curve is a table: its slope is taken over a few of its steps.
                let step = (0.02 * tau).max(1e-5);
                (level(tau), (level(tau + step) - level((tau - step).max(0.0))) / (step + step.min(tau)))
            }
        }
    }
}
