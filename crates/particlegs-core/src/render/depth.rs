//! Optical depth, and the picture.

use super::alpha;
use super::bin::{Binner, StrokeBins};
use super::lens::Lens;
use super::project::{BLOCK, CameraGaussian, FootprintBlock, GaussianBlock, project};
use super::raster::pyramid::{Level, W};
use super::raster::{RasterCanvas, clip};
use super::scene::Scene;
use super::scratch::Scratch;
use super::tone::Tones;
use crate::camera::{Projection, View};
use crate::context::Context;
use crate::memory::filled;
use crate::model::Mixture;
use crate::picture::{Gray8, Pixels, Plane, PlaneRows, Size};
use crate::splat::ToneStyle;
use crate::{Result, parallel};
use fearless_simd::Level as SimdLevel;

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
pub fn optical_depth(scene: &Scene, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
    depth(scene, view, size, &mut Scratch::default(), context)?.to_plane(context)
}

/// [`optical_depth`] into a buffer of the caller's.
pub fn optical_depth_into(
    scene: &Scene,
    view: &View,
    out: Pixels<'_, f32>,
    scratch: &mut Scratch,
    context: &Context<'_>,
) -> Result<()> {
    depth(scene, view, out.size(), scratch, context)?.copy_to(out.into_data());
    Ok(())
}

/// The picture of a scene in a look; a scene of the alpha-blend law has one look ([`Scene::tone`]).
pub fn draw(scene: &Scene, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
    let mut scratch = Scratch::default();
    let tau = depth(scene, view, size, &mut scratch, context)?;
    let mut out = Gray8 { size, data: filled("a picture", 0, size.pixels(), context)? };
    Tones::new(view.opacity, view.radius_pixels(size)).rows(tau, scene.look(style), &mut out.data);
    Ok(out)
}

/// [`draw`] into a buffer of the caller's: `out` becomes 8-bit levels. With the same `scratch` from picture to
/// picture no large memory is taken anew.
pub fn draw_into(
    scene: &Scene,
    view: &View,
    style: ToneStyle,
    out: Pixels<'_, u8>,
    scratch: &mut Scratch,
    context: &Context<'_>,
) -> Result<()> {
    let size = out.size();
    let tones = scratch.tones(view.opacity, view.radius_pixels(size));
    let tau = depth(scene, view, size, scratch, context)?;
    tones.rows(tau, scene.look(style), out.into_data());
    Ok(())
}

/// The depth of every pixel, where it was summed.
fn depth<'a>(
    scene: &Scene,
    view: &View,
    size: Size,
    scratch: &'a mut Scratch,
    context: &Context<'_>,
) -> Result<PlaneRows<'a>> {
    if let Some(blend) = &scene.blend {
        return alpha::optical_depth(blend, &scene.parts, view, size, scratch, context);
    }
    let lens = Lens::optical(view, size, &scene.bounds)?;
    let lenses: Vec<Lens> = scene.shifts.iter().map(|shift| lens.shifted(*shift)).collect();
    let mut rows = clip(sum(scene, &lenses, size, |m, _, i| m.count[i], scratch, context)?);
    if matches!(view.camera.projection, Projection::Perspective { .. }) {
        grow_rows(&mut rows, &lens);
    }
    Ok(rows)
}

/// VTK's splats widen towards the edges by sqrt(1 + x^2/z^2) and sqrt(1 + y^2/z^2): constant for a
/// pixel, so applied to the sum.
pub fn grow(plane: &mut Plane, lens: &Lens) {
    grow_rows(&mut plane.rows(), lens);
}

fn grow_rows(rows: &mut PlaneRows<'_>, lens: &Lens) {
    let factor = |i: usize, center: f64| {
        let t = (i as f64 - center) / lens.focal;
        (1.0 + t * t).sqrt() as f32
    };
    let across: Vec<f32> = (0..rows.size.width).map(|i| factor(i, lens.center[0])).collect();
    rows.each(|j, row| {
        let down = factor(j, lens.center[1]);
        for (v, a) in row.iter_mut().zip(&across) {
            *v *= a * down;
        }
    });
}

