//! From particles to a measured file, in one process.

use super::block::{BlockJob, CodedBlock, Outcome, StopMeans, TrainedRun, Workshop};
use super::clock::Clock;
use super::plan::Plan;
use super::target::Target;
use super::{describe, search};
use crate::blocks::divide;
use crate::codec;
use crate::fit::{self, Effort, Pieces, Under};
use crate::memory::require;
use crate::model::{Certificate, LawKind, Model};
use crate::particles::{Bounds, Particles, Room, check_particles, source_hash};
use crate::progress::Progress;
use crate::train::{Config, Limits};
use crate::{Error, Result, output, score};

/// What `compress` is asked to do.
#[derive(Clone, Debug)]
pub struct Options {
    /// Size, ratio, number or quality.
    pub target: Target,
    /// Time for quality.
    pub effort: Effort,
    /// Default particle radius to store, world units (`None` = 0.0406 of the mean spacing).
    pub radius: Option<f64>,
    /// Default opacity to store (`None` = 0.05).
    pub opacity: Option<f64>,
    /// Blocks that are fitted on their own, 1 or more.
    pub blocks: u32,
    /// Where blocks are put while they wait.
    pub room: Room,
    /// How the fit is trained further; `None` = not.
    pub training: Option<Config>,
    /// How far training goes.
    pub limits: Limits,
    /// Memory to stay within, bytes, as far as it is not decided by the number of blocks.
    pub memory: Option<u64>,
    /// Seed of the fit and the views.
    pub seed: u64,
    /// Measure the decoded model and store what was found?
    pub certificate: bool,
    /// The command as stored in the file: what decides its bytes, without paths, threads and the
    /// number of blocks, which is added.
    pub command: String,
}

impl Options {
    /// How Gaussians become pictures.
    pub fn law(&self) -> LawKind {
        self.training.as_ref().map_or(LawKind::OpticalDepth, |t| t.law)
    }

    /// 32 bytes that name the work: what decides the model's bytes. A checkpoint of other work is of no use.
    pub fn name_of_work(&self, particles: &Particles) -> [u8; 32] {
        let training = serde_json::to_string(&self.training).unwrap_or_default();
        let text = format!("{} blocks {} {training}", self.command, self.blocks);
        let mut hash = blake3::Hasher::new();
        hash.update(text.as_bytes()).update(&source_hash(particles));
        *hash.finalize().as_bytes()
    }
}

/// The first half of a text's BLAKE3, as digits: names a configuration in a command.
pub fn name_of(text: &str) -> String {
    blake3::hash(text.as_bytes()).to_hex()[..16].to_string()
}

/// A file and how it came to be.
pub struct Compressed {
    /// The file, whole.
    pub bytes: Vec<u8>,
    /// The file decoded again.
    pub model: Model,
    /// Bytes of the particles as float32.
    pub raw_bytes: u64,
    /// Multiple of the nominal quantisation steps.
    pub step_factor: f64,
    /// How each training run went: one for a layer of a block.
    pub trained: Vec<TrainedRun>,
    /// Was training stopped, and this is the best so far?
    pub stopped: bool,
    /// Wall-clock seconds by phase, in order.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Compresses a snapshot; `pieces` keeps what an interrupted run can go on from.
///
/// # Errors
/// [`crate::Error::Unreachable`] where an explicit ratio or size is below the smallest file (which it
/// names), or a quality above what all particles as Gaussians reach; [`crate::Error::Memory`] before the
/// fit where it would not fit; [`crate::Error::Input`] for no particles and a box that does not hold
/// them; [`crate::Error::Cancelled`].
pub fn compress(
    particles: &Particles,
    options: &Options,
    pieces: &mut dyn Pieces,
    progress: &dyn Progress,
) -> Result<Compressed> {
    let mut job = Job::begin(particles, options, pieces, progress)?;
    let coded = match job.plan.target {
        Target::Psnr(decibels) => search::reach_quality(&mut job, decibels)?,
        _ => job.each(Plan::block)?,
    };
    let outcomes: Vec<Outcome> = coded.blocks.iter().map(|b| b.outcome).collect();
    job.plan.judge(&outcomes, coded.len() as u64, progress)?;
    job.finish(coded)
}

/// The snapshot in its blocks, what is known about it, and the clock.
pub(super) struct Job<'a> {
    pub particles: &'a Particles,
    pub progress: &'a dyn Progress,
    pub plan: Plan,
    blocks: Vec<BlockJob>,
    memory: Option<u64>,
    limits: &'a Limits,
    pieces: &'a mut dyn Pieces,
    trained: Vec<TrainedRun>,
    stopped: bool,
    clock: Clock,
}

/// The coded blocks of a job, in its order.
pub(super) struct Coded {
    pub blocks: Vec<CodedBlock>,
}

impl Coded {
    /// Bytes of the blocks.
    pub fn len(&self) -> usize {
        self.blocks.iter().map(CodedBlock::size).sum()
    }
}

