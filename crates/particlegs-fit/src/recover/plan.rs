//! The share of each Gaussian in the particles that are drawn.

use super::options::Method;
use super::two_phases::TwoPhases;
use particlegs_core::codec::whole_counts;
use particlegs_core::math::Sym3;
use particlegs_core::model::{Block, Columns, Layer, Mass, Metadata, Mixture, Model, Quantity};
use particlegs_core::{Error, Result};
use particlegs_particles::{Particles, RUN, SnapshotMeta};
use std::ops::Range;

/// Particles that can be drawn: counts stay whole in f64.
const MOST: u64 = 1 << 53;

/// A layer's Gaussians and the particles that each gets.
pub(super) struct LayerPlan {
    /// The layer, which keeps its mass, and the Gaussians of all its blocks.
    pub layer: Layer<Mixture>,
    /// Particles up to and with each Gaussian.
    pub ends: Vec<u64>,
    /// Weight of each Gaussian's particles; empty where the layer has none.
    pub weights: Vec<f32>,
    /// Particles of the layers before.
    pub first: u64,
    /// Of fields that have them.
    pub phases: Columns<TwoPhases>,
}

impl LayerPlan {
    pub fn count(&self) -> u64 {
        self.ends.last().copied().unwrap_or(0)
    }

    fn runs(&self) -> u64 {
        self.count().div_ceil(RUN as u64)
    }
}

/// Layers that are drawn, and the number of their particles.
pub(super) struct RecoveryPlan {
    pub layers: Vec<LayerPlan>,
    pub total: u64,
}

impl RecoveryPlan {
    /// Shares `wanted` particles (`None`: as many as the model stands for) among the Gaussians.
    /// If that is the model's own number, each gets its own count, but for methods that go by
    /// volume. Other numbers of an alpha-blend model are shared by the opacities themselves, which
    /// rounding to whole counts would lose where Gaussians are many and particles few.
    pub fn new(model: Model, wanted: Option<u64>, method: Method) -> Result<RecoveryPlan> {
        let model_total: u64 = model.layers.iter().map(|l: &Layer<Vec<Block>>| l.count()).sum();
        let total = wanted.unwrap_or(model_total);
        if total == 0 || total > MOST {
            return Err(Error::argument(format!("the number of particles must be 1 to 2^53, not {total}")));
        }
        let by_volume = method.by_volume(model.metadata.law);
        let shared = by_volume || total != model_total;
        let mut counts: Vec<f64> = Vec::with_capacity(model.gaussians());
        for block in model.blocks() {
            let (g, start) = (&block.gaussians, counts.len());
            if shared {
                counts.extend(numbers(block))
            } else {
                counts.extend_from_slice(&g.count)
            }
            if by_volume {
                counts[start..].iter_mut().enumerate().for_each(|(i, n)| *n *= volume(&g.cov_of(i)));
            }
        }
        if shared {
            // Over all layers at once, so that they sum to `total`.
            whole_counts(&mut counts, total);
        }
        let mut layers: Vec<LayerPlan> = model.layers.into_iter().map(LayerPlan::new).collect();
        let (mut rest, mut first) = (&counts[..], 0);
        for layer in &mut layers {
            let (mine, others) = rest.split_at(layer.layer.content.len());
            layer.share(mine, first);
            first += layer.count();
            rest = others;
        }
        layers.retain(|l| l.count() > 0);
        Ok(RecoveryPlan { layers, total })
    }

    /// Keeps the fields of every layer that are `drawn`, in their order; of a category all classes.
    pub fn keep_fields(&mut self, drawn: &[Quantity]) {
        for layer in &mut self.layers {
            let all = std::mem::take(&mut layer.layer.content.fields);
            for q in drawn {
                let matching_fields = all.iter().filter(|(name, _)| belongs(name, &q.name));
                matching_fields.for_each(|(name, field)| layer.layer.content.fields.set(name, field.clone()));
            }
        }
    }

    /// Whether any particles have weights of their own.
    pub fn weighted(&self) -> bool {
        self.layers.iter().any(|l| l.layer.mass.is_weighted())
    }

    /// The layers that get particles, and which.
    pub fn described(&self) -> Vec<Layer<Range<u64>>> {
        self.layers.iter().map(|l| l.layer.with(l.first..l.first + l.count())).collect()
    }

