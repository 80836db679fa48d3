//! One block of the job: a part of the particles, in its layers, fitted and coded on its own.
//!
//! What a block becomes depends on its particles, the options and its share of the target alone:
//! not on other blocks, nor on where it is done.

use super::clock::Clock;
use super::plan::Plan;
use super::rate::{Met, meet_size};
use crate::codec::{CodedLayer, Encoder, Precision};
use crate::fit::{self, Effort, FitOptions, Pieces, Under};
use crate::model::{Block, LawKind, Layer, Mass, Mixture, VizMapper};
use crate::particles::{Bounds, Particles};
use crate::progress::Progress;
use crate::reference::Reference;
use crate::train::{self, Config, Initial, Limits, Start, Trained, Training};
use crate::{Error, Result};
use std::ops::Range;

/// Bytes a Gaussian that lose least at a given size (docs/results/nbody128.md): cells of a partition
/// are rounder and take fewer.
pub fn bytes_a_gaussian(effort: Effort) -> f64 {
    if effort == Effort::Fast { 3.4 } else { 4.1 }
}
/// Fits tried at most to find a number of Gaussians whose steps are near nominal.
const FITS: usize = 3;
/// Step factors between these cost less than a refit gains.
pub const NEAR_NOMINAL: std::ops::Range<f64> = 0.75..1.4;

/// How blocks are fitted: the same for all of a job.
#[derive(Clone, Copy, Debug)]
pub struct Fitting {
    /// Time for quality.
    pub effort: Effort,
    /// Particles of all blocks and layers: they share the effort's bound on time.
    pub particles: u64,
    /// The file's default particle radius, world units.
    pub radius: f64,
    /// Pixels whose blur decides splits, world units.
    pub pixel: f64,
    /// The file's default opacity.
    pub opacity: f64,
    /// Seed of the fit.
    pub seed: u64,
}

/// A block to be made.
pub struct BlockJob {
    /// Layers, the smallest first: what they leave of their room goes to the larger.
    pub layers: Vec<LayerJob>,
    /// Particles.
    pub count: u64,
    /// Their bytes as float32.
    pub raw_bytes: u64,
}

/// One layer of a block: one coded block of the file.
pub struct LayerJob {
    /// Its particles.
    pub layer: Layer<Particles>,
    /// Their bounds.
    pub bounds: Bounds,
    /// Sum of the weights, or the count.
    mass: f64,
    raw_bytes: u64,
}

/// A block's layers coded, one block each, and how that went for the largest.
#[derive(Clone, Default)]
pub struct CodedBlock {
    /// Its layers.
    pub layers: Vec<CodedLayer>,
    /// The network of the alpha-blend law.
    pub vizmapper: Option<VizMapper>,
    /// How it meets its room.
    pub outcome: Outcome,
}

/// How a block meets its room.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Outcome {
    /// Multiple of the nominal steps.
    pub step_factor: f64,
    /// Is it too large at the coarsest steps?
    pub too_large: bool,
    /// Is it well below its room at the finest?
    pub too_small: bool,
}

impl CodedBlock {
    /// Bytes.
    pub fn size(&self) -> usize {
        self.layers.iter().flat_map(|l| &l.content).map(Vec::len).sum()
    }

    fn push(&mut self, layer: &LayerJob, bytes: Vec<u8>) {
        self.layers.push(layer.layer.with(vec![bytes]));
    }
}

/// What a stop of the caller's means to a training run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopMeans {
    /// The best so far is coded.
    TheBestSoFar,
    /// The work is given up, to be taken up again from its pieces.
    GivingUp,
}

/// What blocks are made with.
pub struct Workshop<'a> {
    fitting: Fitting,
    training: Option<&'a Config>,
    limits: &'a Limits,
    stop_means: StopMeans,
    /// Has the job several layers?
    layered: bool,
    /// Training runs of the block that are still to come.
    runs_left: usize,
    progress: &'a dyn Progress,
    clock: &'a mut Clock,
    pieces: &'a mut dyn Pieces,
    /// Was a training run stopped, and the best so far taken?
    pub stopped: bool,
    /// Training runs that were done.
    pub trained: Vec<TrainedRun>,
}

