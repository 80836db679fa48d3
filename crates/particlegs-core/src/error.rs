//! One error type for the library: what went wrong, where, and what would help.

use crate::Remedy;
use std::path::{Path, PathBuf};

/// The library's result.
pub type Result<T> = std::result::Result<T, Error>;

/// What a caller can act on. Every variant's text is one line that names the place and the fault: `place` is a file, a
/// folder or an argument, `what` what is wrong with it or which step it is, `remedy` what would help; memory is in bytes.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
#[non_exhaustive]
pub enum Error {
    /// A snapshot, views file or picture that cannot be used as it is.
    #[error("{place}: {what}")]
    Input { place: String, what: String, remedy: Remedy },
    /// A model file whose bytes contradict docs/format.md.
    #[error("{place}: corrupt model file: {what}")]
    Corrupt { place: String, what: String },
    /// A model file of a version or with a feature that this program does not know.
    #[error("{place}: {what}")]
    Compatibility { place: String, what: String },
    /// An argument outside its range.
    #[error("{what}")]
    Argument { what: String, remedy: Remedy },
    /// A size or quality that cannot be reached with this input.
    #[error("{what}")]
    Unreachable { what: String, remedy: Remedy },
    /// More memory than the machine has.
    #[error("{what} needs about {need_bytes} bytes of memory, {have_bytes} are available")]
    Memory { what: String, need_bytes: u64, have_bytes: u64 },
    /// More memory than the caller allows.
    #[error("{what} needs about {need_bytes} bytes of memory, {bound_bytes} are allowed")]
    Bound { what: String, need_bytes: u64, bound_bytes: u64 },
    /// Reading or writing failed.
    #[error("{place}: {source}")]
    Io { place: String, source: std::io::Error },
    /// An output that is an input or another output, or that is there and may not be replaced.
    #[error("{place}: {what}")]
    Output { place: String, what: String, remedy: Remedy },
    /// What was measured is not what a file says.
    #[error("{place}: {what}")]
    Differs { place: String, what: String, remedy: Remedy },
    /// The caller asked to stop.
    #[error("stopped")]
    Cancelled,
    /// The caller asked to stop, and the same command goes on from there.
    #[error("{what}: stopped; what is finished is kept")]
    Checkpointed { what: String },
}

impl Error {
    /// An unusable input without advice.
    pub fn input(place: impl AsPlace, what: impl Into<String>) -> Self {
        Self::input_with(place, what, Remedy::None)
    }

    /// An unusable input and what would help.
    pub fn input_with(place: impl AsPlace, what: impl Into<String>, remedy: impl Into<Remedy>) -> Self {
        Error::Input { place: place.as_place(), what: what.into(), remedy: remedy.into() }
    }

    /// A corrupt model file.
    pub fn corrupt(place: impl AsPlace, what: impl Into<String>) -> Self {
        Error::Corrupt { place: place.as_place(), what: what.into() }
    }

    /// An argument outside its range.
    pub fn argument(what: impl Into<String>) -> Self {
        Error::Argument { what: what.into(), remedy: Remedy::None }
    }

    /// An output that is not written over what is there, and what to do about it.
    pub fn output(place: impl AsPlace, what: impl Into<String>, remedy: impl Into<Remedy>) -> Self {
        Error::Output { place: place.as_place(), what: what.into(), remedy: remedy.into() }
    }

    /// A failed read or write.
    pub fn io(place: impl AsPlace, source: std::io::Error) -> Self {
        Error::Io { place: place.as_place(), source }
    }

    /// What would help.
    pub fn remedy(&self) -> Remedy {
        match self {
            Error::Input { remedy, .. }
            | Error::Argument { remedy, .. }
            | Error::Unreachable { remedy, .. }
            | Error::Output { remedy, .. }
            | Error::Differs { remedy, .. } => remedy.clone(),
            Error::Corrupt { .. } => Remedy::CopyAgain,
            Error::Compatibility { .. } => Remedy::UseNewer,
            Error::Memory { .. } => Remedy::MoreMemory,
            Error::Bound { .. } => Remedy::AllowMemory,
            Error::Checkpointed { .. } => Remedy::GoOn,
            Error::Io { .. } | Error::Cancelled => Remedy::None,
        }
    }
}

/// Anything that names the place of an error.
pub trait AsPlace {
    /// The text shown before the colon.
    fn as_place(&self) -> String;
}

macro_rules! places {
    ($($place:ty: $text:ident;)*) => {
        $(impl AsPlace for $place {
            fn as_place(&self) -> String {
                self.$text().to_string()
            }
        })*
    };
}

places!(&str: to_owned; String: as_str; &String: as_str; &Path: display; &PathBuf: display;);
