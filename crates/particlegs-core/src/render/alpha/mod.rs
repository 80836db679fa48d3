//! The alpha-blend law: 3-D Gaussian splatting as published (Kerbl et al. 2023; paper section III),
//! grey, on the CPU.
//!
//! Everything happens in the training frame ([`crate::camera::Normalisation`]). `adapt` takes a scene's Gaussians there,
//! bends their scales and opacities for the view's radius and opacity ([`network`]), and hands them over relative to the eye
//! ([`project::GreyCameraGaussian`]). [`project`] puts each on the picture ([`project::ProjectedSplat`]); a [`Plan`] holds all
//! that are seen ([`project::Splat`]), sorted by depth, in bins of 16 x 16 pixels; [`raster`] blends each tile front to back.
//! Training walks the same plan again for its gradients.

mod adapt;
mod bin;
mod draw;
mod eye;
pub mod network;
mod plan;
pub mod project;
pub mod raster;

#[cfg(any(test, feature = "twins"))]
#[allow(clippy::disallowed_methods)]
pub mod plain;
#[cfg(test)]
mod tests;

pub use adapt::{Blend, UnadaptedGaussian};
pub use bin::{Bin, TILE, TileRange, Tiles};
pub(super) use draw::optical_depth;
pub use draw::{BRIGHTEST, depth_as_bright};
pub use eye::Eye;
pub use plan::{CutOffs, Plan};
pub use project::Gaussian;
