//! Frame rates of models.

use super::scenes::{OPACITY, TiledScene, views};
use super::work::{BlendWork, DepthWork, WorkBound};
use super::{GpuBench, GpuTables, LIMIT, pixels};
use crate::results::TableCell;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::model::LawKind;
use particlegs_core::picture::Size;
use particlegs_core::render::Scene;
use particlegs_core::splat::ToneStyle;
use particlegs_gpu::alpha::{self, AlphaRenderer};
use particlegs_gpu::render::{DepthRenderer, DepthTiles, Gaussians};
use std::time::Instant;

/// Number of frames, without and with reading back.
const FRAMES: [usize; 2] = [1000, 100];
const QUICK_FRAMES: [usize; 2] = [4, 2];
/// Largest number of frames in flight.
const BEHIND: usize = 32;
/// Number of frames whose kernels are timed.
const TIMED: usize = 4;
/// Names of the change from frame to frame.
const CAMERA: &str = "camera";
const SETTING: &str = "radius and opacity";
/// View whose work is counted.
const COUNTED: usize = 16;

/// Rows for a scene of the optical-depth law.
pub(super) const OF_DEPTH: u64 = 4;
/// Rows for a scene of the alpha-blend law.
pub(super) const OF_ALPHA: u64 = 2;

struct FrameKind {
    law: LawKind,
    look: ToneStyle,
    changes: &'static str,
    /// The way in which pixels are summed.
    way: &'static str,
    /// Footprints of a frame.
    footprints: u64,
    /// Least work of a frame, however pixels are summed.
    least: WorkBound,
}

/// All rows for a scene of the optical-depth law at one size.
pub(super) fn of_depth(bench: GpuBench<'_>, tables: &mut GpuTables, scene: &TiledScene, size: Size) -> Result<()> {
    let renderer = DepthRenderer::new(bench.device)?;
    let gaussians = Gaussians::upload(bench.device, &Scene::from_mixture(&scene.gaussians, scene.bounds))?;
    let canvas = renderer.canvas(&gaussians, size)?;
    for (changes, look, by_tiles) in [
        (CAMERA, ToneStyle::Expected, false),
        (CAMERA, ToneStyle::Expected, true),
        (SETTING, ToneStyle::Expected, false),
        (CAMERA, ToneStyle::Paraview, false),
    ] {
        let views = views(scene, size, changes == CAMERA);
        let work = DepthWork::new(scene, &views[COUNTED], size)?;
        let way = if by_tiles { "tiles of 8 x 8" } else { "atomic adds" };
        let (law, least) = (LawKind::OpticalDepth, work.frame(scene.gaussians.len(), size));
        let kind = FrameKind { law, look, changes, way, footprints: work.footprints, least };
        let mut tiles = by_tiles.then(|| DepthTiles::new(&renderer, &gaussians, &canvas)).transpose()?;
        bench.frames(tables, (scene, size, &views), &kind, |view, read_back| {
            match &mut tiles {
                None => renderer.submit(&gaussians, &canvas, view, look)?,
                Some(tiles) => tiles.submit(view, look)?,
            }
            if read_back { renderer.picture(&canvas).map(drop) } else { Ok(()) }
        })?;
    }
    Ok(())
}

/// All rows for a scene of the alpha-blend law at one size. The network runs if radius and opacity change.
pub(super) fn of_alpha(bench: GpuBench<'_>, tables: &mut GpuTables, tiles: &TiledScene, size: Size) -> Result<()> {
    let renderer = AlphaRenderer::new(bench.device)?;
    let scene = Scene::from_law(&tiles.gaussians, tiles.bounds, tiles.radius, OPACITY);
    let gaussians = alpha::Gaussians::upload(bench.device, &scene)?;
    for changes in [CAMERA, SETTING] {
        let views = views(tiles, size, changes == CAMERA);
        let work = BlendWork::new(tiles, &views[COUNTED], size, bench.context)?;
        let kind = FrameKind {
            law: LawKind::AlphaBlend,
            look: ToneStyle::Paraview,
            changes,
            way: "tiles of 16 x 16",
            footprints: work.footprints,
            least: work.frame(tiles.gaussians.len(), size, changes == SETTING),
        };
        let mut canvas = renderer.canvas(&gaussians, size)?;
        bench.frames(tables, (tiles, size, &views), &kind, |view, read_back| {
            renderer.submit(&gaussians, &mut canvas, view)?;
            if read_back { renderer.picture(&canvas).map(drop) } else { Ok(()) }
        })?;
    }
    Ok(())
}

impl GpuBench<'_> {
    /// Measures frames of `draw`, which also reads them back on request.
    fn frames(
        self,
        tables: &mut GpuTables,
        (scene, size, views): (&TiledScene, Size, &[View]),
        kind: &FrameKind,
        mut draw: impl FnMut(&View, bool) -> Result<()>,
    ) -> Result<()> {
        let [most, most_read] = if self.quick { QUICK_FRAMES } else { FRAMES };
        let timed = self.either(1, TIMED);
        // Warm up.
        self.per_second(views, self.either(1, 3), |view| draw(view, false))?;
        let per_second = self.per_second(views, most, |view| draw(view, false))?;
        let read_back = self.per_second(views, most_read, |view| draw(view, true))?;
        let (law, look, gaussians) = (kind.law.name(), kind.look.name(), scene.gaussians.len());
        let label = format!("frame of {gaussians}, {}, {law}, {look}, {}, {}", pixels(size), kind.changes, kind.way);
        tables
            .time_kernels(self, &label, timed, || self.per_second(views, timed, |view| draw(view, false)).map(drop))?;
        let cells = [
            TableCell::count(gaussians as u64),
            TableCell::text(pixels(size)),
            TableCell::text(law),
            TableCell::text(look),
            TableCell::text(kind.changes),
            TableCell::text(kind.way),
            TableCell::number(views[COUNTED].radius_pixels(size), 2),
            TableCell::count(kind.footprints),
            TableCell::number(per_second, 1),
            TableCell::number(read_back, 1),
        ];
        tables.frames.row(cells.into_iter().chain(self.work(per_second, &kind.least)));
        self.context.advance(1);
        Ok(())
    }

    /// Draws all frames, or as many as the time allows; returns the rate until the last frame is complete.
    fn per_second(self, views: &[View], most: usize, mut draw: impl FnMut(&View) -> Result<()>) -> Result<f64> {
        let (started, mut number) = (Instant::now(), 0);
        while number < most && started.elapsed() < LIMIT {
            self.context.check()?;
            draw(&views[number % views.len()])?;
            number += 1;
            if number % BEHIND == 0 {
                self.device.wait()?;
            }
        }
        self.device.wait()?;
        Ok(number as f64 / started.elapsed().as_secs_f64())
    }
}
