//! What takes a run's steps, and draws its pictures, in place of the processor.

use crate::alpha;
use crate::depth::{DepthStepper, Parameters};
use crate::subject::TrainingSubject;
use particlegs_core::Result;
use particlegs_core::context::Context;
use std::fmt::Debug;

/// A device that takes steps of training, and draws what is learnt.
pub trait Device: Debug + Send + Sync {
    /// What takes steps of these Gaussians of the optical-depth law.
    fn depth_steps(&self, of: &Parameters) -> Result<Box<dyn DepthStepper>>;

    /// What takes steps of these Gaussians of the alpha-blend law.
    fn alpha_steps(&self, of: &alpha::Gaussians) -> Result<Box<dyn alpha::AlphaStepper>>;

    /// The same subject, whose pictures the device draws.
    fn subject<'a>(&self, of: &'a dyn TrainingSubject, context: &Context<'_>) -> Result<Box<dyn TrainingSubject + 'a>>;
}
