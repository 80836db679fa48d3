//! Refinement of a partition: EM with a focus on what pictures show, and rounds of split and merge.
//!
//! A partition's cells have hard walls and each its own Gaussian. Truncated EM softens the walls;
//! then each round frees Gaussians where two do the work of one, gives them to where one stands for
//! two, and lets EM settle. Large snapshots are refined block by block (runs of cells), on a sample
//! of each cell's particles where there are more than the Gaussians need; the last iterations see
//! every particle.

use super::em::{
    Candidates, Expectation, ExpectationOptions, GaussianExchange, GroupStore, GroupedParticles, ParticleGroups,
    RefinedGaussians, Regularisation, expect, maximise, regroup,
};
use super::gain::{Blur, picture_sigma};
use super::overlap_tree::SearchReach;
use super::prior::{Neighbourhood, Prior};
use super::split_merge::{MoveOptions, exchange};
use super::transmittance::TransmittanceMaps;
use super::{Moments, ParticleStore, Partition};
use particlegs_core::checkpoint::CheckpointStore;
use particlegs_core::context::Context;
use particlegs_core::math::{Purpose, Random, Sym3, each_axis};
use particlegs_core::model::Mixture;
use particlegs_core::{Error, Result, parallel};
use std::ops::Range;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RefineOptions {
    /// Cells side by side whose particles look for their Gaussians together: 2 halve the search and lose nothing where
    /// there are no rounds, 4 lose 0.03 bits a held-out particle.
    pub cells_a_group: usize,
    /// EM iterations before the first round.
    pub first_iterations: usize,
    pub rounds: usize,
    /// A split must gain this many times what its merge costs.
    pub ratio: f64,
    /// Largest share of the Gaussians that are split in a round.
    pub most_moved: f64,
    /// EM iterations after each round but the last.
    pub iterations: usize,
    /// EM iterations after the last round.
    pub settling: usize,
    /// Times as far as an iteration of EM would go.
    pub stride: f64,
    /// EM iterations over all particles after that, where the rounds look at a sample.
    pub last_iterations: usize,
    /// Iterations end before there are as many once one gains less than this many bits of log likelihood a particle.
    pub settled: Option<f64>,
    /// Particles a Gaussian that the rounds look at.
    pub sample: f64,
    /// A pixel of the nearest pictures that the model is made for, world units (0: finer than a radius).
    pub pixel: f64,
    pub seed: u64,
    /// The axis across a flat box ([`Prior::thin`]).
    pub thin: Option<usize>,
}

/// Particles of one block's sample, and its Gaussians, at most.
const BLOCK_PARTICLES: f64 = 4_000_000.0;
const BLOCK_GAUSSIANS: usize = 1 << 16;

/// In particle radii: the E step's floor, the focus's blur and the blur of split and merge, before the last round and
/// in it. Found on N-body data at 50 to 2000 particles a Gaussian; the blur of split and merge trades large drawing
/// radii (larger) against small ones, and the last round's alone gains 0.01 dB of these for less of those.
const FLOOR_RADII: f64 = 0.4;
const FOCUS_BLUR_RADII: f64 = 3.0;
const MOVE_BLUR_RADII: f64 = 6.0;
const LAST_MOVE_BLUR_RADII: f64 = 5.0;
/// Pixels of refinement's blurs, in those of the nearest pictures: the far orbit's. Where pixels are wider than splats
/// (33.6 million particles in 1080 lines) 1 loses 0.02 dB far and mid, and gains nothing near.
const PIXELS: f64 = 2.0;
/// See [`Regularisation::focus`]. On nbody64 at ratio 300, focus 0, 0.6 and 1 (of Gaussians wider than 5 radii) give
/// 4.362, 4.393, 4.374 bits a held-out particle on its halves, 22.93, 23.17, 22.88 dB at large radii and 32.13, 32.24,
/// 32.22 dB at the default one: all of it swells P(k) by 1 %, none of it loses halo cores (mass 0.59 of the truth's,
/// 0.83 with 1). From 3 radii on it keeps cores (0.90 with 0.6) and costs 0.01 bits and 0.1 dB at large radii. 0.75
/// gains 0.01 dB at the default radius, and loses 0.08 dB at large ones and 0.005 bits; 0.5 to 0.6 gain 0.02 dB at
/// ratio 3000.
const FOCUS: f64 = 0.63;
/// See [`MoveOptions::likelihood`]: on a half of nbody64 at ratio 300, 0, 0.3, 1, 3 give 4.375, 4.393, 4.371, 4.334
/// bits a held-out particle, and 32.18, 32.22, 32.16, 32.10 dB on all of it; over four ratios 0.12 has the bits of 0.25
/// and 0.01 dB more.
const LIKELIHOOD: f64 = 0.1;

