//! A training run: stages of steps, evaluation on held-out views, checkpoints, a log.

use super::alpha::{AlphaLearner, Ground};
use super::cameras::{Defaults, Views};
use super::config::{Config, Stage};
use super::depth::{DepthGround, DepthLearner};
use super::held_out::HeldOut;
use super::learner::{Crop, Learner, Moment, Shot};
use super::state::State;
use super::targets::Targets;
use crate::camera::{Normalisation, View};
use crate::fit::Pieces;
use crate::math::Random;
use crate::model::{Law, Mixture, Model, VizMapper};
use crate::particles::Particles;
use crate::picture::Size;
use crate::progress::Progress;
use crate::reference::Reference;
use crate::{Error, Result};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// What a step's picture and its part are drawn with.
const STEP: u32 = 0x7472_7374;
/// The key of the run's state among the pieces.
const KEY: &str = "train";
/// Steps over which the loss that is logged is averaged.
const LOG_STEPS: u64 = 50;

/// How far a run goes, and where it may write.
#[derive(Clone, Debug, Default)]
pub struct Limits {
    /// Seconds of training; rates fall so that they are at their end by then. `None` = no limit.
    pub seconds: Option<f64>,
    /// Folder of the scratch file of targets; `None` = the system's.
    pub scratch: Option<PathBuf>,
}

/// A trained mixture.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The best by held-out score.
    pub mixture: Mixture,
    /// Its network, where the law has one.
    pub vizmapper: Option<VizMapper>,
    /// Steps done.
    pub iterations: u64,
    /// Masked PSNR on held-out views before the first step and of the best, dB.
    pub scores: [Option<f64>; 2],
    /// Did the caller stop it early? Its state is kept.
    pub stopped: bool,
}

/// A line of the log.
#[derive(Clone, Debug, Serialize)]
struct Line {
    iteration: u64,
    seconds: f64,
    loss: Option<f64>,
    held_out_masked_psnr: Option<f64>,
    gaussians: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    not_finite: Option<String>,
}

struct Run<'a> {
    config: &'a Config,
    limits: &'a Limits,
    defaults: &'a Defaults,
    progress: &'a dyn Progress,
    learner: Box<dyn Learner + 'a>,
    held_out: HeldOut<'a>,
    views: Views,
    /// Steps done.
    iteration: u64,
    /// Seconds of training before this process.
    before: f64,
    start: Instant,
    /// Sum of the losses since the last line of the log.
    loss_sum: f64,
    best: Best,
}

#[derive(Clone, Default)]
struct Best {
    first: Option<f64>,
    score: Option<f64>,
    /// The learner's state then.
    state: State,
}

