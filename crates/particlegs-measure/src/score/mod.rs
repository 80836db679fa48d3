//! Scores of a model: pictures over views, the density on a grid, the certificate.
//!
//! [`evaluate`] draws every view of all particles and of the model in every look and puts the noise-free score, the
//! floors and the gap beside each score (docs/law/scores.md). The certificate does so for one frame an orbit and adds
//! the density; [`Assessment::verdict`] says in plain words which uses the model is good for. `HeldOutPictures` keeps
//! the truth of a few views, for comparisons of many models.

mod cells;
mod certify;
mod cross_validation;
mod density;
mod evaluate;
mod field_sums;
mod goal;
mod layers;
mod match_groups;
mod pictures;
mod region;
mod science;
mod scores;
mod subset;
mod sums;
#[cfg(test)]
mod tests;
mod truth;
mod verdict;
mod views;

pub use certify::CertificateInput;
pub use cross_validation::Halves;
pub use density::DensityGrid;
use density::density_of;
pub use evaluate::evaluate;
#[cfg(test)]
pub(crate) use evaluate::shot_noise;
pub use field_sums::{FieldCellSums, FieldCellTable, FieldCells, FieldPlace, field_section};
pub use goal::GoalMetric;
pub use region::{ParticlesWithModel, particles_of_region};
#[cfg(test)]
use science::mass_power;
pub use science::spectrum_options;
pub use scores::{Evaluation, LookScores, MeanViewScores, ViewScores};
pub use sums::{MeasurementFrame, PartSums, SumsSection};
pub(crate) use truth::HeldOutPictures;
use truth::ViewTruth;
pub use verdict::{Assessment, Grade, UseCase};
use views::certificate_views;
pub use views::check_radius;
pub use views::evaluation_views;
use views::held_out_views;
