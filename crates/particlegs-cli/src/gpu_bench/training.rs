//! Steps of training a second.

use super::scenes::{Made, views};
use super::{LIMIT, Quick};
use crate::common::Context;
use crate::device::Device;
use particlegs::Result;
use particlegs::picture::{Plane, Size};
use particlegs::progress::Progress;
use particlegs::render::Scene;
use particlegs::splat::Look;
use particlegs::train::depth::{Parameters, StepSize};
use particlegs::train::{Crop, Device as _, Loss, Shot};
use particlegs_gpu::render::{Gaussians, Renderer};
use particlegs_gpu::train::Trainer;
use serde::Serialize;
use std::time::Instant;

/// Steps of a measurement.
const STEPS: usize = 500;
/// Pictures that are learnt from in turn.
const TARGETS: usize = 8;

#[derive(Serialize)]
pub struct Row {
    gaussians: usize,
    width: usize,
    height: usize,
    steps: usize,
    steps_per_second: f64,
    /// Loss of the first and of the last step.
    losses: [f64; 2],
    device_memory_bytes: Option<u64>,
}

/// Steps from Gaussians that are half as many particles each too many or too few, by pictures of those as they were.
///
/// # Errors
/// Those of the device; [`particlegs::Error::Cancelled`].
pub fn row(device: &Device, made: &Made, size: Size, quick: Quick, context: &Context) -> Result<Row> {
    let views: Vec<_> = views(made, size, true).into_iter().step_by(64 / TARGETS).collect();
    let targets = targets(device, made, size, &views)?;
    let mut gaussians = made.gaussians.clone();
    gaussians.count.iter_mut().enumerate().for_each(|(i, n)| *n *= if i % 2 == 0 { 0.5 } else { 1.5 });
    let mut of = Parameters::new(&gaussians, made.particles, 48, (made.bounds, Look::Expected));
    let mut steps = Trainer::new(device)?.depth_steps(&of)?;
    let pace = StepSize { rates: [0.01; 3], beta1: 0.9, beta2: 0.999, calm: 0.5, pull: 0.0, average: 0.01 };
    let mut losses = [0.0; 2];
    let mut some = |first: usize, most: usize| -> Result<(usize, f64)> {
        let (started, mut taken) = (Instant::now(), 0);
        while taken < most && started.elapsed() < LIMIT {
            context.check()?;
            let k = (first + taken) % TARGETS;
            let shot = Shot { view: &views[k], target: &targets[k], crop: Crop::whole(size), progress: context };
            let loss = steps.step(&mut of, &shot, &Loss::PUBLISHED, &pace)?.loss;
            losses[usize::from(first + taken > 0)] = loss;
            taken += 1;
        }
        Ok((taken, started.elapsed().as_secs_f64()))
    };
    // Everything is compiled and there.
    some(0, 2)?;
    let (taken, seconds) = some(2, if quick.0 { 10 } else { STEPS })?;
    Ok(Row {
        gaussians: made.gaussians.len(),
        width: size.width,
        height: size.height,
        steps: taken,
        steps_per_second: taken as f64 / seconds,
        losses,
        device_memory_bytes: device.allocated(),
    })
}

/// The scene's pictures, brightness in [0, 1].
fn targets(device: &Device, made: &Made, size: Size, views: &[particlegs::camera::View]) -> Result<Vec<Plane>> {
    let renderer = Renderer::new(device)?;
    let scene = Scene::of_mixture(&made.gaussians, made.bounds);
    let there = Gaussians::upload(device, &scene)?;
    let canvas = renderer.canvas(&there, size)?;
    let one = |view| {
        let levels = renderer.draw(&there, &canvas, view, Look::Expected)?;
        Ok(Plane { size, data: levels.data.iter().map(|&v| f32::from(v) / 255.0).collect() })
    };
    views.iter().map(one).collect()
}

impl Row {
    /// Rows as people read them.
    pub fn text(rows: &[Row]) -> String {
        let mut text =
            format!("{:>9} {:>10} {:>8} {:>24} {:>7}", "Gaussians", "pixels", "steps/s", "loss, from to", "MB");
        for r in rows {
            let memory = r.device_memory_bytes.map_or("-".into(), |b| format!("{:.0}", b as f64 / 1e6));
            let pixels = format!("{}x{}", r.width, r.height);
            let losses = format!("{:.5} {:.5}", r.losses[0], r.losses[1]);
            text += &format!("\n{:>9} {pixels:>10} {:>8.1} {losses:>24} {memory:>7}", r.gaussians, r.steps_per_second);
        }
        text
    }
}
