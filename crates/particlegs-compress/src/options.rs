//! Options of compression.

use super::memory::MemoryLoad;
use particlegs_core::model::{CertificateLevel, Effort, LawKind, Recipe, Target};
use particlegs_core::{Error, Result};
use particlegs_particles::{Particles, StarFormingGas, Storage};
use particlegs_train::{Config, Limits};
use std::collections::BTreeMap;
use std::fmt;

/// Options of compression. The default is that of the command: the default size, a refined fit, no training,
/// measured.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Size, ratio, number or quality.
    pub target: Target,
    /// Time for quality.
    pub effort: Effort,
    /// Default particle radius to store, world units (`None` = 0.0406 of the mean spacing).
    pub radius: Option<f64>,
    /// Default opacity to store (`None` = 0.05).
    pub opacity: Option<f64>,
    /// Blocks that are fitted on their own, 1 or more; `None` = as many as the memory asks for.
    pub blocks: Option<u32>,
    /// Memory to stay within, bytes; `None` = what the work takes in one block.
    pub memory: Option<u64>,
    /// Place of the particles of blocks while they wait.
    pub storage: Storage,
    /// Hyper-parameters of training after the fit; `None` = no training.
    pub training: Option<Config>,
    /// Limits of training.
    pub limits: Limits,
    /// Seed of the fit and the views.
    pub seed: u64,
    /// Measurements of the decoded model that are stored.
    pub certificate: CertificateLevel,
    /// Whether species share Gaussians.
    pub sharing: SharingPolicy,
    /// Names of fields to store as well, case aside; `all` stands for every field of real numbers. Species of a model
    /// with fields cannot share Gaussians.
    pub fields: Vec<String>,
    /// Temperature of star-forming gas, where a field of it is computed from internal energy.
    pub star_forming: StarFormingGas,
    /// Whether a target of a size counts the fields too, and not positions and masses alone. Up to six fits are made.
    pub size_with_fields: bool,
    /// The selection that is read of the snapshot, for the file's [`Recipe::read`].
    pub read: BTreeMap<String, String>,
}

impl Options {
    /// A file so many times smaller than the positions in float32.
    pub fn ratio(ratio: f64) -> Self {
        Options { target: Target::Ratio(ratio), ..Options::default() }
    }

    /// So many Gaussians.
    pub fn gaussians(number: u64) -> Self {
        Options { target: Target::Gaussians(number), ..Options::default() }
    }

    /// Checks the options on their own, before a snapshot is read.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number out of range, and options that contradict each other.
    pub fn check(&self) -> Result<()> {
        if let Some(radius) = self.radius.filter(|r| !(*r > 0.0 && r.is_finite())) {
            return Err(Error::argument(format!("the particle radius must be positive, not {radius}")));
        }
        if let Some(opacity) = self.opacity.filter(|a| !(*a > 0.0 && *a <= 1.0)) {
            return Err(Error::argument(format!("the opacity must be above 0 and at most 1, not {opacity}")));
        }
        if self.size_with_fields {
            let why = match self.target {
                _ if self.training.is_some() => Some("a model that is trained is trained at one size"),
                Target::Size(_) if self.fields.is_empty() => Some("no field is stored"),
                Target::Size(_) => None,
                _ => Some("the target is not a size"),
            };
            if let Some(why) = why {
                return Err(Error::argument(format!("the size of a file with its fields cannot be the target: {why}")));
            }
        }
        self.target.check().map(drop)
    }

    /// The law by which Gaussians become pictures.
    pub fn law(&self) -> LawKind {
        self.training.as_ref().map_or(LawKind::OpticalDepth, |t| t.law)
    }

    /// The recipe of a model in `blocks` blocks, as its file states it.
    pub fn recipe(&self, blocks: u32) -> Recipe {
        let mut read = self.read.clone();
        if !self.fields.is_empty() {
            read.insert("fields".into(), self.fields.join(","));
        }
        if self.star_forming != StarFormingGas::Keep {
            read.insert("star-forming".into(), self.star_forming.to_string());
        }
        if self.sharing != SharingPolicy::Automatic {
            read.insert(SharingPolicy::OPTION.into(), self.sharing.to_string());
        }
        Recipe {
            target: self.target,
            effort: self.effort,
            seed: self.seed,
            law: self.law(),
            training: self.training.as_ref().map(Config::recipe),
            read,
            radius: self.radius,
            opacity: self.opacity,
            blocks,
            ..Recipe::default()
        }
    }

    /// Whether species may share Gaussians by default. Blocks are fitted as those of a job, whose tasks cannot tell.
    pub(super) fn may_share(&self) -> bool {
        self.fields.is_empty() && self.training.is_none() && self.blocks.is_none() && self.memory.is_none()
    }

    /// The number of blocks in which `particles` are fitted in this process.
    pub fn blocks_of(&self, particles: &Particles) -> Result<u32> {
        let Some(bound_bytes) = self.memory else { return Ok(self.blocks.unwrap_or(1)) };
        let load = self.load(particles.len() as u64, particles.raw_bytes(), 1);
        let Some(blocks) = self.blocks else { return load.blocks_within(bound_bytes) };
        within(bound_bytes, load.block_bytes(u64::from(blocks)), blocks)
    }

    /// The number of blocks in which particles are fitted by tasks of their own, each within the memory, or
    /// within `default` bytes.
    pub(crate) fn tasks_of(&self, load: &MemoryLoad, default: u64) -> Result<u32> {
        let Some(blocks) = self.blocks else { return load.tasks_within(self.memory.unwrap_or(default)) };
        within(self.memory.unwrap_or(u64::MAX), load.task_bytes(u64::from(blocks)), blocks)
    }

    /// The memory load of `count` particles of `raw_bytes`; a process holds so many `copies` of a
    /// block's.
    pub(crate) fn load(&self, count: u64, raw_bytes: u64, copies: u64) -> MemoryLoad {
        let measuring = self.certificate == CertificateLevel::Blocks;
        MemoryLoad { count, raw_bytes, target: self.target, effort: self.effort, copies, measuring, fields: 0 }
    }
}

/// Whether the species of a snapshot share Gaussians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SharingPolicy {
    /// They do if that describes them better in as many bytes.
    #[default]
    Automatic,
    /// They do.
    Yes,
    /// Each has Gaussians of its own.
    No,
}

impl SharingPolicy {
    /// Its name in recipes.
    const OPTION: &str = "share-gaussians";

    /// The one that made a model.
    pub(super) fn of_recipe(recipe: &Recipe) -> Self {
        recipe.read.get(Self::OPTION).and_then(|text| text.parse().ok()).unwrap_or_default()
    }

    const NAMES: [(&str, SharingPolicy); 3] =
        [("auto", SharingPolicy::Automatic), ("yes", SharingPolicy::Yes), ("no", SharingPolicy::No)];
}

impl fmt::Display for SharingPolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::NAMES[*self as usize].0)
    }
}

impl std::str::FromStr for SharingPolicy {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let policy = Self::NAMES.iter().find(|(name, _)| *name == text);
        policy.map(|f| f.1).ok_or_else(|| "use `auto`, `yes` or `no`".into())
    }
}

/// `blocks`, if each takes no more than the bound.
fn within(bound_bytes: u64, need_bytes: u64, blocks: u32) -> Result<u32> {
    if need_bytes <= bound_bytes {
        return Ok(blocks);
    }
    Err(Error::Bound { what: format!("a fit in {blocks} blocks"), need_bytes, bound_bytes })
}
