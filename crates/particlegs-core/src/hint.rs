//! Hints at what a caller can change where work is refused.

use std::fmt::{Display, Formatter, Result};

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
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
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
