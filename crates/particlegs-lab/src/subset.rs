//! The simplest way to save bytes: a random subset of the particles, drawn larger.

use crate::PositionColumns;
use particlegs_core::codec::Thinning;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};

/// A random subset, after decoding.
pub struct CodedSubset {
    pub particles: PositionColumns,
    pub bytes: u64,
    /// Factor of the radius, sqrt(N / kept), so that the same area is covered.
    pub radius_factor: f64,
}

/// The largest subset, in one random order, whose positions, coded within 0.05 of the [`mean_spacing`], take at most
/// `bytes`. `None` if not one particle fits.
pub fn subset(
    particles: &PositionColumns,
    bytes: u64,
    seed: u64,
    context: &Context<'_>,
) -> Result<Option<CodedSubset>> {
    let n = particles[0].len();
    if u32::try_from(n).is_err() || !particles.iter().flatten().all(|v| v.is_finite()) {
        return Err(Error::argument(format!(
            "a subset needs finite coordinates and fewer than {} particles",
            1u64 << 32
        )));
    }
    let place = |i: usize| each_axis(|k| f64::from(particles[k][i]));
    let bounds = bounds(particles);
    let thinning = Thinning { bounds: &bounds, spacing: mean_spacing(particles), bytes, seed };
    let most = thinning.most(n, place, context)?;
    Ok(most.map(|coded| CodedSubset {
        radius_factor: (n as f64 / coded.position[0].len() as f64).sqrt(),
        bytes: coded.bytes as u64,
        particles: coded.position.map(|c| c.into_iter().map(|v| v as f32).collect()),
    }))
}

/// Cube root of the bounds' volume per particle; axes without extent count as the longest. 1 for no particles.
pub fn mean_spacing(particles: &PositionColumns) -> f64 {
    match particles[0].len() {
        0 => 1.0,
        n => bounds(particles).extent_nonzero().iter().map(|e| e.cbrt()).product::<f64>() / (n as f64).cbrt(),
    }
}

fn bounds(particles: &PositionColumns) -> Bounds {
    let mut bounds = Bounds::empty();
    (0..particles[0].len()).for_each(|i| bounds.include(each_axis(|k| f64::from(particles[k][i]))));
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use particlegs_core::context::Context;

    #[test]
    fn the_subset_fills_the_bytes() {
        let particles = testing::clustered(20_000);
        let subset_of = |bytes, seed| subset(&particles, bytes, seed, &Context::SILENT).unwrap();
        for bytes in [1_000, 10_000] {
            let thin = subset_of(bytes, 3).unwrap();
            let count = thin.particles[0].len();
            assert!(thin.bytes <= bytes && thin.bytes as f64 > 0.98 * bytes as f64, "{} of {bytes}", thin.bytes);
            assert!((thin.radius_factor.powi(2) * count as f64 / 20_000.0 - 1.0).abs() < 1e-12);
            assert_eq!(thin.particles, subset_of(bytes, 3).unwrap().particles);
            assert_ne!(thin.particles[0][..10], subset_of(bytes, 4).unwrap().particles[0][..10]);
        }
        assert!(subset_of(50, 1).is_none());
        assert_eq!(subset_of(1_000_000, 1).unwrap().particles[0].len(), 20_000);
    }

    /// Every particle kept is one of the snapshot's, as close as was said.
    #[test]
    fn the_subset_consists_of_particles() {
        let particles = testing::clustered(2000);
        let thin = subset(&particles, 600, 5, &Context::SILENT).unwrap().unwrap();
        let close = 0.05 * mean_spacing(&particles) + 1e-5;
        for i in 0..thin.particles[0].len() {
            let near = |j: &usize| (0..3).all(|k| f64::from((thin.particles[k][i] - particles[k][*j]).abs()) <= close);
            assert!((0..2000).any(|j| near(&j)), "{i}");
        }
    }

    #[test]
    fn unusual_particles_are_accepted_or_refused() {
        let none: PositionColumns = Default::default();
        assert!(subset(&none, 1000, 1, &Context::SILENT).unwrap().is_none());
        let same = [vec![5.0f32; 9], vec![5.0; 9], vec![-1e7; 9]];
        let all = subset(&same, 1000, 1, &Context::SILENT).unwrap().unwrap();
        assert_eq!((all.particles, all.radius_factor), (same, 1.0));
        let bad = [vec![1.0, f32::NAN], vec![0.0; 2], vec![0.0; 2]];
        assert!(matches!(subset(&bad, 1000, 1, &Context::SILENT), Err(Error::Argument { .. })));
    }
}
