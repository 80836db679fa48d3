//! A step: a picture drawn, its loss, the gradient of that, and Adam. On the processor here; a device's are its own.

use super::adjoint::{GaussianGradient, full};
use super::parameters::{FrameChange, Numbers, Parameters, WIDTHS};
use super::raster::Tape;
use crate::adam::Adam;
use crate::learner::{NonFiniteGradient, StepReport, TrainingSample};
use crate::loss::Loss;
use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use particlegs_core::math::exp2;
use particlegs_core::picture::Plane;
use particlegs_core::render::Scratch;
use particlegs_core::splat::{FxaaMean, Response, ToneStyle};
use particlegs_core::{Result, parallel};

const PIXELS: usize = 1 << 14;
/// The least number that is added to the root in Adam's division.
pub const LEAST_EPSILON: f64 = 1e-15;

/// The size of a step: rates, decays and shares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepSize {
    /// Adam's rates of place, shape and count.
    pub rates: [f64; 3],
    /// Decay of Adam's mean gradient.
    pub beta1: f64,
    /// Decay of Adam's mean squared gradient.
    pub beta2: f64,
    /// Share of a group's mean gradient that is added to each one's own in Adam's division.
    pub epsilon: f64,
    /// Share of ln(count / count at the start) that is taken back.
    pub decay: f64,
    /// Share that the average takes of the new Gaussians.
    pub average: f64,
}

pub trait DepthStepper {
    /// Draws the sample, takes the loss, and moves all parameters down its gradient. Gaussians with gradients that
    /// are not finite stay as they are, and are named. Moved parameters may lie elsewhere until they are
    /// [fetched](DepthStepper::fetch).
    fn step(
        &mut self,
        parameters: &mut Parameters,
        sample: &TrainingSample<'_>,
        loss: &Loss,
        size: &StepSize,
    ) -> Result<StepReport>;

    /// Brings the parameters up to date with the steps taken.
    fn fetch(&mut self, parameters: &mut Parameters) -> Result<()>;

    /// The parameters were changed by others than steps.
    fn changed(&mut self);

    /// Density control changed these Gaussians, which had been fetched, and the aims of groups; none are coded, and
    /// the average is of the present.
    fn replaced(&mut self, parameters: &Parameters, which: &[usize]) -> Result<()>;
}

#[derive(Default)]
pub struct DepthCpuSteps {
    scratch: Scratch,
    /// A Gaussian whose gradient is to be spoilt.
    #[cfg(test)]
    pub(super) poison: Option<usize>,
}

/// Gradients in the Gaussians' own frames, by group.
struct OwnFrameGradient {
    groups: [Vec<f32>; 3],
    not_finite: Option<NonFiniteGradient>,
}

impl DepthStepper for DepthCpuSteps {
    fn step(
        &mut self,
        parameters: &mut Parameters,
        sample: &TrainingSample<'_>,
        loss: &Loss,
        size: &StepSize,
    ) -> Result<StepReport> {
        #[allow(unused_mut)]
        let (value, mut world) = self.backward(parameters, sample, loss)?;
        #[cfg(test)]
        if let Some(g) = self.poison.and_then(|i| world.get_mut(i)) {
            g.cov[1] = f64::NAN;
        }
        let gradient = own_frame_gradient(parameters, &world);
        update(parameters, &gradient, size);
        parameters.averaged.approach(&parameters.now, size.average);
        Ok(StepReport { loss: value, not_finite: gradient.not_finite })
    }

    fn fetch(&mut self, _parameters: &mut Parameters) -> Result<()> {
        Ok(())
    }

    fn changed(&mut self) {}

    fn replaced(&mut self, _parameters: &Parameters, _which: &[usize]) -> Result<()> {
        Ok(())
    }
}

impl DepthCpuSteps {
    /// Loss of a sample, and its gradient with every Gaussian.
    fn backward(
        &mut self,
        parameters: &Parameters,
        sample: &TrainingSample<'_>,
        loss: &Loss,
    ) -> Result<(f64, Vec<GaussianGradient>)> {
        let (simd, mixture) = (sample.context.simd(), parameters.seen().mixture());
        let tape =
            Tape::draw(&mixture, &parameters.bounds, sample.view, &sample.crop, &mut self.scratch, sample.context)?;
        let curve =
            BrightnessCurve::new(parameters.look, sample.view.opacity, sample.view.radius_pixels(sample.crop.full));
        let size = tape.tau.size;
        let (mut drawn, mut slope) = (Plane::zeros(size), Plane::zeros(size));
        let pixels = drawn.data.chunks_mut(PIXELS).zip(slope.data.chunks_mut(PIXELS));
        parallel::for_each(pixels.zip(tape.tau.data.chunks(PIXELS)), |((drawn, slope), tau)| {
            curve.apply(simd, tau, drawn, slope);
        });
        let mut valued = loss.evaluate(&drawn, sample.target, simd);
        valued.gradient.data.iter_mut().zip(&slope.data).for_each(|(g, s)| *g *= s);
        Ok((valued.value, tape.gradient(&mixture, valued.gradient)))
    }
}

