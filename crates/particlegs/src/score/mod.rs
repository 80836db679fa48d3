//! Floor 5: how good a model is: pictures over views, the density on a grid, the certificate.
//!
//! [`evaluate`] draws every view of all particles and of the model in every look and puts the
//! noise-free score, the floors and the gap beside each score (docs/law/scores.md). The certificate
//! does so for one frame an orbit and adds the density; [`Assessment::verdict`] says in plain words what it is good for.
//! `HeldOutPictures` keeps the truth of a few views for who compares many models.

mod cells;
mod certify;
mod density;
mod evaluate;
mod goal;
mod halves;
mod held_out;
mod joined;
mod layers;
mod matched;
mod mean;
mod pictures;
mod science;
mod scope;
mod scores;
mod subset;
mod sums;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod truth;
mod verdict;
mod views;

pub(crate) use certify::CertificateInput;
use density::density_of;
pub use evaluate::evaluate;
#[cfg(test)]
pub(crate) use evaluate::shot_noise;
pub(crate) use goal::GoalMetric;
pub(crate) use halves::Halves;
pub(crate) use held_out::HeldOutPictures;
pub(crate) use joined::PartSums;
use mean::mean;
#[cfg(test)]
use science::mass_power;
pub(crate) use science::spectrum_options;
pub(crate) use scope::ParticlesWithModel;
pub use scores::{Evaluation, LookScores, MeanViewScores, ViewScores};
pub(crate) use sums::{MeasurementFrame, SumsSection};
use truth::ViewTruth;
pub use verdict::{Assessment, Grade, UseCase};
use views::certificate_views;
pub(crate) use views::check_radius;
pub use views::evaluation_views;
use views::held_out_views;
