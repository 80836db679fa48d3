//! Floor 0: where particles and Gaussians lie: bounds, and cells that may repeat.

mod bounds;
mod cell;

pub use bounds::Bounds;
pub use cell::{Cell, PeriodicCell};
