//! Floor 3: particles to mixture, without gradients.

pub mod candidates;
pub mod em;
pub mod em_kernel;
pub mod split_merge;
