//! Models between two frames of a series.

use super::change::{FrameMap, TrackedBlock};
use super::exact::exp_twice;
use super::series::TrackedModel;
use super::shape::CholeskyFactor;
use super::sums::compensated;
use crate::math::{Sym3, each_axis, exp};
use crate::model::{Block, Epoch, Layer, Metadata, Mixture, Model, Quantity};
use crate::space::{Bounds, Cell};

impl TrackedModel {
    /// The model at `share` (0 to 1) of the way to the `next` frame, whose Gaussians are known by their
    /// [`TrackedBlock::origin`]: means move along the curve that has their velocities at both ends, shapes along the
    /// geodesic, counts and fields that both frames have on a line. Gaussians and layers of one frame alone fade. Counts are
    /// not whole, and the source has no hash.
    pub fn between(&self, next: &TrackedModel, share: f64) -> Model {
        let share = share.clamp(0.0, 1.0);
        let (before, after) = (&self.metadata, &next.metadata);
        let cell = before.cell.zip(after.cell).map(|(a, b)| between_cells(&a, &b, share)).or(before.cell);
        let frames = [self, next].map(|frame| FrameMap::new(frame.metadata.cell, cell));
        let elapsed = next.time - self.time;
        let classes = |all: &[Quantity], q: &Quantity| -> Vec<Quantity> {
            let category = q.class().map(|c| c.0);
            let alike = |p: &&Quantity| category.is_some() && p.class().map(|c| c.0) == category;
            all.iter().filter(alike).cloned().collect()
        };
        // A category is there with all its classes, or not at all.
        let both = |q: &&Quantity| after.fields.contains(q) && classes(&before.fields, q) == classes(&after.fields, q);
        let fields: Vec<Quantity> = before.fields.iter().filter(both).cloned().collect();
        let block_between = |from: &TrackedBlock, to: &TrackedBlock| {
            BlockPair { from, to, frames: &frames, elapsed, fields: &fields }.at(share)
        };
        // Keyframes may have other numbers of blocks.
        let blocks_between = |a: &[TrackedBlock], b: &[TrackedBlock]| -> Vec<Block> {
            let both = a.iter().zip(b).map(|(from, to)| block_between(from, to));
            let old = a.iter().skip(b.len()).map(|from| block_between(from, &without_gaussians(from)));
            let new = b.iter().skip(a.len()).map(|to| block_between(&without_gaussians(to), to));
            both.chain(old).chain(new).collect()
        };
        let layers = self.layers.iter().map(|a| {
            let b = next.layers.iter().find(|b| b.name == a.name);
            a.with(blocks_between(&a.content, b.map_or(&[], |b| &b.content)))
        });
        // Layers of the next frame alone are paired with no blocks, so that they fade in.
        let new = next.layers.iter().filter(|b| self.layers.iter().all(|a| a.name != b.name));
        let new = new.map(|b| b.with(blocks_between(&[], &b.content)));
        let layers: Vec<Layer<Vec<Block>>> = layers.chain(new).collect();
        let all = || layers.iter().flat_map(|l| &l.content);
        // A model between two frames is of no snapshot, which the hash of zeros says.
        let metadata = Metadata {
            count: all().map(|b| b.count).sum(),
            mass: compensated(&all().map(|b| b.mass).collect::<Vec<_>>()),
            bounds: between_bounds(&before.bounds, &after.bounds, share),
            cell,
            default_radius: mix(before.default_radius, after.default_radius, share),
            source: format!("between {} and {}", before.source, after.source),
            source_hash: [0; 32],
            epoch: between_epochs(&before.epoch, &after.epoch, share),
            fields,
            ..before.clone()
        };
        Model { metadata, layers, certificate: None }
    }
}

/// A block of the same kind in a frame that does not have it.
fn without_gaussians(TrackedBlock { block, .. }: &TrackedBlock) -> TrackedBlock {
    let mut gaussians = Mixture::new(block.gaussians.masses().is_some());
    block.gaussians.fields.iter().for_each(|(name, field)| gaussians.fields.set(name, field.emptied()));
    TrackedBlock::new(Block { gaussians, bounds: block.bounds, count: 0, mass: 0.0 })
}

