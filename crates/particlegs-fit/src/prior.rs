//! The covariance that a few particles support.
//!
//! Particles that a Gaussian was fitted to lie closer to it than others of the same density do, and the fewer they
//! are the longer the needle that they happen to form: two make a line, one a point. So each covariance is widened
//! towards the density of its neighbours, drawn towards their shape at its own size (the mode of the posterior under an
//! inverse Wishart prior: Ormoneit and Tresp 1996; Fraley and Raftery 2007), and widened as the density of a further
//! particle is wider than the sample's. A sheet or stream whose Gaussians are all thin stays thin.

use particlegs_core::math::Sym3;

/// The expectation of a covariance before its own particles are looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prior {
    /// Particles that the neighbours' shape counts as.
    pub(crate) shape: f64,
    /// Particles beyond the first that their density counts as.
    pub(crate) density: f64,
    /// Of n particles variances grow by this / n: a sample's variance is short by 1 / n, its mean off by 1 / n.
    pub(crate) spread: f64,
    /// The axis across a flat box, along which widths are the particles' own: a little of a rounder shape is many times
    /// its thickness.
    pub(crate) thin: Option<usize>,
}

impl Prior {
    #[cfg(test)]
    pub(crate) const NONE: Prior = Prior { shape: 0.0, density: 0.0, spread: 0.0, thin: None };
    /// Of Gaussians that share their particles. With shape 5, spreads of 0, 2, 3 give 4.34, 4.64, 4.63 bits a held-out
    /// particle at ratio 30 on a half of nbody64, and the same within 0.01 at 300; a thin slab grows by spread / 2n.
    pub(crate) const REFINED: Prior = Prior { shape: 5.0, density: 0.5, spread: 2.0, thin: None };

    /// The covariance of `count` particles that is most probable where the sample's is `cov`.
    pub(crate) fn most_probable(self, cov: &Sym3, count: f64, neighbours: &Neighbourhood) -> Sym3 {
        let all = count + self.shape;
        if all <= 0.0 {
            return *cov;
        }
        let share = self.shape / all;
        let sample_size = cov.trace() / 3.0;
        let size = sample_size.max(self.size(sample_size, count, neighbours));
        let widened = cov.add(&neighbours.shape.scale(size - sample_size));
        let shaped = widened.scale(1.0 - share).add(&neighbours.shape.scale(share * size));
        let posterior = match self.thin {
            Some(k) if shaped.variance(k) > 0.0 => shaped.stretched(k, (cov.variance(k) / shaped.variance(k)).sqrt()),
            _ => shaped,
        };
        posterior.scale(1.0 + self.spread / count.max(1.0))
    }

    /// The mean variance of an axis: on a scale of logarithms between the sample's and that of as many particles at the
    /// neighbours' density.
    fn size(self, sample_size: f64, count: f64, neighbours: &Neighbourhood) -> f64 {
        const LEAST_SHARE: f64 = 1e-12;
        let alike = neighbours.variance * libm::cbrt(count * count);
        if self.density == 0.0 || alike <= 0.0 {
            return sample_size;
        }
        let further = (count - 1.0).max(0.0);
        let ratio = (sample_size / alike).max(LEAST_SHARE);
        alike * libm::pow(ratio, further / (further + self.density))
    }
}

/// Gaussians beside one.
#[derive(Clone, Copy)]
pub(crate) struct Neighbourhood {
    /// Their mean shape, of trace 3.
    shape: Sym3,
    /// The mean variance of an axis of one particle at their density; 0 where none has a size.
    variance: f64,
}

impl Neighbourhood {
    /// Where nothing else is known.
    pub(crate) const UNKNOWN: Neighbourhood =
        Neighbourhood { shape: Sym3([1.0, 0.0, 0.0, 1.0, 0.0, 1.0]), variance: 0.0 };
    /// Particles of a sphere among the neighbours: a needle that has none beside it is no evidence of itself.
    const ROUND: f64 = 10.0;

    /// The means over Gaussians by covariance and count, each particle counting alike.
    pub(crate) fn of(gaussians: impl Iterator<Item = (Sym3, f64)>) -> Neighbourhood {
        let (mut sum, mut logs, mut particles) = (Self::UNKNOWN.shape.scale(Self::ROUND), 0.0, 0.0);
        for (cov, count) in gaussians {
            let size = cov.trace() / 3.0;
            if size > 0.0 && count > 0.0 {
                sum = sum.add(&cov.scale(count / size));
                logs += count * libm::log(size / libm::cbrt(count * count));
                particles += count;
            }
        }
        let variance = if particles > 0.0 { libm::exp(logs / particles) } else { 0.0 };
        Neighbourhood { shape: sum.scale(1.0 / (Self::ROUND + particles)), variance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_particles_are_round_and_many_keep_their_shape() {
        let needle = Sym3([100.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        let ratio = |count, neighbours: &Neighbourhood| {
            let e = Prior::REFINED.most_probable(&needle, count, neighbours).eigen();
            (e.values[0] / e.values[1]).sqrt()
        };
        let nothing = Neighbourhood::UNKNOWN;
        assert!(ratio(0.0, &nothing) < 1.0 + 1e-12 && ratio(5.0, &nothing) < 2.0 && ratio(1e5, &nothing) > 9.9);
        // Alone, or among few, it becomes round all the same.
        let among = |count: usize| Neighbourhood::of((0..count).map(|_| (needle, 10.0)));
        assert!(ratio(5.0, &among(1)) < 3.5);
        // Among needles that lie alike a needle of few particles stays one.
        assert!(ratio(5.0, &among(200)) > 9.0);
        assert!((among(20).shape.trace() - 3.0).abs() < 1e-12);
        let trace = Prior::REFINED.most_probable(&needle, 8.0, &nothing).trace();
        assert!((trace / 102.0 - 1.25).abs() < 1e-12, "{trace}");
    }

    #[test]
    fn a_single_particle_is_as_wide_as_its_neighbours_density_says() {
        let sphere = |variance: f64| Sym3::scaled_identity(variance);
        let neighbours = Neighbourhood::of([(sphere(4.0), 8.0), (sphere(0.0), 1.0)].into_iter());
        let size = |variance, count| Prior::REFINED.size(variance, count, &neighbours);
        assert!((size(0.0, 1.0) - 1.0).abs() < 1e-12);
        // More particles are evidence of their own, and at the neighbours' density nothing changes.
        assert!((size(4.0, 8.0) - 4.0).abs() < 1e-12);
        assert!((0.4..0.5).contains(&size(0.4, 8.0)));
        assert!(Prior::REFINED.most_probable(&sphere(0.0), 1.0, &Neighbourhood::UNKNOWN) == sphere(0.0));
    }
}
