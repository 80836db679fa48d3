//! The plan of the whole that every block needs, and the settings by which blocks are made: the same for all of a job,
//! wherever blocks are done.

use super::describe::{SourceFacts, describe};
use super::options::Options;
use particlegs_core::camera::{ORBITS, base_distance, spherical_camera};
use particlegs_core::context::Context;
use particlegs_core::model::{CertificateLevel, LawKind, Layer, Mass, Metadata, Recipe};
use particlegs_core::picture::Size;
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Hint, Result, codec};
use particlegs_measure::score::check_radius;
use particlegs_particles::blocks::{KdTree, SnapshotScan};
use particlegs_particles::{LayeredParticles, check_box};
use particlegs_train::{Config, Limits};
use serde::{Deserialize, Serialize};

/// Options of a compression, and metadata of the whole snapshot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompressionPlan {
    /// Hyper-parameters of training after the fit of a block; `None` = no training.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<Config>,
    pub certificate: CertificateLevel,
    /// Layers, and their numbers of particles.
    pub layers: Vec<Layer<u64>>,
    /// Metadata of the file; its mass comes from the blocks.
    pub metadata: Metadata,
    /// The cuts that assign positions to blocks.
    pub tree: KdTree,
    /// Notes for the user, a sentence each.
    #[serde(skip)]
    pub notes: Vec<String>,
}

impl CompressionPlan {
    /// A plan for a snapshot that was scanned, in `blocks` blocks: all that can be refused before a block is fitted,
    /// and all that a user should know. Says what the default target chose.
    pub(crate) fn new(
        options: &Options,
        source: &LayeredParticles,
        scan: &SnapshotScan,
        blocks: u32,
        context: &Context<'_>,
    ) -> Result<CompressionPlan> {
        let (name, cell) = (&source.meta.name, source.meta.cell.as_ref());
        if source.layers.is_empty() || source.layers.iter().any(|l| l.layer.content == 0) {
            return Err(Error::input(name, "the snapshot, or one of its layers, has no particles"));
        }
        let alpha = options.law() == LawKind::AlphaBlend;
        if alpha && source.layers.len() > 1 {
            let message = "the alpha-blend law supports one layer, but the snapshot has several";
            return Err(Error::argument_with(message, Hint::choose_species()));
        }
        if alpha && options.certificate == CertificateLevel::Blocks {
            let message = "a certificate by blocks needs the optical-depth law: alpha-blend models do not add up";
            return Err(Error::argument(message));
        }
        check_box(&scan.bounds, cell, name)?;
        let outside = scan.outside.judge(source.count(), name)?;
        let no_box = cell.is_none().then(|| "the snapshot states no periodic box, so no axis is periodic".to_string());
        let fields = &source.meta.fields;
        let left_out = (!fields.is_empty()).then(|| format!("the model omits these fields: {}", fields.join(", ")));
        options.target.check()?;
        let known = SourceFacts { count: source.count(), bounds: scan.bounds, source_hash: scan.hash(source.origin) };
        let plan = CompressionPlan {
            training: options.training.clone(),
            certificate: options.certificate,
            layers: source.layers.iter().map(|l| l.layer.clone()).collect(),
            metadata: describe(&source.meta, &known, options, blocks),
            tree: KdTree::new(&scan.sample, blocks)?,
            notes: left_out.into_iter().chain(no_box).chain(outside).collect(),
        };
        if alpha { plan.has_room() } else { Ok(()) }?;
        if plan.certificate.measures() {
            check_radius(&plan.metadata, plan.recipe().seed)?;
        }
        options.target.describe_choice(plan.raw_bytes()).iter().for_each(|words| context.message(words));
        Ok(plan)
    }

    pub fn recipe(&self) -> &Recipe {
        &self.metadata.recipe
    }

    /// 32 bytes that name the work: BLAKE3 of all that is asked for and all that is known of the snapshot,
    /// its own hash with it. Whatever decides the model's bytes is in it, but for how far training goes.
    pub(crate) fn id(&self) -> [u8; 32] {
        *blake3::hash(&serde_json::to_vec(self).expect("plain data")).as_bytes()
    }

    /// Checks that the target holds more than the network: better before hours of training than after.
    fn has_room(&self) -> Result<()> {
        let (target_bytes, beside) = (self.recipe().target.bytes(self.raw_bytes()), self.overhead());
        let Some(bytes) = target_bytes.filter(|b| *b <= beside) else { return Ok(()) };
        let message = format!(
            "the target is {bytes} bytes, but the header and the network of an alpha-blend model alone take {beside}"
        );
        let hint = Hint::from("use a larger target, or set `vizmapper = false` in [alpha_blend] of ");
        Err(Error::unreachable(message, hint.option("config", "")))
    }

    /// The masses of a layer as the file has them: Gaussians of the alpha-blend law have no weights.
    fn kept_mass(&self, layer: &Layer<u64>) -> Mass {
        match self.metadata.law {
            LawKind::OpticalDepth => layer.mass,
            LawKind::AlphaBlend => layer.mass.without_weights(),
        }
    }

    /// Bytes of the particles' columns that the file keeps, as float32.
    pub fn raw_bytes(&self) -> u64 {
        self.layers.iter().map(|l| l.content * self.kept_mass(l).particle_bytes()).sum()
    }

    /// Bytes of the particles with all their columns, as they wait in files and memory.
    pub fn column_bytes(&self) -> u64 {
        self.layers.iter().map(|l| l.content * l.mass.particle_bytes()).sum()
    }

    /// Particles of all blocks and layers: they share the effort's bound on time.
    pub(super) fn particles(&self) -> u64 {
        self.layers.iter().map(|l| l.content).sum()
    }

    /// Pixels whose blur decides splits, world units.
    pub(super) fn pixel(&self) -> f64 {
        near_pixel(&self.metadata.bounds)
    }

    /// Bytes of the file beside its coded blocks, where every block has every layer: where some lack
    /// one, a few bytes more than there will be.
    pub fn overhead(&self) -> u64 {
        let head = |l: &Layer<u64>| Layer { mass: self.kept_mass(l), ..l.with(self.recipe().blocks as usize) };
        let heads: Vec<Layer<usize>> = self.layers.iter().map(head).collect();
        let network = match &self.training {
            Some(t) if t.law == LawKind::AlphaBlend && t.alpha_blend.vizmapper => codec::VIZMAPPER_SECTION_BYTES,
            _ => 0,
        };
        (codec::size_without_blocks(&self.metadata, self.certificate, &heads) + network) as u64
    }
}

/// A pixel at the focal point of the near orbit, 1080 pixels high, world units. (The far orbit's
/// gains twice as much at few Gaussians, and loses 0.5 dB near where there are many.)
pub(crate) fn near_pixel(bounds: &Bounds) -> f64 {
    const SIZE: Size = Size { width: 1920, height: 1080 };
    let distance = ORBITS[2].factor * base_distance(bounds, SIZE);
    distance / spherical_camera(bounds.center(), 0.0, 0.0, distance).focal_pixels(SIZE)
}

/// Settings by which the blocks of a job are made.
#[derive(Clone, Copy)]
pub(crate) struct BlockSetup<'a> {
    pub plan: &'a CompressionPlan,
    pub limits: &'a Limits,
    pub on_stop: StopPolicy,
    pub context: &'a Context<'a>,
}

/// The fate of a training run that the caller stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopPolicy {
    /// The best so far is coded.
    KeepBest,
    /// The work is given up, to be taken up again from its pieces.
    GiveUp,
}
