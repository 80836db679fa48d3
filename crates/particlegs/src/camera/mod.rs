//! Floor 1: cameras, views and the files that hold them, the published orbits.

mod density_view;
mod normalisation;
mod orbit;
mod view;
mod views_file;

pub use density_view::DensityView;
pub use normalisation::Normalisation;
pub use orbit::{FOV_DEG, ORBITS, Orbit, base_distance, clipping_range, spherical_camera, spiral, view_up};
pub use view::{Camera, Frame, Projection, View, ViewSet};
pub use views_file::{read_views, views_text};
