//! A compression as a folder, so that any engine can do its parts anywhere.
//!
//! [`Job::plan`] passes over the snapshot once and writes a manifest: what is asked for, the cuts, the
//! hash of every run of particles. Where runs lie scattered over the blocks, [`Job::scatter`] copies
//! chunks of the snapshot into buckets, one file a chunk (`bucket`), with the values of their fields (`fields`); where
//! they are together already, blocks read them where they are (`gather`). [`Job::block`] fits a block and writes a
//! model file of its own, with a checkpoint on the way, and where the plan says so what it measured of it (`sums`);
//! [`Job::merge`] puts the file together: the same bytes as [`crate::compress`] gives, whatever ran where and in what
//! order.
//!
//! Every file appears whole or not at all, and names the plan that it belongs to.

mod block;
mod bucket;
mod fields;
mod gather;
mod manifest;
mod memory;
mod merge;
mod plan;
mod runs;
mod scatter;
mod status;
mod sums;

pub use block::BlockReport;
pub use manifest::Job;
pub use plan::Task;
pub use status::{JobStatus, State};
