//! The alpha-blend law: 3-D Gaussian splatting as published (Kerbl et al. 2023; paper section III),
//! grey, on the CPU.
//!
//! Everything happens in the training frame ([`crate::camera::Normalisation`]). `adapt` takes a scene's Gaussians there,
//! bends their scales and opacities for the view's radius and opacity ([`network`]), and hands them over relative to the eye
//! ([`project::GreyCameraGaussian`]). [`project`] puts each on the picture ([`project::ProjectedSplat`]); a [`Plan`] holds all
//! that are seen ([`project::Splat`]), sorted by depth, in bins of 16 x 16 pixels; [`raster`] blends each tile front to back.
//! Training walks the same plan again for its gradients.

mod adapt;
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
pub use plan::{Bin, CutOffs, Plan, TILE, TileRange, Tiles};
pub use project::{Eye, Gaussian};

use self::raster::blend_into;
use super::Scratch;
use crate::Result;
use crate::camera::View;
use crate::context::Context;
use crate::model::Mixture;
use crate::picture::{PlaneRows, Size};

/// Largest brightness that a depth is given for.
pub const BRIGHTEST: f32 = 0.999_999;

/// The optical depth that is as bright as `brightness`, cut to [0, [`BRIGHTEST`]]: -ln(1 - b).
pub fn depth_as_bright(brightness: f32) -> f32 {
    -libm::log1pf(-brightness.clamp(0.0, BRIGHTEST))
}

/// The optical depth that a picture's brightness b, cut to [0, 1], stands for: -ln(1 - b).
pub(super) fn optical_depth<'a>(
    blend: &Blend<'_>,
    parts: &[(&Mixture, f64)],
    view: &View,
    size: Size,
    scratch: &'a mut Scratch,
    context: &Context<'_>,
) -> Result<PlaneRows<'a>> {
    let eye = Eye::new(view, size, &blend.frame)?;
    let n: usize = parts.iter().map(|(m, _)| m.len()).sum();
    context.require_memory("a picture", 4 * size.pixels() as u64 + 256 * n as u64)?;
    let gaussians = blend.gaussians(parts, view, &eye, context)?;
    let plan = Plan::new(&eye, n, |i| Some(gaussians[i]), CutOffs::PUBLISHED, context)?;
    let data = &mut scratch.planes([size.pixels()].into_iter(), context)?[0];
    blend_into(&plan, size, data, context)?;
    let mut rows = PlaneRows { size, stride: size.width, data };
    rows.each(|_, row| row.iter_mut().for_each(|b| *b = depth_as_bright(*b)));
    Ok(rows)
}
