//! One block of a job: a part of the particles, in its layers, fitted and coded on its own.
//!
//! The bytes of a block depend on its particles, the options and its share of the target alone:
//! not on other blocks, nor on where it is done.

use super::clock::Clock;
use super::layer::{LayerParticles, LayerResult, LayerTask, Share};
use super::plan::BlockSetup;
use super::size::SizeOutcome;
use particlegs_core::checkpoint::CheckpointStore;
use particlegs_core::codec::{CodedLayer, StoredBlock, StoredSection};
use particlegs_core::model::{LawKind, Layer, Mass, VizMapper};
use particlegs_core::space::Bounds;
use particlegs_core::{Result, codec};
use particlegs_particles::Particles;
use particlegs_train::TrainedRun;

/// The particles of a block, in its layers.
#[derive(Clone)]
pub(crate) struct BlockParticles {
    /// Layers, the smallest first: what they leave of their share goes to the larger.
    pub layers: Vec<LayerParticles>,
    pub count: u64,
    pub raw_bytes: u64,
}

/// A block's layers coded, one block of the file each, and how that went.
pub(crate) struct CodedBlock {
    pub bounds: Bounds,
    pub layers: Vec<CodedLayer>,
    pub vizmapper: Option<VizMapper>,
    /// Multiple of the nominal steps, of the largest layer.
    pub step_factor: f64,
    pub size_met: SizeOutcome,
    pub trained: Vec<TrainedRun>,
    /// The last training run was stopped, and its best state so far is coded.
    pub stopped: bool,
    pub clock: Clock,
}

impl BlockParticles {
    /// The layers of some particles. Weights are not kept by a law whose Gaussians have opacities.
    pub fn new(particles: &Particles, law: LawKind) -> Self {
        let bounds: Vec<Bounds> = particles.layers().iter().map(|l| particles.of_layer(l).bounds()).collect();
        BlockParticles::with_bounds(particles, law, &bounds)
    }

    /// [`BlockParticles::new`] where the bounds of the layers are known.
    pub fn with_bounds(particles: &Particles, law: LawKind, bounds: &[Bounds]) -> Self {
        let stored_mass = |mass: Mass| if law == LawKind::OpticalDepth { mass } else { mass.without_weights() };
        let layer = |(l, bounds): (&Layer<_>, &Bounds)| {
            LayerParticles::new(particles, &Layer { mass: stored_mass(l.mass), ..l.clone() }, *bounds)
        };
        let mut layers: Vec<LayerParticles> = particles.layers().iter().zip(bounds).map(layer).collect();
        layers.sort_by(|a, b| (a.raw_bytes, &a.layer.name).cmp(&(b.raw_bytes, &b.layer.name)));
        let raw_bytes = layers.iter().map(|l| l.raw_bytes).sum();
        BlockParticles { layers, count: particles.len() as u64, raw_bytes }
    }

    /// Codes the block to its share of the job: of bytes, every layer at about the same ratio; of
    /// Gaussians, shared among the layers by their particles.
    pub fn code(
        &self,
        share: Share,
        setup: BlockSetup<'_>,
        checkpoints: &mut dyn CheckpointStore,
    ) -> Result<CodedBlock> {
        let mut coded = CodedBlock::empty(self.layers.iter().fold(Bounds::empty(), |all, l| all.union(&l.bounds)));
        let mut remaining = RemainingShare { share, count: self.count, raw_bytes: self.raw_bytes };
        for (i, layer) in self.layers.iter().enumerate() {
            let task = LayerTask { layer, setup, runs_left: self.layers.len() - i };
            let layer_result = task.make(remaining.next(layer), checkpoints)?;
            remaining.take(layer, &layer_result);
            coded.push(layer, layer_result);
        }
        Ok(coded)
    }
}

/// The rest of a block's share, and the particles that it is for.
struct RemainingShare {
    share: Share,
    count: u64,
    raw_bytes: u64,
}

impl RemainingShare {
    /// The share of the next layer.
    fn next(&self, layer: &LayerParticles) -> Share {
        match self.share {
            Share::Bytes(bytes) => {
                Share::Bytes((bytes as f64 * (layer.raw_bytes as f64 / self.raw_bytes as f64)) as u64)
            }
            Share::Gaussians(number) => {
                let layer_share = (number as f64 * layer.count() as f64 / self.count as f64).round() as u64;
                Share::Gaussians(layer_share.clamp(1, layer.count()))
            }
        }
    }

    /// Takes away the share of a layer: bytes that it has not used are left.
    fn take(&mut self, layer: &LayerParticles, result: &LayerResult) {
        // The part follows from the counts with this layer in them, so they are reduced only below.
        self.share = match (self.share, self.next(layer)) {
            (Share::Gaussians(number), Share::Gaussians(part)) => Share::Gaussians(number.saturating_sub(part)),
            (Share::Bytes(bytes), _) => {
                Share::Bytes(bytes.saturating_sub(codec::stored_bytes(&result.coded.bytes) as u64))
            }
            (share, _) => share,
        };
        self.count -= layer.count();
        self.raw_bytes -= layer.raw_bytes;
    }
}

impl CodedBlock {
    /// A block of no layers yet.
    pub fn empty(bounds: Bounds) -> Self {
        CodedBlock {
            bounds,
            layers: Vec::new(),
            vizmapper: None,
            step_factor: 1.0,
            size_met: SizeOutcome::Met,
            trained: Vec::new(),
            stopped: false,
            clock: Clock::default(),
        }
    }

    /// Bytes.
    pub fn size(&self) -> usize {
        let bytes = |b: &StoredBlock| {
            let sections = b.sections.iter().map(StoredSection::size);
            codec::stored_bytes(&b.bytes) + sections.sum::<usize>()
        };
        self.layers.iter().flat_map(|l| &l.content).map(bytes).sum()
    }

    fn push(&mut self, layer: &LayerParticles, result: LayerResult) {
        self.layers.push(layer.layer.with(vec![result.coded.bytes.into()]));
        self.vizmapper = result.vizmapper.or(self.vizmapper.take());
        // Layers come smallest first, so what is set last is that of the largest.
        (self.step_factor, self.size_met) = (result.coded.step_factor, result.coded.size_met);
        self.trained.extend(result.trained);
        self.stopped |= result.stopped;
        self.clock.append(result.clock);
    }
}
