//! A smaller mixture from a mixture, without the particles.
//!
//! Two Gaussians become the one that has the moments of both, the pairs that show least first. What
//! shows is measured as split and merge measure it: the squared difference of the projections along
//! the three axes, under the blur of pictures, in closed form. Rounds take the cheapest disjoint
//! pairs of neighbours until few enough are left, so that 2 million Gaussians take no heap and no
//! more than n log n. Then, as k-means does for points, each old Gaussian goes to the new one that
//! explains it best (Goldberger and Roweis 2004), and the new ones get the moments of their own.
//! Count, mass, mean and covariance of the whole are kept throughout.

use super::Blur;
use super::candidates::{Ellipsoid, OverlapTree};
use super::split_merge::{Blob, difference, union};
use crate::math::Sym3;
use crate::memory::require;
use crate::model::Mixture;
use crate::particles::Bounds;
use crate::progress::Progress;
use crate::{Error, Result};
use rayon::prelude::*;

/// What to make of a mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimplifyOptions {
    /// Gaussians, at most.
    pub gaussians: usize,
    /// Radius that particles are drawn with, world units.
    pub radius: f64,
    /// A pixel of the pictures that the model is made for, world units.
    pub pixel: f64,
}

/// Neighbours that a Gaussian may merge with, and among which an old one looks for its new one.
const NEIGHBOURS: usize = 12;
/// Largest share of the Gaussians that a round merges away.
const SHARE: f64 = 0.1;
/// Rounds of regrouping.
const REGROUPINGS: usize = 4;
/// Blur of the measure and floor of sizes, in particle radii, as in refinement.
const BLUR_RADII: f64 = 6.0;
const FLOOR_RADII: f64 = 0.6;
/// Bytes that a Gaussian takes in the work.
const BYTES_A_GAUSSIAN: u64 = 600;

/// Merges Gaussians until at most `options.gaussians` are left. The same bits for any number of
/// threads. Gaussians without particles are dropped.
///
/// # Errors
/// [`Error::Argument`] for no Gaussians or a radius that is not positive; [`Error::Memory`];
/// [`Error::Cancelled`].
pub fn simplify(mixture: &Mixture, options: &SimplifyOptions, progress: &dyn Progress) -> Result<Mixture> {
    if options.gaussians == 0 || !(options.radius > 0.0 && options.radius.is_finite() && options.pixel >= 0.0) {
        return Err(Error::argument(format!(
            "{} Gaussians and a radius of {} must be positive",
            options.gaussians, options.radius
        )));
    }
    require("simplifying", mixture.len() as u64 * BYTES_A_GAUSSIAN)?;
    let frame = Frame::of(mixture);
    let old = frame.items(mixture);
    let radius = options.radius / frame.unit;
    let blur = Blur::of_picture(BLUR_RADII * radius, options.pixel / frame.unit);
    let measure = Measure { blur2: 2.0 * blur * blur, floor: (FLOOR_RADII * radius).powi(2) };
    let excess = old.len().saturating_sub(options.gaussians);
    progress.begin("simplify", excess as u64);
    let mut new = old.clone();
    while new.len() > options.gaussians {
        progress.check()?;
        let before = new.len();
        new = round(new, options.gaussians, measure);
        progress.advance((before - new.len()) as u64);
    }
    if excess > 0 {
        for _ in 0..REGROUPINGS {
            progress.check()?;
            new = regrouped(&old, &new, measure);
        }
    }
    progress.end();
    Ok(frame.mixture(&new, mixture.mass.is_some()))
}

/// A Gaussian and its mass.
#[derive(Clone, Copy)]
struct Item {
    blob: Blob,
    mass: f64,
}

#[derive(Clone, Copy)]
struct Measure {
    /// Twice the variance of the blur.
    blur2: f64,
    /// Least variance in the search for neighbours.
    floor: f64,
}

/// The unit and the origin of the work: products of many lengths stay within f64 whatever the unit.
struct Frame {
    origin: [f64; 3],
    unit: f64,
}

impl Frame {
    fn of(mixture: &Mixture) -> Frame {
        let mut bounds = Bounds::empty();
        (0..mixture.len()).for_each(|i| bounds.include(mixture.mean_of(i)));
        let widest = bounds.extent().into_iter().fold(0.0, f64::max);
        let spread = mixture.cov[0].iter().zip(&mixture.cov[3]).zip(&mixture.cov[5]);
        let size = spread.map(|((x, y), z)| (x + y + z).sqrt()).fold(0.0, f64::max);
        let unit = widest.max(size);
        Frame { origin: bounds.center(), unit: if unit > 0.0 && unit.is_finite() { unit } else { 1.0 } }
    }

