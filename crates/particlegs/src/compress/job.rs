//! From particles to a measured file.

use super::block::{BlockJob, CodedBlock, Fitting, Workshop};
use super::clock::Clock;
use super::target::Target;
use super::{describe, search};
use crate::blocks::divide;
use crate::camera::{ORBITS, base_distance, spherical_camera};
use crate::codec::{self, CodedLayer, LayerHead};
use crate::fit::{self, Effort};
use crate::memory::require;
use crate::model::{Metadata, Model};
use crate::particles::{Bounds, Particles};
use crate::picture::Size;
use crate::progress::Progress;
use crate::score;
use crate::{Error, Result};

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
    /// Seed of the fit and the views.
    pub seed: u64,
    /// Measure the decoded model and store what was found?
    pub certificate: bool,
    /// The command as stored in the file: what decides its bytes, without paths and threads.
    pub command: String,
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
    /// Wall-clock seconds by phase, in order.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Compresses a snapshot.
///
/// # Errors
/// [`Error::Unreachable`] where an explicit ratio or size is below the smallest file (which it
/// names), or a quality above what all particles as Gaussians reach; [`Error::Memory`] before the
/// fit where it would not fit; [`Error::Cancelled`].
pub fn compress(particles: &Particles, options: &Options, progress: &dyn Progress) -> Result<Compressed> {
    options.target.check()?;
    let mut job = Job::begin(particles, options, progress)?;
    let coded = match options.target {
        Target::Gaussians(k) => job.at_number(k)?,
        Target::Psnr(decibels) => search::reach_quality(&mut job, decibels)?,
        Target::Default | Target::Ratio(_) | Target::Size(_) => {
            let target = options.target.bytes(job.raw_bytes).unwrap_or(0);
            job.at_size(target)?
        }
    };
    job.finish(coded)
}

/// The snapshot, what is known about it, and the clock.
pub(super) struct Job<'a> {
    pub particles: &'a Particles,
    pub options: &'a Options,
    pub progress: &'a dyn Progress,
    pub metadata: Metadata,
    pub raw_bytes: u64,
    blocks: Vec<BlockJob>,
    /// Bytes of the file beside its coded blocks.
    pub overhead: u64,
    clock: Clock,
}

/// The coded blocks of a job, in its order.
pub(super) struct Coded {
    pub blocks: Vec<CodedBlock>,
}

impl Coded {
    /// Bytes of the blocks.
    pub fn len(&self) -> usize {
        self.blocks.iter().map(CodedBlock::len).sum()
    }
}

impl<'a> Job<'a> {
    fn begin(particles: &'a Particles, options: &'a Options, progress: &'a dyn Progress) -> Result<Self> {
        let mut clock = Clock::default();
        let count = particles.len() as u64;
        let divided = if options.blocks > 1 { particles.raw_bytes() } else { 0 };
        require("the fit", divided + fit::memory_needed(particles) / u64::from(options.blocks.max(1)))?;
        progress.begin("bounds, hash and blocks", count);
        let parts = clock.time("divide", || divide(particles, options.blocks, progress))?;
        let blocks: Vec<BlockJob> = clock.time("read", || parts.iter().map(BlockJob::of).collect());
        let layers = || blocks.iter().flat_map(|b| &b.layers);
        let bounds = layers().fold(Bounds::empty(), |all, l| all.union(&l.bounds));
        let mass = layers().map(|l| l.mass).sum();
        let metadata = clock.time("read", || {
            describe(particles, bounds, mass, options.radius, options.opacity, options.command.clone())
        });
        progress.end();
        progress.check()?;
        let overhead = codec::size_without_blocks(&metadata, options.certificate, &heads(&blocks)) as u64;
        Ok(Job { particles, options, progress, metadata, raw_bytes: particles.raw_bytes(), blocks, overhead, clock })
    }

    /// `number` Gaussians at the nominal precision, shared among the blocks by their particles.
    pub fn at_number(&mut self, number: u64) -> Result<Coded> {
        let all = self.metadata.count;
        self.each(|block, shop| {
            let share = (number as f64 * (block.count as f64 / all as f64)).round() as u64;
            block.at_number(share.max(1), shop)
        })
    }

