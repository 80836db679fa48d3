//! One layer of a block: fitted, trained where the job is to, and coded.

use super::clock::Clock;
use super::held_power::{BlockCoding, hold_power, room};
use super::plan::{BlockSetup, StopPolicy};
use super::size::{CodedGaussians, SizeTarget, bytes_a_gaussian, most_gaussians};
use super::thickness::Thickness;
use particlegs_core::checkpoint::{CheckpointStore, PrefixedCheckpoints};
use particlegs_core::codec::{Encoder, decode_block};
use particlegs_core::model::{Block, LawKind, Layer, Mixture, VizMapper};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};
use particlegs_fit::{Effort, FitOptions, Fitter};
use particlegs_particles::{Domain, Particles};
use particlegs_reference::Reference;
use particlegs_train::{Config, Defaults, InitialGaussians, Limits, Start, TrainedMixture, TrainedRun, Training};
use std::ops::Range;

/// The particles of one layer of a block.
#[derive(Clone)]
pub(crate) struct LayerParticles {
    pub layer: Layer<Particles>,
    pub bounds: Bounds,
    /// Sum of the weights, or the count.
    pub mass: f64,
    pub raw_bytes: u64,
}

impl LayerParticles {
    /// A layer of some particles, and its bounds.
    pub fn new(particles: &Particles, layer: &Layer<Range<usize>>, bounds: Bounds) -> Self {
        let content = particles.of_layer(layer);
        let (mass, raw_bytes) = (content.total_mass(), content.raw_bytes());
        LayerParticles { bounds, mass, raw_bytes, layer: layer.with(content) }
    }

    pub fn particles(&self) -> &Particles {
        &self.layer.content
    }

    pub fn count(&self) -> u64 {
        self.particles().len() as u64
    }
}

/// The size that a layer is coded to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Share {
    /// At most so many bytes.
    Bytes(u64),
    /// So many Gaussians, at the nominal steps.
    Gaussians(u64),
}

/// A layer that is coded, and how that went.
pub(super) struct LayerResult {
    pub coded: CodedGaussians,
    pub vizmapper: Option<VizMapper>,
    pub trained: Option<TrainedRun>,
    /// Training was stopped, and its best state so far is coded.
    pub stopped: bool,
    pub clock: Clock,
}

/// Gaussians before they are coded.
#[derive(Default)]
struct LayerFit {
    mixture: Mixture,
    /// The precision to code them at, where it matters.
    step_factor: Option<f64>,
    trained: Option<TrainedRun>,
    stopped: bool,
    clock: Clock,
}

/// Number and bytes of Gaussians that are to be made.
#[derive(Clone, Copy)]
struct GaussianGoal {
    /// Their number at most.
    gaussians: u64,
    /// Their bytes once they are coded, where known.
    bytes: Option<u64>,
}

/// The bytes that Gaussians are coded to.
#[derive(Clone, Copy, Default)]
struct CodingGoal {
    /// At most; `None` at the nominal steps.
    bytes: Option<u64>,
    /// The precision to code them at, where it matters.
    step_factor: Option<f64>,
    /// The caller has stopped the work already.
    stopped: bool,
}

pub(super) struct LayerTask<'a> {
    pub layer: &'a LayerParticles,
    pub setup: BlockSetup<'a>,
    /// Training runs of the block from this layer's on.
    pub runs_left: usize,
}

