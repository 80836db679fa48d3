//! `particlegs bench gpu`: how fast a graphics card draws and trains scenes that are made here, of nothing but this
//! program.

mod frames;
mod particles;
mod scenes;
mod training;

use crate::common::Context;
use crate::device::Device;
use particlegs::Result;
use particlegs::picture::Size;
use particlegs::progress::Progress;
use particlegs_gpu::Rates;
use serde::Serialize;
use std::time::Duration;

const HD: Size = Size { width: 1920, height: 1080 };
const UHD: Size = Size { width: 3840, height: 2160 };
const SMALL: Size = Size { width: 640, height: 360 };
/// After this time a measurement ends, whatever it has.
const LIMIT: Duration = Duration::from_secs(20);

/// Small and few: to see that all of it runs.
#[derive(Clone, Copy)]
pub struct Quick(pub bool);

#[derive(Serialize)]
pub struct Report {
    particlegs: &'static str,
    device: String,
    threads_of_the_processor: usize,
    /// What the device does at most: bytes read and written where they are copied; atomic additions.
    copied_bytes_per_second: f64,
    additions_per_second: f64,
    frames: Vec<frames::Row>,
    training: Vec<training::Row>,
    particles: particles::Row,
}

/// Measures.
///
/// # Errors
/// Those of the device; [`particlegs::Error::Cancelled`].
pub fn measure(device: &Device, quick: Quick, context: &Context) -> Result<Report> {
    let rates = Rates::measure(device)?;
    // The sample, and how often it lies along the axes: 171 000, 769 000 and 1.73 million Gaussians.
    let tilings = if quick.0 {
        [(1, [1, 2, 2]), (0, [1, 2, 2]), (0, [1, 2, 4])]
    } else {
        [(1, [4, 8, 8]), (0, [4, 16, 16]), (0, [9, 16, 16])]
    };
    let (sizes, hd) = if quick.0 { (&[SMALL][..], SMALL) } else { (&[HD, UHD][..], HD) };
    let [few, more, most] = tilings.map(|(sample, tiles)| scenes::tiled(sample, tiles));
    let (few, more, most) = (few?, more?, most?);
    context.begin("measuring", 2 * 4 * sizes.len() as u64 + 3);
    let mut frames = frames::rows(device, &few, sizes, quick, context)?;
    frames.extend(frames::rows(device, &more, sizes, quick, context)?);
    let mut training = Vec::new();
    for made in [&few, &most] {
        training.push(training::row(device, made, hd, quick, context)?);
        context.advance(1);
    }
    let particles = particles::row(device, &few, hd, quick, context)?;
    context.end();
    Ok(Report {
        particlegs: env!("CARGO_PKG_VERSION"),
        device: device.name().into(),
        threads_of_the_processor: particlegs::parallel::threads(),
        copied_bytes_per_second: rates.copied_bytes,
        additions_per_second: rates.additions,
        frames,
        training,
        particles,
    })
}

impl Report {
    /// The tables as people read them.
    pub fn text(&self) -> String {
        let rates = Rates { copied_bytes: self.copied_bytes_per_second, additions: self.additions_per_second };
        format!(
            "{}: copies {:.1} GB/s, adds {:.2} thousand million times a second to words of a plane\n\n{}\n\n\
             bytes, adds: the share of those rates that a frame's own bytes and additions take\n\n{}\n\n{}",
            self.device,
            1e-9 * rates.copied_bytes,
            1e-9 * rates.additions,
            frames::Row::text(&self.frames, &rates),
            training::Row::text(&self.training),
            self.particles.text()
        )
    }
}
