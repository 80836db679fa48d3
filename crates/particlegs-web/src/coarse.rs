//! A smaller mixture for pictures in motion. Consecutive Gaussians of a file are neighbours in space, so runs of them are
//! merged into one Gaussian with the same mass, mean and covariance, also of fields with places.

use particlegs_core::math::{Sym3, dot, each_axis};
use particlegs_core::model::{Columns, FieldMoments, LawKind, Mixture, Model};
use std::ops::Range;

/// Approximate number of Gaussians that can be drawn in motion.
const MOST: usize = 60_000;

/// Number of Gaussians to merge into one; `None` if the model has at most [`MOST`] or is not of the optical-depth law.
pub(crate) fn run(gaussians: usize, law: LawKind) -> Option<usize> {
    Some(gaussians.div_ceil(MOST)).filter(|run| *run > 1 && law == LawKind::OpticalDepth)
}

/// The model in about [`MOST`] Gaussians.
pub(crate) fn coarse(model: &Model) -> Option<Model> {
    let run = run(model.gaussians(), model.metadata.law)?;
    Some(model.with_gaussians(|m| joined(m, run)))
}

/// Merges each run of `run` Gaussians into one.
pub(crate) fn joined(m: &Mixture, run: usize) -> Mixture {
    // Correlations are not joined.
    let empty_moments = |f: &FieldMoments| FieldMoments { correlations: Columns::default(), ..f.emptied() };
    let mut to = Mixture { fields: m.fields.map(empty_moments), ..Mixture::new(m.masses().is_some()) };
    for start in (0..m.len()).step_by(run) {
        let all = start..m.len().min(start + run);
        let count: f64 = m.count[all.clone()].iter().sum();
        let mass: f64 = all.clone().map(|i| m.mass_of(i)).sum();
        if count <= 0.0 {
            continue;
        }
        // Means are summed about the first, so that places far from 0 keep their digits.
        let first = m.mean_of(start);
        let sum = all.clone().fold([0.0; 3], |s, i| each_axis(|k| s[k] + m.count[i] * (m.mean[k][i] - first[k])));
        let mean = each_axis(|k| first[k] + sum[k] / count);
        let cov = all.clone().fold(Sym3::default(), |s, i| {
            let offset = each_axis(|k| m.mean[k][i] - mean[k]);
            s.add(&m.cov_of(i).add(&Sym3::outer(offset)).scale(m.count[i] / count))
        });
        to.push(mean, cov, count, mass);
        for ((_, joined_field), (_, field)) in to.fields.iter_mut().zip(m.fields.iter()) {
            join_field(joined_field, m, field, &all, (mean, cov));
        }
    }
    to
}

