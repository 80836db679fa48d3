//! Surface density: mass along the line of sight for an area.

use super::depth::sum;
use super::lens::Lens;
use super::scene::Scene;
use super::scratch::Scratch;
use crate::Result;
use crate::camera::DensityView;
use crate::math::each_axis;
use crate::model::Mixture;
use crate::picture::{Plane, Size};
use crate::progress::Progress;

/// Mass a world unit squared at every pixel, averaged over the pixel:
/// `Sigma = sum m (f/z)^2 N2` in perspective, `sum m f^2 N2` in an orthographic view, whose periodic
/// copies are drawn where the view wraps. Where no mass is known the result counts particles.
///
/// # Errors
/// [`crate::Error::Argument`] for a window of thousands of boxes, [`crate::Error::Cancelled`].
pub fn surface_density(scene: &Scene, view: &DensityView, size: Size, progress: &dyn Progress) -> Result<Plane> {
    let lenses = view
        .copies(size, &scene.bounds, reach(scene))?
        .into_iter()
        .flat_map(|own| scene.shifts.iter().map(move |s| each_axis(|k| own[k] + s[k])))
        .map(|shift| Lens::density(view, size, shift))
        .collect::<Result<Vec<_>>>()?;
    let mut scratch = Scratch::default();
    let weight = |m: &Mixture, unit_mass, i| unit_mass * m.mass_of(i);
    sum(scene, &lenses, size, weight, &mut scratch, progress)?.to_plane(progress)
}

/// Five of the largest standard deviation: how far Gaussians reach beyond their means.
fn reach(scene: &Scene) -> f64 {
    let largest = scene
        .parts
        .iter()
        .flat_map(|(m, _)| m.cov[0].iter().zip(&m.cov[3]).zip(&m.cov[5]).map(|((x, y), z)| x + y + z))
        .fold(0.0, f64::max);
    5.0 * largest.sqrt()
}