/// The Gaussians that a run starts from.
#[derive(Clone, Copy, Debug)]
pub enum From<'a> {
    /// Those of a fit.
    Fit(&'a Mixture),
    /// So many particles at random.
    Particles(usize),
    /// A model of the alpha-blend law.
    Model(&'a Model),
}

/// Trains Gaussians on pictures of `particles`.
///
/// Pictures, steps and densities depend on the seed alone; a run that goes on from `pieces` ends with
/// the same bits as one that was never broken. When the caller stops it, the best so far is given and
/// the state kept.
///
/// # Errors
/// [`Error::Argument`] for a configuration out of range; [`Error::Io`] of the scratch file; those of
/// `pieces`.
pub fn train(
    particles: &Particles,
    from: From<'_>,
    (config, limits, defaults): (&Config, &Limits, &Defaults),
    pieces: &mut dyn Pieces,
    progress: &dyn Progress,
) -> Result<Trained> {
    config.check()?;
    let reference = Reference::with_bounds(particles, defaults.bounds);
    let internal = config.stages.iter().any(|s| s.internal > 0.0);
    let views = Views::new(&config.cameras, defaults, internal);
    let learner = learner(particles, from, config, defaults)?;
    let held_out = HeldOut::draw(&reference, &views.held_out, config, defaults, progress)?;
    let mut run = Run {
        config,
        limits,
        defaults,
        progress,
        learner,
        held_out,
        views,
        iteration: 0,
        before: 0.0,
        start: Instant::now(),
        loss_sum: 0.0,
        best: Best::default(),
    };
    match pieces.get(KEY).and_then(|b| State::of_bytes(&b)) {
        Some(state) => run.restore(&state).map_err(|what| Error::argument(format!("the checkpoint: {what}")))?,
        None => run.evaluate()?,
    }
    let stopped = run.stages(&reference, pieces)?;
    if stopped {
        pieces.keep(KEY, run.state().to_bytes())?;
    }
    run.finish(stopped)
}

/// The learner of the law, at its start.
fn learner(particles: &Particles, from: From<'_>, config: &Config, defaults: &Defaults) -> Result<Box<dyn Learner>> {
    let ground = Ground {
        frame: Normalisation::of(&defaults.bounds),
        radius: defaults.radius,
        opacity: defaults.opacity,
        particles: particles.len() as u64,
        seed: defaults.seed,
    };
    let random = |n| AlphaLearner::from_particles(particles, n, ground, config.alpha_blend);
    let (bounds, particles, look, bytes) = (defaults.bounds, particles.len() as u64, config.target, defaults.bytes);
    let depth =
        |m: &Mixture| DepthLearner::new(m, DepthGround { bounds, particles, look, bytes }, config.optical_depth);
    Ok(match (config.law, from) {
        (Law::OpticalDepth, From::Fit(m)) => Box::new(depth(m)),
        (Law::OpticalDepth, From::Particles(n)) => Box::new(depth(&Mixture { shade: None, ..random(n)?.mixture().0 })),
        (Law::OpticalDepth, From::Model(_)) => {
            return Err(Error::argument("models of the optical-depth law are trained by `compress --train`"));
        }
        (Law::AlphaBlend, From::Fit(m)) => Box::new(AlphaLearner::from_mixture(m, ground, config.alpha_blend)?),
        (Law::AlphaBlend, From::Particles(n)) => Box::new(random(n)?),
        (Law::AlphaBlend, From::Model(m)) => Box::new(AlphaLearner::from_model(m, ground, config.alpha_blend)?),
    })
}

impl Run<'_> {
    /// All stages; was the run stopped?
    fn stages(&mut self, reference: &Reference<'_>, pieces: &mut dyn Pieces) -> Result<bool> {
        let total = self.config.iterations();
        self.progress.begin("training", total);
        self.progress.advance(self.iteration);
        let folder = self.limits.scratch.clone().unwrap_or_else(std::env::temp_dir);
        let mut saved = Instant::now();
        let mut end = 0;
        for stage in &self.config.stages {
            end += stage.iterations;
            if self.iteration >= end {
                continue;
            }
            let mut targets = Targets::new(reference, self.config.target, stage, &folder, self.config.cache_bytes);
            while self.iteration < end {
                if self.progress.cancelled() || self.is_late() {
                    let stopped = self.progress.cancelled();
                    self.progress.end();
                    return Ok(stopped);
                }
                match self.step(stage, &mut targets) {
                    Err(Error::Cancelled) => return Ok(true),
                    other => other?,
                }
                if saved.elapsed().as_secs_f64() >= self.config.checkpoint_seconds {
                    pieces.keep(KEY, self.state().to_bytes())?;
                    saved = Instant::now();
                }
            }
        }
        self.progress.end();
        Ok(false)
    }

    fn seconds(&self) -> f64 {
        self.before + self.start.elapsed().as_secs_f64()
    }

    fn is_late(&self) -> bool {
        self.limits.seconds.is_some_and(|s| self.seconds() >= s)
    }

    /// One step, and what is due after it.
    fn step(&mut self, stage: &Stage, targets: &mut Targets<'_>) -> Result<()> {
        let (key, view, crop) = self.choose(stage);
        let target = targets.get(key, &view, &crop, self.progress)?;
        let total = self.config.iterations();
        let by_time = self.limits.seconds.map_or(0.0, |s| self.seconds() / s);
        let at = Moment {
            iteration: self.iteration,
            iterations: total,
            done: (self.iteration as f64 / total as f64).max(by_time).min(1.0),
            densify: stage.densify,
        };
        let shot = Shot { view: &view, target: &target, crop };
        let stepped = self.learner.step(&shot, &self.config.loss, &at)?;
        self.learner.control(&at);
        self.iteration += 1;
        self.loss_sum += stepped.loss;
        self.progress.advance(1);
        if let Some(n) = stepped.not_finite {
            let what = format!("{} of Gaussian {} and {} more", n.group, n.gaussian, n.count - 1);
            self.progress
                .message(&format!("warning: step {}: gradient of {what} is not finite, left out", self.iteration));
            self.log(None, None, Some(what));
        }
        if self.iteration.is_multiple_of(LOG_STEPS) {
            let loss = self.loss_sum / LOG_STEPS as f64;
            self.loss_sum = 0.0;
            self.log(Some(loss), None, None);
        }
        if self.iteration.is_multiple_of(self.config.evaluate_every) || self.iteration == total {
            self.evaluate()?;
        }
        Ok(())
    }

    /// The view of the next step, its number among the targets, and the part that is seen.
    fn choose(&self, stage: &Stage) -> (u64, View, Crop) {
        let mut draw = Random::new(self.defaults.seed, STEP, self.iteration);
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

    /// Scores the Gaussians on the held-out views and keeps the best.
    fn evaluate(&mut self) -> Result<()> {
        let (mixture, vizmapper) = self.learner.shown()?;
        let score = self.held_out.masked_psnr(&mixture, vizmapper.as_ref())?;
        if self.iteration == 0 {
            self.best.first = score;
        }
        if self.iteration == 0 || score > self.best.score {
            self.best = Best { first: self.best.first, score, state: self.learner.state() };
        }
        self.log(None, score, None);
        if let Some(s) = score {
            self.progress.message(&format!(
                "step {} of {}: {s:.3} dB masked PSNR on held-out views, {} Gaussians",
                self.iteration,
                self.config.iterations(),
                self.learner.len()
            ));
        }
        Ok(())
    }

    fn log(&self, loss: Option<f64>, score: Option<f64>, not_finite: Option<String>) {
        let line = Line {
            iteration: self.iteration,
            seconds: self.seconds(),
            loss,
            held_out_masked_psnr: score,
            gaussians: self.learner.len(),
            not_finite,
        };
        if let Ok(text) = serde_json::to_string(&line) {
            self.progress.log(&text);
        }
    }

    /// The best Gaussians.
    fn finish(mut self, stopped: bool) -> Result<Trained> {
        let fail = |what| Error::argument(format!("the best state: {what}"));
        self.learner.restore(&self.best.state).map_err(fail)?;
        // As they are: those that were decoded on the way would be rounded twice.
        let (mixture, vizmapper) = self.learner.mixture();
        let scores = [self.best.first, self.best.score];
        Ok(Trained { mixture, vizmapper, iterations: self.iteration, scores, stopped })
    }

    /// The learner's state, the best one, and where the run stands.
    fn state(&self) -> State {
        let mut all = State::default();
        for (prefix, state) in [("now", &self.learner.state()), ("best", &self.best.state)] {
            all.columns.extend(state.columns.iter().map(|(n, c)| (format!("{prefix}/{n}"), c.clone())));
            all.numbers.extend(state.numbers.iter().map(|(n, c)| (format!("{prefix}/{n}"), c.clone())));
        }
        let score = |s: Option<f64>| s.unwrap_or(f64::NAN);
        let run =
            vec![self.iteration as f64, self.seconds(), self.loss_sum, score(self.best.first), score(self.best.score)];
        all.numbers.insert("run".into(), run);
        all
    }

    fn restore(&mut self, state: &State) -> std::result::Result<(), String> {
        let part = |prefix: &str| {
            let own = |n: &String| n.strip_prefix(prefix).and_then(|n| n.strip_prefix('/')).map(String::from);
            State {
                columns: state.columns.iter().filter_map(|(n, c)| Some((own(n)?, c.clone()))).collect(),
                numbers: state.numbers.iter().filter_map(|(n, c)| Some((own(n)?, c.clone()))).collect(),
            }
        };
        let run = state.doubles("run", 5)?;
        let score = |v: f64| (!v.is_nan()).then_some(v);
        (self.iteration, self.before, self.loss_sum) = (run[0] as u64, run[1], run[2]);
        self.best = Best { first: score(run[3]), score: score(run[4]), state: part("best") };
        self.learner.restore(&part("now"))
    }
}