/// Refines a partition for pictures drawn with `radius` (world units). The same bits for any number
/// of threads. At most as many Gaussians come back as the partition has cells; their counts sum to
/// the number of particles.
pub(crate) fn refine(
    partition: &Partition,
    radius: f64,
    options: &RefineOptions,
    checkpoints: &mut dyn CheckpointStore,
    context: &Context<'_>,
) -> Result<Mixture> {
    if !(radius > 0.0 && radius.is_finite() && options.sample > 0.0 && options.pixel >= 0.0) {
        return Err(Error::argument(format!("radius {radius} and sample {} must be positive", options.sample)));
    }
    let scaled = (radius * partition.store.scale).clamp(1e-9, 1e9);
    let transmittance = (options.rounds > 0).then(|| TransmittanceMaps::new(&partition.store.xyz, scaled));
    let pixel = PIXELS * options.pixel * partition.store.scale;
    let refiner = Refiner { shade: transmittance.as_ref(), partition, radius: scaled, pixel, options, context };
    let blocks = refiner.blocks();
    // Each block reports its first iterations, each round and its end.
    context.begin("refining", (blocks.len() * (options.rounds + 2)) as u64);
    let store = &partition.store;
    let mut mixture = Mixture::new(store.weight.is_some());
    for (i, block) in blocks.into_iter().enumerate() {
        let key = format!("refined {i}");
        let gaussians = match checkpoints.get(&key).and_then(|bytes| RefinedGaussians::from_bytes(&bytes)) {
            Some(gaussians) => gaussians,
            None => {
                let (gaussians, _) = refiner.block(block.clone(), gaussians_of(&partition.moments[block]))?;
                checkpoints.keep(&key, gaussians.to_bytes())?;
                gaussians
            }
        };
        append(&mut mixture, &gaussians, store);
    }
    context.end();
    Ok(mixture)
}

/// Gaussians of a later frame of the same particles.
pub struct TrackedGaussians {
    /// As many as there were, in their order; of count 0 where one has lost its particles.
    pub gaussians: Mixture,
    /// Those that are halves of others now, in the places of Gaussians that were given up.
    pub born: Vec<bool>,
}

/// Refines Gaussians of an earlier frame, moved to where they are expected, on a partition that has a cell for each of
/// them: the particles that it is likeliest to have.
pub(crate) fn track(
    partition: &Partition,
    start: &Mixture,
    radius: f64,
    options: &RefineOptions,
    context: &Context<'_>,
) -> Result<TrackedGaussians> {
    let store = &partition.store;
    let scaled = (radius * store.scale).clamp(1e-9, 1e9);
    let transmittance = (options.rounds > 0).then(|| TransmittanceMaps::new(&store.xyz, scaled));
    let pixel = PIXELS * options.pixel * store.scale;
    let refiner = Refiner { shade: transmittance.as_ref(), partition, radius: scaled, pixel, options, context };
    let blocks = refiner.blocks();
    context.begin("refining", (blocks.len() * (options.rounds + 2)) as u64);
    let weighted = store.weight.is_some();
    let mut tracked = TrackedGaussians { gaussians: Mixture::new(weighted), born: Vec::new() };
    let unit = 1.0 / store.scale;
    for block in blocks {
        let mut gaussians = RefinedGaussians::default();
        for i in block.clone() {
            let mean = each_axis(|k| (start.mean[k][i] - store.origin[k]) * store.scale);
            let cov = start.cov_of(i).scale(store.scale).scale(store.scale);
            gaussians.push(mean, cov, start.count[i], start.mass_of(i));
        }
        let (gaussians, born) = refiner.block(block, gaussians)?;
        // Also Gaussians that have lost their particles: those of two frames correspond by their numbers.
        for j in 0..gaussians.len() {
            let cov = without_negative_variances(&gaussians.cov[j]).scale(unit).scale(unit);
            let mean = store.to_world(gaussians.mean[j]);
            tracked.gaussians.push(mean, cov, gaussians.count[j], gaussians.mass[j]);
        }
        tracked.born.extend(born);
    }
    context.end();
    Ok(tracked)
}

