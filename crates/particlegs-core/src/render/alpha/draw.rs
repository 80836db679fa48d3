//! A scene of the alpha-blend law as a picture.

use super::adapt::Blend;
use super::eye::Eye;
use super::plan::{CutOffs, Plan};
use super::raster::blend;
use crate::camera::View;
use crate::model::Mixture;
use crate::picture::{Plane, Size};
use crate::progress::Progress;
use crate::{Result, memory};

/// Largest brightness that a depth is given for.
const BRIGHTEST: f32 = 0.999_999;

/// The optical depth that a picture's brightness b, cut to [0, 1], stands for: -ln(1 - b).
pub(in crate::render) fn optical_depth(
    of: &Blend,
    parts: &[(&Mixture, f64)],
    view: &View,
    size: Size,
    progress: &dyn Progress,
) -> Result<Plane> {
    let eye = Eye::new(view, size, &of.frame)?;
    let n: usize = parts.iter().map(|(m, _)| m.len()).sum();
    memory::require("a picture", 4 * size.pixels() as u64 + 256 * n as u64)?;
    let gaussians = of.gaussians(parts, view)?;
    let plan = Plan::new(&eye, n, |i| Some(gaussians[i]), CutOffs::PUBLISHED, progress)?;
    let mut plane = blend(&plan, size, progress)?;
    plane.data.iter_mut().for_each(|b| *b = -libm::log1pf(-b.clamp(0.0, BRIGHTEST)));
    Ok(plane)
}
