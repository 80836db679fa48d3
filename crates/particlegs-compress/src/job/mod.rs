//! A compression as a folder, so that any engine can do its parts anywhere.
//!
//! [`JobFolder::plan`] passes over the snapshot once and writes a manifest: what is asked for, the cuts, the
//! hash of every run of particles. Where runs lie scattered over the blocks, [`JobFolder::scatter`] copies
//! chunks of the snapshot into buckets, one file a chunk (`scatter`), with the values of their fields (`fields`); where
//! they are together already, blocks read them where they are (`gather`). [`JobFolder::block`] fits a block and writes a
//! model file of its own, with a checkpoint on the way, and where the plan says so what it measured of it (`sums`);
//! [`JobFolder::merge`] puts the file together: the same bytes as [`crate::compress`] gives, whatever ran where and in what
//! order.
//!
//! Every file appears whole or not at all, and names the plan that it belongs to.

mod block;
mod fields;
mod gather;
mod manifest;
mod merge;
mod plan;
mod runs;
mod scatter;
mod status;
mod sums;

use particlegs_core::Error;

pub use block::BlockReport;
pub use manifest::JobFolder;
pub use plan::Task;
pub use status::{JobStatus, State};

/// The error for the number of a part that a job does not have.
fn no_part(kind: &str, number: u64, count: u64) -> Error {
    let parts = match count {
        0 => format!("has no {kind}s"),
        1 => format!("has only {kind} 0"),
        _ => format!("has {kind}s 0 to {}", count - 1),
    };
    Error::argument(format!("there is no {kind} {number}: this job {parts}"))
}
