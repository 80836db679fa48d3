//! `--certificate`: how much of a decoded model is measured.

use clap::{Args, ValueEnum};
use particlegs::model::CertificateLevel;

/// The option.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct CertificateArgs {
    /// How much of the decoded model is measured and stored in the file.
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = Level::Quick)]
    certificate: Level,
}

/// Levels on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Level {
    /// Nothing: the file holds no scores.
    None,
    /// Pictures, densities, power spectrum and distances.
    Quick,
    /// Also groups, matched in eight draws, and models of halves of the particles against the other halves.
    Full,
    /// What blocks of a job measure each by itself, added up: no process needs all particles.
    Blocks,
}

impl From<Level> for CertificateLevel {
    fn from(level: Level) -> Self {
        match level {
            Level::None => CertificateLevel::None,
            Level::Quick => CertificateLevel::Quick,
            Level::Full => CertificateLevel::Full,
            Level::Blocks => CertificateLevel::Blocks,
        }
    }
}

impl CertificateArgs {
    /// The level.
    pub fn level(&self) -> CertificateLevel {
        self.certificate.into()
    }
}
