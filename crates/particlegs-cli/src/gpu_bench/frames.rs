//! Frames a second of models.

use super::scenes::{Made, Work, views};
use super::{LIMIT, Quick};
use crate::common::Context;
use crate::device::Device;
use particlegs::Result;
use particlegs::camera::View;
use particlegs::picture::Size;
use particlegs::progress::Progress;
use particlegs::render::Scene;
use particlegs::render::raster::pyramid::{PAD, levels};
use particlegs::splat::Look;
use particlegs_gpu::render::{Canvas, Gaussians, Renderer, Tiles};
use serde::Serialize;
use std::time::Instant;

/// Frames of a measurement.
const FRAMES: usize = 1000;
/// Frames that the card may be behind.
const BEHIND: usize = 32;

#[derive(Serialize)]
pub struct Row {
    gaussians: usize,
    width: usize,
    height: usize,
    look: &'static str,
    /// What changes from frame to frame.
    changes: &'static str,
    /// How pixels are summed.
    way: &'static str,
    distance: f64,
    radius_px: f64,
    opacity: f64,
    frames: usize,
    frames_per_second: f64,
    /// Each picture read back before the next one is begun.
    frames_per_second_read_back: f64,
    device_memory_bytes: Option<u64>,
    /// Footprints of a frame, and pixels that they add to, whichever way those are summed.
    footprints: u64,
    additions: f64,
    /// Bytes that a frame moves at least, lists of tiles not counted.
    bytes: f64,
}

/// All rows of a scene.
///
/// # Errors
/// Those of the device; [`particlegs::Error::Cancelled`].
pub fn rows(device: &Device, made: &Made, sizes: &[Size], quick: Quick, context: &Context) -> Result<Vec<Row>> {
    let renderer = Renderer::new(device)?;
    let scene = Scene::of_mixture(&made.gaussians, made.bounds);
    let there = Gaussians::upload(device, &scene)?;
    let mut rows = Vec::new();
    for &size in sizes {
        let canvas = renderer.canvas(&there, size)?;
        for (changes, look, by_tiles) in [
            ("camera", Look::Expected, false),
            ("camera", Look::Expected, true),
            ("radius and opacity", Look::Expected, false),
            ("camera", Look::Paraview, false),
        ] {
            let views = views(made, size, changes == "camera");
            let tiles = by_tiles.then(|| Tiles::new(&renderer, &there, &canvas)).transpose()?;
            let (renderer, there, canvas, views) = (&renderer, &there, &canvas, &views[..]);
            let mut own = Measurement { renderer, there, canvas, views, look, tiles };
            rows.push(own.row(made, size, changes, quick, context)?);
            context.advance(1);
        }
    }
    Ok(rows)
}

/// Frames of a scene at a size.
struct Measurement<'a> {
    renderer: &'a Renderer,
    there: &'a Gaussians,
    canvas: &'a Canvas,
    views: &'a [View],
    look: Look,
    /// Where they sum, not atomic adds.
    tiles: Option<Tiles<'a>>,
}

impl Measurement<'_> {
    fn row(&mut self, made: &Made, size: Size, changes: &'static str, quick: Quick, context: &Context) -> Result<Row> {
        let frames = if quick.0 { 20 } else { FRAMES };
        // Everything is compiled and there.
        self.frames(3, false, context)?;
        let (drawn, seconds) = self.frames(frames, false, context)?;
        let (read, seconds_read) = self.frames(frames / 10, true, context)?;
        let first = &self.views[16];
        let work = Work::of(made, first, size)?;
        Ok(Row {
            gaussians: made.gaussians.len(),
            width: size.width,
            height: size.height,
            look: self.look.name(),
            changes,
            way: if self.tiles.is_some() { "tiles of 8 x 8" } else { "atomic adds" },
            distance: 1.0,
            radius_px: first.radius_pixels(size),
            opacity: first.opacity,
            frames: drawn,
            frames_per_second: drawn as f64 / seconds,
            frames_per_second_read_back: read as f64 / seconds_read,
            device_memory_bytes: self.renderer.device().allocated(),
            bytes: bytes(made.gaussians.len(), &work, size),
            footprints: work.footprints,
            additions: work.additions,
        })
    }

    /// Draws frames until all are drawn or the time is over: how many, and in how many seconds of the clock to the end
    /// of the last.
    fn frames(&mut self, most: usize, read_back: bool, context: &Context) -> Result<(usize, f64)> {
        let (started, mut drawn) = (Instant::now(), 0);
        while drawn < most && started.elapsed() < LIMIT {
            context.check()?;
            let view = &self.views[drawn % self.views.len()];
            match &mut self.tiles {
                None => self.renderer.submit(self.there, self.canvas, view, self.look)?,
                Some(tiles) => tiles.submit(view, self.look)?,
            }
            if read_back {
                self.renderer.picture(self.canvas)?;
            } else if drawn % BEHIND == BEHIND - 1 {
                self.renderer.device().wait()?;
            }
            drawn += 1;
        }
        self.renderer.device().wait()?;
        Ok((drawn, started.elapsed().as_secs_f64()))
    }
}

/// Bytes that a frame moves at least, where planes are not kept near the threads: columns are read, strokes written and
/// read, planes cleared, summed, read and made levels.
fn bytes(gaussians: usize, work: &Work, size: Size) -> f64 {
    const COLUMNS: f64 = 52.0;
    const STROKE: f64 = 36.0;
    let planes: usize = levels(size).iter().map(|l| (l.size.width + 2 * PAD) * l.rows).sum();
    COLUMNS * gaussians as f64
        + 2.0 * STROKE * work.footprints as f64
        + 16.0 * planes as f64
        + 5.0 * size.pixels() as f64
}

impl Row {
    /// Rows as people read them; `rates` are the device's.
    pub fn text(rows: &[Row], rates: &particlegs_gpu::Rates) -> String {
        let mut text = format!("{:>9} {:>10} {:<9} {:<18} {:<14}", "Gaussians", "pixels", "look", "changes", "by");
        text += &format!(" {:>9} {:>10} {:>7} {:>7} {:>7}", "frames/s", "read back", "MB", "bytes", "adds");
        for r in rows {
            let memory = r.device_memory_bytes.map_or("-".into(), |b| format!("{:.0}", b as f64 / 1e6));
            let pixels = format!("{}x{}", r.width, r.height);
            let [bytes, additions] =
                [r.bytes / rates.copied_bytes, r.additions / rates.additions].map(|s| 100.0 * s * r.frames_per_second);
            text += &format!("\n{:>9} {pixels:>10} {:<9} {:<18} {:<14}", r.gaussians, r.look, r.changes, r.way);
            text += &format!(" {:>9.1} {:>10.1} {memory:>7}", r.frames_per_second, r.frames_per_second_read_back);
            text += &format!(" {bytes:>5.1} % {additions:>5.1} %");
        }
        text
    }
}