impl LayerTask<'_> {
    /// Makes it.
    pub fn make(&self, share: Share, checkpoints: &mut dyn CheckpointStore) -> Result<LayerResult> {
        match share {
            Share::Gaussians(gaussians) => {
                self.code(self.gaussians(GaussianGoal { gaussians, bytes: None }, checkpoints)?, None)
            }
            Share::Bytes(bytes) => self.to_size(bytes, checkpoints),
        }
    }

    /// A number of Gaussians whose steps are near nominal, and the steps that just fit `bytes`.
    fn to_size(&self, bytes: u64, checkpoints: &mut dyn CheckpointStore) -> Result<LayerResult> {
        let plan = self.setup.plan;
        let each = bytes_a_gaussian(plan.recipe().effort);
        let target = SizeTarget { bytes, bytes_a_gaussian: each, most: most_gaussians(self.layer.count()) };
        let training = plan.training.as_ref();
        if training.is_some_and(|t| t.start == Start::Random || t.law == LawKind::AlphaBlend) {
            // Nothing is known of what a trained Gaussian costs before it is trained.
            let goal = GaussianGoal { gaussians: target.number(each), bytes: Some(bytes) };
            let fitted = self.gaussians(goal, checkpoints)?;
            return self.code(fitted, Some(bytes));
        }
        let (mut clock, mut fitter) = (Clock::default(), Fitter::new(self.layer.particles()));
        let (coded, mixture) = target.find(|number| {
            let mixture = clock.time("fit", || self.fit(number, &mut fitter, checkpoints))?;
            let mixture_copy = training.is_some().then(|| mixture.clone());
            let goal = CodingGoal { bytes: Some(bytes), ..CodingGoal::default() };
            Ok((clock.time("code", || self.coded(mixture, goal))?, mixture_copy))
        })?;
        // It holds a copy of the particles, which training does not need.
        drop(fitter);
        let (Some(config), Some(mixture)) = (training, mixture) else {
            return Ok(LayerResult { coded, vizmapper: None, trained: None, stopped: false, clock });
        };
        let goal = GaussianGoal { gaussians: mixture.len() as u64, bytes: Some(bytes) };
        let trained = self.train(config, InitialGaussians::Fit(&mixture), goal, checkpoints)?;
        clock.append(trained.clock);
        self.code(LayerFit { clock, ..trained }, Some(bytes))
    }

    /// Gaussians that are fitted and, where the job is to, trained.
    fn gaussians(&self, goal: GaussianGoal, checkpoints: &mut dyn CheckpointStore) -> Result<LayerFit> {
        let mut clock = Clock::default();
        let mut fit = |checkpoints: &mut dyn CheckpointStore| {
            clock.time("fit", || self.fit(goal.gaussians, &mut Fitter::new(self.layer.particles()), checkpoints))
        };
        let Some(config) = &self.setup.plan.training else {
            let mixture = fit(checkpoints)?;
            return Ok(LayerFit { mixture, clock, ..LayerFit::default() });
        };
        let trained = if config.start == Start::Random {
            let first = config.start_gaussians.unwrap_or(goal.gaussians).min(goal.gaussians);
            self.train(config, InitialGaussians::Particles(first as usize), goal, checkpoints)?
        } else {
            let mixture = fit(checkpoints)?;
            self.train(config, InitialGaussians::Fit(&mixture), goal, checkpoints)?
        };
        clock.append(trained.clock);
        Ok(LayerFit { clock, ..trained })
    }

    /// Fits `number` Gaussians, fewer where the particles do not carry so many.
    fn fit(&self, number: u64, fitter: &mut Fitter<'_>, checkpoints: &mut dyn CheckpointStore) -> Result<Mixture> {
        let (plan, count) = (self.setup.plan, self.layer.count());
        let partition = plan.training.as_ref().is_some_and(|t| t.start == Start::Partition);
        let gaussians = usize::try_from(number.min(count)).unwrap_or(usize::MAX);
        let options = FitOptions {
            gaussians,
            // Training does the refinement itself, so the fit spends little on it.
            effort: if partition { Effort::Fast } else { plan.recipe().effort },
            radius: plan.metadata.default_radius,
            pixel: plan.pixel(),
            seed: plan.recipe().seed,
            share: count as f64 / plan.particles().max(1) as f64,
        };
        let prefix = format!("{}/{gaussians}", self.layer.layer.name);
        let mut checkpoints = PrefixedCheckpoints { pieces: checkpoints, prefix };
        fitter.fit(&options, &mut checkpoints, self.setup.context)
    }

    fn train(
        &self,
        config: &Config,
        from: InitialGaussians<'_>,
        goal: GaussianGoal,
        checkpoints: &mut dyn CheckpointStore,
    ) -> Result<LayerFit> {
        let (layer, plan) = (self.layer, self.setup.plan);
        let m = &plan.metadata;
        let defaults = Defaults {
            bounds: layer.bounds,
            radius: m.default_radius,
            opacity: m.default_opacity,
            seed: plan.recipe().seed,
            bytes: goal.bytes,
            gaussians: Some(goal.gaussians),
        };
        let limits = self.limits();
        // A search for a quality trains more than one number.
        let prefix = format!("{}/trained/{}", layer.layer.name, from.len());
        let mut checkpoints = PrefixedCheckpoints { pieces: checkpoints, prefix };
        let mut clock = Clock::default();
        let trained = clock.time("train", || {
            let subject = Reference::with_bounds(layer.particles(), layer.bounds);
            let training = Training { subject: &subject, config, limits: &limits, defaults: &defaults };
            training.run(from, &mut checkpoints, self.setup.context)
        })?;
        if trained.stopped && (self.setup.on_stop == StopPolicy::GiveUp || self.runs_left > 1) {
            return Err(Error::Cancelled);
        }
        let run = TrainedRun::new(limits.run, config, &trained);
        let TrainedMixture { mixture, factor: step_factor, stopped, .. } = trained;
        Ok(LayerFit { mixture, step_factor, trained: Some(run), stopped, clock })
    }

    /// The limits of the layer's training run: its share of the time that is left.
    fn limits(&self) -> Limits {
        let mut limits = self.setup.limits.share(self.runs_left);
        if self.setup.plan.layers.len() > 1 {
            let between = if limits.run.is_empty() { "" } else { ", " };
            limits.run = format!("{}{between}{}", limits.run, self.layer.layer.name);
        }
        limits
    }

    fn encoder(&self, gaussians: Mixture) -> Result<Encoder> {
        let (bounds, mass) = (self.layer.bounds, self.layer.mass);
        Encoder::new(&Block { bounds, count: self.layer.count(), mass, gaussians })
    }

    /// Codes Gaussians. In a flat box those that are not trained get the particles' thickness.
    fn coded(&self, mut gaussians: Mixture, goal: CodingGoal) -> Result<CodedGaussians> {
        let thickness = || Thickness::new(self.layer.particles(), &self.layer.bounds);
        let untrained = self.setup.plan.training.is_none();
        let Some(thickness) = untrained.then(thickness).flatten() else {
            return self.coded_as_they_are(gaussians, goal);
        };
        // Coding changes how wide thin Gaussians are, so each trial corrects by what the decoded ones show.
        for _ in 1..Thickness::TRIALS {
            let coded = self.coded_as_they_are(gaussians.clone(), goal)?;
            let factor = thickness.factor(&[&decode_block(&coded.bytes, "a block")?.gaussians]);
            if (factor - 1.0).abs() < 0.01 {
                return Ok(coded);
            }
            gaussians.stretch(thickness.axis, factor);
        }
        self.coded_as_they_are(gaussians, goal)
    }

    /// Codes Gaussians; with the power of the particles where they are the whole, not trained, and time is not short.
    fn coded_as_they_are(&self, gaussians: Mixture, goal: CodingGoal) -> Result<CodedGaussians> {
        let (plan, context) = (self.setup.plan, self.setup.context);
        let mut encoder = self.encoder(gaussians)?;
        let recipe = plan.recipe();
        let holds_power = recipe.effort != Effort::Fast && recipe.blocks <= 1 && plan.training.is_none();
        let mut coded = match goal.bytes {
            Some(bytes) => {
                let size = if holds_power { bytes - room(bytes) } else { bytes };
                // What was stopped is coded all the same.
                let check = || if goal.stopped { Ok(()) } else { context.check() };
                CodedGaussians::to_size(&encoder, size, goal.step_factor, check)?
            }
            None => CodedGaussians::at_nominal_steps(&encoder),
        };
        if holds_power {
            let most = goal.bytes.map_or(u64::MAX, |bytes| bytes.saturating_sub(encoder.stage_bytes() as u64));
            context.begin("power spectrum", 0);
            let domain = Domain::new(&plan.metadata.bounds, plan.metadata.cell.as_ref());
            let mut coding = BlockCoding::new(&mut encoder, &coded);
            if let Some(bytes) = hold_power(&mut coding, (self.layer.particles(), &domain), most, context)? {
                coded.bytes = bytes;
            }
            context.end();
        }
        Ok(coded)
    }

    /// Codes Gaussians to a size, or at the nominal steps.
    fn code(&self, fitted: LayerFit, bytes: Option<u64>) -> Result<LayerResult> {
        let LayerFit { mixture, step_factor, trained, stopped, mut clock } = fitted;
        let vizmapper = network_of(&mixture);
        let goal = CodingGoal { bytes, step_factor, stopped };
        let coded = clock.time("code", || self.coded(mixture, goal))?;
        Ok(LayerResult { coded, vizmapper, trained, stopped, clock })
    }
}

fn network_of(gaussians: &Mixture) -> Option<VizMapper> {
    Some(VizMapper::clone(gaussians.law.alpha_blend()?.vizmapper.as_ref()?))
}
