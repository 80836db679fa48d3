//! The network that follows radius and opacity, at work (paper section III-B).

use crate::math::{Matrix, Purpose, Random, add_product, each_axis, exp2};
use crate::model::{VIZMAPPER_PARAMETERS, VIZMAPPER_SHAPE, VizMapper, VizRanges};
use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use std::ops::Range;

const INPUTS: usize = VIZMAPPER_SHAPE[0];
const HIDDEN: usize = VIZMAPPER_SHAPE[1];

/// Gaussians in one run of the network.
pub const RUN: usize = 128;

/// Centre and half width of a Gaussian's own inputs, mean log-scale and logit opacity.
pub const OWN: [[f64; 2]; 2] = [[-8.0, 2.0], [-3.0, 4.0]];

/// Ranges of each layer's weights and biases in [`VizMapper::parameters`].
pub struct Places {
    /// Of the weights of each layer, a row an output.
    pub weight: [Range<usize>; 3],
    /// Of the biases of each layer.
    pub bias: [Range<usize>; 3],
}

/// Offsets for the only shape.
impl Default for Places {
    fn default() -> Self {
        let mut at = 0;
        let mut take = |n: usize| {
            at += n;
            at - n..at
        };
        let pairs: [_; 3] =
            each_axis(|l| (take(VIZMAPPER_SHAPE[l] * VIZMAPPER_SHAPE[l + 1]), take(VIZMAPPER_SHAPE[l + 1])));
        Places { weight: pairs.each_ref().map(|p| p.0.clone()), bias: pairs.map(|p| p.1) }
    }
}

/// Radius and opacity wanted, over the defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// `f_r`.
    pub radius: f64,
    /// `f_a`.
    pub opacity: f64,
}

/// The network's changes to one Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation {
    /// Factor on its scales: `f_r (1 + delta_s)`.
    pub scale: f64,
    /// Factor on the odds of its opacity: `max(f_a (1 + delta_o), floor)`.
    pub odds: f64,
    /// Whether the floor held.
    pub floored: bool,
}

impl Adaptation {
    /// Without a network every Gaussian stays as it is, whatever radius and opacity are (paper
    /// section IV-B: the static model).
    pub const STATIC: Adaptation = Adaptation { scale: 1.0, odds: 1.0, floored: false };

    /// The opacity of a Gaussian with this logit: `sigmoid(logit + ln odds)`.
    pub fn opacity(&self, logit: f64) -> f64 {
        1.0 / (1.0 + libm::exp(-logit) / self.odds)
    }
}

impl VizRanges {
    /// The law, from the network's two outputs in [-1, 1].
    pub fn adapt(&self, setting: Setting, out: [f32; 2]) -> Adaptation {
        let [s, o] = out.map(f64::from);
        let free = setting.opacity * (1.0 + self.opacity * o);
        Adaptation {
            scale: setting.radius * (1.0 + self.scale * s),
            odds: free.max(self.floor),
            floored: free.is_nan() || free <= self.floor,
        }
    }
}

impl VizMapper {
    /// An untrained network: its last layer is zero, so that it corrects nothing; the others are
    /// uniform within one over the root of their inputs, as PyTorch starts linear layers.
    pub fn new(ranges: VizRanges, seed: u64) -> Self {
        let mut parameters = vec![0f32; VIZMAPPER_PARAMETERS];
        let places = Places::default();
        let mut draw = Random::from_purpose(Purpose::VizMapperStart, seed, 0);
        for l in 0..2 {
            let bound = 1.0 / (VIZMAPPER_SHAPE[l] as f64).sqrt();
            for i in places.weight[l].clone().chain(places.bias[l].clone()) {
                parameters[i] = (bound * (2.0 * draw.uniform() - 1.0)) as f32;
            }
        }
        VizMapper { parameters, ranges }
    }
}

