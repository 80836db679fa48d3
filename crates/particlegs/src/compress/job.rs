//! From particles to a measured file.

use super::memory::require;
use super::rate::{Met, meet_size};
use super::target::Target;
use super::{describe, search};
use crate::codec::{self, Encoder, Precision};
use crate::fit::{self, Effort, FitOptions};
use crate::model::{Block, Certificate, Layer, Metadata, Mixture, Model};
use crate::particles::Particles;
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
    let (bytes, step_factor) = match options.target {
        Target::Gaussians(k) => job.at_number(k)?,
        Target::Psnr(decibels) => search::reach_quality(&mut job, decibels)?,
        Target::Default | Target::Ratio(_) | Target::Size(_) => {
            let target = options.target.bytes(job.raw_bytes).unwrap_or(0);
            job.at_size(target)?
        }
    };
    job.finish(bytes, step_factor)
}

/// The snapshot, what is known about it, and the clock.
pub(super) struct Job<'a> {
    pub particles: &'a Particles,
    pub options: &'a Options,
    pub progress: &'a dyn Progress,
    pub metadata: Metadata,
    pub raw_bytes: u64,
    seconds: Vec<(&'static str, f64)>,
}

/// Tries to find a number of Gaussians whose steps are near nominal.
const FITS: usize = 3;
/// Step factors between these cost less than a refit gains.
const NEAR_NOMINAL: std::ops::Range<f64> = 0.7..1.45;

impl<'a> Job<'a> {
    fn begin(particles: &'a Particles, options: &'a Options, progress: &'a dyn Progress) -> Result<Self> {
        let raw_bytes = raw_bytes(particles);
        require("the fit", fit::memory_needed(particles))?;
        let start = Instant::now();
        let metadata = describe(
            particles,
            particles.bounds(),
            options.radius,
            options.opacity,
            options.command.clone(),
            progress,
        )?;
        let seconds = vec![("read", start.elapsed().as_secs_f64())];
        Ok(Job { particles, options, progress, metadata, raw_bytes, seconds })
    }

    /// Fits `gaussians` (fewer where the particles do not carry so many).
    pub fn fit(&mut self, gaussians: u64) -> Result<Mixture> {
        let start = Instant::now();
        let options = FitOptions {
            gaussians: usize::try_from(gaussians.min(self.metadata.count)).unwrap_or(usize::MAX),
            effort: self.options.effort,
            radius: self.metadata.default_radius,
            seed: self.options.seed,
        };
        let mixture = fit::fit(self.particles, &options, self.progress)?;
        self.spent("fit", start);
        Ok(mixture)
    }

    /// A model without a certificate.
    pub fn model(&self, gaussians: Mixture) -> Model {
        let m = &self.metadata;
        let block = Block { bounds: m.bounds, count: m.count, mass: m.mass, gaussians };
        Model {
            metadata: m.clone(),
            layers: vec![Layer { name: "particles".into(), blocks: vec![block] }],
            certificate: None,
        }
    }

    /// `number` Gaussians at the nominal precision.
    pub fn at_number(&mut self, number: u64) -> Result<(Vec<u8>, f64)> {
        let mixture = self.fit(number)?;
        let start = Instant::now();
        let bytes = self.encoder(mixture)?.encode(&Precision::default())?;
        self.spent("code", start);
        Ok((bytes, 1.0))
    }

    /// The best file of at most `target` bytes.
    fn at_size(&mut self, target: u64) -> Result<(Vec<u8>, f64)> {
        let mut number = (target as f64 / codec::NOMINAL_BYTES_A_GAUSSIAN).max(1.0) as u64;
        let mut last = None;
        for attempt in 0..FITS {
            let mixture = self.fit(number)?;
            let found = mixture.len() as u64;
            let start = Instant::now();
            let encoder = self.encoder(mixture)?;
            let met = meet_size(target, found as usize, |q| encoder.encode(&Precision::default().scaled(q)))?;
            self.spent("code", start);
            let exhausted = found < number || number >= self.metadata.count;
            if NEAR_NOMINAL.contains(&met.factor) && !met.too_large && !met.too_small
                || (exhausted && !met.too_large)
                || attempt + 1 == FITS && !met.too_large
            {
                last = Some(met);
                break;
            }
            if number == 1 {
                return self.smallest(target, met);
            }
            // What this number of Gaussians costs at the nominal steps tells the right number.
            let nominal = encoder.encode(&Precision::default())?.len() as f64;
            let fixed = encoder.fixed_bytes() as f64;
            let each = (nominal - fixed).max(1.0) / found as f64;
            number = (((target as f64 - fixed) / each).floor() as u64).clamp(1, number.saturating_mul(4));
            last = Some(met);
        }
        match last {
            Some(met) if !met.too_large => {
                if met.too_small {
                    self.progress.message(&format!(
                        "note: the file is {} bytes, below the {target} asked for: these particles need no more",
                        met.bytes.len()
                    ));
                }
                Ok((met.bytes, met.factor))
            }
            _ => {
                let mixture = self.fit(1)?;
                let encoder = self.encoder(mixture)?;
                let met = meet_size(target, 1, |q| encoder.encode(&Precision::default().scaled(q)))?;
                if met.too_large { self.smallest(target, met) } else { Ok((met.bytes, met.factor)) }
            }
        }
    }

    /// Header and one Gaussian do not fit: a warning by default, an error where it was asked for.
    fn smallest(&self, target: u64, met: Met) -> Result<(Vec<u8>, f64)> {
        let smallest = met.bytes.len();
        if !met.too_large {
            return Ok((met.bytes, met.factor));
        }
        let what = format!("{target} bytes were asked for; the smallest file of this snapshot is {smallest} bytes");
        if self.options.target == Target::Default {
            self.progress.message(&format!("warning: {what}"));
            return Ok((met.bytes, met.factor));
        }
        let hint = format!("ask for `--size {smallest}B` or more, or a ratio below {:.4}", self.raw_bytes as f64 / smallest as f64);
        Err(Error::Unreachable { what, hint })
    }

    pub fn encoder(&self, mixture: Mixture) -> Result<Encoder> {
        Encoder::new(&self.model(mixture), self.options.certificate)
    }

    fn spent(&mut self, phase: &'static str, start: Instant) {
        let seconds = start.elapsed().as_secs_f64();
        match self.seconds.iter_mut().find(|s| s.0 == phase) {
            Some(s) => s.1 += seconds,
            None => self.seconds.push((phase, seconds)),
        }
    }

    /// Decodes the file, measures the decoded model, and puts the certificate into its place.
    fn finish(mut self, bytes: Vec<u8>, step_factor: f64) -> Result<Compressed> {
        let start = Instant::now();
        let mut model = codec::decode(&bytes, "the file just coded")?;
        self.spent("decode", start);
        let mut bytes = bytes;
        if self.options.certificate {
            let start = Instant::now();
            let certificate: Certificate =
                score::certificate(&model, self.particles, self.options.seed, self.progress)?;
            bytes = codec::with_certificate(&bytes, &certificate)?;
            model = codec::decode(&bytes, "the file just coded")?;
            self.spent("certificate", start);
        }
        Ok(Compressed { bytes, model, raw_bytes: self.raw_bytes, step_factor, seconds: self.seconds })
    }
}
