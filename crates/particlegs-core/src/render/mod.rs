//! Floor 3: a mixture becomes a picture, by default under the optical-depth law
//! (docs/law/depth.md).
//!
//! A [`Scene`] borrows the Gaussians. A `lens` puts each on the picture plane: position, the
//! moments of its inverse depth, and a 2-D covariance; Gaussians that the camera stands in, that
//! cross the clipping range or that reach far in depth are cut along depth first (`slices`).
//! Footprints go to the `pyramid` level that suits their sharpness and to the bands of rows that
//! they touch (`bins`), bands are drawn over all cores (`canvas`, `raster`), and the levels are summed
//! from coarse to fine. The sum is the optical depth; [`draw`] passes it through a look's curve.
//! The same machinery with masses instead of counts gives the surface density.
//!
//! Models of the alpha-blend law are drawn by `alpha`, behind the same calls.

pub mod alpha;
pub mod bins;
mod canvas;
pub mod depth;
pub mod lens;
pub mod project;
pub mod pyramid;
pub mod raster;
mod scene;
mod scratch;
pub mod slices;
mod surface;

#[cfg(test)]
mod plain;
#[cfg(test)]
mod tests;

pub use depth::{draw, optical_depth};
pub use scene::Scene;
pub use surface::surface_density;
