//! The alpha-blend law: 3-D Gaussian splatting as published (Kerbl et al. 2023; paper section III),
//! grey, on the CPU.
//!
//! Everything happens in the training frame ([`crate::camera::Normalisation`]). [`adapt`] takes a
//! scene's Gaussians there and bends their scales and opacities for the view's radius and opacity.
//! [`project`] puts one on the picture; a [`Plan`] holds all that are seen, sorted by depth, in bins
//! of 16 x 16 pixels; [`raster`] blends each tile front to back. Training walks the same plan again
//! for its gradients.

mod adapt;
mod bins;
mod draw;
mod eye;
mod plan;
pub(crate) mod project;
pub(crate) mod raster;

#[cfg(test)]
pub(crate) mod plain;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

pub(super) use adapt::Blend;
pub(crate) use bins::TILE;
pub(super) use draw::optical_depth;
pub(crate) use eye::Eye;
pub(crate) use plan::{CutOffs, Plan};
pub(crate) use project::Gaussian;
