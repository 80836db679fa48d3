//! Models trained on pictures.
//!
//! A learner (`learner`) holds the Gaussians of one law as parameters (`alpha`, `depth`), draws them,
//! and moves them down the gradient of a [`Loss`]. [`Training::run`] gives it pictures (`cameras`, `targets`)
//! stage by stage as a [`Config`] says, scores it on held-out views, and keeps its state (`state`) so
//! that an interrupted run goes on to the same bits.

// A comment stands where a name does not say it.
#![allow(missing_docs)]

mod accelerator;
mod adam;
pub mod alpha;
mod cameras;
mod config;
pub mod depth;
mod journal;
mod learner;
mod loss;
mod run;
#[cfg(test)]
mod run_tests;
mod state;
mod targets;
#[cfg(test)]
mod targets_tests;

pub use accelerator::{Accelerator, ColumnReader, ParticleInput, TrainingSubject};
pub use adam::Averages;
pub use alpha::AlphaConfig;
pub use cameras::Defaults;
pub use config::{Cameras, Config, Preset, Stage, Start};
pub use depth::{DepthConfig, DepthRates};
pub use learner::{Crop, Densify, NonFiniteGradient, StepReport, TrainingSample};
pub use loss::{Loss, Norm};
pub use run::{InitialGaussians, Limits, TrainedMixture, TrainedRun, Training};