/// Inputs of one Gaussian from mean log-scale and logit opacity.
pub fn inputs(setting: Setting, log_scale: f64, logit: f64) -> [f32; INPUTS] {
    let normalise = |v: f64, [centre, half]: [f64; 2]| ((v - centre) / half) as f32;
    [
        (setting.radius - 1.0) as f32,
        (setting.opacity - 1.0) as f32,
        normalise(log_scale, OWN[0]),
        normalise(logit, OWN[1]),
    ]
}

/// A network laid out for its arithmetic.
pub struct Network {
    /// Weights, a row an input.
    pub first: Vec<f32>,
    /// Weights, a row an input.
    pub second: Vec<f32>,
    /// Weights, a row an output.
    pub last: Vec<f32>,
    /// Weights of the second layer, a row an output.
    pub second_rows: Vec<f32>,
    /// Of the three layers.
    pub bias: [Vec<f32>; 3],
}

/// Activations of a run: of each hidden layer a row of 64 a Gaussian.
#[derive(Default)]
pub struct HiddenActivations {
    /// After SiLU.
    pub value: [Vec<f32>; 2],
    /// Change of that with what stands before it.
    pub slope: [Vec<f32>; 2],
}

impl Network {
    /// Lays the parameters out.
    pub fn new(vizmapper: &VizMapper) -> Self {
        assert_eq!(vizmapper.parameters.len(), VIZMAPPER_PARAMETERS, "the network's shape is fixed");
        let places = Places::default();
        let part = |r: &Range<usize>| vizmapper.parameters[r.clone()].to_vec();
        let weights = places.weight.each_ref().map(part);
        Network {
            first: transposed(&weights[0], INPUTS),
            second: transposed(&weights[1], HIDDEN),
            last: weights[2].clone(),
            second_rows: weights[1].clone(),
            bias: places.bias.each_ref().map(part),
        }
    }

    /// The two outputs of up to [`RUN`] Gaussians, in [-1, 1].
    pub fn run(&self, level: Level, inputs: &[[f32; INPUTS]], hidden: &mut HiddenActivations, out: &mut [[f32; 2]]) {
        dispatch!(level, simd => self.hidden(simd, inputs, hidden));
        for (row, out) in hidden.value[1].chunks_exact(HIDDEN).zip(out) {
            *out = std::array::from_fn(|o| {
                let w = &self.last[o * HIDDEN..(o + 1) * HIDDEN];
                libm::tanhf(self.bias[2][o] + dot(row, w))
            });
        }
    }

    #[inline(always)]
    fn hidden<S: Simd>(&self, simd: S, inputs: &[[f32; INPUTS]], hidden: &mut HiddenActivations) {
        let n = inputs.len();
        let HiddenActivations { value: [h1, h2], slope: [d1, d2] } = hidden;
        for (h, bias) in [(&mut *h1, &self.bias[0]), (&mut *h2, &self.bias[1])] {
            h.clear();
            (0..n).for_each(|_| h.extend_from_slice(bias));
        }
        add_product(
            simd,
            [n, HIDDEN, INPUTS],
            Matrix { data: inputs.as_flattened(), step: [INPUTS, 1] },
            &self.first,
            h1,
        );
        silu(simd, h1, d1);
        add_product(simd, [n, HIDDEN, HIDDEN], Matrix { data: h1, step: [HIDDEN, 1] }, &self.second, h2);
        silu(simd, h2, d2);
    }
}

/// Rows and columns exchanged.
fn transposed(m: &[f32], columns: usize) -> Vec<f32> {
    let rows = m.len() / columns;
    (0..m.len()).map(|i| m[i % rows * columns + i / rows]).collect()
}

/// Of rows of 64, sixteen lanes wide.
pub fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0f32; 16];
    for (a, b) in a.chunks_exact(16).zip(b.chunks_exact(16)) {
        for i in 0..16 {
            lanes[i] += a[i] * b[i];
        }
    }
    crate::math::across(&lanes)
}