/// Gradients turned into the Gaussians' own frames; what is not finite counts as zero.
fn own_frame_gradient(parameters: &Parameters, world: &[GaussianGradient]) -> OwnFrameGradient {
    let seen = &parameters.seen().0;
    let turned = parallel::map_range(world.len(), |i| turned(&seen[i], &world[i]));
    let mut gradient =
        OwnFrameGradient { groups: WIDTHS.map(|k| Vec::with_capacity(k * world.len())), not_finite: None };
    for (i, (t, g)) in turned.iter().zip(world).enumerate() {
        let t = if g.is_finite() && t.iter().all(|v| v.is_finite()) {
            *t
        } else {
            let group = if g.mean.iter().any(|v| !v.is_finite()) {
                "position"
            } else if g.cov.iter().any(|v| !v.is_finite()) {
                "covariance"
            } else {
                "count"
            };
            gradient.not_finite.get_or_insert(NonFiniteGradient { group, gaussian: i, count: 0 }).count += 1;
            [0.0; 10]
        };
        gradient.groups[0].extend(&t[..3]);
        gradient.groups[1].extend(&t[3..9]);
        gradient.groups[2].push(t[9]);
    }
    // After zeros took the place of what is not finite: one such number would spoil its whole group.
    parameters.groups.share(&mut gradient.groups[2], seen);
    gradient
}

/// Adam's step, with the particles of every group of neighbours kept.
fn update(parameters: &mut Parameters, gradient: &OwnFrameGradient, size: &StepSize) {
    let m = parameters.len();
    let (beta1, beta2) = (size.beta1 as f32, size.beta2 as f32);
    let mut moves = WIDTHS.map(|k| vec![0.0f32; k * m]);
    for (k, rate) in size.rates.into_iter().enumerate() {
        // In proportion to the group's own gradients, whose size hangs on the pictures and is not known before.
        let epsilon = (size.epsilon * parameters.averages[k].mean_size(size.beta2)).max(LEAST_EPSILON) as f32;
        Adam { beta1, beta2, epsilon }.step(&mut moves[k], &gradient.groups[k], &mut parameters.averages[k], rate);
    }
    let decay = size.decay as f32;
    let mut changes: Vec<FrameChange> = (0..m)
        .map(|i| {
            let [p, s] = [&moves[0][3 * i..3 * i + 3], &moves[1][6 * i..6 * i + 6]];
            let away = (parameters.now.0[i][9] - parameters.first_log_count[i]) as f32;
            [p[0], p[1], p[2], s[0], s[1], s[2], s[3], s[4], s[5], moves[2][i] - decay * away]
        })
        .collect();
    // After Adam, whose division does not keep the sums that the gradients keep.
    parameters.groups.keep(&parameters.now.0, &mut changes);
    parameters.now.change(&changes);
    if let Some(decoded) = &mut parameters.decoded {
        decoded.change(&changes);
    }
}

/// A gradient in the Gaussian's own frame (see [`super::DepthGaussians::change`]).
fn turned(n: &Numbers, g: &GaussianGradient) -> [f32; 10] {
    let [_, _, _, a, b, c, d, e, f, log_count] = *n;
    let [x, y, z] = g.mean;
    let s = congruent(&[a, b, c, d, e, f], &full(&g.cov));
    let place = [a * x + b * y + d * z, c * y + e * z, f * z];
    let count = g.count * log_count.exp();
    // By L (1 + D) the covariance changes by L (D + D^T) L^T, so the gradient is twice L^T G L.
    let all =
        [place[0], place[1], place[2], 2.0 * s[0], 2.0 * s[1], 2.0 * s[2], 2.0 * s[3], 2.0 * s[4], 2.0 * s[5], count];
    all.map(|v| v as f32)
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

/// Brightness in [0, 1] against optical depth.
enum BrightnessCurve {
    /// 1 - exp(-tau)
    Expected,
    /// ParaView's level curve, with FXAA's mean or without.
    Response(Box<Response>, Option<FxaaMean>),
}

impl BrightnessCurve {
    /// The curve of a look for an opacity and a splat radius in pixels.
    fn new(look: ToneStyle, opacity: f64, radius_px: f64) -> Self {
        match look {
            ToneStyle::Expected => BrightnessCurve::Expected,
            ToneStyle::ParaviewNoFxaa => BrightnessCurve::Response(Box::new(Response::new(opacity)), None),
            ToneStyle::Paraview => {
                BrightnessCurve::Response(Box::new(Response::new(opacity)), Some(FxaaMean::new(opacity, radius_px)))
            }
        }
    }

    /// Brightness of each depth and its change with depth, in slices of one length.
    fn apply(&self, simd: Level, tau: &[f32], drawn: &mut [f32], slope: &mut [f32]) {
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
    // Vectors are whole, so the last few depths are padded with zeros.
    let mut last = [0.0f32; 16];
    last[..rest.len()].copy_from_slice(rest);
    dark(&{ last }).store_slice(&mut last);
    for ((d, s), dark) in drawn_rest.iter_mut().zip(slope_rest).zip(last) {
        (*d, *s) = (1.0 - dark, dark);
    }
}
