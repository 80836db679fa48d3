//! Floor 3: a mixture becomes a picture, by default under the optical-depth law
//! (docs/law/depth.md).
//!
//! A [`Scene`] borrows the Gaussians, a `lens` is the camera. A picture goes through stages, each from one column
//! of plain `repr(C)` f32 to the next, as a GPU twin would read and write them:
//!
//! | stage | reads | writes |
//! |---|---|---|
//! | [`project`] | [`project::CameraGaussian`]: relative to the eye, in its axes | [`project::Footprint`]: position and 2-D covariance on the picture |
//! | [`bin`] | footprints | [`bin::RasterSplat`]s, sorted by the plane that suits their sharpness and the bands of rows that they touch |
//! | [`raster`] | strokes | planes of optical depth, drawn over all cores and summed from coarse to fine |
//! | [`tone`](tone()) | the sum | grey levels by a look's curve |
//!
//! Gaussians that the camera stands in, that cross the clipping range or that reach far in depth are cut along
//! depth first ([`project::slices`]). Differences of large numbers (positions from the eye, what long
//! Gaussians leave of their width) are found in f64 within a stage, and handed over where rounding no longer
//! hurts. The same machinery with masses instead of counts gives the surface density. Maps of a field (`field_map`) are
//! summed in f64 at full resolution, as quotients of sums would show what planes of halved resolution ripple.
//!
//! Models of the alpha-blend law are drawn by [`alpha`], behind the same calls and in the same stages.

pub mod alpha;
pub mod bin;
pub mod depth;
mod depth_cut;
mod field_map;
mod field_query;
pub mod lens;
pub mod project;
pub mod raster;
mod renderer;
mod scene;
mod scratch;
mod surface;
mod tone;
mod weight_footprint;

#[cfg(any(test, feature = "twins"))]
#[allow(clippy::disallowed_methods)]
pub mod plain;
#[cfg(any(test, feature = "twins"))]
pub mod testing;
#[cfg(test)]
mod tests;

pub use depth::{draw, draw_into, optical_depth, optical_depth_into};
pub use field_map::{FieldMap, field_map};
pub use field_query::{FieldQuery, FieldWeight, MapComponent, first_means, mean_vector};
pub use renderer::Renderer;
pub use scene::Scene;
pub use scratch::Scratch;
pub use surface::{extent, surface_density, whole_view};
pub use tone::{Tones, tone};