/// x sigmoid(x) in place, and its slope.
#[inline(always)]
fn silu<S: Simd>(simd: S, x: &mut [f32], slope: &mut Vec<f32>) {
    slope.resize(x.len(), 0.0);
    for (x, slope) in x.chunks_exact_mut(16).zip(slope.chunks_exact_mut(16)) {
        let v = f32x16::from_slice(simd, x);
        let s = f32x16::splat(simd, 1.0) / (exp2(simd, v * -std::f32::consts::LOG2_E) + 1.0);
        let value = v * s;
        value.store_slice(x);
        (s + value * (-s + 1.0)).store_slice(slope);
    }
}

/// Whole columns through the network, a run at a time.
pub fn outputs(level: Level, network: &Network, inputs: &[[f32; INPUTS]], out: &mut [[f32; 2]]) {
    let mut hidden = HiddenActivations::default();
    for (inputs, out) in inputs.chunks(RUN).zip(out.chunks_mut(RUN)) {
        network.run(level, inputs, &mut hidden, out);
    }
}

#[cfg(any(test, feature = "twins"))]
#[allow(clippy::disallowed_methods)]
pub mod twin {
    //! The network as a reader would write it, and one to try it with.

    use super::*;

    /// The network as a reader would write it.
    pub fn plain(parameters: &[f64], x: [f64; 4]) -> [f64; 2] {
        let places = Places::default();
        let mut v = x.to_vec();
        for l in 0..3 {
            let (w, b) = (&parameters[places.weight[l].clone()], &parameters[places.bias[l].clone()]);
            v = w
                .chunks(VIZMAPPER_SHAPE[l])
                .zip(b)
                .map(|(row, b)| {
                    let z = b + row.iter().zip(&v).map(|(w, v)| w * v).sum::<f64>();
                    if l < 2 { z / (1.0 + (-z).exp()) } else { z.tanh() }
                })
                .collect();
        }
        [v[0], v[1]]
    }

    /// An untrained network with a last layer that does something.
    pub fn stirred(seed: u64) -> VizMapper {
        let mut m = VizMapper::new(VizRanges::TRAINING, seed);
        let mut draw = Random::new(seed, 99, 0);
        m.parameters[4 * 64 + 64 + 64 * 64 + 64..].fill_with(|| 0.4 * draw.normal() as f32);
        m
    }
}

#[cfg(test)]
mod tests {
    use super::twin::{plain, stirred};
    use super::*;

    #[test]
    fn agrees_with_its_plain_twin_and_with_itself_without_simd() {
        let m = stirred(5);
        let mut draw = Random::new(1, 2, 3);
        let x: Vec<[f32; 4]> = (0..301).map(|_| [0; 4].map(|_| draw.normal() as f32)).collect();
        let run = |level| {
            let mut out = vec![[0f32; 2]; x.len()];
            outputs(level, &Network::new(&m), &x, &mut out);
            out
        };
        let (fast, slow) = (run(Level::new()), run(Level::baseline()));
        assert_eq!(fast, slow);
        let parameters: Vec<f64> = m.parameters.iter().map(|v| f64::from(*v)).collect();
        for (x, y) in x.iter().zip(&fast) {
            let law = plain(&parameters, x.map(f64::from));
            assert!((0..2).all(|k| (law[k] - f64::from(y[k])).abs() < 2e-6), "{law:?} {y:?}");
        }
    }

    #[test]
    fn an_untrained_network_is_the_identity() {
        let m = VizMapper::new(VizRanges::TRAINING, 7);
        assert_eq!(m, VizMapper::new(VizRanges::TRAINING, 7));
        let mut out = [[1f32; 2]];
        let setting = Setting { radius: 1.5, opacity: 0.25 };
        outputs(Level::new(), &Network::new(&m), &[inputs(setting, -5.0, 2.0)], &mut out);
        let a = m.ranges.adapt(setting, out[0]);
        assert_eq!((a.scale, a.odds, a.floored), (1.5, 0.4, true));
        let logit = (0.3f64 / 0.7).ln();
        assert!((Adaptation::STATIC.opacity(logit) - 0.3).abs() < 1e-15);
        assert!((a.opacity(logit) - 1.0 / (1.0 + 0.7 / 0.3 / 0.4)).abs() < 1e-15);
    }
}
