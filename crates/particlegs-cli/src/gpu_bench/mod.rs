//! `particlegs bench gpu`: how fast a graphics card draws and trains scenes that are made here, of nothing but this
//! program.

mod frames;
mod particles;
mod recipe;
mod scenes;
mod stages;
mod training;
mod work;

use crate::common::Context;
use particlegs::picture::Size;
use particlegs::progress::Progress;
use particlegs::{Error, Result};
use particlegs_gpu::Device;
use particlegs_gpu::Rates;
use particlegs_lab::PublishedRunStatus;
use particlegs_lab::lab::Lab;
use scenes::TiledScene;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;

const HD: Size = Size { width: 1920, height: 1080 };
const UHD: Size = Size { width: 3840, height: 2160 };
const SMALL: Size = Size { width: 320, height: 180 };
/// After this time a measurement ends, whatever it has.
const LIMIT: Duration = Duration::from_secs(20);

/// Small and few: to see that all of it runs.
#[derive(Clone, Copy)]
pub struct QuickRun(pub bool);

impl QuickRun {
    /// Few, or as many as are measured.
    fn or(self, few: usize, many: usize) -> usize {
        if self.0 { few } else { many }
    }
}

#[derive(Serialize)]
pub struct GpuBenchReport {
    particlegs: &'static str,
    device: String,
    threads_of_the_processor: usize,
    #[serde(flatten)]
    measured: DeviceMeasurements,
    /// The published recipe, where it is asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    recipe: Option<PublishedRunStatus>,
}

/// What the device does.
#[derive(Serialize, Deserialize)]
struct DeviceMeasurements {
    /// What it does at most: bytes read and written where they are copied; atomic additions; operations of float32.
    copied_bytes_per_second: f64,
    additions_per_second: f64,
    operations_per_second: f64,
    frames: Vec<frames::FrameRow>,
    training: Vec<training::TrainingRow>,
    particles: Option<particles::ParticleRow>,
    /// What the device refused or failed at, and why.
    not_measured: Vec<String>,
}

/// This program, where it was built in a repository: what another one measured is measured again.
const COMMIT: Option<&str> = option_env!("PARTICLEGS_COMMIT");

/// Measures; where there is a `lab`, also the published recipe, for a piece. What was measured is kept there.
pub fn measure(
    device: &Arc<Device>,
    quick: QuickRun,
    lab: Option<&Lab<'_>>,
    context: &Context,
) -> Result<GpuBenchReport> {
    let now = || DeviceMeasurements::of(device, quick, context);
    let [(sample, tiles), ..] = tilings(quick);
    Ok(GpuBenchReport {
        particlegs: env!("CARGO_PKG_VERSION"),
        device: device.name().into(),
        threads_of_the_processor: particlegs::parallel::threads(),
        measured: match lab {
            Some(lab) => lab.on_device.result("gpu", &(quick.0, COMMIT), now)?,
            None => now()?,
        },
        recipe: lab.map(|lab| recipe::piece(lab, &scenes::tiled(sample, tiles)?, quick)).transpose()?,
    })
}

/// The sample, and how often it lies along the axes: 171 000, 769 000 and 1.73 million Gaussians.
fn tilings(quick: QuickRun) -> [(usize, [usize; 3]); 3] {
    match quick.0 {
        true => [(1, [1, 2, 2]), (0, [1, 2, 2]), (0, [1, 2, 4])],
        false => [(1, [4, 8, 8]), (0, [4, 16, 16]), (0, [9, 16, 16])],
    }
}

/// What a device refuses or fails at does not keep the rest from being measured.
fn tried<T>(made: &TiledScene, size: Size, row: Result<T>, failed: &mut Vec<String>) -> Result<Option<T>> {
    match row {
        Err(Error::Cancelled) => Err(Error::Cancelled),
        Err(e) => {
            failed.push(format!("{} Gaussians, {}x{}: {e}", made.gaussians.len(), size.width, size.height));
            Ok(None)
        }
        Ok(row) => Ok(Some(row)),
    }
}