    fn items(&self, mixture: &Mixture) -> Vec<Item> {
        let per = 1.0 / self.unit;
        let item = |i: usize| {
            let mean = mixture.mean_of(i);
            let mean = std::array::from_fn(|k| (mean[k] - self.origin[k]) * per);
            let cov = mixture.cov_of(i).scale(per).scale(per);
            Item { blob: Blob { count: mixture.count[i], mean, cov }, mass: mixture.mass_of(i) }
        };
        (0..mixture.len()).filter(|&i| mixture.count[i] > 0.0).map(item).collect()
    }

    fn mixture(&self, items: &[Item], masses: bool) -> Mixture {
        let mut out = Mixture { mass: masses.then(Vec::new), ..Mixture::default() };
        for Item { blob, mass } in items {
            let mean = std::array::from_fn(|k| self.origin[k] + blob.mean[k] * self.unit);
            out.push(mean, blob.cov.scale(self.unit).scale(self.unit), blob.count, *mass);
        }
        out
    }
}

fn ellipsoid(b: &Blob, floor: f64) -> Ellipsoid {
    Ellipsoid::new(b.mean, b.cov.add(&Sym3::scaled_identity(floor)), b.count)
}

/// The cheapest merge of a Gaussian.
struct Merge {
    cost: f64,
    a: u32,
    b: u32,
}

/// Merges the cheapest disjoint pairs, until `wanted` are left or a round's share is used up.
fn round(items: Vec<Item>, wanted: usize, measure: Measure) -> Vec<Item> {
    let merges = cheapest(&items, measure);
    let most = (items.len() - wanted).min((items.len() as f64 * SHARE) as usize).max(1);
    let mut partner = vec![None; items.len()];
    let mut gone = vec![false; items.len()];
    let mut made = 0;
    for Merge { a, b, .. } in merges {
        let (a, b) = (a as usize, b as usize);
        if made == most {
            break;
        }
        if gone[a] || gone[b] || partner[a].is_some() || partner[b].is_some() {
            continue;
        }
        partner[a] = Some(b);
        gone[b] = true;
        made += 1;
    }
    let joined = |i: usize| match partner[i] {
        None => items[i],
        Some(j) => Item { blob: union(&items[i].blob, &items[j].blob), mass: items[i].mass + items[j].mass },
    };
    (0..items.len()).filter(|&i| !gone[i]).map(joined).collect()
}

/// Each Gaussian's cheapest merge among its neighbours, the cheapest of all first.
fn cheapest(items: &[Item], measure: Measure) -> Vec<Merge> {
    let ellipsoids: Vec<Ellipsoid> = items.par_iter().map(|i| ellipsoid(&i.blob, measure.floor)).collect();
    let tree = OverlapTree::new(&ellipsoids);
    let own = |found: &mut Vec<(f64, u32)>, j: usize| {
        tree.nearest(&ellipsoids[j], NEIGHBOURS, f64::INFINITY, found);
        let me = &items[j].blob;
        let merge = |n: u32| {
            let other = &items[n as usize].blob;
            let cost = difference(&union(me, other), me, other, measure.blur2);
            Merge { cost, a: (j as u32).min(n), b: (j as u32).max(n) }
        };
        let others = found.iter().map(|f| f.1).filter(|&n| n as usize != j);
        others.map(merge).min_by(by_cost)
    };
    let mut merges: Vec<Merge> =
        (0..items.len()).into_par_iter().with_min_len(64).map_init(Vec::new, own).flatten_iter().collect();
    merges.par_sort_unstable_by(by_cost);
    merges
}

fn by_cost(p: &Merge, q: &Merge) -> std::cmp::Ordering {
    p.cost.total_cmp(&q.cost).then((p.a, p.b).cmp(&(q.a, q.b)))
}

