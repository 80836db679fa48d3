//! A merged alpha-blend model trained further on the whole snapshot (paper section III-D).

use super::certify::DecodedFile;
use super::clock::Clock;
use super::run::CompressedModel;
use super::size::{CodedGaussians, SizeOutcome};
use particlegs_core::checkpoint::{CheckpointStore, PrefixedCheckpoints};
use particlegs_core::codec::Encoder;
use particlegs_core::context::Context;
use particlegs_core::model::{
    Block, Certificate, CertificateLevel, LawKind, Layer, Metadata, Mixture, Model, RecipeStep, Target, VizMapper,
};
use particlegs_core::{Error, Hint, Result, codec};
use particlegs_measure::score::CertificateInput;
use particlegs_particles::Particles;
use particlegs_reference::Reference;
use particlegs_train::{AlphaConfig, Config, Defaults, InitialGaussians, Limits, TrainedMixture, TrainedRun, Training};

/// Options of fine-tuning.
#[derive(Clone, Debug)]
pub struct FineTuning {
    /// Size, ratio or the most Gaussians (at the nominal precision); [`Target::Default`] = the model's
    /// own size.
    pub target: Target,
    /// Hyper-parameters of the training.
    pub training: Config,
    /// Limits of the training.
    pub limits: Limits,
    /// Memory to stay within while the model is measured, bytes.
    pub memory: Option<u64>,
    /// Seed of the pictures.
    pub seed: u64,
    /// The measurements of the decoded model that the file stores.
    pub certificate: CertificateLevel,
}

impl Default for FineTuning {
    fn default() -> Self {
        FineTuning {
            target: Target::Default,
            training: Config::fine_tuning(),
            limits: Limits::default(),
            memory: None,
            seed: 0,
            certificate: CertificateLevel::default(),
        }
    }
}

impl FineTuning {
    /// 32 bytes that name the work on `model`, a file's bytes: BLAKE3 of all options that decide the new
    /// file's bytes, but for how far training goes, and of the model, which names its snapshot. Pieces of
    /// other work are of no use.
    pub fn id(&self, model: &[u8]) -> [u8; 32] {
        let FineTuning { target, training, limits: _, memory: _, seed, certificate } = self;
        let model = blake3::hash(model).to_hex().to_string();
        let all = serde_json::to_vec(&(target, training, seed, certificate, model));
        *blake3::hash(&all.expect("plain data")).as_bytes()
    }
}

/// Trains `model` (of `model_bytes` bytes) on pictures of `particles`, the whole snapshot that it was
/// made of, and codes it again, in one block. Metadata of the source stay.
pub fn finetune(
    model: &Model,
    model_bytes: u64,
    particles: &Particles,
    options: &FineTuning,
    checkpoints: &mut dyn CheckpointStore,
    context: &Context<'_>,
) -> Result<CompressedModel> {
    let file = NewFile::new(model, model_bytes, options)?;
    let count = particles.len() as u64;
    if count != model.metadata.count {
        let message =
            format!("the model was made from {} particles, but the snapshot has {count}", model.metadata.count);
        return Err(Error::argument(message));
    }
    let mut clock = Clock::default();
    let (seed, memory) = (options.seed, options.memory);
    let config = file.config(model, model_bytes, options)?;
    let trained = clock.time("train", || {
        let m = &file.metadata;
        let (radius, opacity) = (m.default_radius, m.default_opacity);
        // `NewFile::config` has put the number of Gaussians into the configuration already.
        let defaults = Defaults { bounds: m.bounds, radius, opacity, seed, bytes: None, gaussians: None };
        let subject = Reference::with_bounds(particles, m.bounds);
        let training = Training { subject: &subject, config: &config, limits: &options.limits, defaults: &defaults };
        training.run(
            InitialGaussians::Model(model),
            &mut PrefixedCheckpoints { pieces: checkpoints, prefix: "finetune".into() },
            context,
        )
    })?;
    let run = TrainedRun::new(String::new(), &config, &trained);
    let TrainedMixture { mixture, stopped, .. } = trained;
    let network = mixture.law.alpha_blend().and_then(|l| l.vizmapper.clone());
    // What was stopped is coded all the same.
    let check = || if stopped { Ok(()) } else { context.check() };
    let coded = clock.time("code", || file.code(mixture, check))?;
    // After a stop the context stays cancelled, and measuring would end at once.
    let measure = (options.certificate.measures() && !stopped).then_some(CertificateInput {
        particles,
        seed,
        level: options.certificate,
        memory,
        reached: None,
    });
    let assembled = |certificate: Option<&Certificate>| file.assemble(&coded, network.as_deref(), certificate);
    let done = DecodedFile::new(assembled, measure, context)?;
    clock.append(done.clock);
    Ok(CompressedModel {
        bytes: done.bytes,
        model: done.model,
        reached: None,
        step_factor: coded.step_factor,
        trained: vec![run],
        stopped,
        notes: Vec::new(),
        seconds: clock.seconds(),
    })
}

