//! Gaussians of a frame from those of the frame before.

use super::assignment::SoftAssignment;
use super::effort::refinement;
use super::refine::{TrackedGaussians, track};
use super::{FitOptions, Moments, ParticleStore, Partition, RefineOptions};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::Mixture;
use particlegs_core::{Result, parallel};
use particlegs_particles::{Chunk, Particles};

/// Particles of one parallel step: many, so that those of a leaf of the assignment fill vectors.
const STEP: usize = 1 << 16;

/// A split of a tracked Gaussian must gain this many times what its merge costs, and no larger share is split in a
/// frame: Gaussians that are new cost more bytes than those that move.
const SPLIT_RATIO: f64 = 3.0;
const MOST_MOVED: f64 = 0.0075;

/// EM iterations end once one gains less than this many bits a particle: where frames are close, after 3; where they
/// are far from each other, after 6.
const SETTLED: f64 = 0.02;

/// EM iterations and rounds of split and merge that a tracked frame gets.
#[derive(Clone, Copy, Debug)]
pub struct TrackingEffort {
    /// EM iterations before the rounds, at most.
    pub first_iterations: usize,
    /// Rounds of split and merge.
    pub rounds: usize,
    /// EM iterations after each.
    pub iterations: usize,
}

/// Refines Gaussians that are expected at `start` on the particles of their frame. They keep their order.
pub fn track_gaussians(
    particles: &Particles,
    start: &Mixture,
    options: &FitOptions,
    effort: TrackingEffort,
    context: &Context<'_>,
) -> Result<TrackedGaussians> {
    context.check()?;
    let local = particles.local_bounds();
    let store = ParticleStore::new(particles, &local);
    let assignment = SoftAssignment::new(start, context.simd());
    let mut owner = vec![0u32; store.len()];
    parallel::for_each_chunk(&mut owner, STEP, |c, owner| {
        let places = store.xyz[c * STEP..][..owner.len()].iter().map(|p| store.to_world(p.map(f64::from)));
        owner.copy_from_slice(&assignment.likeliest(&places.collect::<Vec<_>>()));
    });
    // Its tree goes before the particles are copied.
    drop(assignment);
    let partition = cells_of(store, &owner, start.len());
    let thin = particles.in_world(local).thin_axis();
    let TrackingEffort { first_iterations, rounds, iterations } = effort;
    let settled = Some(SETTLED);
    let base_options = refinement(particles.len(), start.len(), options);
    let (ratio, most_moved) = (SPLIT_RATIO, MOST_MOVED);
    // Sampling is that of a fit of its own; iterations and exchanges are bounded as a frame's.
    let refine_options = RefineOptions {
        thin,
        first_iterations,
        settled,
        rounds,
        iterations,
        settling: iterations,
        stride: 1.0,
        ratio,
        most_moved,
        ..base_options
    };
    track(&partition, start, options.radius, &refine_options, context)
}

/// To which of several mixtures particles belong: that of the Gaussian that each is likeliest to have.
pub struct MixtureAssignment {
    assignment: SoftAssignment,
    /// The number behind the last Gaussian of each mixture, among all.
    ends: Vec<u32>,
}

impl MixtureAssignment {
    /// Prepares the assignment to these mixtures.
    pub fn new(mixtures: &[Mixture], context: &Context<'_>) -> Self {
        let mut all = Mixture::new(false);
        let ends = mixtures.iter().map(|m| {
            all.append(m);
            all.len() as u32
        });
        let ends = ends.collect();
        MixtureAssignment { assignment: SoftAssignment::new(&all, context.simd()), ends }
    }

    /// The mixture of each particle of a chunk whose coordinates begin at `origin`.
    pub fn mixtures_of(&self, chunk: &Chunk<'_>, origin: [f64; 3]) -> Vec<u32> {
        let place = |i: usize| each_axis(|k| origin[k] + f64::from(chunk.position[k][i]));
        let likeliest = self.assignment.likeliest(&(0..chunk.len()).map(place).collect::<Vec<_>>());
        likeliest.iter().map(|gaussian| self.ends.partition_point(|end| end <= gaussian) as u32).collect()
    }
}

/// Particles in the order of their Gaussians.
fn cells_of(store: ParticleStore, owner: &[u32], gaussians: usize) -> Partition {
    let mut end = vec![0usize; gaussians + 1];
    owner.iter().for_each(|&o| end[o as usize + 1] += 1);
    for i in 0..gaussians {
        end[i + 1] += end[i];
    }
    let cells: Vec<_> = (0..gaussians).map(|i| end[i]..end[i + 1]).collect();
    let mut next_place = end;
    let mut xyz = vec![[0.0; 3]; store.len()];
    let mut weight = store.weight.as_ref().map(|w| vec![0.0; w.len()]);
    for (i, &o) in owner.iter().enumerate() {
        let to = next_place[o as usize];
        next_place[o as usize] += 1;
        xyz[to] = store.xyz[i];
        if let (Some(weight), Some(source_weight)) = (&mut weight, &store.weight) {
            weight[to] = source_weight[i];
        }
    }
    let moments = parallel::map_range(gaussians, |i| {
        let cell = cells[i].clone();
        Moments::from_points(&xyz[cell.clone()], weight.as_ref().map(|w| &w[cell]))
    });
    let (origin, scale) = (store.origin, store.scale);
    Partition { store: ParticleStore { xyz, weight, origin, scale }, cells, moments }
}
