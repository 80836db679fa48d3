//! From particles to a measured file.

use super::memory::require;
use super::rate::{Met, meet_size};
use super::target::Target;
use super::{describe, search};
use crate::camera::{ORBITS, base_distance, spherical_camera};
use crate::codec::{self, CodedLayer, Encoder, Precision};
use crate::fit::{self, Effort, FitOptions};
use crate::model::{Block, Metadata, Mixture, Model};
use crate::particles::{Bounds, Particles};
use crate::picture::Size;
use crate::progress::Progress;
use crate::score;
use crate::{Error, Result};
use std::time::Instant;

/// What `compress` is asked to do.
#[derive(Clone, Debug)]
pub struct Options {
    /// Size, ratio, number or quality.
    pub target: Target,
    /// Time for quality.
    pub effort: Effort,
    /// Default particle radius to store, world units (`None` = 0.0406 of the mean spacing).
    pub radius: Option<f64>,
    /// Default opacity to store (`None` = 0.05).
    pub opacity: Option<f64>,
    /// Seed of the fit and the views.
    pub seed: u64,
    /// Measure the decoded model and store what was found?
    pub certificate: bool,
    /// The command as stored in the file: what decides its bytes, without paths and threads.
    pub command: String,
}

/// A file and how it came to be.
pub struct Compressed {
    /// The file, whole.
    pub bytes: Vec<u8>,
    /// The file decoded again.
    pub model: Model,
    /// Bytes of the particles as float32.
    pub raw_bytes: u64,
    /// Multiple of the nominal quantisation steps.
    pub step_factor: f64,
    /// Wall-clock seconds by phase, in order.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Bytes of the particles as float32 columns: 12 each, 16 with weights.
pub fn raw_bytes(particles: &Particles) -> u64 {
    particles.len() as u64 * if particles.weights.is_some() { 16 } else { 12 }
}

/// Compresses a snapshot.
///
/// # Errors
/// [`Error::Unreachable`] where an explicit ratio or size is below the smallest file (which it
/// names), or a quality above what all particles as Gaussians reach; [`Error::Memory`] before the
/// fit where it would not fit; [`Error::Cancelled`].
pub fn compress(particles: &Particles, options: &Options, progress: &dyn Progress) -> Result<Compressed> {
    options.target.check()?;
    let mut job = Job::begin(particles, options, progress)?;
    let coded = match options.target {
        Target::Gaussians(k) => job.at_number(k)?,
        Target::Psnr(decibels) => search::reach_quality(&mut job, decibels)?,
        Target::Default | Target::Ratio(_) | Target::Size(_) => {
            let target = options.target.bytes(job.raw_bytes).unwrap_or(0);
            job.at_size(target)?
        }
    };
    job.finish(coded)
}

/// The snapshot, what is known about it, and the clock.
pub(super) struct Job<'a> {
    pub particles: &'a Particles,
    pub options: &'a Options,
    pub progress: &'a dyn Progress,
    pub metadata: Metadata,
    pub raw_bytes: u64,
    /// Bytes of the file beside its one coded block.
    pub overhead: u64,
    seconds: Vec<(&'static str, f64)>,
}

/// A coded block and its multiple of the nominal steps.
pub(super) struct Coded {
    pub block: Vec<u8>,
    pub factor: f64,
}

/// The one layer's name; readers that know species give their own.
const LAYER: &str = "particles";
/// Bytes a Gaussian that lose least at a given size (docs/results/nbody128.md): cells of a partition
/// are rounder and take fewer.
pub(super) fn bytes_a_gaussian(effort: Effort) -> f64 {
    if effort == Effort::Fast { 3.4 } else { 4.1 }
}
/// Fits tried at most to find a number of Gaussians whose steps are near nominal.
const FITS: usize = 3;
/// Step factors between these cost less than a refit gains.
const NEAR_NOMINAL: std::ops::Range<f64> = 0.75..1.4;

impl<'a> Job<'a> {
    fn begin(particles: &'a Particles, options: &'a Options, progress: &'a dyn Progress) -> Result<Self> {
        require("the fit", fit::memory_needed(particles))?;
        let start = Instant::now();
        let (radius, opacity) = (options.radius, options.opacity);
        progress.begin("bounds and hash", 0);
        let metadata = describe(particles, particles.bounds(), radius, opacity, options.command.clone());
        progress.end();
        progress.check()?;
        let overhead = codec::size_without_blocks(&metadata, options.certificate, &[LAYER], &[1]) as u64;
        let seconds = vec![("read", start.elapsed().as_secs_f64())];
        Ok(Job { particles, options, progress, metadata, raw_bytes: raw_bytes(particles), overhead, seconds })
    }

    /// Fits `number` Gaussians (fewer where the particles do not carry so many), ready to be coded.
    fn fit(&mut self, number: u64) -> Result<Encoder> {
        let start = Instant::now();
        let options = FitOptions {
            gaussians: usize::try_from(number.min(self.metadata.count)).unwrap_or(usize::MAX),
            effort: self.options.effort,
            radius: self.metadata.default_radius,
            pixel: near_pixel(&self.metadata.bounds),
            seed: self.options.seed,
        };
        let gaussians: Mixture = fit::fit(self.particles, &options, self.progress)?;
        self.spent("fit", start);
        let m = &self.metadata;
        Encoder::new(&Block { bounds: m.bounds, count: m.count, mass: m.mass, gaussians })
    }