    pub fn runs(&self) -> u64 {
        self.layers.iter().map(LayerPlan::runs).sum()
    }

    /// Layer of run `id`, the run's number in it, and its particles there.
    pub fn run(&self, mut id: u64) -> (&LayerPlan, u64, Range<u64>) {
        let mut layers = self.layers.iter();
        let mut layer = layers.next().expect("a plan has particles");
        while id >= layer.runs() {
            id -= layer.runs();
            layer = layers.next().expect("a run of the plan");
        }
        let start = id * RUN as u64;
        (layer, id, start..layer.count().min(start + RUN as u64))
    }
}

/// Whether `name` is that of a field, or of a class of it.
pub(super) fn belongs(name: &str, field: &str) -> bool {
    name.strip_prefix(field).is_some_and(|rest| rest.is_empty() || rest.starts_with('='))
}

impl LayerPlan {
    fn new(layer: Layer<Vec<Block>>) -> LayerPlan {
        let layer = layer.map(|blocks| {
            let mut blocks = blocks.into_iter().map(|b| b.gaussians);
            let mut gaussians = blocks.next().unwrap_or_default();
            blocks.for_each(|b| gaussians.append(&b));
            gaussians
        });
        let mut phases = Columns::default();
        for (name, field) in layer.content.fields.iter() {
            TwoPhases::new(field, &layer.content).into_iter().for_each(|of_field| phases.set(name, of_field));
        }
        LayerPlan { layer, ends: Vec::new(), weights: Vec::new(), first: 0, phases }
    }

    /// The Gaussians of the particles `range` of the layer, and which of these particles, counted from the first, are
    /// theirs.
    pub fn parts(&self, range: Range<u64>) -> impl Iterator<Item = (usize, Range<usize>)> {
        let first = self.ends.partition_point(|&end| end <= range.start);
        let n = (range.end - range.start) as usize;
        let mut at = 0;
        let part = move |(i, end): (usize, &u64)| {
            let from = at;
            at = ((end - range.start) as usize).min(n);
            (first + i, from..at)
        };
        self.ends[first..].iter().enumerate().map(part).take_while(move |(_, part)| part.start < n)
    }

    /// Takes the Gaussians' counts. The layer keeps its mass: by its particles' weights where they
    /// have some, else by the mass of a particle.
    fn share(&mut self, counts: &[f64], first: u64) {
        let mut end = 0u64;
        self.ends = counts
            .iter()
            .map(|&c| {
                end += c as u64;
                end
            })
            .collect();
        self.first = first;
        let g = &self.layer.content;
        if let Some(masses) = g.masses() {
            let mean = |i: usize| if g.count[i] > 0.0 { masses[i] / g.count[i] } else { 0.0 };
            let model_mass: f64 = masses.iter().sum();
            let drawn: f64 = counts.iter().enumerate().map(|(i, c)| c * mean(i)).sum();
            let factor = if drawn > 0.0 { model_mass / drawn } else { 1.0 };
            // A weight is positive, though it be too small for f32.
            let weight = |i: usize| ((mean(i) * factor) as f32).clamp(f32::MIN_POSITIVE, f32::MAX);
            self.weights = (0..g.len()).map(weight).collect();
        } else if let Mass::Each(mass) = &mut self.layer.mass {
            let model_count: f64 = g.count.iter().sum();
            if end > 0 && model_count != end as f64 {
                *mass *= model_count / end as f64;
            }
        }
    }
}

/// The particles that each of a block's Gaussians stands for; of an alpha-blend block before they
/// were made whole.
fn numbers(block: &Block) -> Vec<f64> {
    let g = &block.gaussians;
    let Some(alpha_blend) = g.law.alpha_blend() else { return g.count.clone() };
    let sum: f64 = alpha_blend.opacity.iter().sum();
    alpha_blend.opacity.iter().map(|o| o / sum * block.count as f64).collect()
}

/// Volume of an ellipsoid of one standard deviation, but for 4 pi / 3.
fn volume(cov: &Sym3) -> f64 {
    cov.det().max(0.0).sqrt()
}

