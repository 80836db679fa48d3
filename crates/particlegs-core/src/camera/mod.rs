//! Floor 1: cameras, views, the published orbits.

mod density_view;
mod extent;
mod orbit;
mod path;
mod rotation;
mod view;

pub use density_view::{DensityView, Images, Window};
pub use extent::{CenteredCell, Extent, WindowContent};
pub use orbit::{FOV_DEG, Normalisation, ORBITS, Orbit, base_distance, clipping_range, spherical_camera, spiral};
pub use path::{frame_digits, frame_number, path_through};
pub use view::{Camera, CameraRecord, Frame, Projection, View, ViewSet};
