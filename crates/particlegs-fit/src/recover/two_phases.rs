//! Two phases of a logarithmic field, such as cold and hot gas, that are the same everywhere in a layer: only their shares
//! change from place to place.

use super::two_normals::TwoNormals;
use particlegs_core::model::{FieldMoments, Mixture};

/// Share of the particles that the narrowest Gaussians have, whose width is that of a phase.
const NARROWEST: f64 = 0.02;
/// Widths between the phases at least, and the least width over their distance.
const APART: f64 = 6.0;
const LEAST_WIDTH: f64 = 1e-6;
/// Largest errors of variances and of values that follow from the shares of phases: rounding makes 0.35 and 0.11.
const MOST_OFF: [f64; 2] = [0.45, 0.2];
/// Steps towards the mean of all values.
const SCALINGS: usize = 8;

/// Normal distributions of the logarithm, the same in all Gaussians.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoPhases {
    /// Means: the upper one's, the lower one's.
    means: [f64; 2],
    width: f64,
    /// Means of the values of each.
    values: [f64; 2],
    /// Factor of values, which makes their mean over all the model's.
    scale: f64,
}

/// A Gaussian's particles and their logarithms: variances are those across the Gaussian, with what slopes explain.
struct PhaseMoments {
    count: f64,
    mean: f64,
    variance: f64,
    /// Mean of the values.
    value: f64,
}

impl TwoPhases {
    /// Of the Gaussians of a layer; `None` where their moments are not those of two phases: with shares p and 1 - p of
    /// normals about u and v, variance + mean^2 is linear in the mean, and so is the mean of the values
    /// (docs/law/fields.md, "Values over decades").
    pub fn new(field: &FieldMoments, g: &Mixture) -> Option<TwoPhases> {
        field.excess.as_ref()?;
        let moments = |i: usize| {
            let cov = g.cov_of(i);
            let slope = [0, 1, 2].map(|k| field.slope[0][k][i]);
            PhaseMoments {
                count: g.count[i],
                mean: field.mean[0][i],
                variance: field.spread[0][i] + cov.quadratic(slope),
                value: field.overall_value(0, i, &cov),
            }
        };
        let mut gaussians: Vec<PhaseMoments> = (0..g.len()).filter(|i| g.count[*i] >= 1.0).map(moments).collect();
        gaussians.sort_by(|a, b| a.variance.total_cmp(&b.variance));
        let total: f64 = gaussians.iter().map(|m| m.count).sum();
        let average =
            |of: &dyn Fn(&PhaseMoments) -> f64| gaussians.iter().map(|m| m.count * of(m)).sum::<f64>() / total;
        // The narrowest Gaussians have next to nothing of the other phase.
        let mut rest = NARROWEST * total;
        let narrowest = gaussians.iter().find(|m| {
            rest -= m.count;
            rest <= 0.0
        })?;
        let center = average(&|m| m.mean);
        let away = |m: &PhaseMoments| m.mean - center;
        let square = |m: &PhaseMoments| m.variance + away(m) * away(m);
        // About the centre the means are the roots of y^2 - sum y - (variance + mean^2 at the centre - width^2).
        let sum = average(&|m| away(m) * square(m)) / average(&|m| away(m) * away(m));
        let root = (sum * sum + 4.0 * (average(&square) - narrowest.variance)).sqrt();
        let width = narrowest.variance.sqrt().max(LEAST_WIDTH * root);
        let means = [0.5 * (sum + root) + center, 0.5 * (sum - root) + center];
        let values = means.map(|mean| libm::exp(mean + 0.5 * width * width));
        let mut phases = TwoPhases { means, width, values, scale: 1.0 };
        let share = |m: &PhaseMoments| ((m.mean - means[1]) / root).clamp(0.0, 1.0);
        let off = |m: &PhaseMoments| root * root * share(m) * (1.0 - share(m)) + width * width - m.variance;
        let of_values = |m: &PhaseMoments| (phases.value(share(m)) - m.value).abs();
        let model = average(&|m| m.value);
        let alike = average(&|m| off(m) * off(m)) < MOST_OFF[0] * MOST_OFF[0] * average(&|m| m.variance * m.variance)
            && average(&of_values) < MOST_OFF[1] * model
            && root > APART * width;
        if !alike {
            return None;
        }
        // No share is above 1, which the others make up for.
        for _ in 0..SCALINGS {
            phases.scale *= model / average(&|m| phases.value(phases.share(m.value)));
        }
        Some(phases)
    }