/// Adds the moments of a field over a run of Gaussians, whose joint position has this mean and covariance: the linear
/// regression of all values on all places.
fn join_field(
    to: &mut FieldMoments,
    m: &Mixture,
    field: &FieldMoments,
    all: &Range<usize>,
    (mean, cov): ([f64; 3], Sym3),
) {
    let count: f64 = m.count[all.clone()].iter().sum();
    let sum = |term: &dyn Fn(usize) -> f64| all.clone().map(|i| m.count[i] / count * term(i)).sum::<f64>();
    let slope = |c: usize, i: usize| each_axis(|k| field.slope[c][k][i]);
    let means: Vec<f64> = field.mean.iter().map(|column| sum(&|i| column[i])).collect();
    let from_mean = |c: usize, i: usize| field.mean[c][i] - means[c];
    let with = |c: usize| {
        each_axis(|k| sum(&|i| m.cov_of(i).apply(slope(c, i))[k] + (m.mean[k][i] - mean[k]) * from_mean(c, i)))
    };
    let with: Vec<[f64; 3]> = (0..means.len()).map(with).collect();
    // A flat or pointlike covariance has no inverse without a little width.
    let inverse = cov.add(&Sym3::scaled_identity(1e-9 * cov.trace())).inverse().unwrap_or_default();
    let slopes: Vec<[f64; 3]> = with.iter().map(|w| inverse.apply(*w)).collect();
    for (c, mean) in means.iter().enumerate() {
        to.mean[c].push(*mean);
        (0..3).for_each(|k| to.slope[c][k].push(slopes[c][k]));
    }
    let pairs = (0..means.len()).flat_map(|a| (a..means.len()).map(move |b| (a, b)));
    for (place, (a, b)) in pairs.enumerate() {
        let within = |i: usize| field.spread[place][i] + dot(slope(a, i), m.cov_of(i).apply(slope(b, i)));
        // What the joint slopes explain is no spread about them.
        let spread = sum(&|i| within(i) + from_mean(a, i) * from_mean(b, i)) - dot(with[a], slopes[b]);
        to.spread[place].push(if a == b { spread.max(0.0) } else { spread });
    }
    if let Some(excess) = &mut to.excess {
        // The excess is what a log-normal distribution of these moments lacks of the values' mean.
        let value = sum(&|i| field.overall_value(0, i, &m.cov_of(i)));
        let spread = to.spread[0].last().copied().unwrap_or(0.0);
        excess.push(value.ln() - means[0] - 0.5 * (spread + cov.quadratic(slopes[0])));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_keep_their_moments() {
        let mut m = Mixture::new(true);
        m.push([0.0, 0.0, 1.0], Sym3([1.0, 0.0, 0.0, 1.0, 0.0, 1.0]), 10.0, 5.0);
        m.push([2.0, 0.0, 1.0], Sym3([1.0, 0.5, 0.0, 1.0, 0.0, 2.0]), 30.0, 1.0);
        m.push([9.0, 0.0, 1.0], Sym3([1.0, 0.0, 0.0, 1.0, 0.0, 1.0]), 7.0, 2.0);
        let to = joined(&m, 2);
        assert_eq!((to.len(), to.count[0], to.mass_of(0), to.count[1]), (2, 40.0, 6.0, 7.0));
        assert_eq!(to.mean_of(0), [1.5, 0.0, 1.0]);
        // 1 within, and 0.25 * 1.5^2 + 0.75 * 0.5^2 between.
        assert!((to.cov_of(0).0[0] - 1.75).abs() < 1e-12 && (to.cov_of(0).0[1] - 0.375).abs() < 1e-12);
        assert_eq!(to.cov_of(1), m.cov_of(2));
    }

    /// A field that is linear in the place stays it; what differs from that adds to the spread.
    #[test]
    fn runs_keep_a_field_that_is_linear() {
        let mut m = Mixture::new(false);
        m.push([0.0, 0.0, 1.0], Sym3([1.0, 0.0, 0.0, 1.0, 0.0, 1.0]), 10.0, 10.0);
        m.push([2.0, 1.0, 1.0], Sym3([1.0, 0.5, 0.0, 1.0, 0.0, 2.0]), 30.0, 30.0);
        let mut field = FieldMoments::new(3);
        for c in 0..3 {
            let slope = [1.0, c as f64, -2.0];
            field.mean[c].extend((0..2).map(|i| 7.0 + dot(slope, m.mean_of(i))));
            (0..3).for_each(|k| field.slope[c][k].extend([slope[k]; 2]));
        }
        [4.0, 1.0, 0.0, 3.0, 0.5, 2.0].into_iter().zip(&mut field.spread).for_each(|(v, s)| s.extend([v; 2]));
        m.fields.set("v", field.clone());
        let to = joined(&m, 2);
        let moments = to.fields.get("v").unwrap();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
        for c in 0..3 {
            let slope = [1.0, c as f64, -2.0];
            near(moments.mean[c][0], 7.0 + dot(slope, to.mean_of(0)));
            (0..3).for_each(|k| near(moments.slope[c][k][0], slope[k]));
        }
        moments.spread.iter().zip(&field.spread).for_each(|(a, b)| near(a[0], b[0]));
    }
}
