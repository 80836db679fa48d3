//! A merged alpha-blend model trained further on the whole snapshot (paper section III-D).

use super::block::TrainedRun;
use super::job::Compressed;
use super::rate::{Met, meet_size};
use super::{Clock, Target};
use crate::codec::{self, Encoder, Precision};
use crate::fit::{Pieces, Under};
use crate::model::{Block, Certificate, LawKind, Layer, Metadata, Mixture, Model, VizMapper};
use crate::particles::Particles;
use crate::progress::Progress;
use crate::reference::Reference;
use crate::train::{Config, Defaults, Initial, Limits, Training};
use crate::{Error, Result, score};

/// What `finetune` is asked to do.
#[derive(Clone, Debug)]
pub struct FineTuning {
    /// Size, ratio or the most Gaussians (at the nominal precision); [`Target::Default`] = the model's
    /// own size.
    pub target: Target,
    /// How it is trained.
    pub training: Config,
    /// How far training goes.
    pub limits: Limits,
    /// Memory to stay within while the model is measured, bytes.
    pub memory: Option<u64>,
    /// Seed of the pictures.
    pub seed: u64,
    /// Measure the decoded model and store what was found?
    pub certificate: bool,
    /// The command as stored in the file, before the model's own.
    pub command: String,
}

impl FineTuning {
    /// 32 bytes that name the work: what decides the file's bytes. A checkpoint of other work is of no use.
    pub fn name_of_work(&self, model: &[u8]) -> [u8; 32] {
        let training = serde_json::to_string(&self.training).unwrap_or_default();
        let text = format!("{} {:?} {training}", self.command, self.target);
        let mut hash = blake3::Hasher::new();
        hash.update(text.as_bytes()).update(blake3::hash(model).as_bytes());
        *hash.finalize().as_bytes()
    }
}

/// Trains `model` (of `model_bytes` bytes) on pictures of `particles`, the whole snapshot that it was
/// made of, and codes it again, in one block. What is known about the source stays.
///
/// # Errors
/// [`Error::Argument`] for a model of another law, for a quality as target, and where the number of
/// `particles` is not the model's; [`Error::Unreachable`] for a size below the smallest file and for
/// fewer Gaussians than it has; those of [`train::train`].
pub fn finetune(
    model: &Model,
    model_bytes: u64,
    (particles, options): (&Particles, &FineTuning),
    pieces: &mut dyn Pieces,
    progress: &dyn Progress,
) -> Result<Compressed> {
    let law = model.metadata.law;
    if law != LawKind::AlphaBlend {
        let what = format!("a model of the {} law cannot be fine-tuned: its blocks add up as they are", law.name());
        let hint = "`compress --train` trains such a model from its snapshot".into();
        return Err(Error::Argument { what, hint });
    }
    let [layer] = &model.layers[..] else {
        return Err(Error::argument("an alpha-blend model has one layer"));
    };
    let count = particles.len() as u64;
    if count != model.metadata.count {
        let what = format!("the model was made from {} particles, the snapshot has {count}", model.metadata.count);
        return Err(Error::argument(what));
    }
    let raw_bytes = 12 * count;
    let size = match options.target.check()? {
        Target::Default => Some(model_bytes),
        Target::Psnr(_) => {
            return Err(Error::argument("a model is fine-tuned to a size, a ratio or a number of Gaussians"));
        }
        target => target.bytes(raw_bytes),
    };
    let mut metadata = model.metadata.clone();
    metadata.command = format!("{} of: {}", options.command, metadata.command);
    metadata.tool_version = env!("CARGO_PKG_VERSION").to_string();
    let layer = layer.with(());
    Job { model, particles, options, metadata, layer, size, model_bytes, raw_bytes, progress }.run(pieces)
}

struct Job<'a> {
    model: &'a Model,
    particles: &'a Particles,
    options: &'a FineTuning,
    metadata: Metadata,
    /// The one layer.
    layer: Layer<()>,
    /// Bytes wanted; `None` = at the nominal precision, whatever they are.
    size: Option<u64>,
    model_bytes: u64,
    raw_bytes: u64,
    progress: &'a dyn Progress,
}

