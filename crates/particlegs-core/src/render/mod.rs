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
//! Gaussians in one piece go through `project` and most of `bin` a block at a time, so that the compiler makes vectors of
//! the same functions that take others one by one.
//!
//! Gaussians that the camera stands in, that cross the clipping range or that reach far in depth are cut along
//! depth first ([`project::slices`]). Differences of large numbers (positions from the eye, what long
//! Gaussians leave of their width) are found in f64 within a stage, and handed over where rounding no longer
//! hurts. The same machinery with masses instead of counts gives the surface density. Maps of a field (`field_map`) are
//! quotients of such sums, by `field_strokes`; only wider footprints go to planes of halved resolution there, as quotients
//! would show their ripples.
//!
//! Models of the alpha-blend law are drawn by [`alpha`], behind the same calls and in the same stages.

pub mod alpha;
pub mod bin;
pub mod depth;
mod field_map;
mod field_query;
mod field_strokes;
pub mod lens;
mod pixel_moments;
pub mod project;
pub mod raster;
mod scene;
mod scratch;
mod surface;
mod tone;

#[cfg(any(test, feature = "twins"))]
#[allow(clippy::disallowed_methods)]
pub mod plain;
#[cfg(test)]
mod tests;

pub use depth::{draw, draw_into, optical_depth, optical_depth_into};
pub use field_map::{FieldMap, field_map, field_map_by};
pub use field_query::{FieldQuery, FieldWeight, MapComponent, first_means, mean_vector};
pub use field_strokes::{FieldSplat, FieldStroke, FieldTerms, SumKind};
pub use scene::{Renderer, Scene, SceneRenderer};
pub use scratch::Scratch;
pub use surface::{extent, surface_density, surface_density_by, whole_view};
pub use tone::{Tones, tone};

/// Views and models for tests.
#[cfg(any(test, feature = "twins"))]
pub mod testing {
    use crate::camera::{Camera, Projection, View};
    use crate::model::{LawKind, Metadata, Model};
    use crate::space::Bounds;

    /// A camera of 30 degrees that looks at the origin.
    pub fn view(position: [f64; 3], radius: f64, opacity: f64) -> View {
        let projection = Projection::Perspective { fov_deg: 30.0 };
        let camera =
            Camera { position, focal_point: [0.0; 3], view_up: [0.0, 1.0, 0.0], projection, clipping_range: None };
        View { name: "v".into(), camera, radius, opacity }
    }

    /// A model of the alpha-blend law without layers.
    pub fn empty_model(bounds: Bounds, count: u64) -> Model {
        let metadata = Metadata { default_radius: 0.02, ..Metadata::new(LawKind::AlphaBlend, count, bounds) };
        Model { metadata, layers: Vec::new(), certificate: None }
    }
}
