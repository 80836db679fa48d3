//! Bounds, hash and sample of a snapshot by one pass over it, wherever it lies.

use crate::{
    Chunk, InvalidParticles, LayeredParticles, ParticlesOutsideBox, RUN, RunHash, hash_of_runs, hash_run, invalid,
};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::space::Bounds;
use std::sync::Mutex;

/// Results of one pass over a snapshot.
pub struct SnapshotScan {
    /// Its runs, layer after layer, each layer beginning one.
    pub runs: Vec<RunScan>,
    /// Positions spread evenly over it, where they were asked for.
    pub sample: PositionSample,
    /// The weight that all particles of a layer have, of each layer whose weights are all the same.
    same_weight: Vec<Option<f32>>,
    /// Bounds of all particles, world units.
    pub bounds: Bounds,
    /// Those outside the periodic box.
    pub outside: ParticlesOutsideBox,
}

/// A run of at most 65 536 particles of one layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunScan {
    /// Lowest coordinates, about the snapshot's origin.
    pub min: [f32; 3],
    /// Highest coordinates.
    pub max: [f32; 3],
    /// Hash of its positions and weights.
    pub hash: RunHash,
}

/// Results of one run.
#[derive(Default)]
struct RunContent {
    scan: Option<RunScan>,
    sample: [Vec<f32>; 3],
    invalid: InvalidParticles,
    /// Its first weight, if all are the same.
    weight: Option<f32>,
    outside: ParticlesOutsideBox,
}

impl SnapshotScan {
    /// Reads all particles once: bounds, hash, validity, how many lie outside the box and, where it is `sampled`,
    /// positions to cut blocks by.
    pub fn new(source: &LayeredParticles, place: &str, sampled: bool, context: &Context<'_>) -> Result<SnapshotScan> {
        let every = if sampled { PositionSample::every(source.count()) } else { 0 };
        context.begin("reading positions", source.count());
        let mut all = SnapshotScan {
            runs: Vec::new(),
            sample: PositionSample::default(),
            same_weight: Vec::new(),
            bounds: Bounds::empty(),
            outside: ParticlesOutsideBox::default(),
        };
        let (mut start, mut bad) = (0, InvalidParticles::default());
        for layer in &source.layers {
            let runs: Vec<Mutex<RunContent>> = (0..layer.runs()).map(|_| Mutex::default()).collect();
            layer.read(source.origin, 0..layer.runs(), context, &|run, chunk| {
                let first = start + run * RUN as u64;
                let content = RunContent::new(&chunk, source, first, every);
                // Runs come in any order; what depends on order is put together below.
                *runs[run as usize].lock().unwrap_or_else(|e| e.into_inner()) = content;
                Ok(())
            })?;
            let mut weights = Vec::with_capacity(runs.len());
            for (run, content) in runs.into_iter().enumerate() {
                let content = content.into_inner().unwrap_or_else(|e| e.into_inner());
                bad = bad.and(start + (run * RUN) as u64, content.invalid);
                weights.push(content.weight);
                all.sample.append(content.sample);
                all.outside = all.outside.and(content.outside);
                let missing = || {
                    particlegs_core::Error::input(
                        place,
                        format!("chunk {run} of layer `{}` is missing", layer.layer.name),
                    )
                };
                all.runs.push(content.scan.ok_or_else(missing)?);
            }
            start += layer.layer.content;
            let first = weights.first().copied().flatten().filter(|_| layer.layer.mass.is_weighted());
            all.same_weight.push(first.filter(|w| weights.iter().all(|other| *other == Some(*w))));
        }
        context.end();
        // Refused at the end, so that the error counts all invalid particles.
        if bad.count() > 0 {
            return Err(bad.refusal(place));
        }
        all.bounds = all.runs.iter().fold(Bounds::empty(), |all, r| all.union(&r.bounds(source.origin)));
        Ok(all)
    }

    /// Drops the weights of layers in which they turned out to be all the same, here and in `source`, as
    /// `settle_masses` does of particles in memory.
    pub fn settle(&mut self, source: &mut LayeredParticles) {
        let mut from = 0;
        for (index, weight) in self.same_weight.iter_mut().enumerate() {
            let end = from + source.layers[index].runs() as usize;
            if let Some(weight) = weight.take() {
                source.settle(index, weight);
                // The hash must be that of the same particles in memory, which have no weights then.
                self.runs[from..end].iter_mut().for_each(|r| r.hash.weights = None);
            }
            from = end;
        }
    }

    /// Bounds of each layer, world units.
    pub fn layer_bounds(&self, source: &LayeredParticles) -> Vec<Bounds> {
        let mut runs = self.runs.iter();
        let bounds_of =
            |n: u64| runs.by_ref().take(n as usize).fold(Bounds::empty(), |all, r| all.union(&r.bounds(source.origin)));
        source.layers.iter().map(|l| l.runs()).map(bounds_of).collect()
    }

