//! Floor 4: a snapshot in blocks, each fitted on its own.
//!
//! A [`KdTree`] of balanced cuts says which block a position belongs to; it is made from a sample
//! that is spread evenly over the snapshot ([`sample`]), so that any reader is passed over once and
//! whatever the number of particles the same few megabytes are held.

mod divide;
mod sample;
mod survey;
mod tree;

pub use divide::divide;
pub use sample::{Sample, sample};
pub use survey::{RunSurvey, Survey};
pub use tree::KdTree;
