//! `particlegs bench gpu`: how fast a graphics card draws scenes that are made here, of nothing but this program.

use crate::common::Context;
use crate::device::Device;
use particlegs::camera::{Camera, View, base_distance, spiral};
use particlegs::math::each_axis;
use particlegs::model::Mixture;
use particlegs::picture::Size;
use particlegs::progress::Progress;
use particlegs::render::Scene;
use particlegs::space::Bounds;
use particlegs::splat::Look;
use particlegs::{Result, codec};
use particlegs_gpu::render::{Canvas, Gaussians, Renderer};
use serde::Serialize;
use std::time::{Duration, Instant};

/// Models of the bundled sample, of so many Gaussians.
const SAMPLES: [&[u8]; 2] = [include_bytes!("../assets/gpu-751.pgs"), include_bytes!("../assets/gpu-668.pgs")];
const SIZES: [Size; 2] = [Size { width: 1920, height: 1080 }, Size { width: 3840, height: 2160 }];
/// Frames of a measurement, and seconds after which it ends all the same.
const FRAMES: usize = 1000;
const LIMIT: Duration = Duration::from_secs(20);
/// Frames that the card may be behind.
const BEHIND: usize = 32;

/// A scene: a model of the sample, tiled.
struct Made {
    gaussians: Mixture,
    bounds: Bounds,
    radius: f64,
}

#[derive(Serialize)]
pub struct Report {
    particlegs: &'static str,
    device: String,
    threads_of_the_processor: usize,
    rows: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    gaussians: usize,
    width: usize,
    height: usize,
    look: &'static str,
    /// What changes from frame to frame.
    changes: &'static str,
    distance: f64,
    radius_px: f64,
    opacity: f64,
    frames: usize,
    frames_per_second: f64,
    /// Each picture read back before the next one is begun.
    frames_per_second_read_back: f64,
    device_memory_bytes: Option<u64>,
}

/// Measures; small and few with `quick`.
///
/// # Errors
/// Those of the device; [`particlegs::Error::Cancelled`].
pub fn measure(device: &Device, quick: bool, context: &Context) -> Result<Report> {
    let tiles: [(usize, [usize; 3]); 2] =
        if quick { [(1, [1, 2, 2]), (0, [1, 2, 2])] } else { [(1, [4, 8, 8]), (0, [4, 16, 16])] };
    let sizes = if quick { &[Size { width: 640, height: 360 }][..] } else { &SIZES[..] };
    let renderer = Renderer::new(device)?;
    let mut rows = Vec::new();
    context.begin("frames", (tiles.len() * sizes.len() * 3) as u64);
    for (sample, tiling) in tiles {
        let made = tiled(SAMPLES[sample], tiling)?;
        let scene = Scene::of_mixture(&made.gaussians, made.bounds);
        let there = Gaussians::upload(device, &scene)?;
        for &size in sizes {
            let canvas = renderer.canvas(&there, size)?;
            for (changes, look) in
                [("camera", Look::Expected), ("radius and opacity", Look::Expected), ("camera", Look::Paraview)]
            {
                let views = views(&made, size, changes == "camera");
                let own = Measurement { renderer: &renderer, there: &there, canvas: &canvas, views: &views, look };
                rows.push(own.row(&made, size, changes, quick, context)?);
                context.advance(1);
            }
        }
    }
    context.end();
    let threads = particlegs::parallel::threads();
    Ok(Report {
        particlegs: env!("CARGO_PKG_VERSION"),
        device: device.name().into(),
        threads_of_the_processor: threads,
        rows,
    })
}

