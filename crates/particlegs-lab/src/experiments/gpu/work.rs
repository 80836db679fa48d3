//! The least work of pictures and training steps on any GPU, counted on the CPU.
//!
//! Bytes are those that kernels read and write without any cache: columns of Gaussians (4-byte words), footprints,
//! lists, planes. Operations are the float32 operations of the kernels' inner loops, counted in their sources; a power
//! of two counts as one.

use super::scenes::{OPACITY, TiledScene};
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::picture::Size;
use particlegs_core::render::Scene;
use particlegs_core::render::alpha::project::Splat;
use particlegs_core::render::alpha::{CutOffs, Eye, Plan, TILE};
use particlegs_core::render::bin::place;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::project::CameraGaussian;
use particlegs_core::render::project::slices::pieces;
use particlegs_core::render::raster::pyramid::{PAD, levels};
use particlegs_core::{Result, parallel};
use std::f64::consts::PI;

/// Least work of a picture or step.
#[derive(Clone, Copy)]
pub struct WorkBound {
    pub bytes: f64,
    /// Atomic additions to a plane.
    pub additions: f64,
    /// Float32 operations.
    pub operations: f64,
}

/// Contents of a picture of the optical-depth law.
pub struct DepthWork {
    /// Footprints that touch it: Gaussians or parts of them.
    pub footprints: u64,
    /// Pixels that they add to, over all planes.
    pub additions: f64,
}

/// Contents of a picture of the alpha-blend law.
pub struct BlendWork {
    /// Footprints that touch it.
    pub footprints: u64,
    /// Entries of the tile lists.
    pub entries: u64,
    /// Pixels that footprints are blended onto, until each pixel is opaque.
    pub blends: u64,
}

/// Operations of a Gaussian's projection, forward and backward.
const PROJECT: f64 = 300.0;
/// Operations of Adam per parameter.
const ADAM: f64 = 15.0;

impl DepthWork {
    /// Counts a scene in a view.
    pub fn new(scene: &TiledScene, view: &View, size: Size) -> Result<DepthWork> {
        const RUN: usize = 4096;
        let (lens, levels, m) = (Lens::optical(view, size, &scene.bounds)?, levels(size), &scene.gaussians);
        let runs = parallel::map((0..m.len()).step_by(RUN), |start| {
            let mut work = DepthWork { footprints: 0, additions: 0.0 };
            for g in
                (start..m.len().min(start + RUN)).filter_map(|i| CameraGaussian::from_mixture(&lens, m, i, m.count[i]))
            {
                pieces(&lens, &g, |moments| {
                    let Some(placed) = place(&levels, &g.footprint(&lens, &moments)) else { return };
                    let s = placed.stroke;
                    work.footprints += 1;
                    // The area of the ellipse where the exponent is above `end`.
                    work.additions += PI * f64::from(-s.end) / (f64::from(s.along) * f64::from(s.down)).sqrt();
                });
            }
            work
        });
        let footprints = runs.iter().map(|run| run.footprints).sum();
        Ok(DepthWork { footprints, additions: runs.iter().map(|run| run.additions).sum() })
    }

    /// A frame: columns (13 words) are read, footprints (9 words) written and read, planes cleared, summed, read and
    /// turned into levels. Each addition includes a power of two (8 operations).
    pub fn frame(&self, gaussians: usize, size: Size) -> WorkBound {
        let (n, footprints) = (gaussians as f64, self.footprints as f64);
        WorkBound {
            bytes: 52.0 * n + 72.0 * footprints + 16.0 * words_of_planes(size) + 5.0 * size.pixels() as f64,
            additions: self.additions,
            operations: PROJECT * n + 8.0 * self.additions,
        }
    }

    /// A step: a frame without levels; the loss and its gradient (24 bytes per pixel: depth, target and result); the
    /// gradient on all planes; the columns read again and their gradient (10 numbers) written; Adam reads the gradient,
    /// its two means, and the columns as stored, as drawn and as averaged (14 words each), and writes all but the
    /// gradient. Backward, each pixel of a footprint takes 12 operations.
    pub fn step(&self, gaussians: usize, size: Size) -> WorkBound {
        let (n, pixels, frame) = (gaussians as f64, size.pixels() as f64, self.frame(gaussians, size));
        let adam = 40.0 + 2.0 * 2.0 * 40.0 + 2.0 * 3.0 * 56.0;
        WorkBound {
            bytes: frame.bytes + (24.0 - 5.0) * pixels + 8.0 * words_of_planes(size) + (52.0 + 40.0 + adam) * n,
            additions: frame.additions,
            operations: frame.operations + 12.0 * self.additions + (PROJECT + 10.0 * ADAM) * n,
        }
    }
}

/// Words of the planes of a picture.
fn words_of_planes(size: Size) -> f64 {
    levels(size).iter().map(|l| (l.size.width + 2 * PAD) * l.rows).sum::<usize>() as f64
}

impl BlendWork {
    /// Operations of a blend, forward (raster_main.wgsl) and backward.
    const BLEND: [f64; 2] = [16.0, 36.0];
    /// Operations of the network per Gaussian: three layers, a product and a sum per weight.
    const NETWORK: f64 = 2.0 * (4 * 64 + 64 * 64 + 64 * 2) as f64;
    /// Bytes per key and value in a pass of the sort: counted, read, written.
    const SORTED: f64 = 20.0;

