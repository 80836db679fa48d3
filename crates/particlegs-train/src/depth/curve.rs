//! The tone curve with its slope: from optical depth to brightness.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use particlegs_core::math::exp2;
use particlegs_core::splat::{FxaaMean, Response, ToneStyle};

/// Brightness in [0, 1] against optical depth.
pub enum BrightnessCurve {
    /// 1 - exp(-tau)
    Expected,
    /// ParaView's level curve, with FXAA's mean or without.
    Response(Box<Response>, Option<FxaaMean>),
}

impl BrightnessCurve {
    /// The curve of a look for an opacity and a splat radius in pixels.
    pub fn new(look: ToneStyle, opacity: f64, radius_px: f64) -> Self {
        match look {
            ToneStyle::Expected => BrightnessCurve::Expected,
            ToneStyle::ParaviewNoFxaa => BrightnessCurve::Response(Box::new(Response::new(opacity)), None),
            ToneStyle::Paraview => {
                BrightnessCurve::Response(Box::new(Response::new(opacity)), Some(FxaaMean::new(opacity, radius_px)))
            }
        }
    }

    /// Brightness of each depth and its change with depth, in slices of one length.
    pub fn apply(&self, simd: Level, tau: &[f32], drawn: &mut [f32], slope: &mut [f32]) {
        match self {
            BrightnessCurve::Expected => dispatch!(simd, simd => expected(simd, tau, drawn, slope)),
            BrightnessCurve::Response(response, mean) => {
                let level = |t: f32| response.level(t) * mean.as_ref().map_or(1.0, |m| m.ratio(t)) / 255.0;
                for ((&t, d), s) in tau.iter().zip(drawn).zip(slope) {
                    // The curve is a table: its slope is taken over a few of its steps.
                    let step = (0.02 * t).max(1e-5);
                    (*d, *s) = (level(t), (level(t + step) - level((t - step).max(0.0))) / (step + step.min(t)));
                }
            }
        }
    }
}

/// 1 - exp(-tau) and exp(-tau): [`exp2`] rather than libm's, which differ from machine to machine.
#[inline(always)]
fn expected<S: Simd>(simd: S, tau: &[f32], drawn: &mut [f32], slope: &mut [f32]) {
    let dark = |t: &[f32; 16]| exp2(simd, f32x16::from_slice(simd, t) * -std::f32::consts::LOG2_E);
    let (whole, rest) = tau.as_chunks::<16>();
    let (drawn, drawn_rest) = drawn.as_chunks_mut::<16>();
    let (slope, slope_rest) = slope.as_chunks_mut::<16>();
    for ((t, d), s) in whole.iter().zip(drawn).zip(slope) {
        let dark = dark(t);
        dark.store_slice(s);
        (f32x16::splat(simd, 1.0) - dark).store_slice(d);
    }
    let mut last = [0.0f32; 16];
    last[..rest.len()].copy_from_slice(rest);
    dark(&{ last }).store_slice(&mut last);
    for ((d, s), dark) in drawn_rest.iter_mut().zip(slope_rest).zip(last) {
        (*d, *s) = (1.0 - dark, dark);
    }
}
