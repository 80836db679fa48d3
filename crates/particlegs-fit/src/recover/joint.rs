//! Normal numbers that scalar fields are drawn by, so that values correlate within each Gaussian as the model states.

use super::two_phases::{TwoPhases, logarithms};
use particlegs_core::model::{Columns, Mixture};
use std::ops::Range;

/// Variance that is left to a field at least where the others are known.
const LEAST_LEFT: f64 = 1e-6;

/// For each scalar that correlates with another, numbers of a standard normal distribution for the particles that
/// `parts` shares among the Gaussians: made of `normals`, numbers of the field's own.
pub(super) fn correlated_normals<P: Iterator<Item = (usize, Range<usize>)>>(
    (g, phases): (&Mixture, &Columns<TwoPhases>),
    parts: impl Fn() -> P,
    normals: impl FnMut(&str) -> Vec<f64>,
) -> Columns<Vec<f64>> {
    let is_joint = |a: &&str| g.fields.iter().any(|(b, _)| g.correlation(a, b).is_some());
    let names: Vec<&str> = g.fields.iter().map(|f| f.0).filter(is_joint).collect();
    let mut draws: Vec<Vec<f64>> = names.iter().copied().map(normals).collect();
    for (gaussian, part) in parts().filter(|_| !names.is_empty()) {
        let root = root((g, phases), &names, gaussian);
        for i in part {
            // From the last to the first: each is made of those before it.
            for (k, row) in root.iter().enumerate().rev() {
                draws[k][i] = row.iter().enumerate().map(|(j, v)| v * draws[j][i]).sum();
            }
        }
    }
    let mut out = Columns::default();
    names.iter().zip(draws).for_each(|(name, numbers)| out.set(name, numbers));
    out
}

/// The rows of a lower triangle whose product with its transpose has the correlations of a Gaussian's fields, as near
/// as there are fields that have them.
fn root((g, phases): (&Mixture, &Columns<TwoPhases>), names: &[&str], gaussian: usize) -> Vec<Vec<f64>> {
    let gain = |name: &&str| match g.fields.get(name) {
        // Values that are not normal correlate less than what they are drawn by: to first order, so that pairs of
        // skewed distributions that fall as the other rises still miss a third of it.
        Some(f) => logarithms(f, phases.get(name), g, gaussian).map_or(1.0, |normals| normals.gain()),
        None => 1.0,
    };
    let gains: Vec<f64> = names.iter().map(gain).collect();
    let mut rows: Vec<Vec<f64>> = Vec::with_capacity(names.len());
    for (k, name) in names.iter().enumerate() {
        let mut row: Vec<f64> = Vec::with_capacity(k + 1);
        for (j, before) in rows.iter().enumerate() {
            let r = g.correlation(name, names[j]).map_or(0.0, |r| r[gaussian] / (gains[k] * gains[j])).clamp(-1.0, 1.0);
            let explained: f64 = row.iter().zip(before).map(|(a, b)| a * b).sum();
            row.push((r - explained) / before[j]);
        }
        let explained: f64 = row.iter().map(|v| v * v).sum();
        if explained > 1.0 - LEAST_LEFT {
            let scale = ((1.0 - LEAST_LEFT) / explained).sqrt();
            row.iter_mut().for_each(|v| *v *= scale);
        }
        row.push((1.0 - explained.min(1.0 - LEAST_LEFT)).sqrt());
        rows.push(row);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recover::two_normals::TwoNormals;
    use particlegs_core::math::{Random, Sym3};
    use particlegs_core::model::FieldMoments;

    const COUNT: usize = 40_000;

    fn normals(seed: u64) -> Vec<f64> {
        (0..COUNT as u64).map(|i| Random::new(seed, 0, i).normal()).collect()
    }

    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let (x, y) = (mean(a), mean(b));
        let with = |p: &[f64], x: f64, q: &[f64], y: f64| p.iter().zip(q).map(|(p, q)| (p - x) * (q - y)).sum::<f64>();
        with(a, x, b, y) / (with(a, x, a, x) * with(b, y, b, y)).sqrt()
    }

    /// A mixture of one Gaussian whose fields have these excesses and correlations.
    fn mixture(excess: [Option<f64>; 3], pairs: [f64; 3]) -> Mixture {
        let mut m = Mixture::new(false);
        m.push([0.0; 3], Sym3::scaled_identity(1.0), COUNT as f64, 0.0);
        for (name, excess) in ["a", "b", "c"].into_iter().zip(excess) {
            let mut field = FieldMoments { range: vec![[-50.0, 50.0]], ..FieldMoments::new(1) };
            (field.mean[0], field.spread[0]) = (vec![0.0], vec![4.0]);
            field.excess = excess.map(|e| vec![e]);
            m.fields.set(name, field);
        }
        for ((a, b), r) in [("a", "b"), ("a", "c"), ("b", "c")].into_iter().zip(pairs) {
            m.fields.get_mut(a).unwrap().correlations.set(b, vec![r]);
        }
        m
    }

    #[test]
    fn values_correlate_as_stated_also_those_of_two_phases() {
        for (excess, pairs, slack) in [
            ([None; 3], [0.7, -0.4, 0.1], 0.01),
            ([Some(0.0), Some(-1.2), None], [-0.6, 0.3, 0.2], 0.02),
            ([Some(-1.0), Some(-1.5), Some(0.3)], [0.5, 0.0, 0.0], 0.05),
        ] {
            let m = mixture(excess, pairs);
            let part = || std::iter::once((0, 0..COUNT));
            let drawn =
                correlated_normals((&m, &Columns::default()), part, |name| normals(u64::from(name.as_bytes()[0])));
            let value = |name: &str| -> Vec<f64> {
                let (field, z) = (m.fields.get(name).unwrap(), drawn.get(name).unwrap());
                let phases = TwoNormals::new(4.0, field.excess.as_ref().map_or(0.0, |e| e[0]));
                z.iter().map(|z| phases.quantile(*z)).collect()
            };
            for ((a, b), r) in [("a", "b"), ("a", "c"), ("b", "c")].into_iter().zip(pairs) {
                let drawn_correlation = correlation(&value(a), &value(b));
                assert!((drawn_correlation - r).abs() < slack, "{a} {b}: {drawn_correlation}, not {r}");
            }
        }
        // Correlations that no fields can have give some that are numbers.
        let m = mixture([None; 3], [0.99, 0.99, -0.99]);
        let drawn = correlated_normals(
            (&m, &Columns::default()),
            || std::iter::once((0, 0..COUNT)),
            |n| normals(u64::from(n.as_bytes()[0])),
        );
        assert!(drawn.get("c").unwrap().iter().all(|v| v.abs() < 6.0));
        assert!(
            correlated_normals((&Mixture::new(false), &Columns::default()), std::iter::empty, |_| normals(1))
                .get("a")
                .is_none()
        );
    }
}