    /// The mean of values of which this share is of the upper phase.
    fn value(&self, share: f64) -> f64 {
        share * self.values[0] + (1.0 - share) * self.values[1]
    }

    /// The share of the upper phase in values of this mean.
    fn share(&self, value: f64) -> f64 {
        let [upper, lower] = self.values;
        ((self.scale * value - lower) / (upper - lower)).clamp(0.0, 1.0)
    }
}

/// The distribution of the logarithms of Gaussian `i` about their mean, by the phases of its layer where it has any;
/// `None` of fields that are not logarithmic.
pub(super) fn logarithms(
    field: &FieldMoments,
    phases: Option<&TwoPhases>,
    g: &Mixture,
    i: usize,
) -> Option<TwoNormals> {
    let excess = field.excess.as_ref()?[i];
    Some(match phases {
        None => TwoNormals::new(field.spread[0][i], excess),
        Some(phases) => {
            let weight = phases.share(field.overall_value(0, i, &g.cov_of(i)));
            TwoNormals::mixed(weight, phases.means.map(|mean| mean - field.mean[0][i]), phases.width)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::{Random, Sym3};

    /// Gaussians whose particles are drawn by `log`, of Gaussian i of n and a random number.
    fn field(log: impl Fn(f64, &mut Random) -> f64) -> (FieldMoments, Mixture) {
        let (mut f, mut g) = (FieldMoments::logarithmic(), Mixture::new(false));
        f.range = vec![[-50.0, 50.0]];
        for i in 0..400 {
            let mut random = Random::new(9, 0, i);
            let logs: Vec<f64> = (0..200).map(|_| log(i as f64 / 400.0, &mut random)).collect();
            let mean = |of: &dyn Fn(f64) -> f64| logs.iter().map(|v| of(*v)).sum::<f64>() / logs.len() as f64;
            let center = mean(&|v| v);
            let variance = mean(&|v| (v - center) * (v - center));
            f.mean[0].push(center);
            f.slope[0].iter_mut().for_each(|column| column.push(0.0));
            f.spread[0].push(variance);
            f.excess.as_mut().unwrap().push(mean(&f64::exp).ln() - center - 0.5 * variance);
            g.push([i as f64, 0.0, 0.0], Sym3::scaled_identity(1.0), 200.0, 200.0);
        }
        (f, g)
    }

    #[test]
    fn two_phases_are_seen_and_keep_shares_and_the_mean_of_values() {
        let (f, g) = field(|at, r| if r.uniform() < 1.4 * at - 0.2 { 16.0 } else { 9.0 } + 0.3 * r.normal());
        let phases = TwoPhases::new(&f, &g).unwrap();
        assert!((phases.means[0] - 16.0).abs() < 0.1 && (phases.means[1] - 9.0).abs() < 0.1, "{phases:?}");
        assert!((phases.width - 0.3).abs() < 0.06, "{phases:?}");
        let of_model = |i: usize| f.overall_value(0, i, &g.cov_of(i));
        let shares: Vec<f64> = (0..400).map(|i| phases.share(of_model(i))).collect();
        assert!((shares.iter().sum::<f64>() / 400.0 - 0.5).abs() < 0.02);
        // Values that correlate with others are drawn by their quantiles, also where all are of one phase.
        let all_of_one = (0..400).filter(|i| [0.0, 1.0].contains(&shares[*i]));
        for i in all_of_one.chain([200]) {
            let normals = logarithms(&f, Some(&phases), &g, i).unwrap();
            assert!((0.1..=1.0).contains(&normals.gain()) && normals.quantile(0.3).is_finite(), "{i}: {normals:?}");
        }
        let [drawn, model] = [shares.iter().map(|p| phases.value(*p)).sum::<f64>(), (0..400).map(of_model).sum()];
        assert!((drawn / model - 1.0).abs() < 1e-3, "{drawn} {model}");
    }

    #[test]
    fn other_fields_have_no_phases() {
        // One phase that changes from place to place; noise alone; a second phase that follows the first.
        let one = field(|at, r| 9.0 + 4.0 * at + 0.5 * r.normal());
        let noise = field(|_, r| 9.0 + 2.0 * r.normal());
        let following = field(|at, r| 9.0 + 8.0 * at + if r.uniform() < 0.5 { 3.0 } else { 0.0 } + 0.3 * r.normal());
        for (f, g) in [one, noise, following] {
            assert!(TwoPhases::new(&f, &g).is_none());
        }
        assert!(TwoPhases::new(&FieldMoments::logarithmic(), &Mixture::new(false)).is_none());
    }
}