/// How a training run went.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TrainedRun {
    /// Block and layer, where there are several; else empty.
    pub run: String,
    /// Steps done.
    pub iterations: u64,
    /// Steps that the configuration wants.
    pub of: u64,
    /// Masked PSNR on held-out views before the first step and of the best, dB, not coded yet.
    pub scores: [Option<f64>; 2],
    /// Steps with gradients that were not finite, and left out.
    pub not_finite: u64,
}

impl TrainedRun {
    /// Of a run of that name under `config`.
    pub(super) fn of(run: String, config: &Config, trained: &Trained) -> Self {
        let Trained { iterations, scores, not_finite, .. } = *trained;
        TrainedRun { run, iterations, of: config.iterations(), scores, not_finite }
    }
}

impl<'a> Workshop<'a> {
    /// For blocks of `plan`; `pieces` keeps finished pieces of fits and training runs.
    pub fn new(
        plan: &'a Plan,
        limits: &'a Limits,
        stop_means: StopMeans,
        (progress, clock, pieces): (&'a dyn Progress, &'a mut Clock, &'a mut dyn Pieces),
    ) -> Self {
        let (fitting, training) = (plan.fitting(), plan.training.as_ref());
        let layered = plan.layers.len() > 1;
        Workshop {
            fitting,
            training,
            limits,
            stop_means,
            layered,
            runs_left: 1,
            progress,
            clock,
            pieces,
            stopped: false,
            trained: Vec::new(),
        }
    }

    /// The limits of the next training run of the block: its share of the time that is left.
    fn next_limits(&mut self, layer: &str) -> Limits {
        let mut limits = self.limits.share(self.runs_left);
        self.runs_left = self.runs_left.saturating_sub(1);
        if self.layered {
            let between = if limits.run.is_empty() { "" } else { ", " };
            limits.run = format!("{}{between}{layer}", limits.run);
        }
        limits
    }

    /// Cancelled, and not merely stopped?
    fn check(&self) -> Result<()> {
        if self.stopped { Ok(()) } else { self.progress.check() }
    }
}

impl BlockJob {
    /// The layers of some particles. Weights are not kept by a law whose Gaussians have opacities.
    pub fn of(particles: &Particles, law: LawKind) -> Self {
        let kept = |mass: Mass| if law == LawKind::OpticalDepth { mass } else { mass.without_weights() };
        let layer = |l: &Layer<Range<usize>>| LayerJob::of(particles, &Layer { mass: kept(l.mass), ..l.clone() });
        let mut layers: Vec<LayerJob> = particles.layers().iter().map(layer).collect();
        layers.sort_by(|a, b| (a.raw_bytes, &a.layer.name).cmp(&(b.raw_bytes, &b.layer.name)));
        let raw_bytes = layers.iter().map(|l| l.raw_bytes).sum();
        BlockJob { layers, count: particles.len() as u64, raw_bytes }
    }

    /// `number` Gaussians at the nominal precision, shared among the layers by their particles.
    pub fn at_number(&self, number: u64, shop: &mut Workshop<'_>) -> Result<CodedBlock> {
        shop.runs_left = self.layers.len();
        let (mut left, mut particles_left) = (number, self.count);
        let mut coded = CodedBlock::default();
        coded.outcome.step_factor = 1.0;
        for layer in &self.layers {
            let count = layer.layer.content.len() as u64;
            let share = ((left as f64 * count as f64 / particles_left as f64).round() as u64).clamp(1, count);
            (left, particles_left) = (left.saturating_sub(share), particles_left - count);
            let made = layer.made(share, None, shop)?;
            coded.vizmapper = network_of(&made.gaussians).or(coded.vizmapper);
            let encoder = layer.encoder(made.gaussians)?;
            coded.push(layer, shop.clock.time("code", || encoder.encode(&Precision::BALANCED)));
        }
        Ok(coded)
    }

