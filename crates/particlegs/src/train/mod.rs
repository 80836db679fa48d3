//! Floor 4: gradients: models trained on pictures.
//!
//! A [`learner::Learner`] holds the Gaussians of one law as parameters, draws them, and moves them
//! down the gradient of a [`Loss`].

mod adam;
mod alpha;
mod dssim;
mod learner;
mod loss;
mod state;

pub use alpha::AlphaConfig;
pub use learner::Densify;
pub use loss::{Loss, Norm};
