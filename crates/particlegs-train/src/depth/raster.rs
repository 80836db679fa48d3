//! Optical depth of a mixture, and its gradient.

use super::adjoint::{GaussianGradient, PieceDepth};
use super::gather::{gather, of_footprint};
use crate::Crop;
use particlegs_core::camera::View;
use particlegs_core::context::{Context, Level as SimdLevel};
use particlegs_core::model::Mixture;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::render::Scratch;
use particlegs_core::render::bin::{Binner, PlacedFootprint, StrokeBins, place};
use particlegs_core::render::depth::{grow, paint};
use particlegs_core::render::lens::Lens;
use particlegs_core::render::project::slices::pieces_with_slopes;
use particlegs_core::render::project::{CameraGaussian, Footprint};
use particlegs_core::render::raster::pyramid::{self, Level, PAD};
use particlegs_core::space::Bounds;
use particlegs_core::{Result, parallel};

/// Gaussians in one step of parallel work; fixed, so that sums do not depend on threads.
const RUN: usize = 512;

struct FootprintPiece {
    gaussian: u32,
    footprint: Footprint,
    placed: PlacedFootprint,
    depth: PieceDepth,
}

/// A picture's depth, and how it came to be.
pub struct Tape {
    pub tau: Plane,
    lens: Lens,
    levels: Vec<Level>,
    runs: Vec<Vec<FootprintPiece>>,
    simd: SimdLevel,
}

impl Tape {
    /// Draws `mixture` as `render::optical_depth` does.
    pub fn draw(
        mixture: &Mixture,
        bounds: &Bounds,
        view: &View,
        crop: &Crop,
        scratch: &mut Scratch,
        context: &Context<'_>,
    ) -> Result<Tape> {
        let mut lens = Lens::optical(view, crop.full, bounds)?;
        for k in 0..2 {
            // A crop is the whole picture with its centre moved.
            lens.center[k] -= crop.corner[k] as f64;
        }
        let levels = pyramid::levels(crop.size);
        let project = |start| project_run(mixture, start..mixture.len().min(start + RUN), &lens, &levels);
        let drawn = parallel::map((0..mixture.len()).step_by(RUN), project);
        let (runs, bins): (Vec<_>, Vec<_>) = drawn.into_iter().unzip();
        let mut tau = paint(crop.size, &bins, scratch, context)?;
        grow(&mut tau, &lens);
        Ok(Tape { tau, lens, levels, runs, simd: context.simd() })
    }

    /// The gradient with every Gaussian, given that with every pixel's depth.
    pub fn gradient(&self, mixture: &Mixture, mut by_tau: Plane) -> Vec<GaussianGradient> {
        // The drawn depth is never negative; where the planes' sum was, nothing changes it.
        by_tau.data.iter_mut().zip(&self.tau.data).for_each(|(g, &t)| *g = if t > 0.0 { *g } else { 0.0 });
        // The factors of `draw` are constant for a pixel: its gradient has the same.
        grow(&mut by_tau, &self.lens);
        let planes = self.planes(&by_tau);
        let mut out = vec![GaussianGradient::default(); mixture.len()];
        parallel::for_each(self.runs.iter().zip(out.chunks_mut(RUN)).enumerate(), |(run, (pieces, out))| {
            for group in pieces.chunk_by(|a, b| a.gaussian == b.gaussian) {
                let i = group[0].gaussian as usize;
                let g = CameraGaussian::from_mixture(&self.lens, mixture, i, mixture.count[i]);
                out[i - run * RUN] = g.map_or_else(GaussianGradient::default, |g| self.of_pieces(&g, group, &planes));
            }
        });
        out
    }

    fn of_pieces(&self, g: &CameraGaussian, pieces: &[FootprintPiece], planes: &[Vec<f32>]) -> GaussianGradient {
        let mut sum = GaussianGradient::default();
        for piece in pieces {
            let level = piece.placed.level;
            let moments = gather(self.simd, &planes[level], &self.levels[level], &piece.placed.stroke);
            let footprint_gradient = of_footprint(&piece.footprint, &piece.placed, &moments);
            sum.add_piece(&self.lens, g, &piece.depth, &footprint_gradient);
        }
        sum.to_world(&self.lens)
    }

    /// The gradient with every pixel of every plane, the coarse ones by the transpose of summing.
    fn planes(&self, by_tau: &Plane) -> Vec<Vec<f32>> {
        let level = &self.levels[0];
        let Size { width, .. } = level.size;
        let mut base = vec![0.0f32; level.stride * level.rows];
        for (row, from) in by_tau.data.chunks_exact(width).enumerate() {
            base[(row + PAD) * level.stride + PAD..][..width].copy_from_slice(from);
        }
        // Coarser planes than the pieces use need no gradient.
        let used = self.runs.iter().flatten().map(|p| p.placed.level).max().unwrap_or(0);
        let mut planes = vec![base];
        for l in 1..=used {
            let mut coarse = vec![0.0f32; self.levels[l].stride * self.levels[l].rows];
            let levels = [&self.levels[l - 1], &self.levels[l]];
            pyramid::gather_down(self.simd, levels, &planes[l - 1], &mut coarse);
            planes.push(coarse);
        }
        planes
    }
}

fn project_run(
    m: &Mixture,
    range: std::ops::Range<usize>,
    lens: &Lens,
    levels: &[Level],
) -> (Vec<FootprintPiece>, StrokeBins) {
    // A guess: some Gaussians are cut into several pieces along depth.
    let mut binner = Binner::new(levels, range.len() + range.len() / 4);
    let mut pieces = Vec::with_capacity(range.len());
    for i in range {
        let Some(g) = CameraGaussian::from_mixture(lens, m, i, m.count[i]) else { continue };
        pieces_with_slopes(lens, &g, |moments, slopes| {
            let footprint = g.footprint(lens, &moments);
            if let Some(placed) = place(levels, &footprint) {
                binner.add_placed(&placed);
                let depth = PieceDepth { moments, slopes };
                pieces.push(FootprintPiece { gaussian: i as u32, footprint, placed, depth });
            }
        });
    }
    (pieces, binner.finish())
}
