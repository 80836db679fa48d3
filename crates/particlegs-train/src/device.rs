//! What takes a run's steps, and draws its pictures, in place of the processor.

use crate::alpha;
use crate::depth::{DepthStepper, Parameters};
use crate::subject::TrainingSubject;
use particlegs_core::Result;
use particlegs_core::progress::Progress;
use std::fmt::Debug;

/// A device that takes steps of training, and draws what is learnt.
pub trait Device: Debug + Send + Sync {
    /// What takes steps of these Gaussians of the optical-depth law.
    ///
    /// # Errors
    /// [`particlegs_core::Error::Argument`] where it does not hold them; those of the device.
    fn depth_steps(&self, of: &Parameters) -> Result<Box<dyn DepthStepper>>;

    /// What takes steps of these Gaussians of the alpha-blend law.
    ///
    /// # Errors
    /// Those of the device.
    fn alpha_steps(&self, of: &alpha::Gaussians) -> Result<Box<dyn alpha::AlphaStepper>>;

    /// The same subject, whose pictures the device draws.
    ///
    /// # Errors
    /// Those of the device; [`particlegs_core::Error::Cancelled`].
    fn subject<'a>(
        &self,
        of: &'a dyn TrainingSubject,
        progress: &dyn Progress,
    ) -> Result<Box<dyn TrainingSubject + 'a>>;
}
