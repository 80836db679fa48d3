//! xi(r) from the modes of a transform.

use super::Domain;
use super::spectrum::{SpectrumOptions, TransformPair, visit_plane};
use particlegs_core::context::Context;
use particlegs_core::{Result, parallel};

/// xi of both fields in bins of r, from |delta_k|^2 with the shot noise subtracted.
///
/// The mean of exp(i k d) over the directions of d is sin(kr) / (kr), and over a shell of r the
/// difference of 3 (sin kr - kr cos kr) / k^3 at its edges over that of r^3: exact sums over the
/// modes, without a second transform. Bins narrower than about pi / k_max hold ringing.
pub(super) fn xi_of_modes(
    pair: &TransformPair,
    domain: &Domain,
    o: &SpectrumOptions,
    edges: &[f64],
    context: &Context<'_>,
) -> Result<[Vec<f64>; 2]> {
    let [a, b] = &pair.modes;
    let bins = edges.len().saturating_sub(1);
    let noise = pair.shot_noise.map(|n| n / domain.volume());
    let planes = parallel::try_map_range(2 * a.most[0] + 1, |i| {
        let mut sum = vec![[0.0; 2]; bins];
        visit_plane(a, domain, i, o.k_max, context, |at, _, k, weight| {
            let w = weight as f64;
            let power = [w * (a.value[at].norm_sqr() - noise[0]), w * (b.value[at].norm_sqr() - noise[1])];
            let mut below = primitive(k, edges[0]);
            for bin in 0..bins {
                let up_to = primitive(k, edges[bin + 1]);
                let share = up_to - below;
                below = up_to;
                sum[bin][0] += share * power[0];
                sum[bin][1] += share * power[1];
            }
        })?;
        Ok(sum)
    })?;
    let mut sum = vec![[0.0; 2]; bins];
    for p in planes {
        sum.iter_mut().zip(p).for_each(|(s, v)| (0..2).for_each(|t| s[t] += v[t]));
    }
    let xi_of = |t: usize| (0..bins).map(|i| sum[i][t] / (edges[i + 1].powi(3) - edges[i].powi(3))).collect();
    Ok([xi_of(0), xi_of(1)])
}

/// 3 times the integral of r^2 sin(kr) / (kr) up to r.
fn primitive(k: f64, r: f64) -> f64 {
    let x = k * r;
    if x < 1e-3 {
        return r * r * r * (1.0 - 0.1 * x * x);
    }
    let (sin, cos) = libm::sincos(x);
    3.0 * (sin - x * cos) / (k * k * k)
}

/// xi(r) from |delta_k|^2, in bins of pi / k_max from there on.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct XiByTransform {
    /// Edges of the bins, world units: one more than bins.
    pub edges: Vec<f64>,
    /// xi in each bin, truth and other.
    pub xi: [Vec<f64>; 2],
}
