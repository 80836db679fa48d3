//! A training run: stages of steps, evaluation on held-out views, checkpoints, a log.

use super::accelerator::{Accelerator, TrainingSubject};
use super::alpha::{AlphaConfig, AlphaLearner, TrainingScale};
use super::cameras::{Defaults, Views};
use super::config::{Config, Stage};
use super::depth::{DepthContext, DepthCpuSteps, DepthLearner};
use super::journal::{Journal, RunStatus};
use super::learner::{Crop, Learner, StepInfo, TrainingSample};
use super::state::TrainingState;
use super::targets::{HeldOutViews, Targets};
use particlegs_core::camera::{Normalisation, View};
use particlegs_core::checkpoint::CheckpointStore;
use particlegs_core::context::Context;
use particlegs_core::math::{Purpose, Random};
use particlegs_core::model::{Law, LawKind, Mixture, Model};
use particlegs_core::picture::Size;
use particlegs_core::{Error, Hint, Result};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// The key of the run's state among the checkpoints.
const KEY: &str = "train";

/// Limits of a run, the folder that it may write to, and the device that takes its steps.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Beginning of the command that the run is part of.
    pub began: Instant,
    /// Seconds of the command, the fit included, after which training ends; rates of optical depth
    /// fall so that they are at their end by then. `None` = no limit.
    pub seconds: Option<f64>,
    /// Folder of the scratch file of targets; `None` = the system's.
    pub scratch: Option<PathBuf>,
    /// Name of the run in messages and log, where a command has several; else empty.
    pub run: String,
    /// The device that takes its steps; `None` = the processor.
    pub device: Option<Arc<dyn Accelerator>>,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { began: Instant::now(), seconds: None, scratch: None, run: String::new(), device: None }
    }
}

impl Limits {
    /// For the next of `runs` runs one after the other: an equal share of the time that is left.
    pub fn share(&self, runs: usize) -> Limits {
        let used = self.began.elapsed().as_secs_f64();
        let seconds = self.seconds.map(|s| used + (s - used).max(0.0) / runs.max(1) as f64);
        Limits { seconds, ..self.clone() }
    }
}

#[derive(Clone, Debug)]
pub struct TrainedMixture {
    /// The best by held-out score.
    pub mixture: Mixture,
    /// The precision that the mixture is to be coded at, in nominal steps, where it matters.
    pub factor: Option<f64>,
    pub iterations: u64,
    /// Masked PSNR on held-out views before the first step and of the best, dB.
    pub scores: [Option<f64>; 2],
    /// Steps with gradients that were not finite; the Gaussians that have them stay as they were.
    pub not_finite: u64,
    /// Whether the caller stopped it early; its state is kept.
    pub stopped: bool,
}

/// A summary of a training run.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TrainedRun {
    /// Block and layer, where there are several; else empty.
    pub run: String,
    pub iterations: u64,
    /// Steps that the configuration wants.
    pub of: u64,
    /// Masked PSNR on held-out views before the first step and of the best, dB, not coded yet.
    pub scores: [Option<f64>; 2],
    /// Steps with gradients that were not finite; the Gaussians that have them stay as they were.
    pub not_finite: u64,
}

impl TrainedRun {
    /// Of a run of that name under `config`.
    pub fn new(run: String, config: &Config, trained: &TrainedMixture) -> Self {
        let TrainedMixture { iterations, scores, not_finite, .. } = *trained;
        TrainedRun { run, iterations, of: config.iterations(), scores, not_finite }
    }
}

struct TrainingLoop<'a> {
    config: &'a Config,
    limits: &'a Limits,
    defaults: &'a Defaults,
    context: &'a Context<'a>,
    learner: Box<dyn Learner + 'a>,
    held_out: HeldOutViews<'a>,
    views: Views,
    journal: Journal<'a>,
    iteration: u64,
    /// The iteration after which the Gaussians were last scored.
    evaluated: Option<u64>,
    /// Seconds of the command in processes before this one, until the state was kept.
    before: f64,
    /// Seconds of the command at the first step.
    first: f64,
    best: BestState,
}

#[derive(Clone, Default)]
struct BestState {
    first: Option<f64>,
    score: Option<f64>,
    state: TrainingState,
}

