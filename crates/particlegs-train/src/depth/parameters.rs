//! The Gaussians of the optical-depth law in training: the numbers that steps move (means, factors of covariances,
//! logarithms of counts), and what steps hold to.

use super::groups::GaussianGroups;
use crate::adam::Averages;
use particlegs_core::math::Sym3;
use particlegs_core::model::Mixture;
use particlegs_core::parallel;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;

/// Groups of numbers that have a rate each, and their numbers a Gaussian: place, shape, count.
pub const WIDTHS: [usize; 3] = [3, 6, 1];

#[derive(Clone, Debug)]
pub struct Parameters {
    /// Bounds of the particles, world units.
    pub bounds: Bounds,
    pub look: ToneStyle,
    pub now: DepthGaussians,
    /// Their running average, which is scored and kept.
    pub averaged: DepthGaussians,
    /// The same as decoded and moved since, where they are coded on the way: pictures are drawn of these.
    pub decoded: Option<DepthGaussians>,
    /// Neighbours whose counts keep their sum.
    pub groups: GaussianGroups,
    /// ln count at the start.
    pub first_log_count: Vec<f64>,
    /// Adam's averages of each group's numbers, Gaussian by Gaussian.
    pub averages: [Averages; 3],
}

impl Parameters {
    /// Those of a mixture of `particles`, whose counts are kept among so many neighbours (0 = all).
    pub fn new(mixture: &Mixture, particles: u64, kept_among: u64, bounds: Bounds, look: ToneStyle) -> Parameters {
        let now = DepthGaussians::from_mixture(mixture, |i| i);
        Parameters {
            bounds,
            look,
            averaged: now.clone(),
            decoded: None,
            groups: GaussianGroups::new(&now.0, particles, kept_among),
            first_log_count: now.0.iter().map(|n| n[9]).collect(),
            averages: WIDTHS.map(|k| Averages::zeros(k * now.0.len())),
            now,
        }
    }

    pub fn len(&self) -> usize {
        self.now.0.len()
    }

    pub fn is_empty(&self) -> bool {
        self.now.0.is_empty()
    }

    /// The Gaussians that pictures are drawn of.
    pub fn seen(&self) -> &DepthGaussians {
        self.decoded.as_ref().unwrap_or(&self.now)
    }
}

const RUN: usize = 1024;

/// Numbers of a Gaussian: mean (3), rows of the lower factor of its covariance (00, 10, 11, 20, 21,
/// 22), ln count.
pub type Numbers = [f64; 10];

/// A change of a Gaussian in its own frame: mean (3), lower factor (6), ln count.
pub(super) type FrameChange = [f32; 10];

/// Gaussians, ten numbers each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthGaussians(pub Vec<Numbers>);

impl DepthGaussians {
    /// Those of a mixture; Gaussian i is the mixture's `place(i)`.
    pub fn from_mixture(m: &Mixture, place: impl Fn(usize) -> usize + Sync) -> Self {
        let one = |i: usize| {
            let i = place(i);
            let ([x, y, z], l) = (m.mean_of(i), lower(&m.cov_of(i)));
            // A Gaussian of no particles could never grow.
            [x, y, z, l[0], l[1], l[2], l[3], l[4], l[5], m.count[i].max(1e-3).ln()]
        };
        DepthGaussians(parallel::map_range(m.len(), one))
    }

    pub fn mixture(&self) -> Mixture {
        let row = |i: usize| -> Numbers {
            let [x, y, z, a, b, c, d, e, f, log_count] = self.0[i];
            let cov = [a * a, a * b, a * d, b * b + c * c, b * d + c * e, d * d + e * e + f * f];
            [x, y, z, cov[0], cov[1], cov[2], cov[3], cov[4], cov[5], log_count.exp()]
        };
        let rows = parallel::map_range(self.0.len(), row);
        let mut columns = [const { Vec::new() }; 10];
        parallel::for_each(columns.iter_mut().enumerate(), |(k, column)| *column = rows.iter().map(|r| r[k]).collect());
        let [x, y, z, xx, xy, xz, yy, yz, zz, count] = columns;
        Mixture { mean: [x, y, z], cov: [xx, xy, xz, yy, yz, zz], count, ..Mixture::default() }
    }

    /// Moves every number a share of the way to `other`'s.
    pub fn approach(&mut self, other: &DepthGaussians, share: f64) {
        parallel::for_each(self.0.chunks_mut(RUN).zip(other.0.chunks(RUN)), |(run, other)| {
            let numbers = run.as_flattened_mut().iter_mut().zip(other.as_flattened());
            numbers.for_each(|(a, b)| *a += share * (b - *a));
        });
    }

    /// Moves every Gaussian in its own frame: its mean by L v, its factor to L B with B lower
    /// triangular and the exponential of a number on the diagonal, its count by a factor.
    pub fn change(&mut self, by: &[FrameChange]) {
        parallel::for_each(self.0.iter_mut().zip(by), |(n, by)| {
            let [_, _, _, a, b, c, d, e, f, _] = *n;
            let change = by.map(f64::from);
            let [u, v, w, p, s10, q, s20, s21, r, count] = change;
            n[0] += a * u;
            n[1] += b * u + c * v;
            n[2] += d * u + e * v + f * w;
            let (p, q, r) = (p.exp(), q.exp(), r.exp());
            n[3] = a * p;
            n[4] = b * p + c * s10;
            n[5] = c * q;
            n[6] = d * p + e * s10 + f * s20;
            n[7] = e * q + f * s21;
            n[8] = f * r;
            n[9] += count;
        });
    }
}

/// The lower triangular factor of a covariance; directions without extent get 1e-6 of the largest.
fn lower(cov: &Sym3) -> [f64; 6] {
    let largest = cov.0[0].max(cov.0[3]).max(cov.0[5]).max(f64::MIN_POSITIVE);
    let least = 1e-12 * largest;
    let [xx, xy, xz, yy, yz, zz] = cov.0;
    let a = xx.max(least).sqrt();
    let (b, d) = (xy / a, xz / a);
    let c = (yy - b * b).max(least).sqrt();
    let e = (yz - b * d) / c;
    let f = (zz - d * d - e * e).max(least).sqrt();
    [a, b, c, d, e, f]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixtures_come_back_and_nothing_changes_nothing() {
        let mut m = Mixture::default();
        m.push([1.0, -2.0, 3.0], Sym3([2.0, 0.3, -0.1, 1.0, 0.2, 0.5]), 7.0, 0.0);
        m.push([0.0; 3], Sym3([1e-6, 0.0, 0.0, 2.0, 0.0, 3.0]), 1.0, 0.0);
        let mut columns = DepthGaussians::from_mixture(&m, |i| 1 - i);
        columns.change(&[[0.0; 10]; 2]);
        let back = columns.mixture();
        for k in 0..6 {
            assert!((back.cov[k][1] - m.cov[k][0]).abs() < 1e-12, "{k}");
        }
        assert!((back.count[1] - 7.0).abs() < 1e-12 && back.mean_of(1) == m.mean_of(0));
    }

    #[test]
    fn a_mean_moves_by_standard_deviations() {
        let mut m = Mixture::default();
        m.push([0.0; 3], Sym3([4.0, 0.0, 0.0, 9.0, 0.0, 16.0]), 1.0, 0.0);
        let mut columns = DepthGaussians::from_mixture(&m, |i| i);
        columns.change(&[[1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5]]);
        assert_eq!(columns.0[0][..3], [2.0, 3.0, 4.0]);
        assert!((columns.0[0][9] - 0.5).abs() < 1e-12);
    }
}
