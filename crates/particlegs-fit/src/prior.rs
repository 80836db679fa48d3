//! The covariance that a few particles support.
//!
//! Particles that a Gaussian was fitted to lie closer to it than others of the same density do, and the fewer they
//! are the longer the needle that they happen to form. So each covariance is drawn towards the shape of its
//! neighbours at its own size (the mode of the posterior under an inverse Wishart prior: Ormoneit and Tresp 1996;
//! Fraley and Raftery 2007), and widened as the density of a further particle is wider than the sample's. A sheet or
//! stream whose Gaussians are all thin stays thin.

use particlegs_core::math::Sym3;

/// The expectation of a covariance before its own particles are looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prior {
    /// Particles that the neighbours' shape counts as.
    pub(crate) shape: f64,
    /// Of n particles variances grow by this / n: a sample's variance is short by 1 / n, its mean off by 1 / n.
    pub(crate) spread: f64,
    /// The axis across a flat box, along which widths are the particles' own: a little of a rounder shape is many times
    /// its thickness.
    pub(crate) thin: Option<usize>,
}

impl Prior {
    #[cfg(test)]
    pub(crate) const NONE: Prior = Prior { shape: 0.0, spread: 0.0, thin: None };
    /// Of Gaussians that share their particles. With shape 5, spreads of 0, 2, 3 give 4.34, 4.64, 4.63 bits a held-out
    /// particle at ratio 30 on a half of nbody64, and the same within 0.01 at 300; a thin slab grows by spread / 2n.
    pub(crate) const REFINED: Prior = Prior { shape: 5.0, spread: 2.0, thin: None };

    /// The covariance of `count` particles that is most probable where the sample's is `cov` and the neighbours have
    /// the shape `expected`, of trace 3.
    pub(crate) fn most_probable(self, cov: &Sym3, count: f64, expected: &Sym3) -> Sym3 {
        let all = count + self.shape;
        if all <= 0.0 {
            return *cov;
        }
        let share = self.shape / all;
        let size = cov.trace() / 3.0;
        let shaped = cov.scale(1.0 - share).add(&expected.scale(share * size));
        let posterior = match self.thin {
            Some(k) if shaped.variance(k) > 0.0 => shaped.stretched(k, (cov.variance(k) / shaped.variance(k)).sqrt()),
            _ => shaped,
        };
        posterior.scale(1.0 + self.spread / count.max(1.0))
    }
}

/// The shape where nothing else is known.
pub(crate) const SPHERE: Sym3 = Sym3([1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);

/// The mean shape of Gaussians, each of its particles counting alike.
pub(crate) struct MeanShape {
    sum: Sym3,
    count: f64,
}

impl MeanShape {
    /// Particles of a sphere that is there from the beginning.
    const FIRST: f64 = 0.1;

    /// The mean of no Gaussians yet, which is taken as a sphere.
    pub(crate) fn new() -> Self {
        MeanShape { sum: SPHERE.scale(Self::FIRST), count: Self::FIRST }
    }

    pub(crate) fn add(&mut self, cov: &Sym3, count: f64) {
        let size = cov.trace() / 3.0;
        if size > 0.0 && count > 0.0 {
            self.sum = self.sum.add(&cov.scale(count / size));
            self.count += count;
        }
    }

    /// The mean, of trace 3.
    pub(crate) fn get(&self) -> Sym3 {
        self.sum.scale(1.0 / self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_particles_are_round_and_many_keep_their_shape() {
        let needle = Sym3([100.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        let shaped = |count, expected: &Sym3| Prior::REFINED.most_probable(&needle, count, expected);
        let ratio = |count| {
            let e = shaped(count, &MeanShape::new().get()).eigen();
            (e.values[0] / e.values[1]).sqrt()
        };
        assert!(ratio(0.0) < 1.0 + 1e-12 && ratio(5.0) < 2.0 && ratio(1e5) > 9.9);
        // Among needles that lie alike a needle of few particles stays one.
        let mut alike = MeanShape::new();
        (0..20).for_each(|_| alike.add(&needle, 10.0));
        let e = shaped(5.0, &alike.get()).eigen();
        assert!((e.values[0] / e.values[1]).sqrt() > 9.5);
        assert!((alike.get().trace() - 3.0).abs() < 1e-12);
        let trace = shaped(8.0, &alike.get()).trace();
        assert!((trace / 102.0 - 1.25).abs() < 1e-12, "{trace}");
    }
}
