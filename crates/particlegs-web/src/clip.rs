//! The part of a mixture inside a box. Each Gaussian is cut by the box's planes, one axis after another, and replaced by
//! the Gaussian with the mass, mean and covariance of the rest. This is exact for one axis (Johnson, Kotz and
//! Balakrishnan 1994, section 13.10.1). Edges are soft where a Gaussian is wider than the box.

use particlegs_core::math::{Sym3, each_axis, normal_share};
use particlegs_core::model::{FieldMoments, Mixture, Model};
use particlegs_core::space::Bounds;
use std::cell::{Cell, RefCell};

/// Gaussians with a smaller share left are dropped.
const LEAST: f64 = 1e-5;
/// Indices of the rows of a covariance.
const ROWS: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The part of the model inside `bounds`, and the index in the model of each remaining Gaussian.
pub(crate) fn clipped(model: &Model, bounds: &Bounds) -> (Model, Vec<usize>) {
    let (numbers, before) = (RefCell::new(Vec::new()), Cell::new(0));
    let part = model.with_gaussians(|m| {
        let part = inside(m, bounds, |i| numbers.borrow_mut().push(before.get() + i));
        before.set(before.get() + m.len());
        part
    });
    (part, numbers.into_inner())
}

fn inside(m: &Mixture, bounds: &Bounds, mut keep: impl FnMut(usize)) -> Mixture {
    let mut part = Mixture { fields: m.fields.map(FieldMoments::emptied), ..Mixture::new(m.masses().is_some()) };
    for i in 0..m.len() {
        let (mut mean, mut cov, mut share) = (m.mean_of(i), m.cov_of(i), 1.0);
        for axis in 0..3 {
            share *= cut(&mut mean, &mut cov, axis, [bounds.min[axis], bounds.max[axis]]);
            if share < LEAST {
                break;
            }
        }
        if share >= LEAST {
            keep(i);
            part.push(mean, cov, m.count[i] * share, m.mass_of(i) * share);
            let moved = each_axis(|k| mean[k] - m.mean[k][i]);
            for ((_, moments), (_, field)) in part.fields.iter_mut().zip(m.fields.iter()) {
                moments.push_moved(field, i, moved);
            }
        }
    }
    part
}

/// Cuts a Gaussian by two planes across an axis; returns the remaining share.
fn cut(mean: &mut [f64; 3], cov: &mut Sym3, axis: usize, [low, high]: [f64; 2]) -> f64 {
    let variance = cov.0[ROWS[axis][axis]];
    let s = variance.max(0.0).sqrt();
    let at = mean[axis];
    // Less than 1e-8 of the mass lies further away than this.
    let reach = 6.0 * s;
    if at - reach >= low && at + reach <= high {
        return 1.0;
    }
    let share = normal_share(high - at, s) - normal_share(low - at, s);
    if s == 0.0 || share < LEAST {
        return share.max(0.0);
    }
    let density =
        |z: f64| if z.abs() < 40.0 { (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt() } else { 0.0 };
    // A distant plane must not give infinity times a density of 0.
    let (a, b) = (((low - at) / s).clamp(-40.0, 40.0), ((high - at) / s).clamp(-40.0, 40.0));
    let shift = (density(a) - density(b)) / share;
    let left = (1.0 + (a * density(a) - b * density(b)) / share - shift * shift).clamp(0.0, 1.0);
    // The other axes follow by their linear regression on this one.
    let slope = each_axis(|k| cov.0[ROWS[axis][k]] / variance);
    *mean = each_axis(|k| mean[k] + slope[k] * s * shift);
    let change = (left - 1.0) * variance;
    *cov = cov.add(&Sym3::outer(slope).scale(change));
    share
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    /// Compares share, mean and covariance inside a slab with random particles.
    #[test]
    fn a_slab_agrees_with_random_particles() {
        // x = 2 a, y = a + b, z = 0.5 c.
        let cov = Sym3([4.0, 2.0, 0.0, 2.0, 0.0, 0.25]);
        let mut m = Mixture::new(false);
        m.push([1.0, 2.0, 3.0], cov, 1000.0, 1000.0);
        let bounds = Bounds { min: [0.0, -1e9, -1e9], max: [2.5, 1e9, 1e9] };
        let part = inside(&m, &bounds, |_| ());
        let mut random = Random::new(7, 0, 0);
        let (mut n, mut sum, mut square) = (0.0, [0.0; 3], [0.0; 6]);
        const DRAWN: usize = 400_000;
        for _ in 0..DRAWN {
            let (a, b, c) = (random.normal(), random.normal(), random.normal());
            let p = [1.0 + 2.0 * a, 2.0 + a + b, 3.0 + 0.5 * c];
            if p[0] > 0.0 && p[0] < 2.5 {
                n += 1.0;
                for k in 0..3 {
                    sum[k] += p[k];
                    for j in k..3 {
                        square[ROWS[k][j]] += p[k] * p[j];
                    }
                }
            }
        }
        assert!((part.count[0] / 1000.0 - n / DRAWN as f64).abs() < 3e-3);
        let (mean, cov) = (part.mean_of(0), part.cov_of(0));
        for k in 0..3 {
            assert!((mean[k] - sum[k] / n).abs() < 0.02, "{mean:?}");
            for j in k..3 {
                let drawn = square[ROWS[k][j]] / n - sum[k] * sum[j] / (n * n);
                assert!((cov.0[ROWS[k][j]] - drawn).abs() < 0.03, "{cov:?} {drawn}");
            }
        }
    }

    #[test]
    fn halves_have_all_the_mass() {
        let mut m = Mixture::new(false);
        m.push([0.3, 0.1, 0.2], Sym3([1.0, 0.4, 0.1, 0.7, 0.0, 0.0]), 10.0, 10.0);
        let part = |min: f64, max: f64| {
            let bounds = Bounds { min: [-50.0, min, -50.0], max: [50.0, max, 50.0] };
            inside(&m, &bounds, |_| ()).count.iter().sum::<f64>()
        };
        assert!((part(-50.0, 0.5) + part(0.5, 50.0) - 10.0).abs() < 1e-5);
        assert_eq!(part(20.0, 50.0), 0.0);
    }

    #[test]
    fn what_is_cut_keeps_its_field_at_every_place() {
        let mut m = Mixture::new(false);
        m.push([0.0; 3], Sym3([1.0, 0.3, 0.0, 1.0, 0.0, 1.0]), 10.0, 10.0);
        let mut field = FieldMoments::new(1);
        field.mean[0].push(5.0);
        field.slope[0].iter_mut().zip([2.0, -1.0, 0.5]).for_each(|(s, v)| s.push(v));
        field.spread[0].push(3.0);
        m.fields.set("t", field.clone());
        let part = inside(&m, &Bounds { min: [0.5, -9.0, -9.0], max: [9.0; 3] }, |_| ());
        let (moments, mean) = (part.fields.get("t").unwrap(), part.mean_of(0));
        assert!(
            mean[0] > 0.5 && moments.mean[0][0] == field.mean_at(0, 0, mean) && moments.mean[0][0] > 5.9,
            "{mean:?}"
        );
        assert_eq!((&moments.slope, &moments.spread), (&field.slope, &field.spread));
    }
}
