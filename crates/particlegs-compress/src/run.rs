//! From particles to a measured file, in one process.

use super::FieldSelection;
use super::block::CodedBlock;
use super::certify::DecodedFile;
use super::clock::Clock;
use super::executor::do_blocks;
use super::in_memory::InMemoryBlocks;
use super::options::Options;
use super::plan::CompressionPlan;
use super::search;
use super::setup::{BlockSetup, StopPolicy};
use super::shared_species::SharedLayer;
use super::thickness::Thickness;
use super::total_size::compress_to_total;
#[cfg(doc)]
use particlegs_core::Error;
use particlegs_core::Result;
use particlegs_core::checkpoint::CheckpointStore;
use particlegs_core::context::Context;
use particlegs_core::model::{GoalResult, Metadata, Model};
use particlegs_core::space::Bounds;
use particlegs_files::memory::require;
use particlegs_files::output;
use particlegs_fit::memory_needed;
use particlegs_measure::score::{CertificateInput, GoalMetric};
use particlegs_particles::blocks::SnapshotScan;
use particlegs_particles::{LayerFields, LayeredParticles, Particles, Storage};
use particlegs_train::TrainedRun;

/// A file and how it came to be.
pub struct CompressedModel {
    /// The file, whole.
    pub bytes: Vec<u8>,
    /// The file decoded again.
    pub model: Model,
    /// The goal in the terms of the data, and the value that the file reaches.
    pub reached: Option<GoalResult>,
    /// Multiple of the nominal quantisation steps.
    pub step_factor: f64,
    /// Reports of training runs: one for a layer of a block.
    pub trained: Vec<TrainedRun>,
    /// Whether training was stopped, and this is the best so far.
    pub stopped: bool,
    /// Notes for the user, a sentence each: those of [`Compression::notes`], then on how the target is met, and on
    /// the thickness of the model of a flat box.
    pub notes: Vec<String>,
    /// Wall-clock seconds by phase, in order.
    pub seconds: Vec<(&'static str, f64)>,
}

impl CompressedModel {
    /// A model that was there already, with its file's bytes.
    pub fn existing(bytes: Vec<u8>, model: Model) -> CompressedModel {
        let (reached, trained, stopped, notes, seconds) = Default::default();
        CompressedModel { bytes, model, reached, step_factor: 1.0, trained, stopped, notes, seconds }
    }
}

/// Compresses a snapshot; `checkpoints` keeps pieces from which an interrupted run goes on.
pub fn compress(
    particles: &Particles,
    options: &Options,
    checkpoints: &mut dyn CheckpointStore,
    context: &Context<'_>,
) -> Result<CompressedModel> {
    Compression::plan(particles, &[], options, context)?.run(checkpoints, context)
}

/// A compression that is planned: the snapshot was read once, and no block is fitted yet.
pub struct Compression<'a> {
    particles: &'a Particles,
    options: &'a Options,
    fields: Option<FieldSelection<'a>>,
    plan: CompressionPlan,
    layer_bounds: Vec<Bounds>,
    /// All species as one layer, if they share Gaussians.
    shared: Option<SharedLayer>,
    clock: Clock,
}

impl<'a> Compression<'a> {
    /// Checks the options, finds the fields that they name among `sources`, those of each layer (none are needed where
    /// no field is named), and reads the particles once: bounds, hash, and a sample for their cuts.
    pub fn plan(
        particles: &'a Particles,
        sources: &'a [LayerFields],
        options: &'a Options,
        context: &Context<'_>,
    ) -> Result<Self> {
        options.check()?;
        let Options { fields, star_forming, .. } = options;
        if fields.is_empty() {
            return Compression::of_positions(particles, &particles.meta.fields, options, context);
        }
        let chosen = FieldSelection::new(fields, *star_forming, particles, sources, options.law())?;
        let mut planned = Compression::of_positions(particles, chosen.omitted(), options, context)?;
        planned.plan.notes.splice(0..0, chosen.notes().iter().cloned());
        planned.fields = Some(chosen);
        Ok(planned)
    }