/// A block in two frames.
struct BlockPair<'a> {
    from: &'a TrackedBlock,
    to: &'a TrackedBlock,
    /// From the cell of each frame to that between.
    frames: &'a [FrameMap; 2],
    elapsed: f64,
    fields: &'a [Quantity],
}

impl BlockPair<'_> {
    fn at(&self, share: f64) -> Block {
        let (a, b) = (&self.from.block, &self.to.block);
        let [old, new] = [&a.gaussians, &b.gaussians];
        let weighted = old.masses().is_some();
        let mut gaussians = Mixture::new(weighted);
        let in_both = |q: &&Quantity| old.fields.get(&q.name).is_some() && new.fields.get(&q.name).is_some();
        let names: Vec<&str> = self.fields.iter().filter(in_both).map(|q| &q.name[..]).collect();
        for &name in &names {
            let [a, b] = [old, new].map(|m| m.fields.get(name));
            let (Some(a), Some(b)) = (a, b) else { continue };
            let mut moments = a.emptied();
            moments.correlations.retain(|with| b.correlations.get(with).is_some());
            let wider = |(a, b): (&[f64; 2], &[f64; 2])| [a[0].min(b[0]), a[1].max(b[1])];
            moments.range = a.range.iter().zip(&b.range).map(wider).collect();
            gaussians.fields.set(name, moments);
        }
        // A Gaussian of one frame alone has its own moments.
        let add_fields = |to: &mut Mixture, from: [(&Mixture, usize); 2]| {
            for &name in &names {
                let [a, b] = from.map(|(m, i)| m.fields.get(name).map(|f| (f, i)));
                if let (Some(a), Some(b), Some(moments)) = (a, b, to.fields.get_mut(name)) {
                    moments.push_between([a, b], share);
                }
            }
        };
        let mut fades = vec![true; old.len()];
        let [from_old, from_new] = self.frames;
        for (j, origin) in self.to.origin.iter().enumerate() {
            let end = from_new.carried(new.mean_of(j));
            let Some(i) = origin.map(|i| i as usize).filter(|&i| i < old.len()) else {
                // Nothing is known of its motion before its first frame, so it fades in where it is.
                gaussians.push(from_old.image(end), new.cov_of(j), new.count[j] * share, new.mass_of(j) * share);
                add_fields(&mut gaussians, [(new, j); 2]);
                continue;
            };
            fades[i] = false;
            let start = from_old.carried(old.mean_of(i));
            // The shortest way, through a face of the cell where that is nearer.
            let chord = from_old.nearest(each_axis(|k| end[k] - start[k]));
            let velocities = [self.from.velocity(i), self.to.velocity(j)];
            // An unknown velocity is taken along the chord: where neither is known the curve is straight.
            let [first, last] = velocities.map(|v| v.map_or(chord, |v| each_axis(|k| v[k] * self.elapsed)));
            // The cubic Hermite curve: its derivatives at both ends are the two velocities.
            let weight = share * (1.0 - share);
            let deviation = |k: usize| weight * ((1.0 - share) * (first[k] - chord[k]) - share * (last[k] - chord[k]));
            let mean = each_axis(|k| start[k] + share * chord[k] + deviation(k));
            let cov = between_shapes(&old.cov_of(i), &new.cov_of(j), share);
            let count = mix(old.count[i], new.count[j], share);
            gaussians.push(from_old.image(mean), cov, count, mix(old.mass_of(i), new.mass_of(j), share));
            add_fields(&mut gaussians, [(old, i), (new, j)]);
        }
        for i in (0..old.len()).filter(|&i| fades[i]) {
            // A Gaussian that goes keeps its last velocity while it fades.
            let velocity = self.from.velocity(i).unwrap_or_default();
            let carried = from_old.carried(old.mean_of(i));
            let mean = from_old.image(each_axis(|k| carried[k] + velocity[k] * self.elapsed * share));
            gaussians.push(mean, old.cov_of(i), old.count[i] * (1.0 - share), old.mass_of(i) * (1.0 - share));
            add_fields(&mut gaussians, [(old, i); 2]);
        }
        let bounds = between_bounds(&a.bounds, &b.bounds, share);
        let count = compensated(&gaussians.count).round() as u64;
        let mass = gaussians.masses().map_or(count as f64, |masses| compensated(masses));
        Block { bounds, count, mass, gaussians }
    }
}