    /// The best of at most `room` bytes, every layer at about the same ratio.
    pub fn at_size(&self, room: u64, shop: &mut Workshop<'_>) -> Result<CodedBlock> {
        shop.runs_left = self.layers.len();
        let (mut room, mut raw_left) = (room, self.raw_bytes);
        let mut coded = CodedBlock::default();
        for layer in &self.layers {
            let share = (room as f64 * (layer.raw_bytes as f64 / raw_left as f64)) as u64;
            let (met, vizmapper) = layer.at_size(share, shop)?;
            coded.vizmapper = vizmapper.or(coded.vizmapper);
            room = room.saturating_sub(met.bytes.len() as u64);
            raw_left -= layer.raw_bytes;
            let Met { bytes, factor: step_factor, too_large, too_small } = met;
            coded.outcome = Outcome { step_factor, too_large, too_small };
            coded.push(layer, bytes);
        }
        Ok(coded)
    }
}

impl LayerJob {
    fn of(particles: &Particles, layer: &Layer<Range<usize>>) -> Self {
        let particles = particles.of_layer(layer);
        LayerJob {
            bounds: particles.bounds(),
            mass: particles.total_mass(),
            raw_bytes: particles.raw_bytes(),
            layer: layer.with(particles),
        }
    }

    /// Fits `number` Gaussians (fewer where the particles do not carry so many), ready to be coded.
    fn fit(&self, number: u64, shop: &mut Workshop<'_>) -> Result<Mixture> {
        let count = self.layer.content.len() as u64;
        let Fitting { mut effort, particles, radius, pixel, seed, .. } = shop.fitting;
        if shop.training.is_some_and(|t| t.start == Start::Partition) {
            effort = Effort::Fast;
        }
        let gaussians = usize::try_from(number.min(count)).unwrap_or(usize::MAX);
        let share = count as f64 / particles.max(1) as f64;
        let options = FitOptions { gaussians, effort, radius, pixel, seed, share };
        let mut pieces = Under { pieces: shop.pieces, prefix: format!("{}/{gaussians}", self.layer.name) };
        shop.clock.time("fit", || fit::fit_in_pieces(&self.layer.content, &options, &mut pieces, shop.progress))
    }

    /// Gaussians ready to be coded.
    fn encoder(&self, gaussians: Mixture) -> Result<Encoder> {
        let count = self.layer.content.len() as u64;
        Encoder::new(&Block { bounds: self.bounds, count, mass: self.mass, gaussians })
    }

    /// Trains Gaussians on pictures of the layer.
    fn train(
        &self,
        config: &Config,
        from: Initial<'_>,
        bytes: Option<u64>,
        shop: &mut Workshop<'_>,
    ) -> Result<Trained> {
        let Fitting { radius, opacity, seed, .. } = shop.fitting;
        let defaults = train::Defaults { bounds: self.bounds, radius, opacity, seed, bytes };
        let limits = shop.next_limits(&self.layer.name);
        // A search for a quality trains more than one number.
        let mut pieces = Under { pieces: shop.pieces, prefix: format!("{}/trained/{}", self.layer.name, from.len()) };
        let trained = shop.clock.time("train", || {
            let subject = Reference::with_bounds(&self.layer.content, self.bounds);
            let training = Training { subject: &subject, config, limits: &limits, defaults: &defaults };
            training.run(from, &mut pieces, shop.progress)
        })?;
        if trained.stopped && (shop.stop_means == StopMeans::GivingUp || shop.runs_left > 0) {
            return Err(Error::Cancelled);
        }
        shop.stopped |= trained.stopped;
        shop.trained.push(TrainedRun::of(limits.run, config, &trained));
        Ok(trained)
    }

