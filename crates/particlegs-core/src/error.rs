//! One error type for the library: what went wrong, where, and a hint at what would help.

use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

/// The library's result.
pub type Result<T> = std::result::Result<T, Error>;

/// An error that a caller can act on. Every variant's text is one line that names place and fault: `place` is a file, a
/// folder or an argument, `what` what is wrong with it or which step it is, `hint` what would help; memory is in bytes.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
#[non_exhaustive]
pub enum Error {
    /// A snapshot, views file or picture that cannot be used as it is.
    #[error("{place}: {what}")]
    Input { place: String, what: String, hint: Hint },
    /// A model file whose bytes contradict docs/format.md.
    #[error("{place}: corrupt model file: {what}")]
    Corrupt { place: String, what: String },
    /// A model file of a version or with a feature that this program does not know.
    #[error("{place}: {what}")]
    Compatibility { place: String, what: String },
    /// An argument outside its range.
    #[error("{what}")]
    Argument { what: String, hint: Hint },
    /// A size or quality that cannot be reached with this input.
    #[error("{what}")]
    Unreachable { what: String, hint: Hint },
    /// More memory than the machine has.
    #[error("{what} needs about {need_bytes} bytes of memory, but only {have_bytes} are available")]
    Memory { what: String, need_bytes: u64, have_bytes: u64 },
    /// More memory than the caller allows.
    #[error("{what} needs about {need_bytes} bytes of memory, but only {bound_bytes} are allowed")]
    Bound { what: String, need_bytes: u64, bound_bytes: u64 },
    /// Reading or writing failed.
    #[error("{place}: {source}")]
    Io { place: String, source: std::io::Error },
    /// An output that is an input or another output, or that is there and may not be replaced.
    #[error("{place}: {what}")]
    Output { place: String, what: String, hint: Hint },
    /// A measurement that differs from what a file says.
    #[error("{place}: {what}")]
    Differs { place: String, what: String, hint: Hint },
    /// The caller asked to stop.
    #[error("stopped")]
    Cancelled,
    /// The caller asked to stop, and the same command goes on from there.
    #[error("{what}: stopped; finished work is saved")]
    Checkpointed { what: String },
}

impl Error {
    /// A number for each kind of error, from 2 to 130: the command's exit code (docs/guide/exit-codes.md).
    pub fn code(&self) -> u8 {
        match self {
            Error::Argument { .. } => 2,
            Error::Input { .. } => 3,
            Error::Corrupt { .. } | Error::Compatibility { .. } => 4,
            Error::Unreachable { .. } => 5,
            Error::Io { .. } => 6,
            Error::Memory { .. } | Error::Bound { .. } => 7,
            Error::Output { .. } => 8,
            Error::Differs { .. } => 9,
            // As sysexits.h has it for what is to be tried again.
            Error::Checkpointed { .. } => 75,
            // 128 and the number of SIGINT.
            Error::Cancelled => 130,
        }
    }

    /// An unusable input without advice.
    pub fn input(place: impl AsPlace, what: impl Into<String>) -> Self {
        Self::input_with(place, what, Hint::default())
    }

    /// An unusable input and what would help.
    pub fn input_with(place: impl AsPlace, what: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Error::Input { place: place.as_place(), what: what.into(), hint: hint.into() }
    }

    /// A corrupt model file.
    pub fn corrupt(place: impl AsPlace, what: impl Into<String>) -> Self {
        Error::Corrupt { place: place.as_place(), what: what.into() }
    }

    /// An argument outside its range.
    pub fn argument(what: impl Into<String>) -> Self {
        Self::argument_with(what, Hint::default())
    }

    /// An argument outside its range and what would help.
    pub fn argument_with(what: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Error::Argument { what: what.into(), hint: hint.into() }
    }

    /// The same, where an argument is at fault: its place comes first.
    #[must_use]
    pub fn at(self, place: &str) -> Self {
        match self {
            Error::Argument { what, hint } => Error::Argument { what: format!("{place}: {what}"), hint },
            other => other,
        }
    }

    /// A size or quality that cannot be reached and what would help.
    pub fn unreachable(what: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Error::Unreachable { what: what.into(), hint: hint.into() }
    }

