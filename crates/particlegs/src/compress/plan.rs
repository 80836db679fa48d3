//! What every block must know of the whole: the same for all of a job, wherever blocks are done.

use super::block::{BlockJob, CodedBlock, Fitting, Outcome, Workshop};
use super::job::Options;
use super::target::Target;
use crate::camera::{ORBITS, base_distance, spherical_camera};
use crate::codec::{self, CodedLayer};
use crate::fit::Effort;
use crate::model::{Certificate, LawKind, Layer, Mass, Metadata, VizMapper};
use crate::particles::Bounds;
use crate::picture::Size;
use crate::progress::Progress;
use crate::train::Config;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// What is asked for, and what is known of the whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Size, ratio or number.
    pub target: Target,
    /// Time for quality.
    pub effort: Effort,
    /// Seed of the fits and the views.
    pub seed: u64,
    /// How blocks are trained after the fit; `None` = not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<Config>,
    /// Is the decoded model measured?
    pub certificate: bool,
    /// Number of blocks.
    pub blocks: u32,
    /// Layers, and their numbers of particles.
    pub layers: Vec<Layer<u64>>,
    /// What the file will say; its mass comes from the blocks.
    pub metadata: Metadata,
}

impl Plan {
    /// A plan for a snapshot that `metadata` describes.
    ///
    /// # Errors
    /// [`Error::Argument`] for a target that is none; [`Error::Input`] for a snapshot or a layer of no
    /// particles.
    pub fn new(options: &Options, metadata: Metadata, layers: Vec<Layer<u64>>) -> Result<Plan> {
        if metadata.count == 0 || layers.iter().any(|l| l.content == 0) {
            return Err(Error::input(&metadata.source, "no particles, or a layer without any"));
        }
        let alpha = options.law() == LawKind::AlphaBlend;
        if alpha && layers.len() > 1 {
            return Err(Error::argument(
                "the alpha-blend law has one layer: choose one with --particle-type, or use the optical-depth law",
            ));
        }
        let plan = Plan {
            target: options.target.check()?,
            effort: options.effort,
            seed: options.seed,
            training: options.training.clone(),
            certificate: options.certificate,
            blocks: options.blocks,
            layers,
            metadata,
        };
        if alpha { plan.has_room() } else { Ok(()) }?;
        Ok(plan)
    }

    /// Does the target hold more than the network? Better said before hours of training than after.
    fn has_room(&self) -> Result<()> {
        let (asked, beside) = (self.target.bytes(self.raw_bytes()), self.overhead());
        let Some(bytes) = asked.filter(|b| *b <= beside) else { return Ok(()) };
        let what = format!(
            "{bytes} bytes were asked for; of an alpha-blend model the head and the network alone take {beside}"
        );
        let hint = "ask for a larger file, or set `vizmapper = false` in [alpha_blend] of --config".into();
        Err(Error::Unreachable { what, hint })
    }

    /// The masses of a layer as the file has them: Gaussians of the alpha-blend law have no weights.
    fn kept_mass(&self, layer: &Layer<u64>) -> Mass {
        match self.metadata.law {
            LawKind::OpticalDepth => layer.mass,
            LawKind::AlphaBlend => layer.mass.without_weights(),
        }
    }

    /// Bytes of what the file keeps of the particles, as float32.
    pub fn raw_bytes(&self) -> u64 {
        self.layers.iter().map(|l| l.content * self.kept_mass(l).particle_bytes()).sum()
    }

    /// Bytes of the particles with all their columns, as they wait in files and memory.
    pub fn column_bytes(&self) -> u64 {
        self.layers.iter().map(|l| l.content * l.mass.particle_bytes()).sum()
    }

    /// Says what the default target chose.
    pub fn announce(&self, progress: &dyn Progress) {
        if let Some(words) = self.target.choice_in_words(self.raw_bytes()) {
            progress.message(&words);
        }
    }

    /// How blocks are fitted.
    pub fn fitting(&self) -> Fitting {
        Fitting {
            effort: self.effort,
            particles: self.layers.iter().map(|l| l.content).sum(),
            radius: self.metadata.default_radius,
            pixel: near_pixel(&self.metadata.bounds),
            opacity: self.metadata.default_opacity,
            seed: self.seed,
        }
    }

    /// Bytes of the file beside its coded blocks, where every block has every layer: where some lack
    /// one, a few bytes more than there will be.
    pub fn overhead(&self) -> u64 {
        let head = |l: &Layer<u64>| Layer { mass: self.kept_mass(l), ..l.with(self.blocks as usize) };
        let heads: Vec<Layer<usize>> = self.layers.iter().map(head).collect();
        let network = match &self.training {
            Some(t) if t.law == LawKind::AlphaBlend && t.alpha_blend.vizmapper => codec::VIZMAPPER_SECTION_BYTES,
            _ => 0,
        };
        (codec::size_without_blocks(&self.metadata, self.certificate, &heads) + network) as u64
    }

