//! Floor 1: cameras, views and the files that hold them, the published orbits.

mod views_file;

pub use particlegs_core::camera::*;
pub use views_file::ViewsFile;
