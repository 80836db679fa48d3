//! Training of the alpha-blend law: 3-D Gaussian splatting as published, with the network that
//! follows radius and opacity (paper section III).
//!
//! `learner` holds the [`Gaussians`] in the training frame (`parameters`, `start`). A step
//! ([`AlphaStepper`]) is a `pass`: adapt, draw, then back again, tile by tile (`raster`), Gaussian by Gaussian
//! (`chain`) and through the network (`network`); and Adam. `density` clones, splits and prunes as published. The
//! rates and all other options stand in [`AlphaConfig`].

mod chain;
mod config;
mod density;
mod learner;
mod network;
mod parameters;
mod pass;
mod raster;
mod start;
mod steps;

#[cfg(test)]
mod learner_tests;
#[cfg(test)]
mod tests;

pub use config::AlphaConfig;
pub(crate) use learner::AlphaLearner;
pub use parameters::{AlphaParameters, GROUPS, Gaussians, SH0, TrainingScale};
pub use steps::{AlphaCpuSteps, AlphaStepper, StepSize};