    /// At most `number` Gaussians, fitted and, where the job is to, trained.
    fn made(&self, number: u64, bytes: Option<u64>, shop: &mut Workshop<'_>) -> Result<Made> {
        let Some(config) = shop.training.filter(|_| !shop.stopped) else {
            return Ok(Made { gaussians: self.fit(number, shop)?, factor: None });
        };
        let mut config = config.clone();
        if config.alpha_blend.most_gaussians == 0 {
            config.alpha_blend.most_gaussians = number as usize;
        }
        let trained = if config.start == Start::Random {
            let most = if config.start_gaussians == 0 { number } else { config.start_gaussians };
            self.train(&config, Initial::Particles(most.min(number) as usize), bytes, shop)?
        } else {
            let gaussians = self.fit(number, shop)?;
            self.train(&config, Initial::Fit(&gaussians), bytes, shop)?
        };
        Ok(Made { gaussians: trained.mixture, factor: trained.factor })
    }

    /// A number of Gaussians whose steps are near nominal, and the steps that just fit `room`.
    fn at_size(&self, room: u64, shop: &mut Workshop<'_>) -> Result<(Met, Option<VizMapper>)> {
        let count = self.layer.content.len() as u64;
        let mut number = ((room as f64 / bytes_a_gaussian(shop.fitting.effort)) as u64).clamp(1, count);
        if shop.training.is_some_and(|t| t.start == Start::Random || t.law == LawKind::AlphaBlend) {
            // Nothing is known of what a trained Gaussian costs before it is trained.
            let made = self.made(number, Some(room), shop)?;
            let network = network_of(&made.gaussians);
            return Ok((self.coded(made.gaussians, made.factor, room, shop)?.outcome, network));
        }
        let mut met = self.met_with(number, room, shop)?;
        for _ in 1..FITS {
            let fine = !met.outcome.too_large && NEAR_NOMINAL.contains(&met.outcome.factor);
            // What a Gaussian costs at the nominal steps tells the right number.
            let better = ((room as f64 / met.nominal_bytes) as u64).clamp(1, count);
            if fine || better == number || met.found < number && better > met.found {
                break;
            }
            number = better;
            met = self.met_with(number, room, shop)?;
        }
        if met.outcome.too_large && number > 1 {
            met = self.met_with(1, room, shop)?;
        }
        if let (Some(config), Some(gaussians)) = (shop.training, met.fitted.take()) {
            let trained = self.train(config, Initial::Fit(&gaussians), Some(room), shop)?;
            met = self.coded(trained.mixture, trained.factor, room, shop)?;
        }
        Ok((met.outcome, None))
    }

    fn met_with(&self, number: u64, room: u64, shop: &mut Workshop<'_>) -> Result<MetWith> {
        let gaussians = self.fit(number, shop)?;
        self.coded(gaussians, None, room, shop)
    }

    /// Gaussians coded to a size, at the `wanted` precision where that fits.
    fn coded(&self, gaussians: Mixture, wanted: Option<f64>, room: u64, shop: &mut Workshop<'_>) -> Result<MetWith> {
        let fitted = shop.training.is_some().then(|| gaussians.clone());
        let encoder = self.encoder(gaussians)?;
        let start = std::time::Instant::now();
        let encode = |q| {
            shop.check()?;
            Ok(encoder.encode(&Precision::BALANCED.scaled(q)))
        };
        let (outcome, nominal) = meet_size(room, encoder.len(), wanted, encode)?;
        shop.clock.add("code", start.elapsed().as_secs_f64());
        let nominal_bytes = nominal as f64 / encoder.len() as f64;
        Ok(MetWith { outcome, found: encoder.len() as u64, nominal_bytes, fitted })
    }
}

/// The network that a mixture is drawn with.
fn network_of(gaussians: &Mixture) -> Option<VizMapper> {
    Some(VizMapper::clone(gaussians.law.alpha_blend()?.vizmapper.as_ref()?))
}

/// Gaussians, and the precision to code them at.
struct Made {
    gaussians: Mixture,
    /// The precision to code them at, where it matters.
    factor: Option<f64>,
}

/// A fit coded to a size.
struct MetWith {
    outcome: Met,
    /// Gaussians that the fit gave.
    found: u64,
    /// Bytes a Gaussian at the nominal steps.
    nominal_bytes: f64,
    /// What the fit gave, where it is to be trained.
    fitted: Option<Mixture>,
}
