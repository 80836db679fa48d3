//! Frames a second of models.

use super::scenes::{OPACITY, TiledScene, views};
use super::stages::KernelStages;
use super::work::{BlendWork, DepthWork, WorkBound};
use super::{LIMIT, QuickRun, in_megabytes};
use crate::common::Context;
use particlegs::Result;
use particlegs::camera::View;
use particlegs::model::LawKind;
use particlegs::picture::Size;
use particlegs::progress::Progress;
use particlegs::render::Scene;
use particlegs::splat::ToneStyle;
use particlegs_gpu::Device;
use particlegs_gpu::render::{DepthCanvas, DepthRenderer, DepthTiles, Gaussians};
use particlegs_gpu::{Rates, alpha};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// Frames of a measurement, and those that are read back.
const FRAMES: [usize; 2] = [1000, 100];
const QUICK_FRAMES: [usize; 2] = [4, 2];
/// Frames that the card may be behind.
const BEHIND: usize = 32;
/// Frames whose kernels are timed.
const TIMED: usize = 4;
/// What changes from frame to frame.
const CAMERA: &str = "camera";
const SETTING: &str = "radius and opacity";

#[derive(Serialize, Deserialize)]
pub struct FrameRow {
    gaussians: usize,
    width: usize,
    height: usize,
    /// What changes from frame to frame.
    changes: String,
    #[serde(flatten)]
    kind: FrameKind,
    distance: f64,
    radius_px: f64,
    opacity: f64,
    frames: usize,
    frames_per_second: f64,
    /// Each picture read back before the next one is begun.
    frames_per_second_read_back: f64,
    device_memory_bytes: Option<u64>,
    stages: KernelStages,
}

/// What is drawn, and by what.
#[derive(Serialize, Deserialize)]
struct FrameKind {
    law: LawKind,
    look: ToneStyle,
    /// How pixels are summed.
    way: String,
    /// Footprints of a frame.
    footprints: u64,
    /// What a frame takes at least, whichever way its pixels are summed.
    #[serde(flatten)]
    least: WorkBound,
}

/// A scene on a card, at a size.
trait DeviceScene {
    /// Gives the card a picture to draw.
    fn submit(&mut self, view: &View) -> Result<()>;

    /// Reads the last one back.
    fn read(&self) -> Result<()>;
}

/// Of the optical-depth law.
struct OpticalDepthScene<'a> {
    renderer: &'a DepthRenderer,
    there: &'a Gaussians,
    canvas: &'a DepthCanvas,
    look: ToneStyle,
    /// Where they sum, not atomic adds.
    tiles: Option<DepthTiles<'a>>,
}

impl DeviceScene for OpticalDepthScene<'_> {
    fn submit(&mut self, view: &View) -> Result<()> {
        match &mut self.tiles {
            None => self.renderer.submit(self.there, self.canvas, view, self.look),
            Some(tiles) => tiles.submit(view, self.look),
        }
    }

    fn read(&self) -> Result<()> {
        self.renderer.picture(self.canvas).map(drop)
    }
}

/// Of the alpha-blend law.
struct AlphaBlendScene<'a> {
    renderer: &'a alpha::AlphaRenderer,
    there: &'a alpha::Gaussians,
    canvas: alpha::AlphaCanvas,
}

impl DeviceScene for AlphaBlendScene<'_> {
    fn submit(&mut self, view: &View) -> Result<()> {
        self.renderer.submit(self.there, &mut self.canvas, view)
    }

    fn read(&self) -> Result<()> {
        self.renderer.picture(&self.canvas).map(drop)
    }
}

/// Rows of a scene of the optical-depth law.
pub const OF_DEPTH: u64 = 4;
/// Rows of one of the alpha-blend law.
pub const OF_ALPHA: u64 = 2;

/// All rows of a scene of the optical-depth law at a size.
pub fn of_depth(
    device: &Arc<Device>,
    made: &TiledScene,
    size: Size,
    quick: QuickRun,
    context: &Context,
) -> Result<Vec<FrameRow>> {
    let renderer = DepthRenderer::new(device)?;
    let scene = Scene::of_mixture(&made.gaussians, made.bounds);
    let there = Gaussians::upload(device, &scene)?;
    let mut rows = Vec::new();
    let canvas = renderer.canvas(&there, size)?;
    for (changes, look, by_tiles) in [
        (CAMERA, ToneStyle::Expected, false),
        (CAMERA, ToneStyle::Expected, true),
        (SETTING, ToneStyle::Expected, false),
        (CAMERA, ToneStyle::Paraview, false),
    ] {
        let own = Measurement::new(device, made, size, changes, quick);
        let work = DepthWork::of(made, own.counted(), size)?;
        let kind = FrameKind {
            law: LawKind::OpticalDepth,
            look,
            way: if by_tiles { "tiles of 8 x 8" } else { "atomic adds" }.into(),
            footprints: work.footprints,
            least: work.frame(made.gaussians.len(), size),
        };
        let tiles = by_tiles.then(|| DepthTiles::new(&renderer, &there, &canvas)).transpose()?;
        let mut drawn = OpticalDepthScene { renderer: &renderer, there: &there, canvas: &canvas, look, tiles };
        rows.push(own.row(&mut drawn, kind, context)?);
        context.advance(1);
    }
    Ok(rows)
}