/// The file that a model becomes.
struct NewFile {
    metadata: Metadata,
    layer: Layer<()>,
    /// Bytes beside its coded block.
    beside: u64,
    /// Bytes for the coded block; `None` = as many as the Gaussians have at the nominal precision.
    block_bytes: Option<u64>,
}

impl NewFile {
    fn new(model: &Model, model_bytes: u64, options: &FineTuning) -> Result<Self> {
        let law = model.metadata.law;
        if law != LawKind::AlphaBlend {
            let message = format!("a model of the {} law needs no fine-tuning: its blocks add up exactly", law.name());
            return Err(Error::argument_with(message, Hint::train_from_snapshot()));
        }
        let [layer] = &model.layers[..] else {
            return Err(Error::argument("an alpha-blend model must have exactly one layer"));
        };
        let size = match options.target.check()? {
            Target::Default => Some(model_bytes),
            Target::Psnr(_) | Target::Goal(_) => {
                return Err(Error::argument(
                    "fine-tuning needs a size, a ratio or a number of Gaussians as its target",
                ));
            }
            // Particles of this law have no weights: three float32 each.
            target => target.bytes(12 * model.metadata.count),
        };
        let mut metadata = model.metadata.clone();
        let (target, seed, training) = (options.target, options.seed, options.training.recipe());
        metadata.fields.clear();
        // The new step is a part of the header, whose bytes are counted below.
        metadata.recipe.steps.push(RecipeStep::Finetune { target, seed, training });
        metadata.tool_version = env!("CARGO_PKG_VERSION").to_string();
        let layer = layer.with(());
        let head = Layer { mass: layer.mass.without_weights(), ..layer.with(1) };
        let network = if options.training.alpha_blend.vizmapper { codec::VIZMAPPER_SECTION_BYTES } else { 0 };
        let beside = (codec::size_without_blocks(&metadata, options.certificate, &[head]) + network) as u64;
        let block_bytes = size.map(|size| {
            size.checked_sub(beside).filter(|left| *left > 0).ok_or_else(|| {
                let message = format!("the target is {size} bytes, but the header and the network alone take {beside}");
                Error::unreachable(message, "use a larger target")
            })
        });
        Ok(NewFile { metadata, layer, beside, block_bytes: block_bytes.transpose()? })
    }

    /// The hyper-parameters with the most Gaussians: as many as are asked for; else as they say; else as
    /// many as the block holds at the model's own bytes a Gaussian, and no fewer than it has.
    fn config(&self, model: &Model, model_bytes: u64, options: &FineTuning) -> Result<Config> {
        let (model_gaussians, configured_most) =
            (model.gaussians() as u64, options.training.alpha_blend.most_gaussians);
        let most_gaussians = match (options.target, self.block_bytes) {
            (Target::Gaussians(k), _) if k < model_gaussians => {
                let message = format!("the target is {k} Gaussians, but the model already has {model_gaussians}");
                let hint = Hint::from("use ").option("gaussians", model_gaussians).words(" or more");
                return Err(Error::unreachable(message, hint));
            }
            (Target::Gaussians(k), _) => Some(k),
            (_, Some(bytes)) => configured_most.or_else(|| {
                let grown =
                    model_gaussians as f64 * (bytes as f64 / model_bytes.saturating_sub(self.beside).max(1) as f64);
                Some(model_gaussians.max(grown as u64))
            }),
            _ => configured_most,
        };
        let alpha_blend = AlphaConfig { most_gaussians, ..options.training.alpha_blend };
        Ok(Config { alpha_blend, ..options.training.clone() })
    }

    fn code(&self, gaussians: Mixture, check: impl FnMut() -> Result<()>) -> Result<CodedGaussians> {
        let (bounds, count) = (self.metadata.bounds, self.metadata.count);
        let encoder = Encoder::new(&Block { bounds, count, mass: count as f64, gaussians })?;
        let Some(bytes) = self.block_bytes else { return Ok(CodedGaussians::at_nominal_steps(&encoder)) };
        let coded = CodedGaussians::to_size(&encoder, bytes, None, check)?;
        if coded.size_met == SizeOutcome::TooLarge {
            let (target, smallest) = (bytes + self.beside, codec::stored_bytes(&coded.bytes) as u64 + self.beside);
            let message = format!("the target is {target} bytes, but the smallest possible file has {smallest} bytes");
            return Err(Error::unreachable(message, Hint::larger_file(smallest)));
        }
        Ok(coded)
    }

    fn assemble(
        &self,
        coded: &CodedGaussians,
        network: Option<&VizMapper>,
        certificate: Option<&Certificate>,
    ) -> Result<Vec<u8>> {
        let layers = vec![self.layer.with(vec![coded.bytes.clone().into()])];
        let (count, mass) = codec::sums(&layers)?;
        codec::assemble_with(&Metadata { count, mass, ..self.metadata.clone() }, network, certificate, layers)
    }
}