fn mix(a: f64, b: f64, share: f64) -> f64 {
    a + share * (b - a)
}

/// A covariance on the geodesic from one to the other.
fn between_shapes(from: &Sym3, to: &Sym3, share: f64) -> Sym3 {
    let factor = CholeskyFactor::new(from);
    let Some([size, shape @ ..]) = factor.logarithm(to) else { return *from };
    let unit = exp_twice(shape.map(|v| v * share));
    factor.congruent(&unit).scale(exp(2.0 * size * share))
}

fn between_bounds(a: &Bounds, b: &Bounds, share: f64) -> Bounds {
    let corner = |a: [f64; 3], b: [f64; 3]| each_axis(|k| mix(a[k], b[k], share));
    Bounds { min: corner(a.min, b.min), max: corner(a.max, b.max) }
}

fn between_cells(a: &Cell, b: &Cell, share: f64) -> Cell {
    let vector = |a: [f64; 3], b: [f64; 3]| each_axis(|k| mix(a[k], b[k], share));
    let vectors = each_axis(|i| vector(a.vectors[i], b.vectors[i]));
    Cell { origin: vector(a.origin, b.origin), vectors, ..*a }
}

/// Steps and frames have no between.
fn between_epochs(a: &Epoch, b: &Epoch, share: f64) -> Epoch {
    let number = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| mix(a, b, share));
    let (scale_factor, time) = (number(a.scale_factor, b.scale_factor), number(a.time, b.time));
    Epoch { scale_factor, time, frame: None, step: None }
}

#[cfg(test)]
mod tests {
    use super::super::change::{ChangePrecision, ChangeTarget, FrameStep};
    use super::*;
    use crate::math::Random;
    use crate::model::{FieldMoments, LawKind, QuantityKind};

    const CELL: Cell =
        Cell { origin: [0.0; 3], vectors: [[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]], periodic: [true; 3] };

    /// Gaussians that fall along x at time t; the last dies and a new one is born after t = 1.
    fn block(t: f64) -> Block {
        let mut gaussians = Mixture::new(false);
        for i in 0..50 {
            let mut r = Random::new(3, 1, i);
            let at = [0.0; 3].map(|_| 10.0 * r.uniform());
            let shape = Sym3::scaled_identity(0.04 * (1.0 + t * t));
            gaussians.push([(at[0] + t * t).rem_euclid(10.0), at[1], at[2]], shape, 100.0, 100.0);
        }
        let bounds = Bounds { min: [0.0; 3], max: [10.0; 3] };
        Block { bounds, count: 5000, mass: 5000.0, gaussians }
    }

    fn tracked(block: TrackedBlock, time: f64) -> TrackedModel {
        let bounds = block.block.bounds;
        let metadata = Metadata { cell: Some(CELL), ..Metadata::new(LawKind::OpticalDepth, block.block.count, bounds) };
        let layer = Layer { name: "gas".into(), mass: crate::model::Mass::default(), content: vec![block] };
        TrackedModel { time, metadata, certificate: None, layers: vec![layer], key: Vec::new() }
    }