/// The model about another origin.
pub(super) fn moved(mut moved: Model, origin: [f64; 3]) -> Model {
    for k in 0..3 {
        for block in moved.layers.iter_mut().flat_map(|l| &mut l.content) {
            block.gaussians.mean[k].iter_mut().for_each(|x| *x -= origin[k]);
        }
        let m = &mut moved.metadata;
        (m.bounds.min[k], m.bounds.max[k]) = (m.bounds.min[k] - origin[k], m.bounds.max[k] - origin[k]);
        if let Some(cell) = &mut m.cell {
            cell.origin[k] -= origin[k];
        }
    }
    moved
}

/// The origin that particles of a model are written about: 0 unless float32 would not hold their places there.
pub(super) fn origin_of(metadata: &Metadata) -> [f64; 3] {
    metadata.bounds.float32_origin(metadata.default_radius)
}

/// Metadata of particles drawn from a model, in these layers.
pub(super) fn meta_of(metadata: &Metadata, layers: &[Layer<Range<u64>>]) -> SnapshotMeta {
    let one = layers.len() == 1 && layers[0].name == Particles::ONE_LAYER;
    SnapshotMeta {
        name: format!("{} (synthetic)", metadata.source),
        cell: metadata.cell,
        units: metadata.units.clone(),
        particle_mass: layers[0].mass.unit().filter(|_| one),
        weight_name: metadata.weight_name().map(str::to_string),
        cosmology: metadata.cosmology,
        epoch: metadata.epoch,
        ..SnapshotMeta::default()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::options::Options;
    use super::*;
    use particlegs_core::model::{AlphaBlend, Law, LawKind, Metadata};
    use particlegs_core::space::Bounds;
    use particlegs_particles::RawForm;
    use proptest::prelude::*;

    /// Options of raw columns, seed 5.
    pub fn options(method: Method) -> Options {
        Options { particles: None, method, scale: 1.0, seed: 5, form: RawForm::Columns, model_name: "m.pgs".into() }
    }

    /// A model of one layer a slice of (count, mass); each Gaussian at its number along x.
    pub fn model(layers: &[(&str, &[(u64, Option<f64>)])]) -> Model {
        let layer = |(name, gaussians): &(&str, &[(u64, Option<f64>)])| {
            let weighted = gaussians.iter().any(|g| g.1.is_some());
            let mut m = Mixture::new(weighted);
            for (i, &(count, mass)) in gaussians.iter().enumerate() {
                let cov = Sym3([0.04, 0.01, 0.0, 0.02, -0.005, 0.01]);
                m.push([i as f64 + 0.5, 5.0, 5.0], cov, count as f64, mass.unwrap_or(0.0));
            }
            let count = gaussians.iter().map(|g| g.0).sum();
            let mass = if weighted { gaussians.iter().filter_map(|g| g.1).sum() } else { count as f64 };
            let bounds = Bounds { min: [0.0; 3], max: [10.0; 3] };
            let content = vec![Block { bounds, count, mass, gaussians: m }];
            Layer { name: name.to_string(), mass: Mass::new(weighted, (!weighted).then_some(2.0)), content }
        };
        let layers: Vec<Layer<Vec<Block>>> = layers.iter().map(layer).collect();
        let bounds = Bounds { min: [0.0; 3], max: [10.0; 3] };
        let count = layers.iter().map(|l: &Layer<Vec<Block>>| l.count()).sum();
        let metadata = Metadata {
            mass: layers.iter().flat_map(|l| &l.content).map(|b| b.mass).sum(),
            cell: Some(particlegs_core::space::Cell::orthogonal([10.0; 3])),
            default_radius: 0.1,
            ..Metadata::new(LawKind::OpticalDepth, count, bounds)
        };
        Model { metadata, layers, certificate: None }
    }

    proptest! {
        /// Any number is drawn exactly, and every layer keeps its mass.
        #[test]
        fn numbers_and_masses_are_kept(
            counts in proptest::collection::vec((1u64..500, 0.1f64..10.0), 1..9),
            wanted in 50u64..5000,
        ) {
            let dm: Vec<_> = counts.iter().map(|c| (c.0, None)).collect();
            let gas: Vec<_> = counts.iter().map(|c| (c.0, Some(c.1))).collect();
            let model = model(&[("dm", &dm), ("gas", &gas)]);
            let masses: Vec<f64> = model.layers.iter().map(|l| l.mass.unit_or_one() * l.content[0].mass).collect();
            let own_plan = RecoveryPlan::new(model.clone(), None, Method::Count).unwrap();
            for (layer, g) in own_plan.layers.iter().zip([&dm, &gas]) {
                let each: Vec<u64> = std::iter::once(0).chain(layer.ends.iter().copied()).collect();
                prop_assert!(each.windows(2).zip(g).all(|(w, g)| w[1] - w[0] == g.0));
            }
            for method in [Method::Count, Method::Volume] {
                let plan = RecoveryPlan::new(model.clone(), Some(wanted), method).unwrap();
                prop_assert_eq!(plan.layers.iter().map(LayerPlan::count).sum::<u64>(), wanted);
                for (layer, mass) in plan.layers.iter().zip(&masses) {
                    let drawn: f64 = match layer.layer.mass.is_weighted() {
                        false => layer.layer.mass.unit().unwrap() * layer.count() as f64,
                        true => (0..layer.ends.len())
                            .map(|i| (layer.ends[i] - if i == 0 { 0 } else { layer.ends[i - 1] }) as f64 * f64::from(layer.weights[i]))
                            .sum(),
                    };
                    prop_assert!((drawn / mass - 1.0).abs() < 1e-6, "{drawn} {mass}");
                }
            }
        }
    }

    /// Gaussians of opacities 0.1, 0.2 and 0.7, the second of eight times the volume.
    pub fn shaded(count: u64) -> Model {
        let mut m = model(&[("particles", &[(1, None), (1, None), (1, None)])]);
        (m.metadata.law, m.metadata.count, m.metadata.mass) = (LawKind::AlphaBlend, count, count as f64);
        let block = &mut m.layers[0].content[0];
        (block.count, block.mass) = (count, count as f64);
        let opacity = vec![0.1, 0.2, 0.7];
        let g = &mut block.gaussians;
        g.count = opacity.clone();
        whole_counts(&mut g.count, count);
        (0..6).for_each(|k| g.cov[k][1] *= 4.0);
        g.law = Law::AlphaBlend(AlphaBlend { opacity, grey: vec![1.0; 3], vizmapper: None });
        m
    }

    /// Shares of V0, V1, V4 and V6 as in docs/law/published.md, "Recovery".
    #[test]
    fn alpha_blend_models_are_shared_by_opacity() {
        let each = |count: u64, wanted: Option<u64>, method| {
            let plan = RecoveryPlan::new(shaded(count), wanted, method).unwrap();
            let ends = &plan.layers[0].ends;
            [ends[0], ends[1] - ends[0], ends[2] - ends[1]]
        };
        for method in [Method::Count, Method::Ellipsoid, Method::Stratified, Method::Spaced] {
            assert_eq!(each(1000, None, method), [100, 200, 700]);
            // Two particles say nothing of the opacities, which are still there.
            assert_eq!(each(2, None, method).iter().sum::<u64>(), 2);
            assert_eq!(each(2, Some(1000), method), [100, 200, 700]);
        }
        // Opacity times volume: 1 : 16 : 7.
        for method in [Method::Volume, Method::Grid] {
            assert_eq!(each(2400, None, method), [100, 1600, 700]);
            assert_eq!(each(3, Some(2400), method), [100, 1600, 700]);
        }
        // Grids of the other law go by counts.
        let depth = model(&[("particles", &[(10, None), (30, None)])]);
        assert_eq!(RecoveryPlan::new(depth, Some(400), Method::Grid).unwrap().layers[0].ends, [100, 400]);
    }

    #[test]
    fn no_particles_and_too_many_are_refused() {
        let m = model(&[("particles", &[(5, None)])]);
        assert!(RecoveryPlan::new(m.clone(), Some(0), Method::Count).is_err());
        assert!(RecoveryPlan::new(m, Some(u64::MAX), Method::Count).is_err());
    }

    #[test]
    fn runs_cover_every_layer() {
        let plan =
            RecoveryPlan::new(model(&[("a", &[(70_000, None), (3, None)]), ("b", &[(1, None)])]), None, Method::Count)
                .unwrap();
        assert_eq!(plan.runs(), 3);
        let runs: Vec<_> = (0..3).map(|id| plan.run(id)).map(|(l, n, r)| (l.layer.name.clone(), n, r)).collect();
        assert_eq!(runs[1], ("a".into(), 1, 65_536..70_003));
        assert_eq!(runs[2], ("b".into(), 0, 0..1));
    }
}