    /// An output that is not written over what is there, and what to do about it.
    pub fn output(place: impl AsPlace, what: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Error::Output { place: place.as_place(), what: what.into(), hint: hint.into() }
    }

    /// A failed read or write.
    pub fn io(place: impl AsPlace, source: std::io::Error) -> Self {
        Error::Io { place: place.as_place(), source }
    }

    /// The hint at what would help.
    pub fn hint(&self) -> Hint {
        match self {
            Error::Input { hint, .. }
            | Error::Argument { hint, .. }
            | Error::Unreachable { hint, .. }
            | Error::Output { hint, .. }
            | Error::Differs { hint, .. } => hint.clone(),
            Error::Corrupt { .. } => {
                Hint::from("copy the file again from its source; ").command("verify", "").words(" checks it")
            }
            Error::Compatibility { .. } => "use a newer particlegs".into(),
            Error::Memory { .. } => "use a machine with more memory, or a smaller snapshot or picture".into(),
            Error::Bound { .. } => {
                Hint::from("allow that much with ").option("memory", "").words(", or ask for a smaller model")
            }
            Error::Checkpointed { .. } => "run the same command again to continue".into(),
            Error::Io { .. } | Error::Cancelled => Hint::default(),
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

/// A hint at what would help: words, among them options and commands, which the command line, Python and a page each
/// spell in their own way ([`Hint::spell`]). Empty where nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hint(Vec<HintPart>);

#[derive(Clone, Debug, PartialEq)]
enum HintPart {
    Words(String),
    Option(&'static str, String),
    Command(&'static str, String),
}

impl Hint {
    /// Whether it is empty.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Goes on with words.
    pub fn words(mut self, words: impl Into<String>) -> Self {
        let words = words.into();
        self.0.extend((!words.is_empty()).then_some(HintPart::Words(words)));
        self
    }

    /// Goes on with an option, by the command line's name without dashes, and its value (empty: without one).
    pub fn option(mut self, name: &'static str, value: impl Display) -> Self {
        self.0.push(HintPart::Option(name, value.to_string()));
        self
    }

    /// Goes on with a command and its arguments.
    pub fn command(mut self, name: &'static str, arguments: impl Display) -> Self {
        self.0.push(HintPart::Command(name, arguments.to_string()));
        self
    }

    /// This, then another.
    pub fn and(mut self, other: Hint) -> Self {
        if !self.is_empty() && !other.is_empty() {
            self = self.words("; ");
        }
        self.0.extend(other.0);
        self
    }

    /// In one line: options by name and value, and commands by name and arguments, as the functions spell them.
    pub fn spell(&self, option: impl Fn(&str, &str) -> String, command: impl Fn(&str, &str) -> String) -> String {
        let spell = |part: &HintPart| match part {
            HintPart::Words(words) => words.clone(),
            HintPart::Option(name, value) => option(name, value),
            HintPart::Command(name, arguments) => command(name, arguments),
        };
        self.0.iter().map(spell).collect()
    }

    /// State the periodic box.
    pub fn state_box() -> Self {
        Hint::from("set it with ").option("box", "Lx,Ly,Lz")
    }

    /// Choose fewer species.
    pub fn choose_species() -> Self {
        Hint::from("choose fewer with ").option("particle-type", "")
    }

    /// A file of at least so many bytes.
    pub fn larger_file(bytes: u64) -> Self {
        Hint::from("ask for ").option("size", format!("{bytes}B")).words(" or more")
    }

    /// Train from the snapshot.
    pub fn train_from_snapshot() -> Self {
        Hint::default().command("compress", "").words(" with ").option("train", "").words(" trains such a model")
    }

    /// Use the CPU.
    pub fn use_cpu() -> Self {
        Hint::from("use the CPU: ").option("device", "cpu")
    }
}

impl Display for Hint {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let spell = |name: &str, more: &str| format!("`{}`", [name, more].join(" ").trim_end());
        f.write_str(&self.spell(spell, spell))
    }
}

impl From<&str> for Hint {
    fn from(words: &str) -> Self {
        Hint::default().words(words)
    }
}

impl From<String> for Hint {
    fn from(words: String) -> Self {
        Hint::default().words(words)
    }
}