    /// Plans the model without fields; `omitted` are the names of the snapshot's fields that it will not have.
    pub(super) fn of_positions(
        particles: &'a Particles,
        omitted: &[String],
        options: &'a Options,
        context: &Context<'_>,
    ) -> Result<Self> {
        particles.check_files()?;
        let blocks = options.blocks_of(particles)?;
        require("the fit", memory_needed(particles) / u64::from(blocks.max(1)))?;
        if let (Storage::Disk(folder), true) = (&options.storage, blocks > 1) {
            output::check_space_in(folder, particles.raw_bytes())?;
        }
        let mut clock = Clock::default();
        let mut source = LayeredParticles::from_particles(particles);
        source.meta.fields = omitted.to_vec();
        let scan = clock.time("read", || SnapshotScan::new(&source, &particles.meta.name, blocks != 1, context))?;
        let mut plan = clock.time("divide", || CompressionPlan::new(options, &source, &scan, blocks, context))?;
        let mut layer_bounds = scan.layer_bounds(&source);
        let trial = (plan.gaussians(), plan.metadata.default_radius);
        let shared = clock.time("fit", || SharedLayer::chosen(particles, options, trial, context))?;
        if let Some(shared) = &shared {
            plan.layers = vec![shared.layer()];
            plan.metadata.shared_species.clone_from(&shared.species);
            layer_bounds = vec![scan.bounds];
            plan.notes.push("the particle types share Gaussians".into());
        }
        Ok(Compression { particles, options, fields: None, plan, layer_bounds, shared, clock })
    }

    /// Metadata of the file; its mass comes from the blocks.
    pub(crate) fn metadata(&self) -> &Metadata {
        &self.plan.metadata
    }

    /// Notes for the user before blocks are fitted, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.plan.notes
    }

    /// 32 bytes that name the work: a hash of all that decides the model's bytes. Pieces of other work are of no
    /// use.
    pub fn id(&self) -> [u8; 32] {
        self.plan.id()
    }

    /// Fits and codes the blocks, puts the file together and measures it.
    pub fn run(mut self, checkpoints: &mut dyn CheckpointStore, context: &Context<'_>) -> Result<CompressedModel> {
        match self.fields.take() {
            None => self.fit(checkpoints, context),
            Some(fields) if self.options.size_with_fields => {
                compress_to_total(self.particles, self.options, &fields, context)
            }
            Some(fields) => fields.add_to_model(self.fit(checkpoints, context)?, context),
        }
    }

    /// The model without fields.
    pub(super) fn fit(self, checkpoints: &mut dyn CheckpointStore, context: &Context<'_>) -> Result<CompressedModel> {
        let Compression { particles, options, fields: _, plan, layer_bounds, shared, mut clock } = self;
        let mut trained = Vec::new();
        // What cannot be measured is refused before anything is fitted.
        let metric_of = |goal| GoalMetric::new(goal, particles, &plan.metadata, plan.recipe().seed, context);
        let metric = plan.recipe().target.goal().map(|goal| clock.time("measure", || metric_of(goal))).transpose()?;
        let (blocks, reached) = {
            let fitted = shared.as_ref().map_or(particles, |s| &s.particles);
            let divide = || InMemoryBlocks::new(fitted, &plan.tree, &layer_bounds, options, context);
            let mut store = clock.time("divide", divide)?;
            let setup = BlockSetup { plan: &plan, limits: &options.limits, on_stop: StopPolicy::KeepBest, context };
            let mut code = |target| -> Result<Vec<CodedBlock>> {
                let mut fit = |target| {
                    do_blocks(&mut store, target, setup, checkpoints)?;
                    Ok(store.take_coded())
                };
                let mut coded = match &shared {
                    None => fit(target)?,
                    Some(shared) => plan.with_shares(target, shared, &mut fit, context)?,
                };
                for block in &mut coded {
                    clock.append(std::mem::take(&mut block.clock));
                    trained.append(&mut block.trained);
                }
                Ok(coded)
            };
            match &metric {
                Some(metric) => {
                    search::reach(metric, &plan, &mut code, context).map(|(b, reached)| (b, Some(reached)))?
                }
                None => (code(plan.recipe().target)?, None),
            }
            // The store goes: the particles of blocks may be half of all that is in memory.
        };
        let size_note = plan.judge(&blocks)?;
        let stopped = blocks.iter().any(|b| b.stopped);
        let (level, memory) = (plan.certificate, options.memory);
        let measured = level.measures() && !stopped;
        let measure =
            measured.then_some(CertificateInput { particles, seed: plan.recipe().seed, level, memory, reached });
        let done = DecodedFile::new(|certificate| plan.file(&blocks, certificate), measure, context)?;
        clock.append(done.clock);
        let step_factor = blocks.iter().map(|b| b.step_factor).sum::<f64>() / blocks.len().max(1) as f64;
        let seconds = clock.seconds();
        let DecodedFile { bytes, model, .. } = done;
        let thickness_note = Thickness::new(particles, &plan.metadata.bounds).and_then(|t| t.note(&model));
        let notes = plan.notes.iter().cloned().chain(size_note).chain(thickness_note).collect();
        Ok(CompressedModel { bytes, model, reached, step_factor, trained, stopped, notes, seconds })
    }
}
