//! A scene of the alpha-blend law as a picture.

use super::adapt::Blend;
use super::eye::Eye;
use super::plan::{CutOffs, Plan};
use super::raster::blend_into;
use crate::Result;
use crate::camera::View;
use crate::context::Context;
use crate::model::Mixture;
use crate::picture::{PlaneRows, Size};
use crate::render::Scratch;

/// Largest brightness that a depth is given for.
pub const BRIGHTEST: f32 = 0.999_999;

/// The optical depth that is as bright as `brightness`, cut to [0, [`BRIGHTEST`]]: -ln(1 - b).
pub fn depth_as_bright(brightness: f32) -> f32 {
    -libm::log1pf(-brightness.clamp(0.0, BRIGHTEST))
}

/// The optical depth that a picture's brightness b, cut to [0, 1], stands for: -ln(1 - b).
pub(in crate::render) fn optical_depth<'a>(
    blend: &Blend,
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
