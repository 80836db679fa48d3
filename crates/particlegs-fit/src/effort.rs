//! The fit of a snapshot: partition, then as much refinement as the effort asks for.

use super::partition::partition;
use super::{ParticleStore, PartitionOptions, RefineOptions, refine};
use particlegs_core::Result;
use particlegs_core::checkpoint::{CheckpointStore, NoCheckpoints};
use particlegs_core::context::Context;
use particlegs_core::model::{Effort, Mixture};
use particlegs_core::space::Bounds;
use particlegs_particles::Particles;

/// Size, effort and scale of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Number of Gaussians, at most.
    pub gaussians: usize,
    /// Time against quality.
    pub effort: Effort,
    /// Radius that particles are drawn with, world units.
    pub radius: f64,
    /// A pixel of the pictures that the model is made for, world units (0: finer than a radius).
    pub pixel: f64,
    /// Seed of the sample.
    pub seed: u64,
    /// Share of the effort's bound on time: the part of all particles of the job that these are.
    pub share: f64,
}

impl FitOptions {
    /// So many Gaussians for pictures of particles of `radius` (world units), at the default effort, blind to
    /// pixels, with seed 0.
    pub fn new(gaussians: usize, radius: f64) -> Self {
        FitOptions { gaussians, effort: Effort::Default, radius, pixel: 0.0, seed: 0, share: 1.0 }
    }
}

/// Fits at most `options.gaussians` Gaussians to `particles`.
pub fn fit(particles: &Particles, options: &FitOptions, context: &Context<'_>) -> Result<Mixture> {
    Fitter::new(particles).fit(options, &mut NoCheckpoints, context)
}

/// Bytes of memory that a fit takes beside the mapped file: the store that is reordered, and a
/// margin for the Gaussians and their neighbourhoods.
pub fn memory_needed(particles: &Particles) -> u64 {
    particles.len() as u64 * if particles.weights().is_some() { 20 } else { 16 }
}

/// Fits the same particles again and again, for one number of Gaussians after the other: the copy of
/// them that a refined fit reorders is made in the same memory each time.
pub struct Fitter<'a> {
    particles: &'a Particles,
    /// Bounds about the particles' origin.
    local: Bounds,
    store: Option<ParticleStore>,
}

impl<'a> Fitter<'a> {
    /// A fitter of these particles; nothing is copied before the first fit.
    pub fn new(particles: &'a Particles) -> Self {
        Fitter { particles, local: particles.local_bounds(), store: None }
    }

    /// [`fit`] that keeps its pieces, and takes those that are there.
    pub fn fit(
        &mut self,
        options: &FitOptions,
        checkpoints: &mut dyn CheckpointStore,
        context: &Context<'_>,
    ) -> Result<Mixture> {
        context.check()?;
        let store = match self.store.take() {
            Some(mut store) => {
                store.copy_again(self.particles);
                store
            }
            None => ParticleStore::new(self.particles, &self.local),
        };
        let partition_options = PartitionOptions { pixel: options.pixel, ..PartitionOptions::default() };
        let cells = partition(store, options.gaussians, options.radius, partition_options, context)?;
        let (particles, gaussians) = (cells.store.len(), cells.cells.len());
        let thin = self.particles.in_world(self.local).thin_axis();
        let refine_options = RefineOptions { thin, ..refinement(particles, gaussians, options) };
        let mixture = refine(&cells, options.radius, &refine_options, checkpoints, context)?;
        // What comes after takes less memory than refinement, but not always less than a partition.
        self.store = Some(cells.store);
        Ok(mixture)
    }
}

/// The refinement that `particles` and `gaussians` allow, decided by cost alone (never by a
/// clock, so that results repeat).
pub(super) fn refinement(particles: usize, gaussians: usize, options: &FitOptions) -> RefineOptions {
    /// Rounds of the best effort at most: 16 gain no more than two fits differ by.
    const MOST_ROUNDS: f64 = 12.0;
    /// The same if the rounds look at a sample: of nbody128 at ratio 3000, 8 and 12 lose 0.10 and 0.02 dB.
    const MOST_ROUNDS_SAMPLED: f64 = 16.0;
    /// Rounds of the default effort (docs/results/notebook.md).
    const FEW_ROUNDS: f64 = 6.0;
    /// Two iterations between rounds that go so far are worth three of EM's own: on nbody64 and abacus-mini at ratio
    /// 300, six rounds lose 0.012 and 0.015 bits against twelve of three iterations, and 0.029 and 0.024 with 1.
    const STRIDE: f64 = 1.6;
    /// Particle visits by the rounds of the best effort, half a CPU-second a million; the default has half of them.
    const VISITS: f64 = 1600e6;
    let (pixel, seed) = (options.pixel, options.seed);
    match options.effort {
        // Each iteration more gains 0.04 bits and 0.1 dB, and takes half as long as the partition.
        Effort::Fast => RefineOptions {
            cells_a_group: 2,
            first_iterations: 1,
            rounds: 0,
            ratio: 1.2,
            most_moved: 0.2,
            iterations: 0,
            settling: 0,
            stride: 1.0,
            last_iterations: 0,
            settled: None,
            sample: 100.0,
            pixel,
            seed,
            thin: None,
        },
        Effort::Default | Effort::Best => {
            let sample = 333.0;
            let looked_at = (particles as f64).min(sample * gaussians as f64).max(1.0);
            let (most, visits) = match options.effort {
                Effort::Best if looked_at < particles as f64 => (MOST_ROUNDS_SAMPLED, VISITS),
                Effort::Best => (MOST_ROUNDS, VISITS),
                _ => (FEW_ROUNDS, 0.5 * VISITS),
            };
            RefineOptions {
                cells_a_group: 1,
                first_iterations: 8,
                rounds: (visits * options.share / looked_at).clamp(1.0, most) as usize,
                ratio: 1.2,
                most_moved: 0.2,
                iterations: 2,
                settling: 8,
                stride: STRIDE,
                last_iterations: 2,
                settled: None,
                sample,
                pixel,
                seed,
                thin: None,
            }
        }
    }
}
