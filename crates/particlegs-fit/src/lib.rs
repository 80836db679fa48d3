//! Particles to a mixture of Gaussians, without gradients, and a mixture to synthetic particles ([`recover`]).
//!
//! A `ParticleStore` is the snapshot copied once, free to be reordered. `partition` cuts it into cells
//! whose particles lie side by side, best cut first, and sums each cell's `Moments`: one
//! Gaussian a cell. The geometry counts particles, as ParaView draws them; masses are carried
//! along. `refine` softens the cells by truncated EM and moves Gaussians from where they are not
//! needed to where they are; [`fit`] does both as an [`Effort`] allows. `simplify` makes a mixture
//! smaller without the particles.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod assignment;
mod best_cuts;
mod block_runs;
mod cut;
mod effort;
mod eigen;
mod em;
mod em_kernel;
mod field_correlations;
mod field_moments;
mod gain;
mod gaussian_bytes;
mod moments;
mod overlap_tree;
mod partition;
#[cfg(test)]
mod partition_tests;
mod prior;
pub mod recover;
mod refine;
#[cfg(test)]
mod refine_tests;
mod simplify;
mod split_merge;
mod store;
mod tracking;
mod transmittance;

pub use effort::{FitOptions, Fitter, fit, memory_needed};
pub use field_correlations::{FieldCorrelation, correlations};
pub use field_moments::{BlockField, FieldMeans, FieldShape, gather, value_fault};
pub use moments::Moments;
pub use particlegs_core::model::Effort;
use partition::{Partition, PartitionOptions};
pub use refine::TrackedGaussians;
use refine::{RefineOptions, refine};
pub use simplify::{SimplifyOptions, simplify};
pub(crate) use store::ParticleStore;
pub use tracking::{MixtureAssignment, TrackingEffort, track_gaussians};
