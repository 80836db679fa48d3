//! The interface of a law in training: steps, density control, a mixture, a state.

use super::loss::Loss;
use super::state::TrainingState;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::Mixture;
use particlegs_core::picture::{Plane, Size};

pub struct TrainingSample<'a> {
    pub view: &'a View,
    /// Brightness wanted, in [0, 1]; its size is the crop's.
    pub target: &'a Plane,
    /// The part of the view's picture that the target shows.
    pub crop: Crop,
    /// The machine, asked for its instruction set and memory.
    pub context: &'a Context<'a>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop {
    pub full: Size,
    /// Left column and top row of the part.
    pub corner: [usize; 2],
    pub size: Size,
}

impl Crop {
    pub fn whole(full: Size) -> Self {
        Crop { full, corner: [0, 0], size: full }
    }
}

/// The place of a step in its run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepInfo {
    /// Steps done before this one, over all stages.
    pub iteration: u64,
    pub iterations: u64,
    /// Share of the run that is done, by steps or by time, whichever is more.
    pub done: f64,
    /// Density control of the stage.
    pub densify: Densify,
}

/// Schedule and threshold of adding Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Densify {
    /// Iterations from one time to the next; 0 = never.
    pub every: u64,
    /// The iteration of the whole run after which none are added.
    pub until: u64,
    /// Mean gradient of the position on the picture (in units of half its size) above which a
    /// Gaussian is cloned or split; alpha-blend alone.
    pub threshold: f64,
}

/// The outcome of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    pub loss: f64,
    /// The first parameter whose gradient was not finite, if any: the Gaussian was left as it was.
    pub not_finite: Option<NonFiniteGradient>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NonFiniteGradient {
    /// Group of parameters, e.g. `position`.
    pub group: &'static str,
    pub gaussian: usize,
    pub count: usize,
}

/// The trainable Gaussians of one law.
pub(crate) trait Learner {
    /// Draws the sample, takes the loss, and moves all parameters a step down its gradient. Gaussians
    /// with gradients that are not finite stay as they are, and are named.
    fn step(&mut self, sample: &TrainingSample<'_>, loss: &Loss, at: &StepInfo) -> Result<StepReport>;

    /// Density control due after the step at `at`.
    fn control(&mut self, at: &StepInfo) -> Result<()>;

    /// Brings here what steps have moved elsewhere: before the Gaussians or the state are asked for.
    fn fetch(&mut self) -> Result<()> {
        Ok(())
    }

    fn len(&self) -> usize;

    /// The Gaussians in world units.
    fn mixture(&self) -> Mixture;

    /// The Gaussians as the file will give them, where that is known.
    fn shown(&self) -> Result<Mixture> {
        Ok(self.mixture())
    }

    /// The precision, in nominal steps, at which these Gaussians were coded already: at no other are
    /// they as good.
    fn factor(&self) -> Option<f64> {
        None
    }

    /// Everything that the next step depends on, exactly.
    fn state(&self) -> TrainingState;

    /// Goes on from a state.
    ///
    /// # Errors
    /// A text, where columns are missing or of unequal length.
    fn restore(&mut self, state: &TrainingState) -> std::result::Result<(), String>;
}