impl<'a> Job<'a> {
    fn begin(
        particles: &'a Particles,
        options: &'a Options,
        pieces: &'a mut dyn Pieces,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        if particles.is_empty() {
            return Err(Error::input(&particles.meta.name, "no particles"));
        }
        let mut clock = Clock::default();
        require("the fit", fit::memory_needed(particles) / u64::from(options.blocks.max(1)))?;
        if let (Room::Disk(folder), true) = (&options.room, options.blocks > 1) {
            output::check_space_in(folder, particles.raw_bytes())?;
        }
        progress.begin("bounds, hash and blocks", particles.len() as u64);
        let parts = clock.time("divide", || divide(particles, options.blocks, &options.room, progress))?;
        let blocks: Vec<BlockJob> =
            clock.time("read", || parts.iter().map(|p| BlockJob::of(p, options.law())).collect());
        let bounds = blocks.iter().flat_map(|b| &b.layers).fold(Bounds::empty(), |all, l| all.union(&l.bounds));
        check_particles(particles, &bounds, progress)?;
        let hash = clock.time("read", || source_hash(particles));
        progress.end();
        progress.check()?;
        let metadata = describe(&particles.meta, particles.len() as u64, bounds, hash, options);
        let layers = particles.layers().iter().map(|l| l.with(l.content.len() as u64)).collect();
        let plan = Plan::new(options, metadata, layers)?;
        plan.announce(progress);
        let (memory, limits) = (options.memory, &options.limits);
        Ok(Job {
            particles,
            progress,
            plan,
            blocks,
            memory,
            limits,
            pieces,
            trained: Vec::new(),
            stopped: false,
            clock,
        })
    }

    /// `number` Gaussians at the nominal precision, shared among the blocks by their particles.
    pub fn at_number(&mut self, number: u64) -> Result<Coded> {
        self.each(|plan, block, shop| plan.block_at_number(block, number, shop))
    }

    /// Does each block in turn; a fit itself uses all threads.
    fn each(
        &mut self,
        mut work: impl FnMut(&Plan, &BlockJob, &mut Workshop<'_>) -> Result<CodedBlock>,
    ) -> Result<Coded> {
        let mut blocks = Vec::with_capacity(self.blocks.len());
        for (number, block) in self.blocks.iter().enumerate() {
            let mut pieces = Under { pieces: &mut *self.pieces, prefix: number.to_string() };
            let tools = (self.progress, &mut self.clock, &mut pieces as &mut dyn Pieces);
            let left = self.blocks.len() - number;
            let mut limits = self.limits.share(left);
            if self.blocks.len() > 1 {
                limits.run = format!("block {number}");
            }
            // A file wants every block: only the last one's training can be left early.
            let stop_means = if left > 1 { StopMeans::GivingUp } else { StopMeans::TheBestSoFar };
            let mut shop = Workshop::new(&self.plan, &limits, stop_means, tools);
            shop.stopped = self.stopped;
            blocks.push(work(&self.plan, block, &mut shop)?);
            self.stopped = shop.stopped;
            self.trained.append(&mut shop.trained);
        }
        Ok(Coded { blocks })
    }

    /// The file of coded blocks.
    pub fn file(&self, coded: &Coded, certificate: Option<&Certificate>) -> Result<Vec<u8>> {
        let network = coded.blocks.first().and_then(|b| b.vizmapper.as_ref());
        self.plan.file(coded.blocks.iter().flat_map(|b| &b.layers), network, certificate)
    }

    /// Decodes the file and, where asked for, measures the decoded model.
    fn finish(mut self, coded: Coded) -> Result<Compressed> {
        // Their particles are not needed any more; in memory they may be half of all there is.
        self.blocks.clear();
        let mut bytes = self.file(&coded, None)?;
        let mut model = self.clock.time("decode", || codec::decode(&bytes, "the file just coded"))?;
        if self.plan.certificate && !self.stopped {
            let (seed, progress) = (self.plan.seed, self.progress);
            // The model and what is drawn of it take the rest.
            let pictures = self.memory.map(|m| m / 5);
            let certificate = self
                .clock
                .time("certificate", || score::certificate(&model, self.particles, seed, pictures, progress))?;
            bytes = self.file(&coded, Some(&certificate))?;
            // What is told is what the file holds, rounded as it is there.
            model.certificate = codec::read_info(&bytes, "the file just coded")?.certificate;
        }
        let factors = coded.blocks.iter().map(|b| b.outcome.step_factor);
        let step_factor = factors.sum::<f64>() / coded.blocks.len().max(1) as f64;
        let (raw_bytes, seconds) = (self.plan.raw_bytes(), self.clock.seconds());
        let (trained, stopped) = (self.trained, self.stopped);
        Ok(Compressed { bytes, model, raw_bytes, step_factor, trained, stopped, seconds })
    }
}