/// The sample's model, `tiles` times along the axes, as if it were one snapshot.
fn tiled(bytes: &[u8], tiles: [usize; 3]) -> Result<Made> {
    let model = codec::decode(bytes, "the sample")?;
    let m = &model.metadata;
    let side = m.cell.and_then(|c| c.lengths()).unwrap_or(m.bounds.extent());
    let mut gaussians = Mixture::default();
    for x in 0..tiles[0] {
        for y in 0..tiles[1] {
            for z in 0..tiles[2] {
                for own in model.blocks().map(|b| &b.gaussians) {
                    for i in 0..own.len() {
                        let (at, tile) = (own.mean_of(i), [x, y, z]);
                        let mean = each_axis(|k| at[k] + tile[k] as f64 * side[k]);
                        gaussians.push(mean, own.cov_of(i), own.count[i], own.count[i]);
                    }
                }
            }
        }
    }
    let max = each_axis(|k| m.bounds.max[k] + (tiles[k] - 1) as f64 * side[k]);
    let bounds = Bounds { min: m.bounds.min, max };
    let particles = m.count * tiles.iter().product::<usize>() as u64;
    Ok(Made { gaussians, bounds, radius: bounds.default_radius(particles) })
}

/// Views from the far orbit: around it, or from one place with other radii and opacities.
fn views(made: &Made, size: Size, around: bool) -> Vec<View> {
    let cameras: Vec<Camera> = spiral(made.bounds.center(), base_distance(&made.bounds, size), 64, None);
    let view = |(i, camera): (usize, &Camera)| {
        let change = if around { 1.0 } else { 0.5 + i as f64 / 64.0 };
        let camera = if around { *camera } else { cameras[16] };
        View { name: "far".into(), camera, radius: made.radius * change, opacity: 0.05 * change }
    };
    cameras.iter().enumerate().map(view).collect()
}

/// Frames of a scene at a size.
struct Measurement<'a> {
    renderer: &'a Renderer,
    there: &'a Gaussians,
    canvas: &'a Canvas,
    views: &'a [View],
    look: Look,
}

impl Measurement<'_> {
    fn row(&self, made: &Made, size: Size, changes: &'static str, quick: bool, context: &Context) -> Result<Row> {
        let frames = if quick { 20 } else { FRAMES };
        // Everything is compiled and there.
        self.frames(3, false, context)?;
        let (drawn, seconds) = self.frames(frames, false, context)?;
        let (read, seconds_read) = self.frames(frames / 10, true, context)?;
        let first = &self.views[16];
        Ok(Row {
            gaussians: made.gaussians.len(),
            width: size.width,
            height: size.height,
            look: self.look.name(),
            changes,
            distance: 1.0,
            radius_px: first.radius_pixels(size),
            opacity: first.opacity,
            frames: drawn,
            frames_per_second: drawn as f64 / seconds,
            frames_per_second_read_back: read as f64 / seconds_read,
            device_memory_bytes: self.renderer.device().allocated(),
        })
    }

    /// Draws frames until all are drawn or the time is over: how many, and in how many seconds of the clock to the end
    /// of the last.
    fn frames(&self, most: usize, read_back: bool, context: &Context) -> Result<(usize, f64)> {
        let (started, mut drawn) = (Instant::now(), 0);
        while drawn < most && started.elapsed() < LIMIT {
            context.check()?;
            let view = &self.views[drawn % self.views.len()];
            self.renderer.submit(self.there, self.canvas, view, self.look)?;
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

impl Report {
    /// The table as people read it.
    pub fn text(&self) -> String {
        let mut text = format!("{}\n{:>9} {:>10} {:<9} {:<18}", self.device, "Gaussians", "pixels", "look", "changes");
        text += &format!(" {:>9} {:>10} {:>9}", "frames/s", "read back", "MB");
        for r in &self.rows {
            let memory = r.device_memory_bytes.map_or("-".into(), |b| format!("{:.0}", b as f64 / 1e6));
            let pixels = format!("{}x{}", r.width, r.height);
            text += &format!("\n{:>9} {pixels:>10} {:<9} {:<18}", r.gaussians, r.look, r.changes);
            text += &format!(" {:>9.1} {:>10.1} {memory:>9}", r.frames_per_second, r.frames_per_second_read_back);
        }
        text
    }
}
