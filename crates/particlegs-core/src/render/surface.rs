//! Surface density: mass along the line of sight for an area.

use super::depth::sum;
use super::lens::Lens;
use super::raster::clip;
use super::scene::Scene;
use super::scratch::Scratch;
use crate::Result;
use crate::camera::{CenteredCell, DensityView, Extent, Window, spherical_camera};
use crate::context::Context;
use crate::math::each_axis;
use crate::model::Mixture;
use crate::picture::{Plane, Size};
use crate::space::Cell;
use crate::splat::erf;
use std::borrow::Cow;

/// Mass a world unit squared at every pixel, averaged over the pixel:
/// `Sigma = sum m (f/z)^2 N2` in perspective, `sum m f^2 N2` in an orthographic view, whose periodic
/// images are drawn as the view says. Where a layer has no masses the result counts particles.
pub fn surface_density(scene: &Scene, view: &DensityView, size: Size, context: &Context<'_>) -> Result<Plane> {
    surface_density_by(scene, view, size, |scene, lens, size| {
        let lenses: Vec<Lens> = scene.shifts.iter().map(|shift| lens.shifted(*shift)).collect();
        let weight = |m: &Mixture, unit_mass, i| scene.weight(m, unit_mass, i);
        sum(scene, &lenses, size, weight, &mut Scratch::default(), context)?.to_plane(context)
    })
}

/// The same, where `sum` adds up the Gaussians of a scene as a lens sees them at each of its shifts, by their
/// [`Scene::weights`], and leaves the interpolation's undershoot.
pub fn surface_density_by(
    scene: &Scene,
    view: &DensityView,
    size: Size,
    sum: impl FnOnce(&Scene, &Lens, Size) -> Result<Plane>,
) -> Result<Plane> {
    let Some(centered) = view.centered_cell() else { return drawn(scene, view, size, sum) };
    let parts: Vec<Cow<'_, Mixture>> = scene.parts.iter().map(|(m, _)| moved(m, &centered)).collect();
    let parts = parts.iter().zip(&scene.parts).map(|(m, (_, mass))| (&**m, *mass)).collect();
    let scene = Scene { parts, shifts: scene.shifts.clone(), ..*scene };
    view.wrapped(
        size,
        |cell| all_tails(&scene, view.camera.focal_point, cell),
        |view, size| drawn(&scene, view, size, sum),
    )
}

/// Gaussians by their images in a cell; copied where one of them moves.
pub(super) fn moved<'a>(mixture: &'a Mixture, cell: &CenteredCell) -> Cow<'a, Mixture> {
    let mut moved = Cow::Borrowed(mixture);
    for i in 0..mixture.len() {
        let shift = cell.shift(mixture.mean_of(i));
        if shift != [0.0; 3] {
            let copy = moved.to_mut();
            (0..3).for_each(|k| copy.mean[k][i] += shift[k]);
        }
    }
    moved
}

fn drawn(
    scene: &Scene,
    view: &DensityView,
    size: Size,
    sum: impl FnOnce(&Scene, &Lens, Size) -> Result<Plane>,
) -> Result<Plane> {
    let copies = view.copies(size, &scene.bounds, reach(scene))?.into_iter();
    let shifts = copies.flat_map(|copy| scene.shifts.iter().map(move |s| each_axis(|k| copy[k] + s[k]))).collect();
    let scene = Scene { parts: scene.parts.clone(), shifts, ..*scene };
    let mut plane = sum(&scene, &Lens::density(view, size, [0.0; 3])?, size)?;
    let all = |plane: &Plane| -> f64 { plane.data.iter().map(|v| f64::from(*v)).sum() };
    let mass = all(&plane);
    clip(plane.rows());
    // Clipped undershoot adds mass, which is taken from all pixels alike.
    let share = (mass / all(&plane)).max(1.0 - MOST_CLIPPED) as f32;
    plane.rows().each(|_, row| row.iter_mut().for_each(|v| *v *= share));
    Ok(plane)
}

