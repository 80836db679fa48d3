//! A snapshot in blocks, each fitted on its own.
//!
//! A [`KdTree`] of balanced cuts says which block a position belongs to; it is made from a sample
//! that is spread evenly over the snapshot, which a [`SnapshotScan`] takes in its one pass, so that whatever the
//! number of particles the same few megabytes are held.

mod divide;
mod scan;
mod tree;

pub use divide::divide;
pub use scan::{PositionSample, RunScan, SnapshotScan};
pub use tree::KdTree;
