//! Floor 3: particles to mixture, without gradients.
//!
//! A [`Store`] is the snapshot copied once, free to be reordered. [`partition`] cuts it into cells
//! whose particles lie side by side, best cut first, and sums each cell's [`Moments`]: one
//! Gaussian a cell. The geometry counts particles, as ParaView draws them; masses are carried
//! along.

mod cut;
mod gain;
mod moments;
mod partition;
mod select;
mod store;

pub use gain::Blur;
pub use moments::Moments;
pub use partition::{Partition, PartitionOptions, partition};
pub use store::Store;