struct Refiner<'a> {
    /// `None` where the options ask for no rounds.
    shade: Option<&'a TransmittanceMaps>,
    partition: &'a Partition,
    /// Store units.
    radius: f64,
    pixel: f64,
    options: &'a RefineOptions,
    context: &'a Context<'a>,
}

impl Refiner<'_> {
    /// Runs of cells that are refined together.
    fn blocks(&self) -> Vec<Range<usize>> {
        let cells = &self.partition.cells;
        let particles = self.partition.store.len() as f64;
        let parts = (particles * self.rate() / BLOCK_PARTICLES)
            .max(cells.len() as f64 / BLOCK_GAUSSIANS as f64)
            .ceil()
            .max(1.0) as usize;
        let most = cells.len().div_ceil(parts).max(1);
        (0..cells.len()).step_by(most).map(|s| s..cells.len().min(s + most)).collect()
    }

    /// Share of the particles in the sample.
    fn rate(&self) -> f64 {
        let sample_particles = self.options.sample * self.partition.cells.len() as f64;
        (sample_particles / self.partition.store.len().max(1) as f64).min(1.0)
    }

    fn shape(&self) -> Regularisation {
        let prior = Prior { thin: self.options.thin, ..Prior::REFINED };
        let blur = Blur::from_sigma(picture_sigma(FOCUS_BLUR_RADII * self.radius, self.pixel));
        Regularisation {
            floor: (FLOOR_RADII * self.radius).powi(2),
            focus: FOCUS,
            blur: blur.variance,
            prior,
            stride: self.options.stride,
        }
    }

    /// Refines the Gaussians of some cells, from `gaussians` on; and says which of these gave up their places to halves
    /// of others.
    fn block(&self, cells: Range<usize>, mut gaussians: RefinedGaussians) -> Result<(RefinedGaussians, Vec<bool>)> {
        let store = &self.partition.store;
        let first = self.partition.cells[cells.start].start;
        let span = first..self.partition.cells[cells.end - 1].end;
        let groups = self.partition.cells[cells.clone()].chunks(self.options.cells_a_group.max(1));
        let ranges = groups.map(|c| c[0].start - first..c[c.len() - 1].end - first).collect();
        let moments = &self.partition.moments[cells];
        let groups = ParticleGroups::new(ranges, &store.xyz[span.clone()]);
        let weight = store.weight.as_ref().map(|w| &w[span.clone()]);
        let whole = GroupedParticles { xyz: &store.xyz[span], weight, groups: &groups };
        let rate = self.rate();
        let born;
        if rate < 1.0 {
            let sampled = sample(whole, rate, self.options.seed);
            // Priors weigh by particles: the sample's Gaussians must have the sample's counts meanwhile.
            scale_counts(&mut gaussians, rate);
            let neighbourhoods;
            (neighbourhoods, born) = self.rounds(sampled.view(), &mut gaussians)?;
            scale_counts(&mut gaussians, 1.0 / rate);
            if self.options.last_iterations > 0 {
                // The candidates of the rounds are those of the sample's groups.
                let candidates = self.candidates(&groups, &gaussians)?;
                let iterations = self.options.last_iterations;
                let neighbours = (&candidates, &neighbourhoods[..]);
                self.iterate(whole, neighbours, &mut gaussians, (iterations, true), &mut Expectation::default())?;
            }
        } else {
            (_, born) = self.rounds(whole, &mut gaussians)?;
        }
        self.context.advance(1);
        conserve(&mut gaussians, moments, store.weight.is_some());
        Ok((gaussians, born))
    }

    fn candidates(&self, groups: &ParticleGroups, gaussians: &RefinedGaussians) -> Result<Candidates> {
        Candidates::find(groups, gaussians, SearchReach { most: 24, beyond: 14.0 }, self.shape().floor, self.context)
    }

    /// EM with fixed candidates and neighbours; leaves the last E step in `expectation`, with its owners. The last
    /// iteration of all goes no further than EM, so that moments are those of the particles.
    fn iterate(
        &self,
        particles: GroupedParticles<'_>,
        (candidates, neighbourhoods): (&Candidates, &[Neighbourhood]),
        gaussians: &mut RefinedGaussians,
        (iterations, is_end): (usize, bool),
        expectation: &mut Expectation,
    ) -> Result<()> {
        let mut previous_likelihood = f64::NEG_INFINITY;
        let settled = self.options.settled;
        let enough = settled.map(|bits| bits * std::f64::consts::LN_2 * particles.xyz.len() as f64);
        for i in 0..iterations {
            // Only the last iteration's owners are used; where one may settle, any may be the last.
            expectation.options =
                ExpectationOptions { owner: settled.is_some() || i + 1 == iterations, likelihood: settled.is_some() };
            let mut shape = self.shape();
            if is_end && i + 1 == iterations {
                shape.stride = 1.0;
            }
            expect(particles, candidates, gaussians, shape, expectation, self.context)?;
            maximise(expectation, particles.groups, candidates, gaussians, shape, neighbourhoods);
            if enough.is_some_and(|enough| expectation.likelihood - previous_likelihood < enough) {
                break;
            }
            previous_likelihood = expectation.likelihood;
        }
        Ok(())
    }

    /// EM and rounds of split and merge; returns each Gaussian's last neighbours, and which are
    /// halves of others.
    fn rounds(
        &self,
        particles: GroupedParticles<'_>,
        gaussians: &mut RefinedGaussians,
    ) -> Result<(Vec<Neighbourhood>, Vec<bool>)> {
        let options = self.options;
        let mut born = vec![false; gaussians.len()];
        let moves = |radii: f64| MoveOptions {
            blur: Blur::from_sigma(picture_sigma(radii * self.radius, self.pixel)),
            shape: self.shape(),
            likelihood: LIKELIHOOD,
            ratio: options.ratio,
            share: options.most_moved,
        };
        let candidates = self.candidates(particles.groups, gaussians)?;
        let mut neighbourhoods = cells_beside(gaussians);
        let mut expectation = Expectation::default();
        let first_iterations = options.first_iterations.max(1);
        let is_end = options.rounds == 0;
        self.iterate(
            particles,
            (&candidates, &neighbourhoods),
            gaussians,
            (first_iterations, is_end),
            &mut expectation,
        )?;
        self.context.advance(1);
        let (mut store, mut next_store) = (None::<GroupStore>, GroupStore::default());
        // Of the round before, and what it exchanged.
        let mut previous_candidates = None::<(Candidates, Vec<GaussianExchange>)>;
        let Some(transmittance) = self.shade else { return Ok((neighbourhoods, born)) };
        for round in 1..=options.rounds {
            let last = round == options.rounds;
            self.context.check()?;
            // Splits and mean shapes rely on group j being Gaussian j's own particles.
            let grouped = store.as_ref().map_or(particles, GroupStore::view);
            regroup(grouped, &expectation.owner, gaussians.len(), &mut next_store);
            // The memory of the round before is the next one's.
            next_store = store.replace(next_store).unwrap_or_default();
            let particles = store.as_ref().map_or(particles, GroupStore::view);
            // An exchange moves few Gaussians, so that the lists of one search last two rounds.
            let is_searched = (options.rounds - round).is_multiple_of(2);
            let regrouped = previous_candidates
                .take()
                .filter(|_| !is_searched)
                .map(|(candidates, exchanges)| candidates.regrouped(&exchanges, gaussians.len()));
            let candidates = match regrouped.filter(|candidates| candidates.cover(particles.groups)) {
                Some(candidates) => candidates,
                None => self.candidates(particles.groups, gaussians)?,
            };
            neighbourhoods = candidates.neighbourhoods(gaussians);
            let moves = moves(if last { LAST_MOVE_BLUR_RADII } else { MOVE_BLUR_RADII });
            let exchanges = exchange(gaussians, particles, &candidates, transmittance, moves, self.context)?;
            let candidates = candidates.after(&exchanges, gaussians.len());
            for m in &exchanges {
                // A half lies where the whole did, so the same neighbours tell its shape.
                neighbourhoods[m.freed as usize] = neighbourhoods[m.split as usize];
                born[m.freed as usize] = true;
            }
            let iterations = if last { options.settling } else { options.iterations };
            self.iterate(
                particles,
                (&candidates, &neighbourhoods),
                gaussians,
                (iterations.max(1), last),
                &mut expectation,
            )?;
            previous_candidates = Some((candidates, exchanges));
            self.context.advance(1);
        }
        Ok((neighbourhoods, born))
    }
}

