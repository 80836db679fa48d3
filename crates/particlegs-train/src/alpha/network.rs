//! The network's gradient.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use particlegs_core::math::{Matrix, add_product};
use particlegs_core::model::VIZMAPPER_PARAMETERS;
use particlegs_core::parallel;
use particlegs_core::render::alpha::network::{HiddenActivations, Network, Places, RUN, dot};

/// Gaussians in one step of parallel work; fixed, so that sums do not depend on threads.
const STEP: usize = 16 * RUN;

const HIDDEN: usize = 64;

/// Changes with every layer's weights (the first layer's a row an input, the others' a row an
/// output) and biases.
struct NetworkGradient {
    weight: [Vec<f32>; 3],
    bias: [Vec<f32>; 2],
    last_bias: [f32; 2],
}

#[derive(Default)]
struct NetworkScratch {
    hidden: HiddenActivations,
    out: Vec<[f32; 2]>,
    last: Vec<[f32; 2]>,
    second: Vec<f32>,
    first: Vec<f32>,
}

/// A run of Gaussians on their way back through the network.
struct NetworkRun<'a> {
    /// The network's inputs.
    inputs: &'a [[f32; 4]],
    /// The changes with the network's outputs.
    wanted: &'a [[f32; 2]],
    /// The changes with the last two inputs, to be filled.
    with_inputs: &'a mut [[f32; 2]],
}

/// From the changes `wanted` with the network's outputs: those with its parameters, and with the
/// last two of each Gaussian's inputs.
pub(super) fn slopes(
    level: Level,
    network: &Network,
    inputs: &[[f32; 4]],
    wanted: &[[f32; 2]],
) -> (Vec<f32>, Vec<[f32; 2]>) {
    let mut with_inputs = vec![[0f32; 2]; inputs.len()];
    let spaces = parallel::Scratch::<NetworkScratch>::default();
    let steps = inputs.chunks(STEP).zip(wanted.chunks(STEP)).zip(with_inputs.chunks_mut(STEP));
    let steps = parallel::map(steps, |((inputs, wanted), with_inputs)| {
        let mut sums = NetworkGradient {
            weight: [4, HIDDEN, 2].map(|n| vec![0.0; n * HIDDEN]),
            bias: [(); 2].map(|_| vec![0.0; HIDDEN]),
            last_bias: [0.0; 2],
        };
        let runs = inputs.chunks(RUN).zip(wanted.chunks(RUN)).zip(with_inputs.chunks_mut(RUN));
        for ((inputs, wanted), with_inputs) in runs {
            let run = NetworkRun { inputs, wanted, with_inputs };
            spaces.with(|scratch| dispatch!(level, simd => back(simd, network, run, scratch, &mut sums)));
        }
        sums
    });
    (total(&steps), with_inputs)
}

#[inline(always)]
fn back<S: Simd>(
    simd: S,
    network: &Network,
    run: NetworkRun<'_>,
    scratch: &mut NetworkScratch,
    sums: &mut NetworkGradient,
) {
    let NetworkRun { inputs, wanted, with_inputs } = run;
    let n = inputs.len();
    let NetworkScratch { hidden, out, last, second, first } = scratch;
    out.resize(n, [0.0; 2]);
    network.run(simd.level(), inputs, hidden, out);
    last.clear();
    // tanh' = 1 - tanh^2: the outputs are enough.
    last.extend(out.iter().zip(wanted).map(|(o, w)| [0, 1].map(|k| w[k] * (1.0 - o[k] * o[k]))));
    last.iter().for_each(|d| (0..2).for_each(|k| sums.last_bias[k] += d[k]));
    // Steps of [1, width] read a run transposed: gradients of weights are sums over its Gaussians.
    let last = last.as_flattened();
    add_product(simd, [2, HIDDEN, n], Matrix { data: last, step: [1, 2] }, &hidden.value[1], &mut sums.weight[2]);
    second.clear();
    second.resize(n * HIDDEN, 0.0);
    add_product(simd, [n, HIDDEN, 2], Matrix { data: last, step: [2, 1] }, &network.last, second);
    times(simd, second, &hidden.slope[1]);
    // A single 1 that is never stepped over stands for a row of ones: the product sums the run.
    add_product(simd, [1, HIDDEN, n], Matrix { data: &[1.0], step: [0, 0] }, second, &mut sums.bias[1]);
    add_product(
        simd,
        [HIDDEN, HIDDEN, n],
        Matrix { data: second, step: [1, HIDDEN] },
        &hidden.value[0],
        &mut sums.weight[1],
    );
    first.clear();
    first.resize(n * HIDDEN, 0.0);
    add_product(simd, [n, HIDDEN, HIDDEN], Matrix { data: second, step: [HIDDEN, 1] }, &network.second_rows, first);
    times(simd, first, &hidden.slope[0]);
    add_product(simd, [1, HIDDEN, n], Matrix { data: &[1.0], step: [0, 0] }, first, &mut sums.bias[0]);
    add_product(simd, [4, HIDDEN, n], Matrix { data: inputs.as_flattened(), step: [1, 4] }, first, &mut sums.weight[0]);
    // The first two inputs are the picture's radius and opacity, which are not trained.
    for (row, with) in first.chunks_exact(HIDDEN).zip(with_inputs) {
        *with = [2, 3].map(|k| dot(row, &network.first[k * HIDDEN..(k + 1) * HIDDEN]));
    }
}