/// A window of little but undershoot loses no more than this share.
const MOST_CLIPPED: f64 = 1e-3;

/// Share of the mass that may lie beyond each pair of faces of a scene's extent.
const BEYOND: f64 = 1e-6;

/// The extent that a map of a scene shows whole: that of its particles; where that repeats, as long as the tails of
/// Gaussians that reach out of it want. An open scene has the window of its particles, so that both can be compared.
pub fn extent(scene: &Scene, cell: Option<&Cell>) -> Extent {
    let mut extent = Extent::new(&scene.bounds, cell);
    if extent.periodic == [false; 3] {
        return extent;
    }
    let whole = Cell { origin: [0.0; 3], vectors: extent.edges, periodic: [true; 3] };
    extent.tails = all_tails(scene, extent.center, &whole);
    extent
}

/// The map along z that shows a scene whole in a picture of `size`: each Gaussian once where the cell repeats.
///
/// # Errors
/// [`crate::Error::Argument`] for a scene without extent, or a size out of range.
pub fn whole_view(name: &str, scene: &Scene, cell: Option<Cell>, size: Size) -> Result<DensityView> {
    let extent = extent(scene, cell.as_ref());
    let width = extent.width(&spherical_camera([0.0; 3], 0.0, 0.0, 1.0).frame()?, size);
    let window = Window { center: extent.center, angles_deg: [0.0; 2], width, depth: None };
    DensityView::orthographic(name, &window, size, &scene.bounds, cell)
}

/// The length that tails add to each edge of a cell about `center`, over the edge.
pub(super) fn all_tails(scene: &Scene, center: [f64; 3], cell: &Cell) -> [f64; 3] {
    cell.inverse().map_or([0.0; 3], |inverse| each_axis(|a| tails(scene, center, each_axis(|k| inverse[k][a]))))
}

/// The length that tails add to an edge, over the edge, whose fractions are counted from `center` by `row`.
fn tails(scene: &Scene, center: [f64; 3], row: [f64; 3]) -> f64 {
    let (mut total, mut near) = (0.0, Vec::new());
    for (m, unit) in &scene.parts {
        for i in 0..m.len() {
            let (mean, mass) = (m.mean_of(i), unit * m.mass_of(i));
            let at = (0..3).map(|k| row[k] * (mean[k] - center[k])).sum::<f64>().abs();
            let along = m.cov_of(i).apply(row);
            let sigma = (0..3).map(|k| row[k] * along[k]).sum::<f64>().max(0.0).sqrt();
            total += mass;
            // A Gaussian that ends six deviations inside a face has 1e-9 of its mass beyond, far below `BEYOND`.
            if at + 6.0 * sigma > 0.5 {
                near.push((at, sigma.max(f64::MIN_POSITIVE), mass));
            }
        }
    }
    let beyond = |t: f64| -> f64 {
        let tail = |x: f64| 0.5 * (1.0 - erf(x * std::f64::consts::FRAC_1_SQRT_2));
        near.iter().map(|(at, sigma, m)| m * (tail((0.5 + t - at) / sigma) + tail((0.5 + t + at) / sigma))).sum()
    };
    // The mass beyond falls with t: doubling brackets the length, and 24 halvings give it to 6e-8 of that.
    let [mut low, mut high] = [0.0, 1.0];
    while beyond(high) > BEYOND * total && high < 1e6 {
        high *= 2.0;
    }
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        *(if beyond(middle) > BEYOND * total { &mut low } else { &mut high }) = middle;
    }
    // An edge becomes longer at both of its faces.
    2.0 * high
}

/// Five of the largest standard deviation: how far Gaussians reach beyond their means.
pub(super) fn reach(scene: &Scene) -> f64 {
    let largest = scene
        .parts
        .iter()
        .flat_map(|(m, _)| m.cov[0].iter().zip(&m.cov[3]).zip(&m.cov[5]).map(|((x, y), z)| x + y + z))
        .fold(0.0, f64::max);
    5.0 * largest.sqrt()
}