impl Job<'_> {
    fn run(self, pieces: &mut dyn Pieces) -> Result<Compressed> {
        let room = self.room()?;
        let mut clock = Clock::default();
        let m = &self.metadata;
        let defaults = Defaults {
            bounds: m.bounds,
            radius: m.default_radius,
            opacity: m.default_opacity,
            seed: self.options.seed,
            bytes: None,
        };
        let (config, limits) = (self.config(room)?, &self.options.limits);
        let mut pieces = Under { pieces, prefix: "finetune".into() };
        let trained = clock.time("train", || {
            let subject = Reference::with_bounds(self.particles, m.bounds);
            let training = Training { subject: &subject, config: &config, limits, defaults: &defaults };
            training.run(Initial::Model(self.model), &mut pieces, self.progress)
        })?;
        let stopped = trained.stopped;
        let run = TrainedRun::of(String::new(), &config, &trained);
        let network = trained.mixture.law.alpha_blend().and_then(|l| l.vizmapper.clone());
        let network = network.as_deref();
        let met = clock.time("code", || self.coded(trained.mixture, room, stopped))?;
        let mut bytes = self.file(&met, network, None)?;
        let mut model = clock.time("decode", || codec::decode(&bytes, "the file just coded"))?;
        if self.options.certificate && !stopped {
            let (seed, pictures) = (self.options.seed, self.options.memory.map(|m| m / 5));
            let certificate = clock
                .time("certificate", || score::certificate(&model, self.particles, seed, pictures, self.progress))?;
            bytes = self.file(&met, network, Some(&certificate))?;
            model.certificate = codec::read_info(&bytes, "the file just coded")?.certificate;
        }
        Ok(Compressed {
            bytes,
            model,
            raw_bytes: self.raw_bytes,
            step_factor: met.factor,
            trained: vec![run],
            stopped,
            seconds: clock.seconds(),
        })
    }

    /// Bytes for the coded block, where the file's are asked for.
    fn room(&self) -> Result<Option<u64>> {
        let (Some(size), beside) = (self.size, self.beside()) else { return Ok(None) };
        let Some(room) = size.checked_sub(beside).filter(|r| *r > 0) else {
            let what = format!("{size} bytes were asked for; the head and the network alone take {beside}");
            return Err(Error::Unreachable { what, hint: "ask for a larger file".into() });
        };
        Ok(Some(room))
    }

    /// Bytes of the file beside its coded block.
    fn beside(&self) -> u64 {
        let head = Layer { mass: self.layer.mass.without_weights(), ..self.layer.with(1) };
        let network = if self.options.training.alpha_blend.vizmapper { codec::VIZMAPPER_SECTION_BYTES } else { 0 };
        (codec::size_without_blocks(&self.metadata, self.options.certificate, &[head]) + network) as u64
    }

    /// The hyper-parameters with the most Gaussians: as many as are asked for; else as they say; else as
    /// many as `room` holds at the model's own bytes a Gaussian, and no fewer than it has.
    fn config(&self, room: Option<u64>) -> Result<Config> {
        let mut config = self.options.training.clone();
        let (own, most) = (self.model.gaussians(), &mut config.alpha_blend.most_gaussians);
        match (self.options.target, room) {
            (Target::Gaussians(k), _) if k < own as u64 => {
                let what = format!("{k} Gaussians were asked for; the model has {own}");
                return Err(Error::Unreachable { what, hint: format!("ask for `--gaussians {own}` or more") });
            }
            (Target::Gaussians(k), _) => *most = usize::try_from(k).unwrap_or(usize::MAX),
            (_, Some(room)) if *most == 0 => {
                let grown = own as f64 * (room as f64 / self.model_bytes.saturating_sub(self.beside()).max(1) as f64);
                *most = own.max(grown as usize);
            }
            _ => {}
        }
        Ok(config)
    }

    /// All Gaussians as one block: of at most `room` bytes, or at the nominal precision.
    fn coded(&self, gaussians: Mixture, room: Option<u64>, stopped: bool) -> Result<Met> {
        let count = self.metadata.count;
        let encoder = Encoder::new(&Block { bounds: self.metadata.bounds, count, mass: count as f64, gaussians })?;
        let encode = |q| {
            if !stopped {
                self.progress.check()?;
            }
            Ok(encoder.encode(&Precision::BALANCED.scaled(q)))
        };
        let Some(room) = room else {
            return Ok(Met { bytes: encode(1.0)?, factor: 1.0, too_large: false, too_small: false });
        };
        let (met, _) = meet_size(room, encoder.len(), None, encode)?;
        if met.too_large {
            let smallest = met.bytes.len() as u64 + self.beside();
            let what = format!("{} bytes were asked for; the smallest file has {smallest} bytes", room + self.beside());
            return Err(Error::Unreachable { what, hint: format!("ask for `--size {smallest}B` or more") });
        }
        Ok(met)
    }

    fn file(&self, met: &Met, network: Option<&VizMapper>, certificate: Option<&Certificate>) -> Result<Vec<u8>> {
        let layers = vec![self.layer.with(vec![met.bytes.clone()])];
        let (count, mass) = codec::sums(&layers)?;
        codec::assemble_with(&Metadata { count, mass, ..self.metadata.clone() }, network, certificate, layers)
    }
}
