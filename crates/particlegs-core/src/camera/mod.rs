//! Floor 1: cameras, views, the published orbits.

mod density_view;
mod extent;
mod normalisation;
mod orbit;
mod view;

pub use density_view::{DensityView, Images, Window};
pub use extent::{CenteredCell, Extent};
pub use normalisation::Normalisation;
pub use orbit::{FOV_DEG, ORBITS, Orbit, base_distance, clipping_range, spherical_camera, spiral, view_up};
pub use view::{Camera, Frame, Projection, View, ViewSet};
