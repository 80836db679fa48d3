//! Pictures of all particles a second.

use super::scenes::{Made, views};
use super::{LIMIT, Quick};
use crate::common::Context;
use crate::device::Device;
use particlegs::math::{Random, each_axis};
use particlegs::picture::Size;
use particlegs::progress::Progress;
use particlegs::splat::Look;
use particlegs::{Result, parallel};
use particlegs_gpu::reference::{MOST, Pictures};
use serde::Serialize;
use std::ops::Range;
use std::time::Instant;

/// Pictures of a measurement.
const PICTURES: usize = 20;
/// Pieces of [`MOST`] particles: 268 million.
const PIECES: usize = 24;

#[derive(Serialize)]
pub struct Row {
    particles: u64,
    width: usize,
    height: usize,
    style: &'static str,
    pictures: usize,
    /// Each read back.
    seconds_a_picture: f64,
    seconds_to_load: f64,
    device_memory_bytes: Option<u64>,
}

/// The noise-free picture of particles that are drawn of the scene, a piece again and again, each time moved.
///
/// # Errors
/// Those of the device; [`particlegs::Error::Cancelled`].
pub fn row(device: &Device, made: &Made, size: Size, quick: Quick, context: &Context) -> Result<Row> {
    let (pieces, each) = if quick.0 { (2, 100_000) } else { (PIECES, MOST) };
    let (count, columns) = (pieces * each, drawn(made, each));
    let started = Instant::now();
    let moved = |range: Range<usize>| moved(&columns, made, range);
    let mut there = Pictures::new(device, made.bounds.center(), made.bounds, count, Box::new(moved))?;
    there.keep_all(&mut |_| context.check())?;
    let seconds_to_load = started.elapsed().as_secs_f64();
    let views = views(made, size, true);
    there.draw(&views[0], size, Look::Expected, context)?;
    let (started, mut pictures) = (Instant::now(), 0);
    while pictures < if quick.0 { 2 } else { PICTURES } && started.elapsed() < LIMIT {
        pictures += 1;
        there.draw(&views[pictures], size, Look::Expected, context)?;
    }
    Ok(Row {
        particles: count as u64,
        width: size.width,
        height: size.height,
        style: "expected",
        pictures,
        seconds_a_picture: started.elapsed().as_secs_f64() / pictures as f64,
        seconds_to_load,
        device_memory_bytes: device.allocated(),
    })
}

/// Particles of a range: the drawn ones again and again, each time moved around the box, so that they are as clumped as
/// before, and elsewhere.
fn moved(columns: &[Vec<f32>; 3], made: &Made, range: Range<usize>) -> [Vec<f32>; 3] {
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

/// So many particles of the scene's Gaussians as columns about its middle.
fn drawn(made: &Made, number: usize) -> [Vec<f32>; 3] {
    let (m, center) = (&made.gaussians, made.bounds.center());
    let one = |i: usize| -> [f32; 3] {
        let mut r = Random::new(1, 1, i as u64);
        let of = (r.uniform() * m.len() as f64) as usize % m.len();
        let (mean, e) = (m.mean_of(of), m.cov_of(of).eigen());
        let along = e.values.map(|v| v.max(0.0).sqrt() * r.normal());
        each_axis(|k| mean[k] - center[k] + (0..3).map(|a| along[a] * e.vectors[a][k]).sum::<f64>()).map(|v| v as f32)
    };
    let rows = parallel::map_range(number, one);
    [0, 1, 2].map(|k| rows.iter().map(|r| r[k]).collect())
}

impl Row {
    /// As people read it.
    pub fn text(&self) -> String {
        let memory = self.device_memory_bytes.map_or("-".into(), |b| format!("{:.0} MB", b as f64 / 1e6));
        format!(
            "{} particles, {}x{}, {}: {:.1} ms a picture, loaded in {:.1} s, {memory}",
            self.particles,
            self.width,
            self.height,
            self.style,
            1e3 * self.seconds_a_picture,
            self.seconds_to_load
        )
    }
}
