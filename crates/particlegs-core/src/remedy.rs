//! What a caller can change where work is refused.

use std::fmt;
use std::path::PathBuf;

/// What would help, for people and for programs: how it is asked for (an option, an argument, a button) is the
/// caller's to say. Shown, it is a phrase in plain words; nothing where nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Remedy {
    /// Nothing is known.
    #[default]
    None,
    /// Something that no choice of the caller's stands for.
    Words(String),
    /// Both, one after the other.
    Both(Box<(Remedy, Remedy)>),
    /// Copy a model file again from its source.
    CopyAgain,
    /// Use a newer version.
    UseNewer,
    /// Use a machine with more memory.
    MoreMemory,
    /// Allow more memory.
    AllowMemory,
    /// Do the same again: it goes on from what is kept.
    GoOn,
    /// State the periodic box.
    StateBox,
    /// State the periodic box, or choose a region that does not wrap around.
    StateBoxOrRegion,
    /// Leave invalid particles out, or take no weights.
    LeaveOutInvalid,
    /// Weigh particles by their masses, or count them.
    WeighByMass,
    /// One layer a species, not one a mass.
    LayersBySpecies,
    /// Choose fewer species, or one.
    ChooseSpecies,
    /// Name the format: one of these.
    NameFormat(String),
    /// Name the format, so that files of others are left out.
    NameFormatOfFolder,
    /// Name the columns of positions: those there are.
    NamePositions(Vec<String>),
    /// Choose the field of positions: those there are.
    ChoosePositions(Vec<String>),
    /// Name the blocks of a file that does not.
    NameBlocks,
    /// Read this frame, the last whole one.
    ReadFrame(u64),
    /// A file of at least so many bytes, or at most this ratio.
    LargerFile {
        /// Bytes.
        bytes: u64,
        /// The ratio that they are, where it is one.
        ratio: Option<f64>,
    },
    /// A larger file, or no network of the alpha-blend law.
    LargerFileOrNoNetwork,
    /// At least so many Gaussians.
    MoreGaussians(u64),
    /// A size, a ratio or a number instead of a quality.
    NoQuality,
    /// Train from the snapshot.
    TrainFromSnapshot,
    /// Draw particles from the model.
    DrawParticles,
    /// Plan the job.
    PlanJob,
    /// Sort a chunk of a job, again where it is broken.
    SortChunk {
        /// The job's folder.
        folder: PathBuf,
        /// The chunk.
        chunk: u64,
        /// Is what is there broken?
        broken: bool,
    },
    /// Fit a block of a job, again where it is broken.
    FitBlock {
        /// The job's folder.
        folder: PathBuf,
        /// The block.
        block: u32,
        /// Is what is there broken?
        broken: bool,
    },
    /// The file is a snapshot: a model can be made of it.
    IsSnapshot,
    /// The file is a model: particles and pictures can be drawn of it.
    IsModel,
    /// The folder is a job: its blocks can be merged.
    IsJob,
    /// The file belongs to a job: its folder can be merged.
    IsFileOfJob,
    /// A model file is wanted.
    NameModel,
}

impl Remedy {
    /// Nothing known?
    pub fn is_none(&self) -> bool {
        match self {
            Remedy::None => true,
            Remedy::Words(words) => words.is_empty(),
            _ => false,
        }
    }

    /// This, then another.
    pub fn and(self, other: Remedy) -> Remedy {
        match (self.is_none(), other.is_none()) {
            (true, _) => other,
            (_, true) => self,
            _ => Remedy::Both(Box::new((self, other))),
        }
    }
}

impl fmt::Display for Remedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let again = |broken: &bool| if *broken { " again" } else { "" };
        match self {
            Remedy::None => Ok(()),
            Remedy::Words(words) => f.write_str(words),
            Remedy::Both(both) => write!(f, "{}; {}", both.0, both.1),
            Remedy::CopyAgain => f.write_str("copy the file again from its source"),
            Remedy::UseNewer => f.write_str("use a newer version"),
            Remedy::MoreMemory => f.write_str("use a machine with more memory, or a smaller snapshot or picture"),
            Remedy::AllowMemory => f.write_str("allow that much memory, or ask for a smaller model"),
            Remedy::GoOn => f.write_str("do the same again to continue"),
            Remedy::StateBox => f.write_str("state the periodic box"),
            Remedy::StateBoxOrRegion => f.write_str("state the periodic box, or a region that does not wrap around"),
            Remedy::LeaveOutInvalid => f.write_str("leave invalid particles out, or take no weights"),
            Remedy::WeighByMass => f.write_str("weigh by masses, or take no weights to count particles"),
            Remedy::LayersBySpecies => f.write_str("take one layer a species"),
            Remedy::ChooseSpecies => f.write_str("choose fewer species"),
            Remedy::NameFormat(formats) => write!(f, "name the format, one of: {formats}"),
            Remedy::NameFormatOfFolder => f.write_str("name one of them, or the format"),
            Remedy::NamePositions(there) => write!(f, "name the columns of positions; there are: {}", there.join(", ")),
            Remedy::ChoosePositions(there) => write!(f, "choose the field of positions: {}", there.join(", ")),
            Remedy::NameBlocks => f.write_str("name the blocks behind the header, in order"),
            Remedy::ReadFrame(frame) => write!(f, "frame {frame} is the last whole one"),
            Remedy::LargerFile { bytes, ratio: None } => write!(f, "ask for {bytes} bytes or more"),
            Remedy::LargerFile { bytes, ratio: Some(ratio) } => {
                write!(f, "ask for {bytes} bytes or more, or for a ratio of {ratio:.4} or less")
            }
            Remedy::LargerFileOrNoNetwork => f.write_str("ask for a larger file, or for no network"),
            Remedy::MoreGaussians(number) => write!(f, "ask for {number} Gaussians or more"),
            Remedy::NoQuality => f.write_str("ask for a size, a ratio or a number of Gaussians"),
            Remedy::TrainFromSnapshot => f.write_str("train such a model from its snapshot"),
            Remedy::DrawParticles => f.write_str("draw particles from it"),
            Remedy::PlanJob => f.write_str("plan the job first"),
            Remedy::SortChunk { chunk, broken, .. } => write!(f, "sort chunk {chunk}{}", again(broken)),
            Remedy::FitBlock { block, broken, .. } => write!(f, "fit block {block}{}", again(broken)),
            Remedy::IsSnapshot => f.write_str("make a model of it first"),
            Remedy::IsModel => f.write_str("draw particles or pictures of it"),
            Remedy::IsJob => f.write_str("merge its blocks first"),
            Remedy::IsFileOfJob => f.write_str("merge the job's blocks first"),
            Remedy::NameModel => f.write_str("name a model file"),
        }
    }
}

impl From<&str> for Remedy {
    fn from(words: &str) -> Self {
        Remedy::Words(words.into())
    }
}

impl From<String> for Remedy {
    fn from(words: String) -> Self {
        Remedy::Words(words)
    }
}