/// All rows of a scene of the alpha-blend law, which has one look, at a size. The network runs where radius and opacity change.
pub fn of_alpha(
    device: &Arc<Device>,
    made: &TiledScene,
    size: Size,
    quick: QuickRun,
    context: &Context,
) -> Result<Vec<FrameRow>> {
    let renderer = alpha::AlphaRenderer::new(device)?;
    let there = alpha::Gaussians::upload(device, &Scene::of_law(&made.gaussians, made.bounds, [made.radius, OPACITY]))?;
    let mut rows = Vec::new();
    for changes in [CAMERA, SETTING] {
        let own = Measurement::new(device, made, size, changes, quick);
        let work = BlendWork::of(made, own.counted(), size, context)?;
        let kind = FrameKind {
            law: LawKind::AlphaBlend,
            look: ToneStyle::Paraview,
            way: "tiles of 16 x 16".into(),
            footprints: work.footprints,
            least: work.frame(made.gaussians.len(), size, changes == SETTING),
        };
        let mut drawn = AlphaBlendScene { renderer: &renderer, there: &there, canvas: renderer.canvas(&there, size)? };
        rows.push(own.row(&mut drawn, kind, context)?);
        context.advance(1);
    }
    Ok(rows)
}

/// Frames of a scene at a size.
struct Measurement<'a> {
    device: &'a Arc<Device>,
    gaussians: usize,
    size: Size,
    changes: &'static str,
    views: Vec<View>,
    quick: QuickRun,
}

impl<'a> Measurement<'a> {
    fn new(device: &'a Arc<Device>, made: &TiledScene, size: Size, changes: &'static str, quick: QuickRun) -> Self {
        let (gaussians, views) = (made.gaussians.len(), views(made, size, changes == CAMERA));
        Measurement { device, gaussians, size, changes, views, quick }
    }

    /// The view whose work is counted.
    fn counted(&self) -> &View {
        &self.views[16]
    }

    fn row(&self, drawn: &mut dyn DeviceScene, kind: FrameKind, context: &Context) -> Result<FrameRow> {
        let [most, most_read] = [0, 1].map(|k| self.quick.or(QUICK_FRAMES[k], FRAMES[k]));
        let timed = self.quick.or(1, TIMED);
        // Everything is compiled and there.
        self.frames(drawn, self.quick.or(1, 3), false, context)?;
        let (number, seconds) = self.frames(drawn, most, false, context)?;
        let (read, seconds_read) = self.frames(drawn, most_read, true, context)?;
        let stages = KernelStages::of(self.device, timed, || self.frames(drawn, timed, false, context).map(drop))?;
        let counted = self.counted();
        Ok(FrameRow {
            gaussians: self.gaussians,
            width: self.size.width,
            height: self.size.height,
            changes: self.changes.into(),
            kind,
            distance: 1.0,
            radius_px: counted.radius_pixels(self.size),
            opacity: counted.opacity,
            frames: number,
            frames_per_second: number as f64 / seconds,
            frames_per_second_read_back: read as f64 / seconds_read,
            device_memory_bytes: self.device.allocated(),
            stages,
        })
    }

    /// Draws frames until all are drawn or the time is over: how many, and in how many seconds of the clock to the end
    /// of the last.
    fn frames(
        &self,
        drawn: &mut dyn DeviceScene,
        most: usize,
        read_back: bool,
        context: &Context,
    ) -> Result<(usize, f64)> {
        let (started, mut number) = (Instant::now(), 0);
        while number < most && started.elapsed() < LIMIT {
            context.check()?;
            drawn.submit(&self.views[number % self.views.len()])?;
            if read_back {
                drawn.read()?;
            } else if number % BEHIND == BEHIND - 1 {
                self.device.wait()?;
            }
            number += 1;
        }
        self.device.wait()?;
        Ok((number, started.elapsed().as_secs_f64()))
    }
}

impl FrameRow {
    /// Rows as people read them; `rates` are the device's.
    pub fn text(rows: &[FrameRow], rates: &Rates) -> String {
        let mut text = format!("{:>9} {:>10} {:<13} {:<8} {:<18}", "Gaussians", "pixels", "law", "look", "changes");
        text += &format!(" {:<16} {:>9} {:>10} {:>7}{}", "by", "frames/s", "read back", "MB", WorkBound::heads());
        for r in rows {
            let (memory, k) = (in_megabytes(r.device_memory_bytes), &r.kind);
            let pixels = format!("{}x{}", r.width, r.height);
            text += &format!("\n{:>9} {pixels:>10} {:<13} {:<8}", r.gaussians, k.law.name(), k.look.name());
            text += &format!(" {:<18} {:<16} {:>9.1}", r.changes, k.way, r.frames_per_second);
            text += &format!(" {:>10.1} {memory:>7}", r.frames_per_second_read_back);
            text += &k.least.shares(r.frames_per_second, rates);
        }
        text
    }

    /// What the row is of, and its kernels.
    pub fn stages(&self) -> (String, &KernelStages) {
        let FrameRow { gaussians, width, height, changes, kind: FrameKind { law, look, way, .. }, .. } = self;
        let (law, look) = (law.name(), look.name());
        (format!("frame of {gaussians}, {width}x{height}, {law}, {look}, {changes}, {way}"), &self.stages)
    }
}
