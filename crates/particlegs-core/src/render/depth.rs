//! Optical depth, and the picture.

use super::alpha;
use super::bins::{Binner, Bins};
use super::canvas::Canvas;
use super::lens::Lens;
use super::project::{DepthMoments, InCamera, inverse_moments};
use super::pyramid::Level;
use super::scene::Scene;
use super::scratch;
use super::slices::{Fate, cut, fate};
use crate::Result;
use crate::camera::{Projection, View};
use crate::model::Mixture;
use crate::picture::{Gray8, Plane, Size};
use crate::progress::Progress;
use crate::splat::Look;
use rayon::prelude::*;

/// Gaussians projected in one step; fixed, so that sums do not depend on threads.
const RUN: usize = 4096;
/// Runs whose strokes wait together to be drawn ...
const MOST_RUNS: usize = 64;
/// ... and strokes of a run, about: they bound the memory where Gaussians fall into very many pieces.
const MOST_STROKES: usize = 1 << 18;

/// Optical depth a pixel: `tau = sum n W N2` (docs/law/depth.md), every Gaussian integrated
/// along depth. The growth of splats towards the corners is taken where they land.
///
/// Of a scene of the alpha-blend law, whose pictures are brightnesses b in [0, 1], it is the depth
/// that would look as bright: `-ln(1 - b)`.
///
/// # Errors
/// [`crate::Error::Argument`] where the view has a number outside its range, for an orthographic
/// view of the alpha-blend law, and where one of its Gaussians is not a number;
/// [`crate::Error::Memory`], [`crate::Error::Cancelled`].
pub fn optical_depth(scene: &Scene, view: &View, size: Size, progress: &dyn Progress) -> Result<Plane> {
    if let Some(blend) = &scene.blend {
        return alpha::optical_depth(blend, &scene.parts, view, size, progress);
    }
    let lens = Lens::optical(view, size, &scene.bounds)?;
    let mut plane = sum(scene, &[lens], size, |m, _, i| m.count[i], progress)?;
    if matches!(view.camera.projection, Projection::Perspective { .. }) {
        grow(&mut plane, &lens);
    }
    Ok(plane)
}

/// The picture of a scene in a look; a scene of the alpha-blend law has one look ([`Scene::tone`]).
///
/// # Errors
/// As [`optical_depth`].
pub fn draw(scene: &Scene, view: &View, size: Size, look: Look, progress: &dyn Progress) -> Result<Gray8> {
    let tau = optical_depth(scene, view, size, progress)?;
    let picture = scene.tone(&tau, look, view, size);
    scratch::give(tau.data);
    Ok(picture)
}

/// VTK's splats widen towards the edges by sqrt(1 + x^2/z^2) and sqrt(1 + y^2/z^2): constant for a
/// pixel, so applied to the sum.
pub fn grow(plane: &mut Plane, lens: &Lens) {
    let factor = |i: usize, center: f64| {
        let t = (i as f64 - center) / lens.focal;
        (1.0 + t * t).sqrt() as f32
    };
    let across: Vec<f32> = (0..plane.size.width).map(|i| factor(i, lens.center[0])).collect();
    plane.data.par_chunks_mut(plane.size.width).enumerate().for_each(|(j, row)| {
        let down = factor(j, lens.center[1]);
        for (v, a) in row.iter_mut().zip(&across) {
            *v *= a * down;
        }
    });
}