    /// The snapshot's hash (`hash_of_runs`).
    pub fn hash(&self, origin: [f64; 3]) -> [u8; 32] {
        hash_of_runs(origin, self.runs.iter().map(|r| &r.hash))
    }
}

impl RunScan {
    /// Bounds, world units.
    fn bounds(&self, origin: [f64; 3]) -> Bounds {
        let world = |p: [f32; 3]| each_axis(|k| origin[k] + f64::from(p[k]));
        Bounds { min: world(self.min), max: world(self.max) }
    }
}

impl RunContent {
    fn new(chunk: &Chunk<'_>, source: &LayeredParticles, first: u64, every: u64) -> Self {
        let end = |f: fn(f32, f32) -> f32, from: f32| chunk.position.map(|c| c.iter().fold(from, |a, &v| f(a, v)));
        let (min, max) = (end(f32::min, f32::INFINITY), end(f32::max, f32::NEG_INFINITY));
        let one = chunk.weight.and_then(|w| w.first().copied().filter(|f| w.iter().all(|v| v == f)));
        let scan = RunScan { min, max, hash: hash_run(chunk) };
        RunContent {
            outside: ParticlesOutsideBox::count(
                chunk,
                source.origin,
                &scan.bounds(source.origin),
                source.meta.cell.as_ref(),
            ),
            scan: Some(scan),
            sample: PositionSample::of_run(chunk, first, every),
            invalid: invalid(chunk),
            weight: one,
        }
    }
}

/// Positions sampled at most. Cuts through fewer particles are exact; the share of a block among
/// 8 is off by about 0.1 % then.
const MOST: u64 = 1 << 22;

/// Positions about the reader's origin: all particles where they are few, else every K-th.
#[derive(Default)]
pub struct PositionSample {
    /// x, y, z.
    pub position: [Vec<f32>; 3],
}

impl PositionSample {
    /// Of `count` particles, the first of every so many is taken.
    fn every(count: u64) -> u64 {
        count.div_ceil(MOST).max(1)
    }

    /// The sample of a run whose first particle is number `first`: one of `every` particles, none for 0.
    fn of_run(chunk: &Chunk<'_>, first: u64, every: u64) -> [Vec<f32>; 3] {
        if every == 0 {
            return Default::default();
        }
        let skip = (every - first % every) % every;
        chunk.position.map(|c| c.iter().skip(skip as usize).step_by(every as usize).copied().collect())
    }

    fn append(&mut self, run: [Vec<f32>; 3]) {
        (0..3).for_each(|k| self.position[k].extend_from_slice(&run[k]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Particles;
    use crate::testing::two_layers;
    use particlegs_core::context::Context;
    use particlegs_core::model::Layer;
    use std::ops::Range;

    fn snapshot(weights: impl Fn(usize) -> f32) -> Particles {
        let mut p = two_layers(3 * RUN, weights);
        p.origin = [1e6, 0.0, -3.5];
        p
    }

    #[test]
    fn a_scan_tells_what_the_particles_in_memory_tell() {
        for same in [false, true] {
            let p = snapshot(|i| if same && i >= 70_000 { 2.0 } else { 1.0 + i as f32 });
            let mut source = LayeredParticles::from_particles(&p);
            let mut scan = SnapshotScan::new(&source, "here", true, &Context::SILENT).unwrap();
            assert_eq!(scan.hash(source.origin), p.source_hash());
            scan.settle(&mut source);
            let p = p.settle_masses();
            assert_eq!(scan.bounds, p.bounds());
            assert_eq!(scan.hash(source.origin), p.source_hash());
            let column = |k: usize| (0..p.len()).map(|i| (p.position(i)[k] - p.origin[k]) as f32).collect::<Vec<_>>();
            assert_eq!(scan.sample.position, [0, 1, 2].map(column), "every particle of so few");
            assert_eq!(source.raw_bytes(), p.raw_bytes());
            let heads = |l: &Layer<Range<usize>>| (l.name.clone(), l.mass);
            let read: Vec<_> = source.layers.iter().map(|l| (l.layer.name.clone(), l.layer.mass)).collect();
            assert_eq!(read, p.layers().iter().map(heads).collect::<Vec<_>>());
            assert_eq!(read[1].1.is_weighted(), !same);
        }
    }

    #[test]
    fn invalid_values_are_named() {
        let p = snapshot(|i| if i == 140_000 { -1.0 } else { 1.0 + i as f32 });
        let error =
            SnapshotScan::new(&LayeredParticles::from_particles(&p), "here", false, &Context::SILENT).err().unwrap();
        assert!(
            error
                .to_string()
                .contains(": 1 with a mass or weight that is not between 0 and 3e38; the first has index 140000"),
            "{error}"
        );
    }
}
