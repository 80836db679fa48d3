//! Floor 0: where particles and Gaussians lie: bounds, and cells that may repeat.

mod bounds;
mod cell;
mod periodic_cell;

pub use bounds::Bounds;
pub use cell::Cell;
pub use periodic_cell::PeriodicCell;