#[inline(always)]
fn times<S: Simd>(simd: S, a: &mut [f32], b: &[f32]) {
    for (a, b) in a.chunks_exact_mut(16).zip(b.chunks_exact(16)) {
        (f32x16::from_slice(simd, a) * f32x16::from_slice(simd, b)).store_slice(a);
    }
}

/// Adds up steps, in the order of [`particlegs_core::model::VizMapper::parameters`].
fn total(steps: &[NetworkGradient]) -> Vec<f32> {
    let places = Places::default();
    let mut sums = vec![0f64; VIZMAPPER_PARAMETERS];
    let mut add = |at: usize, v: f32| sums[at] += f64::from(v);
    for s in steps {
        for (i, v) in s.weight[0].iter().enumerate() {
            add(places.weight[0].start + i % HIDDEN * 4 + i / HIDDEN, *v);
        }
        for (l, start) in [(1, places.weight[1].start), (2, places.weight[2].start)] {
            s.weight[l].iter().enumerate().for_each(|(i, v)| add(start + i, *v));
        }
        for l in 0..2 {
            s.bias[l].iter().enumerate().for_each(|(i, v)| add(places.bias[l].start + i, *v));
        }
        (0..2).for_each(|k| add(places.bias[2].start + k, s.last_bias[k]));
    }
    sums.into_iter().map(|v| v as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;
    use particlegs_core::render::alpha::network::twin::{plain, stirred};

    #[test]
    fn slopes_are_differences() {
        let mapper = stirred(3);
        let mut draw = Random::new(4, 5, 6);
        let n = 2 * STEP / 3 + STEP;
        let x: Vec<[f32; 4]> = (0..n).map(|_| [0; 4].map(|_| draw.normal() as f32)).collect();
        // All but a few want nothing, so that differences need few evaluations.
        let mut wanted = vec![[0f32; 2]; n];
        let few = [0, 77, RUN, STEP + 5, n - 1];
        few.iter().for_each(|i| wanted[*i] = [draw.normal() as f32, draw.normal() as f32]);
        let (with_parameters, with_inputs) = slopes(Level::new(), &Network::new(&mapper), &x, &wanted);
        let value = |p: &[f64], shift: Option<(usize, usize, f64)>| -> f64 {
            few.iter()
                .map(|&i| {
                    let mut x = x[i].map(f64::from);
                    if let Some((j, k, by)) = shift
                        && i == j
                    {
                        x[k] += by;
                    }
                    let out = plain(p, x);
                    f64::from(wanted[i][0]) * out[0] + f64::from(wanted[i][1]) * out[1]
                })
                .sum()
        };
        let mut p: Vec<f64> = mapper.parameters.iter().map(|v| f64::from(*v)).collect();
        let h = 1e-5;
        for at in 0..p.len() {
            let original = p[at];
            p[at] = original + h;
            let up = value(&p, None);
            p[at] = original - h;
            let law = (up - value(&p, None)) / (2.0 * h);
            p[at] = original;
            assert!(
                (law - f64::from(with_parameters[at])).abs() < 2e-5 * (1.0 + law.abs()),
                "{at}: {} for {law}",
                with_parameters[at]
            );
        }
        for (&i, k) in few.iter().flat_map(|i| [(i, 2), (i, 3)]) {
            let law = (value(&p, Some((i, k, h))) - value(&p, Some((i, k, -h)))) / (2.0 * h);
            assert!((law - f64::from(with_inputs[i][k - 2])).abs() < 2e-5 * (1.0 + law.abs()));
        }
    }
}