    /// Counts a scene in a view.
    pub fn new(scene: &TiledScene, view: &View, size: Size, context: &Context<'_>) -> Result<BlendWork> {
        let Some(blend) = Scene::from_law(&scene.gaussians, scene.bounds, scene.radius, OPACITY).blend() else {
            return Ok(BlendWork { footprints: 0, entries: 0, blends: 0 });
        };
        let eye = Eye::new(view, size, &blend.frame)?;
        let seen = blend.gaussians(&[(&scene.gaussians, 1.0)], view, &eye, context)?;
        let plan = Plan::new(&eye, seen.len(), |i| Some(seen[i]), CutOffs::PUBLISHED, context)?;
        let tiles = parallel::map_range(plan.tiles.number(), |tile| in_tile(&plan, tile, size));
        let [entries, blends] = [0, 1].map(|k| tiles.iter().map(|t| t[k]).sum());
        Ok(BlendWork { footprints: plan.splats.len() as u64, entries, blends })
    }

    /// A frame. Per Gaussian: columns (16 words) and the network's output are read; tiles, depth and index are written
    /// and sorted in eight passes; tiles and index are read twice. A footprint (8 words) is written. An entry is
    /// written, sorted by four bits of the tile number per pass, checked, and read with its footprint. Per pixel:
    /// brightness and transmittance are written and turned into levels. If the network runs, it reads and writes two
    /// words.
    pub fn frame(&self, gaussians: usize, size: Size, with_network: bool) -> WorkBound {
        let (n, footprints, pixels) = (gaussians as f64, self.footprints as f64, size.pixels() as f64);
        let tiles = size.width.div_ceil(TILE) * size.height.div_ceil(TILE);
        // The sorter takes four bits a pass, and always an even number of passes.
        let passes = 2.0 * f64::from((usize::BITS - (tiles - 1).leading_zeros()).div_ceil(8));
        let an_entry = 8.0 + passes * Self::SORTED + 4.0 + 36.0;
        let network = if with_network { 1.0 } else { 0.0 };
        WorkBound {
            bytes: (88.0 + 8.0 * Self::SORTED + 24.0 + 16.0 * network) * n
                + 32.0 * footprints
                + an_entry * self.entries as f64
                + 13.0 * pixels,
            additions: 0.0,
            operations: (PROJECT + network * Self::NETWORK) * n + Self::BLEND[0] * self.blends as f64,
        }
    }

    /// A step: a frame with the network and without levels. Per Gaussian: 12 parameters are unpacked to columns; the
    /// gradient of the footprint (7 words) is written and read; columns, parameters and tiles are read, and the
    /// gradients for Adam, the network and density control written; the network adds to four parameters; Adam reads
    /// gradient, parameters and two means, and writes all but the gradient. Entries are read again with their
    /// footprints, and their gradients written and read. Per pixel: the loss and its gradient (24 bytes), then gradient
    /// and brightness in the backward pass.
    pub fn step(&self, gaussians: usize, size: Size) -> WorkBound {
        let (n, pixels, frame) = (gaussians as f64, size.pixels() as f64, self.frame(gaussians, size, true));
        let chain = 2.0 * 28.0 + 64.0 + 48.0 + 8.0 + 8.0 + 48.0 + 8.0 + 16.0;
        let adam = 48.0 + 2.0 * 48.0 + 2.0 * 96.0;
        WorkBound {
            bytes: frame.bytes
                + (112.0 + chain + 48.0 + adam) * n
                + (36.0 + 56.0) * self.entries as f64
                + (24.0 + 8.0 - 5.0) * pixels,
            additions: 0.0,
            operations: frame.operations
                + (PROJECT + 3.0 * Self::NETWORK + 12.0 * ADAM) * n
                + Self::BLEND[1] * self.blends as f64,
        }
    }
}

/// Entries of a tile's list, and pixels that they are blended onto until each is opaque.
fn in_tile(plan: &Plan, tile: usize, size: Size) -> [u64; 2] {
    let corner = [tile % plan.tiles.across * TILE, tile / plan.tiles.across * TILE];
    let extent = [TILE.min(size.width - corner[0]), TILE.min(size.height - corner[1])];
    let mut left = vec![1.0f32; extent[0] * extent[1]];
    let [mut entries, mut blends] = [0, 0];
    for number in plan.in_tile(tile) {
        let s = &plan.splats[number as usize];
        entries += 1;
        for (p, left) in left.iter_mut().enumerate().filter(|(_, left)| **left > 0.0) {
            let at = [corner[0] + p % extent[0], corner[1] + p / extent[0]];
            let Some(alpha) = alpha(s, at.map(|v| v as f32)) else { continue };
            let next = *left * (1.0 - alpha.min(plan.cut.most_alpha));
            *left = if next < plan.cut.least_transmittance { 0.0 } else { next };
            blends += 1;
        }
    }
    [entries, blends]
}

/// A footprint's alpha at a pixel; `None` if it is too faint to be drawn.
fn alpha(s: &Splat, at: [f32; 2]) -> Option<f32> {
    let dy = at[1] - s.y;
    let d = at[0] - s.x - s.lean * dy;
    let power = s.along * d * d + s.down * dy * dy;
    (power >= s.end).then(|| s.peak * power.exp2())
}

impl WorkBound {
    /// A noise-free picture of particles with this standard deviation in pixels. Positions are read twice, once to
    /// count the work; sums of 8 bytes per pixel are cleared, read, and turned into depth and levels. The square of
    /// three deviations to either side touches (6 sigma + 1)^2 pixels on average, and each takes two means of the splat
    /// (about 40 operations).
    pub fn of_particles(count: usize, sigma: f64, size: Size) -> WorkBound {
        let (n, pixels) = (count as f64, size.pixels() as f64);
        let additions = n * (6.0 * sigma + 1.0).powi(2);
        WorkBound { bytes: 24.0 * n + 25.0 * pixels, additions, operations: 2.0 * 60.0 * n + 40.0 * additions }
    }
}
