//! The particles' own rival to a model: as many of them, chosen at random, as its bytes hold, drawn larger.

use super::ViewTruth;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::codec::{CodedPoints, Thinning};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::picture::{Gray8, Size};
use particlegs_core::splat::ToneStyle;
use particlegs_particles::{Column, Particles, Positions};
use particlegs_reference::Reference;

/// A random subset as its coded bytes have it.
pub struct RandomSubset {
    particles: Particles,
    pub kept: u64,
    pub bytes: u64,
    /// Their radius, in the particles' own: sqrt(N / kept), so that as much light is covered.
    scale: f64,
}

/// The subset in one view.
pub enum SubsetView {
    /// In every look.
    Whole(Box<ViewTruth>),
    /// In `expected` alone: ParaView's pictures of few large splats take as long as those of all particles.
    Expected(Gray8),
}

impl SubsetView {
    /// The picture in a look, where it was drawn.
    pub fn picture(&self, look: ToneStyle) -> Option<&Gray8> {
        match self {
            SubsetView::Whole(truth) => Some(truth.picture(look)),
            SubsetView::Expected(picture) => (look == ToneStyle::Expected).then_some(picture),
        }
    }
}

impl RandomSubset {
    /// The most particles whose places, coded, take at most `bytes` ([`Thinning::most`]). `None` where not one fits.
    pub fn new(
        truth: &Reference<'_>,
        spacing: f64,
        bytes: u64,
        seed: u64,
        context: &Context<'_>,
    ) -> Result<Option<Self>> {
        let (particles, bounds) = (truth.particles(), truth.bounds());
        let n = particles.len();
        particlegs_files::memory::require("a subset of the particles", n as u64 / 8 + 2 * bytes)?;
        let most = Thinning { bounds, spacing, bytes, seed }.most(n, |i| particles.position(i), context)?;
        Ok(most.map(|coded| {
            let kept_count = coded.position[0].len();
            let scale = (n as f64 / kept_count as f64).sqrt();
            let bytes = coded.bytes as u64;
            RandomSubset { particles: as_particles(&coded, particles), kept: kept_count as u64, bytes, scale }
        }))
    }

    /// Draws it where `truth` is drawn, in all looks or in `expected` alone.
    pub fn draw(
        &self,
        truth: &Reference<'_>,
        view: &View,
        size: Size,
        whole: bool,
        context: &Context<'_>,
    ) -> Result<SubsetView> {
        let reference = Reference::with_bounds(&self.particles, *truth.bounds());
        let view = View { radius: view.radius * self.scale, ..view.clone() };
        Ok(match whole {
            true => SubsetView::Whole(Box::new(ViewTruth::draw(&reference, &view, size, context)?)),
            false => SubsetView::Expected(reference.draw(&view, size, ToneStyle::Expected, context)?),
        })
    }
}

/// About the origin of the particles that they are taken from.
fn as_particles(coded: &CodedPoints, source: &Particles) -> Particles {
    let columns: [Column; 3] =
        each_axis(|k| Column::owned(coded.position[k].iter().map(|v| (v - source.origin[k]) as f32).collect()));
    Particles::new(Positions::Columns(columns), source.origin, source.meta.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_particles::testing::sample;

    #[test]
    fn as_many_particles_are_kept_as_fit_the_bytes() {
        let particles = sample();
        let truth = Reference::new(&particles);
        let subset_of = |bytes, seed| RandomSubset::new(&truth, 0.78, bytes, seed, &Context::SILENT).unwrap();
        for bytes in [2_000, 10_485, 200_000] {
            let thin = subset_of(bytes, 42).unwrap();
            assert!(thin.bytes <= bytes && thin.bytes as f64 >= 0.99 * bytes as f64, "{} of {bytes}", thin.bytes);
            assert_eq!(thin.particles.len() as u64, thin.kept);
            assert!((thin.scale * thin.scale * thin.kept as f64 / 262_144.0 - 1.0).abs() < 1e-12);
        }
        let again = subset_of(10_485, 42).unwrap();
        assert_eq!(
            (again.kept, again.particles.position(7)),
            (subset_of(10_485, 42).unwrap().kept, again.particles.position(7))
        );
        assert_ne!(subset_of(10_485, 43).unwrap().particles.position(7), again.particles.position(7));
        // All of them, and none.
        assert_eq!(subset_of(100_000_000, 1).unwrap().kept, 262_144);
        assert!(subset_of(60, 1).is_none());
    }

    /// Every particle kept is one of the snapshot's, as close as was said.
    #[test]
    fn kept_particles_are_particles_of_the_snapshot() {
        let particles = sample();
        let truth = Reference::new(&particles);
        let thin = RandomSubset::new(&truth, 0.78, 1_000, 5, &Context::SILENT).unwrap().unwrap();
        for i in 0..thin.particles.len() {
            let p = thin.particles.position(i);
            let near = (0..particles.len()).any(|j| {
                let q = particles.position(j);
                (0..3).all(|k| (p[k] - q[k]).abs() <= 0.05 * 0.78 + 1e-4)
            });
            assert!(near, "{p:?}");
        }
    }
}
