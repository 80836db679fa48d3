//! A smaller mixture for pictures in motion. Consecutive Gaussians of a file are neighbours in space, so runs of them are
//! merged into one Gaussian with the same mass, mean and covariance.

use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::{LawKind, Mixture, Model};

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
    let mut to = Mixture::new(m.masses().is_some());
    for start in (0..m.len()).step_by(run) {
        let all = start..m.len().min(start + run);
        let count: f64 = m.count[all.clone()].iter().sum();
        let mass: f64 = all.clone().map(|i| m.mass_of(i)).sum();
        if count <= 0.0 {
            continue;
        }
        let first = m.mean_of(start);
        let sum = all.clone().fold([0.0; 3], |s, i| each_axis(|k| s[k] + m.count[i] * (m.mean[k][i] - first[k])));
        let mean = each_axis(|k| first[k] + sum[k] / count);
        let cov = all.fold(Sym3::default(), |s, i| {
            let offset = each_axis(|k| m.mean[k][i] - mean[k]);
            s.add(&m.cov_of(i).add(&Sym3::outer(offset)).scale(m.count[i] / count))
        });
        to.push(mean, cov, count, mass);
    }
    to
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
}