/// Sum over all Gaussians and lenses of weight times the footprint. `weight` gets the mixture, the
/// mass of a particle of weight 1 in it, and the Gaussian.
pub(super) fn sum(
    scene: &Scene,
    lenses: &[Lens],
    size: Size,
    weight: impl Fn(&Mixture, f64, usize) -> f64 + Sync,
    progress: &dyn Progress,
) -> Result<Plane> {
    let mut canvas = Canvas::new(size)?;
    let mut runs: Vec<Run<'_>> = scene
        .parts
        .iter()
        .flat_map(|&(m, unit_mass)| (0..m.len()).step_by(RUN).map(move |start| Run { m, unit_mass, start }))
        .collect();
    runs.reverse();
    let mut group = MOST_RUNS;
    while !runs.is_empty() {
        let from = runs.len().saturating_sub(group);
        let projected = runs[from..]
            .par_iter()
            .rev()
            .map(|run| {
                progress.check()?;
                let end = run.m.len().min((run.start / RUN + 1) * RUN);
                let weight = |m: &Mixture, i| weight(m, run.unit_mass, i);
                Ok(project_run(run.m, run.start..end, lenses, &canvas.levels, &weight))
            })
            .collect::<Result<Vec<(Bins, usize)>>>()?;
        // Strokes are drawn in the order of their Gaussians: what comes after a run that was too much at
        // once waits, and is projected again.
        let (mut drawn, mut bins) = (0, Vec::with_capacity(projected.len()));
        for (own, left) in projected {
            bins.push(own);
            match left {
                0 => drawn += 1,
                left => {
                    let at = runs.len() - 1 - drawn;
                    let end = runs[at].m.len().min((runs[at].start / RUN + 1) * RUN);
                    runs[at].start = end - left;
                    break;
                }
            }
        }
        let whole = drawn == runs.len() - from;
        group = if whole { (2 * group).min(MOST_RUNS) } else { group.div_ceil(2) };
        runs.truncate(runs.len() - drawn);
        canvas.draw(&bins, progress)?;
    }
    canvas.finish()
}

/// Gaussians to be projected in one step: from `start` to the next multiple of [`RUN`].
struct Run<'a> {
    m: &'a Mixture,
    unit_mass: f64,
    start: usize,
}

/// Draws all strokes and sums the planes.
pub fn paint(size: Size, bins: &[Bins], progress: &dyn Progress) -> Result<Plane> {
    let mut canvas = Canvas::new(size)?;
    canvas.draw(bins, progress)?;
    canvas.finish()
}

/// Projects a run of Gaussians to strokes; stops where they are too many to be kept. Says how many
/// Gaussians are left.
fn project_run(
    m: &Mixture,
    range: std::ops::Range<usize>,
    lenses: &[Lens],
    levels: &[Level],
    weight: &(impl Fn(&Mixture, usize) -> f64 + Sync),
) -> (Bins, usize) {
    let mut binner = Binner::new(levels, range.len() + range.len() / 4);
    for i in range.clone() {
        if binner.len() > MOST_STROKES {
            return (binner.finish(), range.end - i);
        }
        let weight = weight(m, i);
        if weight > 0.0 {
            for lens in lenses {
                project(&in_camera(m, i, lens, weight), lens, &mut binner);
            }
        }
    }
    (binner.finish(), 0)
}

/// Projects one Gaussian.
#[inline]
fn project(g: &InCamera, lens: &Lens, binner: &mut Binner) {
    let (depth, variance) = (g.mean[2], g.cov[5]);
    match fate(lens, depth, variance) {
        Fate::Outside => {}
        Fate::Cut if lens.misses(g) => {}
        Fate::Whole if lens.perspective => {
            binner.add(&g.footprint(lens, &g.regression(), &inverse_moments(depth, variance / (depth * depth))));
        }
        Fate::Whole => {
            let moments = DepthMoments { weight: 1.0, mean: depth, square: 0.0, variance };
            binner.add(&g.footprint(lens, &g.regression(), &moments));
        }
        Fate::Cut => cut(lens, g, |f| binner.add(&f)),
    }
}

/// A Gaussian in the camera's axes.
pub fn in_camera(m: &Mixture, i: usize, lens: &Lens, weight: f64) -> InCamera {
    let a = &lens.axes;
    let v: [f64; 3] = std::array::from_fn(|k| m.mean[k][i] - lens.position[k]);
    let mean = a.map(|a| a[0] * v[0] + a[1] * v[1] + a[2] * v[2]);
    let s = m.cov_of(i);
    let rows = a.map(|r| s.apply(r));
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    InCamera {
        mean,
        cov: [
            dot(a[0], rows[0]),
            dot(a[0], rows[1]),
            dot(a[0], rows[2]),
            dot(a[1], rows[1]),
            dot(a[1], rows[2]),
            dot(a[2], rows[2]),
        ],
        weight,
    }
}
