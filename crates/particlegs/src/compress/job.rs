//! From particles to a measured file.

use super::rate::{Met, meet_size};
use super::target::Target;
use super::{describe, search};
use crate::camera::{ORBITS, base_distance, spherical_camera};
use crate::codec::{self, CodedLayer, Encoder, LayerHead, Precision};
use crate::fit::{self, Effort, FitOptions};
use crate::memory::require;
use crate::model::{Block, Metadata, Mixture, Model};
use crate::particles::{Bounds, ParticleLayer, Particles};
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
    /// Layers, the smallest first: what they leave of their room goes to the larger.
    layers: Vec<LayerJob>,
    /// Bytes of the file beside its coded blocks.
    pub overhead: u64,
    seconds: Vec<(&'static str, f64)>,
}

/// One species or mass class, a block of its own.
struct LayerJob {
    name: String,
    particle_mass: Option<f64>,
    particles: Particles,
    bounds: Bounds,
    /// Sum of the weights, or the count.
    mass: f64,
    raw_bytes: u64,
}

/// Coded blocks, one a layer of the job, and the multiple of the nominal steps of the largest.
#[derive(Clone)]
pub(super) struct Coded {
    pub blocks: Vec<Vec<u8>>,
    pub factor: f64,
}

impl Coded {
    /// Bytes of the blocks.
    pub fn len(&self) -> usize {
        self.blocks.iter().map(Vec::len).sum()
    }
}

/// Bytes a Gaussian that lose least at a given size (docs/results/nbody128.md): cells of a partition
/// are rounder and take fewer.
pub(super) fn bytes_a_gaussian(effort: Effort) -> f64 {
    if effort == Effort::Fast { 3.4 } else { 4.1 }
}
/// Fits tried at most to find a number of Gaussians whose steps are near nominal.
const FITS: usize = 3;
/// Step factors between these cost less than a refit gains.
pub(super) const NEAR_NOMINAL: std::ops::Range<f64> = 0.75..1.4;

impl<'a> Job<'a> {
    fn begin(particles: &'a Particles, options: &'a Options, progress: &'a dyn Progress) -> Result<Self> {
        let start = Instant::now();
        let (radius, opacity) = (options.radius, options.opacity);
        progress.begin("bounds and hash", 0);
        let mut layers: Vec<LayerJob> = particles.layers().iter().map(|l| LayerJob::of(particles, l)).collect();
        let bounds = layers.iter().fold(Bounds::empty(), |all, l| all.union(&l.bounds));
        let mass = layers.iter().map(|l| l.mass).sum();
        let metadata = describe(particles, bounds, mass, radius, opacity, options.command.clone());
        progress.end();
        progress.check()?;
        layers.sort_by(|a, b| (a.raw_bytes, &a.name).cmp(&(b.raw_bytes, &b.name)));
        let need = layers.iter().map(|l| fit::memory_needed(&l.particles)).max().unwrap_or(0);
        require("the fit", need)?;
        let heads: Vec<_> = layers.iter().map(LayerJob::head).collect();
        let overhead = codec::size_without_blocks(&metadata, options.certificate, &heads) as u64;
        let seconds = vec![("read", start.elapsed().as_secs_f64())];
        Ok(Job { particles, options, progress, metadata, raw_bytes: particles.raw_bytes(), layers, overhead, seconds })
    }

    /// Fits `number` Gaussians to a layer (fewer where its particles do not carry so many), ready to
    /// be coded.
    fn fit(&mut self, layer: usize, number: u64) -> Result<Encoder> {
        let start = Instant::now();
        let LayerJob { particles, bounds, mass, .. } = &self.layers[layer];
        let count = particles.len() as u64;
        let options = FitOptions {
            gaussians: usize::try_from(number.min(count)).unwrap_or(usize::MAX),
            effort: self.options.effort,
            radius: self.metadata.default_radius,
            pixel: near_pixel(&self.metadata.bounds),
            seed: self.options.seed,
        };
        let gaussians: Mixture = fit::fit(particles, &options, self.progress)?;
        let block = Block { bounds: *bounds, count, mass: *mass, gaussians };
        self.spent("fit", start);
        Encoder::new(&block)
    }

    /// `number` Gaussians at the nominal precision, shared among the layers by their particles.
    pub fn at_number(&mut self, number: u64) -> Result<Coded> {
        let (mut left, mut particles_left) = (number, self.metadata.count);
        let mut blocks = Vec::with_capacity(self.layers.len());
        for layer in 0..self.layers.len() {
            let count = self.layers[layer].particles.len() as u64;
            let share = (left as f64 * count as f64 / particles_left as f64).round() as u64;
            let encoder = self.fit(layer, share.clamp(1, count))?;
            (left, particles_left) = (left.saturating_sub(share.max(1)), particles_left - count);
            let start = Instant::now();
            blocks.push(encoder.encode(&Precision::BALANCED));
            self.spent("code", start);
        }
        Ok(Coded { blocks, factor: 1.0 })
    }