/// Each cell's neighbours in the order of the cuts.
fn cells_beside(cells: &RefinedGaussians) -> Vec<Neighbourhood> {
    const CELLS: usize = 4;
    let beside = |i: usize| i.saturating_sub(CELLS)..cells.len().min(i + CELLS + 1);
    parallel::map_range(cells.len(), |i| cells.neighbourhood(beside(i)))
}

/// The cells as Gaussians.
fn gaussians_of(moments: &[Moments]) -> RefinedGaussians {
    let mut gaussians = RefinedGaussians::default();
    for m in moments {
        gaussians.push(m.mean, m.cov, m.count as f64, m.mass);
    }
    gaussians
}

/// Every 1/rate-th particle of the store's order, in which neighbours stand together: each cell
/// keeps its share. The seed shifts which.
fn sample(particles: GroupedParticles<'_>, rate: f64, seed: u64) -> GroupStore {
    let shift = Random::from_purpose(Purpose::RefinementSample, seed, 0).uniform();
    let keep = |i: usize| ((i + 1) as f64 * rate + shift).floor() > (i as f64 * rate + shift).floor();
    let mut xyz = Vec::with_capacity((particles.xyz.len() as f64 * rate) as usize + 1);
    let mut weight = particles.weight.map(|_| Vec::with_capacity(xyz.capacity()));
    let mut ranges = Vec::with_capacity(particles.groups.range.len());
    for range in &particles.groups.range {
        let from = xyz.len();
        for i in range.clone() {
            if keep(i) {
                xyz.push(particles.xyz[i]);
                if let (Some(new), Some(old)) = (&mut weight, particles.weight) {
                    new.push(old[i]);
                }
            }
        }
        ranges.push(from..xyz.len());
    }
    let groups = ParticleGroups::new(ranges, &xyz);
    GroupStore { xyz, weight, groups }
}