impl DeviceMeasurements {
    fn of(device: &Arc<Device>, quick: QuickRun, context: &Context) -> Result<DeviceMeasurements> {
        let rates = Rates::measure(device)?;
        let (sizes, hd) = if quick.0 { (&[SMALL][..], SMALL) } else { (&[HD, UHD][..], HD) };
        let [few, more, most] = tilings(quick).map(|(sample, tiles)| scenes::tiled(sample, tiles));
        let (few, more, most) = (few?, more?, most?);
        context.begin("measuring", 2 * (frames::OF_DEPTH + frames::OF_ALPHA) * sizes.len() as u64 + 4);
        let (mut frames, mut training, mut failed) = (Vec::new(), Vec::new(), Vec::new());
        for made in [&few, &more] {
            let published = made.published();
            for &size in sizes {
                let rows = frames::of_depth(device, made, size, quick, context);
                frames.extend(tried(made, size, rows, &mut failed)?.unwrap_or_default());
                let rows = frames::of_alpha(device, &published, size, quick, context);
                frames.extend(tried(&published, size, rows, &mut failed)?.unwrap_or_default());
            }
        }
        for made in [&few, &most] {
            let row = training::of_depth(device, made, hd, quick, context);
            training.extend(tried(made, hd, row, &mut failed)?);
            context.advance(1);
        }
        let row = training::of_alpha(device, &few.published(), hd, quick, context);
        training.extend(tried(&few, hd, row, &mut failed)?);
        context.advance(1);
        let particles = tried(&few, hd, particles::row(device, &few, hd, quick, context), &mut failed)?;
        context.end();
        Ok(DeviceMeasurements {
            copied_bytes_per_second: rates.copied_bytes,
            additions_per_second: rates.additions,
            operations_per_second: rates.operations,
            frames,
            training,
            particles,
            not_measured: failed,
        })
    }

    /// Where the time goes.
    fn stages(&self) -> String {
        let models = self
            .frames
            .iter()
            .map(frames::FrameRow::stages)
            .chain(self.training.iter().map(training::TrainingRow::stages));
        stages::KernelStages::table(models.chain(self.particles.iter().map(particles::ParticleRow::stages)))
    }

    /// The tables as people read them.
    fn text(&self) -> String {
        let rates = Rates {
            copied_bytes: self.copied_bytes_per_second,
            additions: self.additions_per_second,
            operations: self.operations_per_second,
        };
        format!(
            "copies {:.1} GB/s; adds {:.2} thousand million times a second to words of a plane; {:.1} thousand million \
             operations of float32 a second\n\n{}\n\n{}\n\n{}\n\nbytes, adds, ops: the share of those rates that is \
             taken by what a frame, a step or a picture moves, adds and computes at least; 100 % is as fast as the \
             device goes\n\n{}{}",
            1e-9 * rates.copied_bytes,
            1e-9 * rates.additions,
            1e-9 * rates.operations,
            frames::FrameRow::text(&self.frames, &rates),
            training::TrainingRow::text(&self.training, &rates),
            self.particles.as_ref().map_or(String::new(), |p| p.text(&rates)),
            self.stages(),
            self.not_measured.iter().map(|why| format!("\nnot measured: {why}")).collect::<String>()
        )
    }
}

impl GpuBenchReport {
    /// As people read it.
    pub fn text(&self) -> String {
        let recipe = self.recipe.as_ref().map_or(String::new(), |r| format!("\n\n{}", recipe::text(r)));
        format!("{}: {}{recipe}", self.device, self.measured.text())
    }
}

/// Bytes as columns have them.
fn in_megabytes(bytes: Option<u64>) -> String {
    bytes.map_or("-".into(), |b| format!("{:.0}", b as f64 / 1e6))
}
