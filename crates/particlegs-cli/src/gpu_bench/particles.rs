//! Pictures of all particles a second.

use super::scenes::{TiledScene, views};
use super::stages::KernelStages;
use super::work::WorkBound;
use super::{LIMIT, QuickRun, in_megabytes};
use crate::common::Context;
use particlegs::Result;
use particlegs::picture::Size;
use particlegs::progress::Progress;
use particlegs::render::Renderer;
use particlegs::splat::ToneStyle;
use particlegs::train::ParticleInput;
use particlegs_gpu::Device;
use particlegs_gpu::Rates;
use particlegs_gpu::reference::{MOST, ParticlePictures};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// Pictures of a measurement.
const PICTURES: usize = 20;
/// Pieces of [`MOST`] particles: 268 million.
const PIECES: usize = 24;

#[derive(Serialize, Deserialize)]
pub struct ParticleRow {
    particles: u64,
    width: usize,
    height: usize,
    style: ToneStyle,
    pictures: usize,
    /// Each read back.
    seconds_a_picture: f64,
    seconds_to_load: f64,
    device_memory_bytes: Option<u64>,
    /// What a picture takes at least.
    #[serde(flatten)]
    least: WorkBound,
    stages: KernelStages,
}

/// The noise-free picture of particles that are drawn of the scene, a piece again and again, each time moved.
pub fn row(
    device: &Arc<Device>,
    made: &TiledScene,
    size: Size,
    quick: QuickRun,
    context: &Context,
) -> Result<ParticleRow> {
    let (pieces, each) = if quick.0 { (2, 100_000) } else { (PIECES, MOST) };
    let (count, columns) = (pieces * each, made.particles(each));
    let started = Instant::now();
    let moved = |range: Range<usize>| moved(&columns, made, range);
    let (origin, bounds) = (made.bounds.center(), made.bounds);
    let mut there = ParticlePictures::new(device, ParticleInput { origin, bounds, count, columns: Box::new(moved) })?;
    there.keep_all(&mut |_| context.check())?;
    let seconds_to_load = started.elapsed().as_secs_f64();
    let views = views(made, size, true);
    there.draw(&views[0], size, ToneStyle::Expected, context)?;
    let (started, mut pictures) = (Instant::now(), 0);
    while pictures < quick.or(1, PICTURES) && started.elapsed() < LIMIT {
        pictures += 1;
        there.draw(&views[pictures], size, ToneStyle::Expected, context)?;
    }
    let seconds_a_picture = started.elapsed().as_secs_f64() / pictures as f64;
    let stages = KernelStages::of(device, 1, || there.draw(&views[0], size, ToneStyle::Expected, context).map(drop))?;
    Ok(ParticleRow {
        particles: count as u64,
        width: size.width,
        height: size.height,
        style: ToneStyle::Expected,
        pictures,
        seconds_a_picture,
        seconds_to_load,
        device_memory_bytes: device.allocated(),
        least: WorkBound::of_particles(count, views[0].radius_pixels(size), size),
        stages,
    })
}

/// Particles of a range: the drawn ones again and again, each time moved around the box, so that they are as clumped as
/// before, and elsewhere.
fn moved(columns: &[Vec<f32>; 3], made: &TiledScene, range: Range<usize>) -> [Vec<f32>; 3] {
    let (each, extent) = (columns[0].len(), made.bounds.extent().map(|e| e as f32));
    [0, 1, 2].map(|k| {
        let (column, half) = (&columns[k], 0.5 * extent[k]);
        let at = |i: usize| {
            let away = ((i / each) as f64 * [0.618, 0.755, 0.57][k]).fract() as f32;
            (column[i % each] + half + away * extent[k]).rem_euclid(extent[k]) - half
        };
        range.clone().map(at).collect()
    })
}

impl ParticleRow {
    /// As people read it; `rates` are the device's.
    pub fn text(&self, rates: &Rates) -> String {
        let (memory, pixels) = (in_megabytes(self.device_memory_bytes), format!("{}x{}", self.width, self.height));
        format!(
            "{:>9} {:>10} {:<9} {:>10} {:>9} {:>7}{}\n{:>9} {pixels:>10} {:<9} {:>10.1} {:>9.1} {memory:>7}{}",
            "particles",
            "pixels",
            "look",
            "ms",
            "s to load",
            "MB",
            WorkBound::heads(),
            self.particles,
            self.style.name(),
            1e3 * self.seconds_a_picture,
            self.seconds_to_load,
            self.least.shares(1.0 / self.seconds_a_picture, rates)
        )
    }

    /// What the row is of, and its kernels.
    pub fn stages(&self) -> (String, &KernelStages) {
        let ParticleRow { particles, width, height, style, .. } = self;
        (format!("picture of {particles} particles, {width}x{height}, {}", style.name()), &self.stages)
    }
}