fn scale_counts(gaussians: &mut RefinedGaussians, by: f64) {
    gaussians.count.iter_mut().chain(&mut gaussians.mass).for_each(|v| *v *= by);
}

/// A Gaussian of fewer particles goes: others took them, and its moments are rounding errors.
const LEAST_PARTICLES: f64 = 0.5;

/// Makes counts and masses sum to the particles': responsibilities are rounded, and Gaussians of next to none go.
fn conserve(gaussians: &mut RefinedGaussians, moments: &[Moments], weighted: bool) {
    for j in 0..gaussians.len() {
        if gaussians.count[j] < LEAST_PARTICLES {
            (gaussians.count[j], gaussians.mass[j]) = (0.0, 0.0);
        }
    }
    let count: f64 = moments.iter().map(|m| m.count as f64).sum();
    let mass: f64 = moments.iter().map(|m| m.mass).sum();
    to_sum(&mut gaussians.count, count);
    if weighted {
        to_sum(&mut gaussians.mass, mass);
    } else {
        gaussians.mass.clone_from(&gaussians.count);
    }
}

fn to_sum(values: &mut [f64], sum: f64) {
    let total: f64 = values.iter().sum();
    if total > 0.0 {
        values.iter_mut().for_each(|v| *v *= sum / total);
    }
}

/// A covariance without the negative variances that sums of f32 leave where a few particles lie in a line or a plane.
fn without_negative_variances(cov: &Sym3) -> Sym3 {
    let mut e = cov.eigen();
    if e.values[2] >= 0.0 {
        return *cov;
    }
    e.values = e.values.map(|v| v.max(0.0));
    Sym3::from_eigen(&e)
}

/// Adds a block's living Gaussians in world units.
fn append(mixture: &mut Mixture, gaussians: &RefinedGaussians, store: &ParticleStore) {
    let unit = 1.0 / store.scale;
    for j in 0..gaussians.len() {
        if gaussians.count[j] > 0.0 {
            let cov = without_negative_variances(&gaussians.cov[j]).scale(unit).scale(unit);
            mixture.push(store.to_world(gaussians.mean[j]), cov, gaussians.count[j], gaussians.mass[j]);
        }
    }
}
