//! Floor 5: how good a model is: pictures over views, the density on a grid, the certificate.
//!
//! [`evaluate`] draws every view of all particles and of the model in every look and puts the
//! noise-free score, the floors and the gap beside each score (docs/law/scores.md). The certificate
//! does so for one frame an orbit and adds the density; [`Finding::verdict`] says in plain words what it is good for.
//! `HeldOut` keeps the truth of a few views for who compares many models.

mod cells;
mod certify;
mod density;
mod evaluate;
mod halves;
mod held_out;
mod matched;
mod mean;
mod pictures;
mod science;
mod scores;
mod subset;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod truth;
mod verdict;
mod views;

pub(crate) use certify::Measure;
use density::density_of;
pub use evaluate::evaluate;
#[cfg(test)]
pub(crate) use evaluate::shot_noise;
pub(crate) use halves::Halves;
pub(crate) use held_out::HeldOut;
use mean::mean;
pub(crate) use science::spectrum_options;
pub use scores::{Evaluation, LookScores, MeanViewScores, ViewScores};
use truth::Truth;
pub use verdict::{Finding, Use, Word};
use views::certificate_views;
pub use views::evaluation_views;
pub(crate) use views::held_out_views;