    #[test]
    fn gaussians_between_frames_are_where_they_were() {
        let step = FrameStep { cells: [Some(CELL); 2], elapsed: 0.5 };
        let mut frames = vec![TrackedBlock::new(block(0.0))];
        let born = [false; 50];
        for n in 1..8 {
            let next = block(0.5 * f64::from(n));
            let (bounds, count, mass) = (next.bounds, next.count, next.mass);
            let target = ChangeTarget { gaussians: &next.gaussians, born: &born, bounds, count, mass };
            let fine = ChangePrecision { steps: [0.01; 5], gains: [1.0, 1.0] };
            let before = &frames[frames.len() - 1];
            let bytes = before.encode(&target, &step, &fine).unwrap();
            frames.push(before.decode(&bytes, &step).unwrap());
        }
        let last = tracked(frames.pop().unwrap(), 3.5);
        let before = tracked(frames.pop().unwrap(), 3.0);
        let model = before.between(&last, 0.5);
        let truth = block(3.25);
        let gaussians = &model.layers[0].content[0].gaussians;
        for i in 0..50 {
            let offset =
                each_axis(|k| (gaussians.mean[k][i] - truth.gaussians.mean[k][i] + 5.0).rem_euclid(10.0) - 5.0);
            // A straight line is off by 0.06.
            assert!(offset.iter().all(|d| d.abs() < 0.02), "{offset:?}");
            assert!((gaussians.cov[0][i] / truth.gaussians.cov[0][i] - 1.0).abs() < 0.03);
        }
        assert_eq!((model.metadata.count, model.metadata.mass), (5000, 5000.0));
    }

    #[test]
    fn layers_and_blocks_of_one_frame_alone_fade() {
        let mut first = tracked(TrackedBlock::new(block(0.0)), 0.0);
        let mut next = tracked(TrackedBlock::new(block(1.0)), 1.0);
        let named = |name: &str, model: &TrackedModel| Layer { name: name.into(), ..model.layers[0].clone() };
        first.layers.push(named("dust", &first));
        next.layers.insert(0, named("stars", &next));
        let model = first.between(&next, 0.25);
        let counts: Vec<(&str, u64)> = model.layers.iter().map(|l| (&l.name[..], l.content[0].count)).collect();
        assert_eq!(counts, [("gas", 5000), ("dust", 3750), ("stars", 1250)]);
        assert_eq!(model.metadata.count, 10_000);
        next.layers[1].content.push(TrackedBlock::new(block(1.0)));
        let quantity = Quantity::new("heat", QuantityKind::Scalar);
        for model in [&mut first, &mut next] {
            model.metadata.fields = vec![quantity.clone()];
            for tracked in model.layers.iter_mut().flat_map(|l| &mut l.content) {
                let mut heat = FieldMoments::new(1);
                heat.range = vec![[1.0, 1.0]];
                let n = tracked.block.gaussians.len();
                heat.mean[0] = vec![1.0; n];
                heat.spread[0] = vec![0.5; n];
                heat.slope[0].iter_mut().for_each(|c| *c = vec![0.0; n]);
                tracked.block.gaussians.fields.set("heat", heat);
            }
        }
        let heat = |b: &Block| b.gaussians.fields.get("heat").map(|f| f.mean[0].len()) == Some(b.gaussians.len());
        assert!(first.between(&next, 0.25).layers.iter().flat_map(|l| &l.content).all(heat));
        let counts = |model: Model| model.layers[0].content.iter().map(|b| b.count).collect::<Vec<_>>();
        assert_eq!(counts(first.between(&next, 0.25)), [5000, 1250]);
        next.layers.rotate_left(1);
        assert_eq!(counts(next.between(&first, 0.25)), [5000, 3750]);
    }

    #[test]
    fn gaussians_of_one_frame_alone_fade() {
        let first = tracked(TrackedBlock::new(block(0.0)), 0.0);
        let next = tracked(TrackedBlock::new(block(1.0)), 1.0);
        let model = first.between(&next, 0.25);
        let gaussians = &model.layers[0].content[0].gaussians;
        assert_eq!((gaussians.len(), gaussians.count[0], gaussians.count[99]), (100, 25.0, 75.0));
        assert_eq!(model.metadata.count, 5000);
    }
}