    /// The best file of at most `target` bytes, every layer at about the same ratio.
    fn at_size(&mut self, target: u64) -> Result<Coded> {
        let (mut room, mut raw_left) = (target.saturating_sub(self.overhead), self.raw_bytes);
        let mut coded = Coded { blocks: Vec::with_capacity(self.layers.len()), factor: 1.0 };
        let (mut too_large, mut too_small) = (false, false);
        for layer in 0..self.layers.len() {
            let raw_bytes = self.layers[layer].raw_bytes;
            let share = (room as f64 * (raw_bytes as f64 / raw_left as f64)) as u64;
            let met = self.layer_at_size(layer, share)?;
            room = room.saturating_sub(met.bytes.len() as u64);
            raw_left -= raw_bytes;
            (too_large, too_small) = (met.too_large, met.too_small);
            coded.factor = met.factor;
            coded.blocks.push(met.bytes);
        }
        let bytes = coded.len() as u64 + self.overhead;
        if too_large {
            self.refuse_or_warn(target, bytes)?;
        } else if too_small {
            self.progress.message(&format!(
                "note: the file has {bytes} bytes, fewer than the {target} asked for: these particles need no more"
            ));
        }
        Ok(coded)
    }

    /// The best block of a layer of at most `room` bytes: a number of Gaussians whose steps are near
    /// nominal, and the steps that just fit.
    fn layer_at_size(&mut self, layer: usize, room: u64) -> Result<Met> {
        let count = self.layers[layer].particles.len() as u64;
        let mut number = ((room as f64 / bytes_a_gaussian(self.options.effort)) as u64).clamp(1, count);
        let mut met = self.met_with(layer, number, room)?;
        for _ in 1..FITS {
            let fine = !met.outcome.too_large && NEAR_NOMINAL.contains(&met.outcome.factor);
            // What a Gaussian costs at the nominal steps tells the right number.
            let better = ((room as f64 / met.nominal_bytes) as u64).clamp(1, count);
            if fine || better == number || met.found < number && better > met.found {
                break;
            }
            number = better;
            met = self.met_with(layer, number, room)?;
        }
        if met.outcome.too_large && number > 1 {
            met = self.met_with(layer, 1, room)?;
        }
        Ok(met.outcome)
    }

    fn met_with(&mut self, layer: usize, number: u64, room: u64) -> Result<MetWith> {
        let encoder = self.fit(layer, number)?;
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
    fn refuse_or_warn(&self, target: u64, smallest: u64) -> Result<()> {
        let what = format!("{target} bytes were asked for; the smallest file of this snapshot has {smallest} bytes");
        if self.options.target == Target::Default {
            self.progress.message(&format!("warning: {what}"));
            return Ok(());
        }
        let ratio = self.raw_bytes as f64 / smallest as f64;
        let hint = format!("ask for `--size {smallest}B` or more, or for a ratio of {ratio:.4} or less");
        Err(Error::Unreachable { what, hint })
    }

    /// The file of coded blocks.
    pub fn file(&self, coded: &Coded, certificate: Option<&crate::model::Certificate>) -> Result<Vec<u8>> {
        let layer = |(l, block): (&LayerJob, &Vec<u8>)| CodedLayer {
            name: l.name.clone(),
            particle_mass: l.particle_mass,
            blocks: vec![block.clone()],
        };
        codec::assemble(&self.metadata, certificate, self.layers.iter().zip(&coded.blocks).map(layer).collect())
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
        let mut bytes = self.file(&coded, None)?;
        let mut model = codec::decode(&bytes, "the file just coded")?;
        self.spent("decode", start);
        if self.options.certificate {
            let start = Instant::now();
            let certificate = score::certificate(&model, self.particles, self.options.seed, self.progress)?;
            bytes = self.file(&coded, Some(&certificate))?;
            model.certificate = Some(certificate);
            self.spent("certificate", start);
        }
        Ok(Compressed { bytes, model, raw_bytes: self.raw_bytes, step_factor: coded.factor, seconds: self.seconds })
    }
}

impl LayerJob {
    fn head(&self) -> LayerHead<'_> {
        let weighted = self.particles.weights.is_some();
        LayerHead { name: &self.name, particle_mass: self.particle_mass, weighted, blocks: 1 }
    }

    fn of(all: &Particles, layer: &ParticleLayer) -> Self {
        let particles = all.of_layer(layer);
        LayerJob {
            name: layer.name.clone(),
            particle_mass: layer.particle_mass,
            bounds: particles.bounds(),
            mass: particles.total_mass(),
            raw_bytes: particles.raw_bytes(),
            particles,
        }
    }
}

/// A pixel at the focal point of the near orbit, 1080 pixels high, world units. (The far orbit's
/// gains twice as much at few Gaussians, and loses 0.5 dB near where there are many.)
pub(super) fn near_pixel(bounds: &Bounds) -> f64 {
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