/// Each old Gaussian goes to the new one under which it is likeliest; the new ones get the moments
/// of their own. One that nothing goes to is dropped.
fn regrouped(old: &[Item], new: &[Item], measure: Measure) -> Vec<Item> {
    let ellipsoids: Vec<Ellipsoid> = new.par_iter().map(|i| ellipsoid(&i.blob, measure.floor)).collect();
    let tree = OverlapTree::new(&ellipsoids);
    let inverse: Vec<Option<(Sym3, f64)>> =
        ellipsoids.par_iter().map(|e| Some((e.cov.inverse()?, e.cov.det().ln() - e.log_count2))).collect();
    let home = |found: &mut Vec<(f64, u32)>, item: &Item| {
        let me = ellipsoid(&item.blob, measure.floor);
        tree.nearest(&me, NEIGHBOURS, f64::INFINITY, found);
        // Minus twice the mean log-likelihood of its particles, but for a constant.
        let cost = |n: u32| {
            let Some((inverse, constant)) = &inverse[n as usize] else { return f64::INFINITY };
            let d = std::array::from_fn(|k| me.mean[k] - ellipsoids[n as usize].mean[k]);
            trace_of_product(inverse, &me.cov) + inverse.quadratic(d) + constant
        };
        let all = found.iter().map(|f| (cost(f.1), f.1));
        all.min_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1))).map_or(0, |best| best.1)
    };
    let homes: Vec<u32> = old.par_iter().with_min_len(64).map_init(Vec::new, home).collect();
    let mut groups: Vec<Option<Item>> = vec![None; new.len()];
    for (item, &home) in old.iter().zip(&homes) {
        let group = &mut groups[home as usize];
        *group = Some(match group {
            None => *item,
            Some(g) => Item { blob: union(&g.blob, &item.blob), mass: g.mass + item.mass },
        });
    }
    groups.into_iter().flatten().collect()
}

fn trace_of_product(a: &Sym3, b: &Sym3) -> f64 {
    let (a, b) = (&a.0, &b.0);
    a[0] * b[0] + a[3] * b[3] + a[5] * b[5] + 2.0 * (a[1] * b[1] + a[2] * b[2] + a[4] * b[4])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::progress::Silent;

    fn mixture(n: u64, unit: f64) -> Mixture {
        let mut m = Mixture { mass: Some(Vec::new()), ..Mixture::default() };
        for i in 0..n {
            let mut r = Random::new(9, 0, i);
            let mut v = || [r.normal(), r.normal(), r.normal()];
            let (mean, a, b) = (v(), v(), v());
            let cov = Sym3::outer(a).add(&Sym3::outer(b)).scale(0.01).add(&Sym3::scaled_identity(1e-4));
            let count = (1.0 + 20.0 * v()[0].abs()).round();
            m.push(mean.map(|x| unit * (7.0 + x)), cov.scale(unit).scale(unit), count, 0.5 * count);
        }
        m
    }

    /// Count, mass, mean and covariance of the whole.
    fn moments(m: &Mixture) -> (f64, Blob) {
        let item = |i| Blob { count: m.count[i], mean: m.mean_of(i), cov: m.cov_of(i) };
        let whole = (1..m.len()).fold(item(0), |all, i| union(&all, &item(i)));
        ((0..m.len()).map(|i| m.mass_of(i)).sum(), whole)
    }

    #[test]
    fn moments_are_conserved_at_any_unit() {
        for unit in [1.0, 1e-20, 1e20] {
            let m = mixture(500, unit);
            for k in [1, 7, 200, 499, 500, 900] {
                let options = SimplifyOptions { gaussians: k, radius: 0.02 * unit, pixel: 0.01 * unit };
                let small = simplify(&m, &options, &Silent).unwrap();
                assert!(small.len() <= k && small.len() >= k.min(500) * 9 / 10, "{k}: {}", small.len());
                let ((mass, a), (mass2, b)) = (moments(&m), moments(&small));
                assert_eq!((a.count, mass), (b.count, mass2));
                for j in 0..3 {
                    assert!((a.mean[j] - b.mean[j]).abs() < 1e-10 * unit);
                }
                for j in 0..6 {
                    assert!((a.cov.0[j] - b.cov.0[j]).abs() < 1e-10 * unit * unit);
                }
            }
        }
    }

    #[test]
    fn twins_merge_first() {
        let mut m = Mixture::default();
        for x in [0.0, 1.0, 1.001, 2.0] {
            m.push([x, 0.0, 0.0], Sym3::scaled_identity(0.01), 10.0, 0.0);
        }
        let small = simplify(&m, &SimplifyOptions { gaussians: 3, radius: 0.01, pixel: 0.0 }, &Silent).unwrap();
        assert_eq!(small.count, [10.0, 20.0, 10.0]);
        assert!((small.mean[0][1] - 1.0005).abs() < 1e-12);
    }

    #[test]
    fn nothing_is_refused() {
        let options = SimplifyOptions { gaussians: 0, radius: 1.0, pixel: 0.0 };
        assert!(simplify(&mixture(3, 1.0), &options, &Silent).is_err());
    }
}
