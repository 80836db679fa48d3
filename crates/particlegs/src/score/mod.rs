//! Floor 5: how good a model is: pictures over views, the density on a grid, the certificate.
//!
//! [`evaluate`] draws every view of all particles and of the model in every look and puts the
//! noise-free score, the floors and the gap beside each score (docs/law/scores.md). [`certificate`]
//! does so for one frame an orbit and adds the density; [`verdict`] says in plain words what it is good for. [`HeldOut`] keeps the truth of a few views
//! for whoever compares many models.

mod agree;
mod certify;
mod compare;
mod density;
mod evaluate;
mod held_out;
mod mean;
mod science;
mod scores;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod truth;
mod verdict;
mod views;

pub use agree::{Figure, contradictions, doubts, side_by_side};
pub use certify::certificate;
pub use compare::{Compared, Comparison, MeanScores, compare_folders};
pub use density::DensityAgreement;
pub(crate) use density::density_of;
pub use evaluate::{evaluate, shot_noise};
pub use held_out::HeldOut;
use mean::mean;
pub use scores::{ByOrbit, Evaluation, Floor, Gap, LookScores, MeanViewScores, NoFxaaScores, ViewScores};
use truth::Truth;
pub use verdict::{Finding, Use, Verdict, Word, verdict};
pub(crate) use views::certificate_views;
pub(crate) use views::held_out_views;
pub use views::{EvalView, ViewSeed, evaluation_views, views_of_file};
