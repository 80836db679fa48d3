//! Floor 4: gradients: models trained on pictures.
//!
//! A [`learner::Learner`] holds the Gaussians of one law as parameters, draws them, and moves them
//! down the gradient of a [`Loss`].

mod adam;
mod alpha;
mod cameras;
mod config;
mod depth;
mod dssim;
mod held_out;
mod learner;
mod loss;
mod run;
mod state;
mod targets;

pub use alpha::AlphaConfig;
pub use cameras::Defaults;
pub use config::{Cameras, Config, Preset, Stage, Start};
pub use depth::{DepthConfig, Rates};
pub(crate) use learner::Crop;
pub use learner::Densify;
pub use loss::{Loss, Norm};
pub use run::{From, Limits, Trained, train};
