//! The strokes that the GPU adds up: the same as in the CPU renderer, sorted by plane
//! ([`particlegs_core::render::bin::place`]).

use crate::question::EngineResponse;
use particlegs_core::Result;
use particlegs_core::model::{Mixture, Model};
use particlegs_core::picture::Size;
use particlegs_core::render::bin::{RasterSplat, place};
use particlegs_core::render::lens::Lens;
use particlegs_core::render::project::{CameraGaussian, project};
use particlegs_core::render::raster::pyramid::{Level, PAD, levels};
use serde::Serialize;

/// Number of Gaussians processed together.
const BLOCK: usize = 64;

/// Parameters of the GPU renderer besides the strokes.
#[derive(Serialize)]
struct StrokePlanes {
    /// Margin of a plane at each edge, pixels.
    pad: usize,
    /// Pixels per unit of x/depth, and the pixel of the optical axis: splats widen away from it in perspective.
    focal: f64,
    center: [f64; 2],
    perspective: bool,
    /// Finest first.
    planes: Vec<PlaneLayout>,
}

#[derive(Serialize)]
struct PlaneLayout {
    width: usize,
    height: usize,
    first: usize,
    count: usize,
}

/// The strokes of the shown layers through `lenses`, one per image of the box; `mass` adds masses instead of counts.
pub(crate) fn strokes(
    model: &Model,
    shown: impl Fn(usize) -> bool,
    lenses: &[Lens],
    size: Size,
    mass: bool,
) -> Result<EngineResponse> {
    // As pictures have it, which count particles where a layer has no masses.
    let by_mass = mass && model.has_masses();
    let levels = levels(size);
    let mut by_level: Vec<Vec<RasterSplat>> = levels.iter().map(|_| Vec::new()).collect();
    for (_, layer) in model.layers.iter().enumerate().filter(|(place, _)| shown(*place)) {
        let unit = layer.mass.unit_or_one();
        for block in &layer.content {
            let weight = |m: &Mixture, i| if by_mass { unit * m.mass_of(i) } else { m.count[i] };
            for lens in lenses {
                add(&block.gaussians, lens, &weight, &levels, &mut by_level);
            }
        }
    }
    let mut first = 0;
    let planes = levels.iter().zip(&by_level).map(|(level, splats)| {
        let plane = PlaneLayout { width: level.size.width, height: level.size.height, first, count: splats.len() };
        first += splats.len();
        plane
    });
    let planes: Vec<PlaneLayout> = planes.collect();
    let lens = &lenses[0];
    let about =
        StrokePlanes { pad: PAD, focal: lens.focal, center: lens.center, perspective: lens.perspective, planes };
    let mut numbers = Vec::with_capacity(32 * first);
    for s in by_level.iter().flatten() {
        for v in [s.x, s.y, s.slope, s.along, s.down, s.end, s.peak, s.half] {
            numbers.extend(v.to_le_bytes());
        }
    }
    EngineResponse::with(&about, numbers)
}

fn add(
    m: &Mixture,
    lens: &Lens,
    weight: &impl Fn(&Mixture, usize) -> f64,
    levels: &[Level],
    by_level: &mut [Vec<RasterSplat>],
) {
    let (mut gaussians, mut footprints) = (Vec::with_capacity(BLOCK), Vec::with_capacity(BLOCK));
    for start in (0..m.len()).step_by(BLOCK) {
        gaussians.clear();
        footprints.clear();
        let block = start..m.len().min(start + BLOCK);
        let seen = block.map(|i| (i, weight(m, i))).filter(|(_, w)| *w > 0.0);
        gaussians.extend(seen.filter_map(|(i, w)| CameraGaussian::from_mixture(lens, m, i, w)));
        project(lens, &gaussians, &mut footprints);
        for placed in footprints.iter().filter_map(|f| place(levels, f)) {
            by_level[placed.level].push(placed.stroke);
        }
    }
}