    /// A block as the target wants it: its share of the room or of the number.
    ///
    /// # Errors
    /// [`Error::Argument`] where the target can only be met by all blocks together; those of the fit.
    pub fn block(&self, block: &BlockJob, shop: &mut Workshop<'_>) -> Result<CodedBlock> {
        match (self.target, self.target.bytes(self.raw_bytes())) {
            (_, Some(bytes)) => {
                let room = bytes.saturating_sub(self.overhead());
                let share = block.raw_bytes as f64 / self.raw_bytes() as f64;
                block.at_size((room as f64 * share) as u64, shop)
            }
            (Target::Gaussians(number), _) => self.block_at_number(block, number, shop),
            _ => Err(Error::argument("a PSNR target cannot be divided among blocks: ask for a size or a ratio")),
        }
    }

    /// A block with its share of `number` Gaussians.
    ///
    /// # Errors
    /// Those of the fit.
    pub fn block_at_number(&self, block: &BlockJob, number: u64, shop: &mut Workshop<'_>) -> Result<CodedBlock> {
        let share = (number as f64 * (block.count as f64 / self.metadata.count as f64)).round() as u64;
        block.at_number(share.max(1), shop)
    }

    /// Says what a user must know of how blocks of `bytes` in all meet their target.
    ///
    /// # Errors
    /// [`Error::Unreachable`] where header and one Gaussian do not fit an explicit size.
    pub fn judge(&self, outcomes: &[Outcome], bytes: u64, progress: &dyn Progress) -> Result<()> {
        let Some(target) = self.target.bytes(self.raw_bytes()) else { return Ok(()) };
        let smallest = bytes + self.overhead();
        if outcomes.iter().any(|o| o.too_large) {
            let what =
                format!("{target} bytes were asked for; the smallest file of this snapshot has {smallest} bytes");
            if self.target != Target::Default {
                let ratio = self.raw_bytes() as f64 / smallest as f64;
                let hint = format!("ask for `--size {smallest}B` or more, or for a ratio of {ratio:.4} or less");
                return Err(Error::Unreachable { what, hint });
            }
            progress.message(&format!("warning: {what}"));
        } else if outcomes.iter().all(|o| o.too_small) {
            progress.message(&format!(
                "note: the file has {smallest} bytes, less than the {target} asked for: these particles need no more"
            ));
        }
        Ok(())
    }

    /// The file of all blocks, with the network of block 0 (paper section III-D).
    ///
    /// # Errors
    /// Those of [`codec::assemble`].
    pub fn file<'a>(
        &self,
        blocks: impl Iterator<Item = &'a CodedLayer>,
        vizmapper: Option<&VizMapper>,
        certificate: Option<&Certificate>,
    ) -> Result<Vec<u8>> {
        self.file_of(self.metadata.clone(), blocks, vizmapper, certificate)
    }

    /// The file of one block on its own: a model of its particles, drawn as the whole is.
    ///
    /// # Errors
    /// Those of [`codec::assemble`].
    pub fn block_file(&self, job: &BlockJob, coded: &CodedBlock) -> Result<Vec<u8>> {
        let bounds = job.layers.iter().fold(Bounds::empty(), |all, l| all.union(&l.bounds));
        self.file_of(Metadata { bounds, ..self.metadata.clone() }, coded.layers.iter(), coded.vizmapper.as_ref(), None)
    }

    fn file_of<'a>(
        &self,
        metadata: Metadata,
        blocks: impl Iterator<Item = &'a CodedLayer>,
        vizmapper: Option<&VizMapper>,
        certificate: Option<&Certificate>,
    ) -> Result<Vec<u8>> {
        let mut layers: Vec<CodedLayer> = Vec::new();
        for layer in blocks {
            match layers.iter_mut().find(|l| l.name == layer.name) {
                Some(l) => l.content.extend(layer.content.iter().cloned()),
                None => layers.push(layer.clone()),
            }
        }
        let (count, mass) = codec::sums(&layers)?;
        codec::assemble_with(&Metadata { count, mass, ..metadata }, vizmapper, certificate, layers)
    }
}

/// A pixel at the focal point of the near orbit, 1080 pixels high, world units. (The far orbit's
/// gains twice as much at few Gaussians, and loses 0.5 dB near where there are many.)
pub(super) fn near_pixel(bounds: &Bounds) -> f64 {
    const SIZE: Size = Size { width: 1920, height: 1080 };
    let distance = ORBITS[2].factor * base_distance(bounds, SIZE);
    distance / spherical_camera(bounds.center(), 0.0, 0.0, distance).focal_pixels(SIZE)
}