    /// The best file of at most `target` bytes, every block at the same ratio.
    fn at_size(&mut self, target: u64) -> Result<Coded> {
        let (room, all) = (target.saturating_sub(self.overhead), self.raw_bytes);
        let coded =
            self.each(|block, shop| block.at_size((room as f64 * (block.raw_bytes as f64 / all as f64)) as u64, shop))?;
        let bytes = coded.len() as u64 + self.overhead;
        if coded.blocks.iter().any(|b| b.too_large) {
            self.refuse_or_warn(target, bytes)?;
        } else if coded.blocks.iter().all(|b| b.too_small) {
            self.progress.message(&format!(
                "note: the file has {bytes} bytes, fewer than the {target} asked for: these particles need no more"
            ));
        }
        Ok(coded)
    }

    /// Does each block in turn; a fit itself uses all threads.
    fn each(&mut self, mut work: impl FnMut(&BlockJob, &mut Workshop<'_>) -> Result<CodedBlock>) -> Result<Coded> {
        let fitting = Fitting {
            effort: self.options.effort,
            radius: self.metadata.default_radius,
            pixel: near_pixel(&self.metadata.bounds),
            seed: self.options.seed,
        };
        let mut shop = Workshop { fitting, progress: self.progress, clock: &mut self.clock };
        Ok(Coded { blocks: self.blocks.iter().map(|b| work(b, &mut shop)).collect::<Result<_>>()? })
    }

    /// Header and one Gaussian do not fit: a warning by default, an error where it was asked for.
    fn refuse_or_warn(&self, target: u64, smallest: u64) -> Result<()> {
        let what = format!("{target} bytes were asked for; the smallest file of this snapshot has {smallest} bytes");
        if self.options.target == Target::Default {
            self.progress.message(&format!("warning: {what}"));
            return Ok(());
        }
        let ratio = self.raw_bytes as f64 / smallest as f64;
        let hint = format!("ask for `--size {smallest}B` or more, or for a ratio of {ratio:.4} or less");
        Err(Error::Unreachable { what, hint })
    }

    /// The file of coded blocks.
    pub fn file(&self, coded: &Coded, certificate: Option<&crate::model::Certificate>) -> Result<Vec<u8>> {
        let mut layers: Vec<CodedLayer> = Vec::new();
        for (job, coded) in self.blocks.iter().zip(&coded.blocks) {
            for (layer, block) in job.layers.iter().zip(&coded.layers) {
                match layers.iter_mut().find(|l| l.name == layer.name) {
                    Some(l) => l.blocks.push(block.clone()),
                    None => layers.push(CodedLayer {
                        name: layer.name.clone(),
                        particle_mass: layer.particle_mass,
                        blocks: vec![block.clone()],
                    }),
                }
            }
        }
        codec::assemble(&self.metadata, certificate, layers)
    }

    /// Decodes the file and, where asked for, measures the decoded model.
    fn finish(mut self, coded: Coded) -> Result<Compressed> {
        let mut bytes = self.file(&coded, None)?;
        let mut model = self.clock.time("decode", || codec::decode(&bytes, "the file just coded"))?;
        if self.options.certificate {
            let (seed, progress) = (self.options.seed, self.progress);
            let certificate =
                self.clock.time("certificate", || score::certificate(&model, self.particles, seed, progress))?;
            bytes = self.file(&coded, Some(&certificate))?;
            model.certificate = Some(certificate);
        }
        let factors = coded.blocks.iter().map(|b| b.factor);
        let step_factor = factors.sum::<f64>() / coded.blocks.len().max(1) as f64;
        Ok(Compressed { bytes, model, raw_bytes: self.raw_bytes, step_factor, seconds: self.clock.seconds() })
    }
}

/// The file's layers without their blocks.
fn heads(blocks: &[BlockJob]) -> Vec<LayerHead<'_>> {
    let mut heads: Vec<LayerHead<'_>> = Vec::new();
    for layer in blocks.iter().flat_map(|b| &b.layers) {
        match heads.iter_mut().find(|h| h.name == layer.name) {
            Some(head) => head.blocks += 1,
            None => heads.push(LayerHead {
                name: &layer.name,
                particle_mass: layer.particle_mass,
                weighted: layer.particles.weights.is_some(),
                blocks: 1,
            }),
        }
    }
    heads
}

/// A pixel at the focal point of the near orbit, 1080 pixels high, world units. (The far orbit's
/// gains twice as much at few Gaussians, and loses 0.5 dB near where there are many.)
pub(super) fn near_pixel(bounds: &Bounds) -> f64 {
    const SIZE: Size = Size { width: 1920, height: 1080 };
    let distance = ORBITS[2].factor * base_distance(bounds, SIZE);
    distance / spherical_camera(bounds.center(), 0.0, 0.0, distance).focal_pixels(SIZE)
}
