//! From particles to a measured file, in one process.

use super::block::CodedBlock;
use super::certify::DecodedFile;
use super::clock::Clock;
use super::executor::{InMemoryBlocks, do_blocks};
use super::options::Options;
use super::plan::{BlockSetup, CompressionPlan, StopPolicy};
use super::shared_species::SharedLayer;
use super::thickness::Thickness;
use super::{FieldSelection, search};
use particlegs_core::checkpoint::{CheckpointStore, NoCheckpoints};
use particlegs_core::context::Context;
use particlegs_core::model::{GoalResult, Metadata, Model, Target};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};
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
        // One block has no cuts, and needs no sample to find them.
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
    fn fit(self, checkpoints: &mut dyn CheckpointStore, context: &Context<'_>) -> Result<CompressedModel> {
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

/// Fits at most.
const FITS: usize = 6;
/// A file that fills this share of the size is good enough, and the share that the next one is to fill.
const FILLED: f64 = 0.98;
const AIM: f64 = 0.99;
/// Bytes that a Gaussian and a number of a field take about: for the first fit.
const GAUSSIAN: f64 = 5.0;
const NUMBER: f64 = 3.0;

/// Compresses particles to a file that has at most the size of the target with its fields. The recipe of the file has
/// the size that positions and masses got.
///
/// # Errors
/// [`Error::Unreachable`] where no fit gives such a file; those of a compression.
fn compress_to_total(
    particles: &Particles,
    options: &Options,
    fields: &FieldSelection<'_>,
    context: &Context<'_>,
) -> Result<CompressedModel> {
    let Target::Size(total) = options.target else { return Err(Error::argument("the target is not a size")) };
    let numbers: usize = fields.quantities().iter().map(|q| q.component_names().len()).sum();
    let mut size = (total as f64 * GAUSSIAN / (GAUSSIAN + NUMBER * numbers as f64)) as u64;
    let (mut best, mut fits) = (None::<CompressedModel>, Vec::new());
    for _ in 0..FITS {
        let options = Options { target: Target::Size(size.max(1)), ..options.clone() };
        let planned = Compression::of_positions(particles, fields.omitted(), &options, context);
        let mut done = match planned.and_then(|planned| planned.fit(&mut NoCheckpoints, context)) {
            // Less than the positions alone need: the best so far stands.
            Err(Error::Unreachable { .. }) => break,
            done => done?,
        };
        done.notes.splice(0..0, fields.notes().iter().cloned());
        let filled = done.bytes.len() as f64 > FILLED * size as f64;
        let done = fields.add_to_model(done, context)?;
        let whole = done.bytes.len() as u64;
        context.message(&format!("{size} bytes for positions and masses: {whole} bytes with fields"));
        fits.push([size as f64, whole as f64]);
        if whole <= total {
            // A fit that does not fill its size would make nothing of a larger one.
            let enough = whole as f64 >= FILLED * total as f64 || !filled;
            best = best.filter(|b| b.bytes.len() as u64 > whole).or(Some(done));
            if enough {
                break;
            }
        }
        size = next_size(&fits, total as f64);
    }
    best.ok_or_else(|| {
        let message = format!("no file of at most {total} bytes stores these positions and fields");
        Error::unreachable(message, "use a larger size, or fewer fields")
    })
}

/// The size to try, by sizes and whole sizes so far: on the line between the largest that was small enough and the
/// smallest that was not; else through the last two.
fn next_size(fits: &[[f64; 2]], total: f64) -> u64 {
    let aim = AIM * total;
    let low = fits.iter().filter(|f| f[1] <= total).max_by(|a, b| a[0].total_cmp(&b[0]));
    let high = fits.iter().filter(|f| f[1] > total).min_by(|a, b| a[0].total_cmp(&b[0]));
    let last = fits[fits.len() - 1];
    let [a, b] = match (low, high) {
        (Some(low), Some(high)) => [*low, *high],
        _ => [last, fits.iter().rev().nth(1).copied().unwrap_or([0.0; 2])],
    };
    // No file grows by less than its positions do.
    let slope = ((b[1] - a[1]) / (b[0] - a[0])).max(1.0);
    // A line through two sizes that are close together may point anywhere, so the step is bounded.
    (a[0] + (aim - a[1]) / slope).clamp(0.3 * last[0], 3.0 * last[0]) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_found_where_fields_grow_unevenly() {
        // Many Gaussians at first, then only finer numbers.
        let whole = |size: f64| size + 3.0 * size.min(20_000.0) + 0.3 * (size - 20_000.0).max(0.0).sqrt();
        for total in [5e3, 2e4, 7e4, 9e4, 2e5] {
            let mut fits = vec![[0.4 * total, whole(0.4 * total)]];
            while fits.len() < FITS && !(FILLED * total..=total).contains(&fits[fits.len() - 1][1]) {
                let next = next_size(&fits, total) as f64;
                fits.push([next, whole(next)]);
            }
            assert!((FILLED * total..=total).contains(&fits[fits.len() - 1][1]), "{total}: {fits:?}");
        }
    }
}