/// The Gaussians that a run starts from.
#[derive(Clone, Copy, Debug)]
pub enum InitialGaussians<'a> {
    Fit(&'a Mixture),
    Particles(usize),
    Model(&'a Model),
}

impl InitialGaussians<'_> {
    pub fn len(&self) -> usize {
        match self {
            InitialGaussians::Fit(m) => m.len(),
            InitialGaussians::Particles(n) => *n,
            InitialGaussians::Model(m) => m.gaussians(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A task of training: Gaussians that draw the pictures of `subject`.
#[derive(Clone, Copy)]
pub struct Training<'a> {
    pub subject: &'a dyn TrainingSubject,
    pub config: &'a Config,
    pub limits: &'a Limits,
    /// Bounds, and the radius and opacity of the default picture.
    pub defaults: &'a Defaults,
}

impl<'a> Training<'a> {
    /// Trains the Gaussians of `initial`.
    ///
    /// Without a time limit pictures, steps and densities depend on the seed alone; a run that goes on from `checkpoints`
    /// ends with the same bits as one that was never broken. When the caller stops it, the best so far is given and
    /// the state kept.
    pub fn run(
        &self,
        initial: InitialGaussians<'_>,
        checkpoints: &mut dyn CheckpointStore,
        context: &Context<'_>,
    ) -> Result<TrainedMixture> {
        self.config.check()?;
        context.require_memory("training", bytes_wanted(self.config, initial.len()))?;
        let learner = self.learner(initial)?;
        let Some(device) = &self.limits.device else { return self.run_with(learner, checkpoints, context) };
        let subject = device.subject(self.subject, context)?;
        Training { subject: &*subject, ..*self }.run_with(learner, checkpoints, context)
    }

    /// [`Training::run`] of any learner.
    pub(super) fn run_with(
        &self,
        learner: Box<dyn Learner + 'a>,
        checkpoints: &mut dyn CheckpointStore,
        context: &'a Context<'a>,
    ) -> Result<TrainedMixture> {
        let Training { subject, config, limits, defaults } = *self;
        let internal = config.stages.iter().any(|s| s.internal > 0.0);
        let views = Views::new(&config.cameras, defaults, internal);
        let held_out = HeldOutViews::draw(subject, &views.held_out, config, defaults, context)?;
        let mut run = TrainingLoop {
            config,
            limits,
            defaults,
            context,
            learner,
            held_out,
            views,
            journal: Journal::new(context, &limits.run),
            iteration: 0,
            evaluated: None,
            before: 0.0,
            first: limits.began.elapsed().as_secs_f64(),
            best: BestState::default(),
        };
        match checkpoints.get(KEY).and_then(|b| TrainingState::from_bytes(&b)) {
            Some(state) => {
                run.restore(&state).map_err(|message| Error::argument(format!("bad checkpoint: {message}")))?
            }
            None => run.evaluate()?,
        }
        let stopped = match run.stages(subject, checkpoints) {
            Err(Error::Cancelled) => true,
            done => done.map(|()| false)?,
        };
        context.end();
        // Finished runs are kept as well: what comes after them may be interrupted too.
        run.learner.fetch()?;
        checkpoints.keep_now(KEY, run.state().to_bytes())?;
        run.journal.end();
        run.finish(stopped)
    }

    fn learner(&self, initial: InitialGaussians<'_>) -> Result<Box<dyn Learner>> {
        let Training { subject, config, limits, defaults } = *self;
        let (bounds, particles) = (defaults.bounds, subject.len() as u64);
        let scale = TrainingScale {
            frame: Normalisation::new(&bounds),
            radius: defaults.radius,
            opacity: defaults.opacity,
            particles,
            seed: defaults.seed,
        };
        let most_gaussians = config.alpha_blend.most_gaussians.or(defaults.gaussians);
        let alpha = AlphaConfig { most_gaussians, ..config.alpha_blend };
        let random = |n| AlphaLearner::from_particles(subject, n, scale, alpha);
        let depth_context = DepthContext { bounds, particles, look: config.target, bytes: defaults.bytes };
        let depth = |m: &Mixture| {
            DepthLearner::new(m, depth_context, config.optical_depth, |parameters| match &limits.device {
                Some(device) => device.depth_steps(parameters),
                None => Ok(Box::new(DepthCpuSteps::default())),
            })
        };
        let blended = |learner: AlphaLearner| match &limits.device {
            Some(device) => learner.by(|gaussians| device.alpha_steps(gaussians)),
            None => Ok(learner),
        };
        Ok(match (config.law, initial) {
            (LawKind::OpticalDepth, InitialGaussians::Fit(m)) => Box::new(depth(m)?),
            (LawKind::OpticalDepth, InitialGaussians::Particles(n)) => {
                Box::new(depth(&Mixture { law: Law::OpticalDepth, ..random(n)?.mixture() })?)
            }
            (LawKind::OpticalDepth, InitialGaussians::Model(_)) => {
                let message = "a trained model of the optical-depth law cannot be trained further";
                return Err(Error::argument_with(message, Hint::train_from_snapshot()));
            }
            (LawKind::AlphaBlend, InitialGaussians::Fit(m)) => {
                Box::new(blended(AlphaLearner::from_mixture(m, scale, alpha)?)?)
            }
            (LawKind::AlphaBlend, InitialGaussians::Particles(n)) => Box::new(blended(random(n)?)?),
            (LawKind::AlphaBlend, InitialGaussians::Model(m)) => {
                Box::new(blended(AlphaLearner::from_model(m, scale, alpha)?)?)
            }
        })
    }
}

/// Memory that a run takes: of its largest pictures, of the pictures that the renderer of targets
/// draws, and of the Gaussians that it begins with. As measured, and rounded up.
pub(super) fn bytes_wanted(config: &Config, gaussians: usize) -> u64 {
    const A_PIXEL: u64 = 32;
    const A_TARGETS_PIXEL: u64 = 8;
    const A_GAUSSIAN: u64 = 2000;
    let of_stage = |s: &Stage| {
        let pixels = (s.size[0] * s.size[1]) as u64;
        pixels * (A_PIXEL + A_TARGETS_PIXEL * (s.oversample * s.oversample) as u64)
    };
    config.stages.iter().map(of_stage).max().unwrap_or(0) + A_GAUSSIAN * gaussians as u64
}

impl TrainingLoop<'_> {
    /// All stages, as far as the time goes.
    fn stages(&mut self, subject: &dyn TrainingSubject, checkpoints: &mut dyn CheckpointStore) -> Result<()> {
        self.context.begin("training", self.config.iterations());
        self.context.advance(self.iteration);
        let folder = self.limits.scratch.clone().unwrap_or_else(std::env::temp_dir);
        let mut saved = Instant::now();
        let mut end = 0;
        // A run may have been stopped between a step and what is due after it.
        self.evaluate_if_due()?;
        for stage in &self.config.stages {
            end += stage.iterations;
            if self.iteration >= end {
                continue;
            }
            let mut targets = Targets::new(subject, self.config.target, stage, &folder, self.config.cache_bytes);
            while self.iteration < end {
                self.context.check()?;
                if self.is_late() {
                    self.journal.late(&self.status());
                    return self.evaluate();
                }
                self.step(stage, &mut targets)?;
                self.evaluate_if_due()?;
                if saved.elapsed().as_secs_f64() >= self.config.checkpoint_seconds {
                    self.learner.fetch()?;
                    checkpoints.keep_now(KEY, self.state().to_bytes())?;
                    saved = Instant::now();
                }
            }
        }
        Ok(())
    }

    /// Seconds of the command.
    fn seconds(&self) -> f64 {
        self.before + self.limits.began.elapsed().as_secs_f64()
    }

    fn is_late(&self) -> bool {
        self.limits.seconds.is_some_and(|s| self.seconds() >= s)
    }

    /// Share of the time for training that is over.
    fn share_of_time(&self) -> f64 {
        // The limit may have been over before the first step.
        let share = |s: f64| (self.seconds() - self.first) / (s - self.first).max(f64::MIN_POSITIVE);
        self.limits.seconds.map_or(0.0, share)
    }

    fn status(&self) -> RunStatus {
        RunStatus {
            iteration: self.iteration,
            iterations: self.config.iterations(),
            seconds: self.seconds(),
            gaussians: self.learner.len(),
        }
    }

    /// One step on the next view, and what is due of adding and moving Gaussians.
    fn step(&mut self, stage: &Stage, targets: &mut Targets<'_>) -> Result<()> {
        let (key, view, crop) = self.choose(stage);
        let target = targets.get(key, &view, &crop, self.context)?;
        let total = self.config.iterations();
        let at = StepInfo {
            iteration: self.iteration,
            iterations: total,
            done: (self.iteration as f64 / total as f64).max(self.share_of_time()).min(1.0),
            densify: stage.densify,
        };
        // Silent: progress is that of steps, and a step is not cancelled half-way.
        let sample = TrainingSample { view: &view, target: &target, crop, context: &self.context.silent() };
        let stepped = self.learner.step(&sample, &self.config.loss, &at)?;
        self.learner.control(&at)?;
        self.iteration += 1;
        self.context.advance(1);
        let status = self.status();
        self.journal.step(stepped.loss, stepped.not_finite, &status);
        Ok(())
    }

    /// The view of the next step, its number among the targets, and the part that is seen.
    fn choose(&self, stage: &Stage) -> (u64, View, Crop) {
        // Keyed by the iteration alone: a run that goes on from a checkpoint sees the same pictures.
        let mut draw = Random::from_purpose(Purpose::TrainingStep, self.defaults.seed, self.iteration);
        let mut below = |n: usize| ((draw.uniform() * n as f64) as usize).min(n.saturating_sub(1));
        let inside = (below(1 << 20) as f64) < stage.internal * f64::from(1 << 20) && !self.views.internal.is_empty();
        let views = if inside { &self.views.internal } else { &self.views.training };
        let i = below(views.len());
        let key = if inside { self.views.training.len() + i } else { i };
        let full = Size { width: stage.size[0], height: stage.size[1] };
        let crop = match stage.crop {
            [0, 0] => Crop::whole(full),
            [width, height] => Crop {
                full,
                corner: [below(full.width - width + 1), below(full.height - height + 1)],
                size: Size { width, height },
            },
        };
        (key as u64, views[i].clone(), crop)
    }

    /// Scores the Gaussians where that is due and not done.
    fn evaluate_if_due(&mut self) -> Result<()> {
        let due =
            self.iteration.is_multiple_of(self.config.evaluate_every) || self.iteration == self.config.iterations();
        if due { self.evaluate() } else { Ok(()) }
    }

    /// Scores the Gaussians on the held-out views, unless they are scored already, and keeps the best.
    fn evaluate(&mut self) -> Result<()> {
        if self.evaluated == Some(self.iteration) {
            return Ok(());
        }
        self.learner.fetch()?;
        let mixture = self.learner.shown()?;
        let score = self.held_out.masked_psnr(&mixture)?;
        if self.iteration == 0 {
            self.best.first = score;
        }
        // `None` compares as less than any score, so it never replaces one.
        if self.iteration == 0 || score > self.best.score {
            self.best = BestState { first: self.best.first, score, state: self.learner.state() };
        }
        self.evaluated = Some(self.iteration);
        self.journal.evaluation(score, &self.status());
        Ok(())
    }

    fn finish(mut self, stopped: bool) -> Result<TrainedMixture> {
        let fail = |message| Error::argument(format!("the best state of training cannot be restored: {message}"));
        self.learner.restore(&self.best.state).map_err(fail)?;
        // As they are: those that were decoded on the way would be rounded twice.
        let mixture = self.learner.mixture();
        let scores = [self.best.first, self.best.score];
        let not_finite = self.journal.faulty;
        let factor = self.learner.factor();
        Ok(TrainedMixture { mixture, factor, iterations: self.iteration, scores, not_finite, stopped })
    }

    /// The learner's state, the best one, and where the run stands.
    fn state(&self) -> TrainingState {
        let mut all = TrainingState::default();
        for (prefix, state) in [("now", &self.learner.state()), ("best", &self.best.state)] {
            all.columns.extend(state.columns.iter().map(|(n, c)| (format!("{prefix}/{n}"), c.clone())));
            all.numbers.extend(state.numbers.iter().map(|(n, c)| (format!("{prefix}/{n}"), c.clone())));
        }
        let score = |s: Option<f64>| s.unwrap_or(f64::NAN);
        let run = vec![
            self.iteration as f64,
            self.evaluated.map_or(f64::NAN, |i| i as f64),
            self.seconds(),
            self.first,
            self.journal.loss_sum,
            self.journal.faulty as f64,
            score(self.best.first),
            score(self.best.score),
        ];
        all.numbers.insert("run".into(), run);
        all
    }

    fn restore(&mut self, state: &TrainingState) -> std::result::Result<(), String> {
        let part = |prefix: &str| {
            let bare_name = |n: &String| n.strip_prefix(prefix).and_then(|n| n.strip_prefix('/')).map(String::from);
            TrainingState {
                columns: state.columns.iter().filter_map(|(n, c)| Some((bare_name(n)?, c.clone()))).collect(),
                numbers: state.numbers.iter().filter_map(|(n, c)| Some((bare_name(n)?, c.clone()))).collect(),
            }
        };
        let run = state.doubles("run", 8)?;
        let some = |v: f64| (!v.is_nan()).then_some(v);
        self.iteration = run[0] as u64;
        self.evaluated = some(run[1]).map(|i| i as u64);
        (self.before, self.first) = (run[2], run[3]);
        (self.journal.loss_sum, self.journal.faulty) = (run[4], run[5] as u64);
        self.best = BestState { first: some(run[6]), score: some(run[7]), state: part("best") };
        self.learner.restore(&part("now"))
    }
}
