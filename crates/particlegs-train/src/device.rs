//! What takes a run's steps in place of the processor.

use crate::depth::{Parameters, Steps};
use particlegs_core::Result;
use std::fmt::Debug;

/// A device that takes steps of training.
pub trait Device: Debug + Send + Sync {
    /// What takes steps of these Gaussians of the optical-depth law.
    ///
    /// # Errors
    /// [`particlegs_core::Error::Argument`] where it does not hold them; those of the device.
    fn depth_steps(&self, of: &Parameters) -> Result<Box<dyn Steps>>;
}