    /// `number` Gaussians at the nominal precision.
    pub fn at_number(&mut self, number: u64) -> Result<Coded> {
        let encoder = self.fit(number)?;
        let start = Instant::now();
        let block = encoder.encode(&Precision::BALANCED);
        self.spent("code", start);
        Ok(Coded { block, factor: 1.0 })
    }

    /// The best file of at most `target` bytes: a number of Gaussians whose steps are near nominal,
    /// and the steps that just fit.
    fn at_size(&mut self, target: u64) -> Result<Coded> {
        let room = target.saturating_sub(self.overhead);
        let mut number = ((room as f64 / bytes_a_gaussian(self.options.effort)) as u64).clamp(1, self.metadata.count);
        let mut met = self.met_with(number, room)?;
        for _ in 1..FITS {
            let fine = !met.outcome.too_large && NEAR_NOMINAL.contains(&met.outcome.factor);
            // What a Gaussian costs at the nominal steps tells the right number.
            let better = ((room as f64 / met.nominal_bytes) as u64).clamp(1, self.metadata.count);
            if fine || better == number || met.found < number && better > met.found {
                break;
            }
            number = better;
            met = self.met_with(number, room)?;
        }
        if met.outcome.too_large && number > 1 {
            met = self.met_with(1, room)?;
        }
        if met.outcome.too_large {
            self.refuse_or_warn(target, &met.outcome)?;
        } else if met.outcome.too_small {
            let bytes = met.outcome.bytes.len() as u64 + self.overhead;
            self.progress.message(&format!(
                "note: the file has {bytes} bytes, fewer than the {target} asked for: these particles need no more"
            ));
        }
        Ok(Coded { block: met.outcome.bytes, factor: met.outcome.factor })
    }

    fn met_with(&mut self, number: u64, room: u64) -> Result<MetWith> {
        let encoder = self.fit(number)?;
        let start = Instant::now();
        let encode = |q| {
            self.progress.check()?;
            Ok(encoder.encode(&Precision::BALANCED.scaled(q)))
        };
        let (outcome, nominal) = meet_size(room, encoder.len(), encode)?;
        self.spent("code", start);
        Ok(MetWith { outcome, found: encoder.len() as u64, nominal_bytes: nominal as f64 / encoder.len() as f64 })
    }

    /// Header and one Gaussian do not fit: a warning by default, an error where it was asked for.
    fn refuse_or_warn(&self, target: u64, met: &Met) -> Result<()> {
        let smallest = met.bytes.len() as u64 + self.overhead;
        let what = format!("{target} bytes were asked for; the smallest file of this snapshot has {smallest} bytes");
        if self.options.target == Target::Default {
            self.progress.message(&format!("warning: {what}"));
            return Ok(());
        }
        let ratio = self.raw_bytes as f64 / smallest as f64;
        let hint = format!("ask for `--size {smallest}B` or more, or for a ratio of {ratio:.4} or less");
        Err(Error::Unreachable { what, hint })
    }

    /// The file of a coded block.
    pub fn file(&self, block: Vec<u8>, certificate: Option<&crate::model::Certificate>) -> Result<Vec<u8>> {
        codec::assemble(&self.metadata, certificate, vec![CodedLayer { name: LAYER.into(), blocks: vec![block] }])
    }

    fn spent(&mut self, phase: &'static str, start: Instant) {
        let seconds = start.elapsed().as_secs_f64();
        match self.seconds.iter_mut().find(|s| s.0 == phase) {
            Some(s) => s.1 += seconds,
            None => self.seconds.push((phase, seconds)),
        }
    }

    /// Decodes the file and, where asked for, measures the decoded model.
    fn finish(mut self, coded: Coded) -> Result<Compressed> {
        let start = Instant::now();
        let mut bytes = self.file(coded.block.clone(), None)?;
        let mut model = codec::decode(&bytes, "the file just coded")?;
        self.spent("decode", start);
        if self.options.certificate {
            let start = Instant::now();
            let certificate = score::certificate(&model, self.particles, self.options.seed, self.progress)?;
            bytes = self.file(coded.block, Some(&certificate))?;
            model.certificate = Some(certificate);
            self.spent("certificate", start);
        }
        Ok(Compressed { bytes, model, raw_bytes: self.raw_bytes, step_factor: coded.factor, seconds: self.seconds })
    }
}

/// A pixel at the focal point of the near orbit, 1080 pixels high, world units. (The far orbit's
/// gains twice as much at few Gaussians, and loses 0.5 dB near where there are many.)
fn near_pixel(bounds: &Bounds) -> f64 {
    const SIZE: Size = Size { width: 1920, height: 1080 };
    let distance = ORBITS[2].factor * base_distance(bounds, SIZE);
    distance / spherical_camera(bounds.center(), 0.0, 0.0, distance).focal_pixels(SIZE)
}

/// A fit coded to a size.
struct MetWith {
    outcome: Met,
    /// Gaussians that the fit gave.
    found: u64,
    /// Bytes a Gaussian at the nominal steps.
    nominal_bytes: f64,
}