/// Sum over all Gaussians and lenses of weight times the footprint. `weight` gets the mixture, the
/// mass of a particle of weight 1 in it, and the Gaussian. Undershoot is not clipped yet.
pub(super) fn sum<'a>(
    scene: &Scene,
    lenses: &[Lens],
    size: Size,
    weight: impl Fn(&Mixture, f64, usize) -> f64 + Sync,
    scratch: &'a mut Scratch,
    context: &Context<'_>,
) -> Result<PlaneRows<'a>> {
    let mut canvas = RasterCanvas::new(size, 1, scratch, context)?;
    let mut runs: Vec<GaussianRun<'_>> = scene
        .parts
        .iter()
        .flat_map(|&(m, unit_mass)| (0..m.len()).step_by(RUN).map(move |start| GaussianRun { m, unit_mass, start }))
        .collect();
    // Taken from the end as they are done: the rest need not move.
    runs.reverse();
    let mut group = MOST_RUNS;
    while !runs.is_empty() {
        let from = runs.len().saturating_sub(group);
        let projected = parallel::map_range(runs.len() - from, |k| {
            context.check()?;
            let run = &runs[runs.len() - 1 - k];
            let weight = |i| weight(run.m, run.unit_mass, i);
            Ok(project_run(run, lenses, &canvas.levels, weight, context.simd()))
        });
        // Strokes are drawn in the order of their Gaussians: what comes after a run that was too much at
        // once waits, and is projected again.
        let (mut drawn, mut bins) = (0, Vec::with_capacity(projected.len()));
        for run in projected {
            let (run_bins, left): (StrokeBins, usize) = run?;
            bins.push(run_bins);
            match left {
                0 => drawn += 1,
                left => {
                    let at = runs.len() - 1 - drawn;
                    runs[at].start = runs[at].end() - left;
                    break;
                }
            }
        }
        // After a group that was too much fewer runs go together, after a whole one more of them again.
        let whole = drawn == runs.len() - from;
        group = if whole { (2 * group).min(MOST_RUNS) } else { group.div_ceil(2) };
        runs.truncate(runs.len() - drawn);
        canvas.draw(&bins, context)?;
    }
    Ok(canvas.finish(&W, context))
}

/// Gaussians to be projected in one step: from `start` to the next multiple of [`RUN`].
struct GaussianRun<'a> {
    m: &'a Mixture,
    unit_mass: f64,
    start: usize,
}

impl GaussianRun<'_> {
    fn end(&self) -> usize {
        self.m.len().min((self.start / RUN + 1) * RUN)
    }
}

/// Draws all strokes and sums the planes.
pub fn paint(size: Size, bins: &[StrokeBins], scratch: &mut Scratch, context: &Context<'_>) -> Result<Plane> {
    let mut canvas = RasterCanvas::new(size, 1, scratch, context)?;
    canvas.draw(bins, context)?;
    clip(canvas.finish(&W, context)).to_plane(context)
}

/// Projects a run of Gaussians to strokes; stops where they are too many to be kept. Says how many
/// Gaussians are left.
fn project_run(
    run: &GaussianRun<'_>,
    lenses: &[Lens],
    levels: &[Level],
    weight: impl Fn(usize) -> f64,
    simd: SimdLevel,
) -> (StrokeBins, usize) {
    let (m, range) = (run.m, run.start..run.end());
    let mut binner = Binner::new(levels, range.len() + range.len() / 4);
    let (mut gaussians, mut footprints, mut slices) = (GaussianBlock::EMPTY, FootprintBlock::EMPTY, Vec::new());
    for start in range.clone().step_by(BLOCK) {
        if binner.strokes() > MOST_STROKES {
            return (binner.finish(), range.end - start);
        }
        let numbers = start..range.end.min(start + BLOCK);
        gaussians.read(m, numbers.clone(), &weight);
        for lens in lenses {
            fearless_simd::dispatch!(simd, simd => footprints.project(simd, lens, &gaussians));
            for (k, i) in numbers.clone().enumerate().filter(|(k, _)| gaussians.weight[*k] > 0.0) {
                if footprints.is_whole[k] {
                    binner.add_whole(&footprints, k);
                } else if let Some(g) = CameraGaussian::from_mixture(lens, m, i, gaussians.weight[k]) {
                    slices.clear();
                    project(lens, &[g], &mut slices);
                    binner.add(&slices);
                }
            }
        }
    }
    (binner.finish(), 0)
}
