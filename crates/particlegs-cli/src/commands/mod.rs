//! One file a command.

mod completions;
mod reference;

use clap::Subcommand;
use particlegs::Result;

/// The verbs.
// Parsed once: its size costs nothing.
#[allow(clippy::large_enum_variant)]
#[derive(Subcommand)]
pub enum Command {
    /// Draw pictures of all particles: ParaView's exactly, or noise-free.
    Reference(reference::Arguments),
    /// Print a shell's completion script.
    Completions(completions::Arguments),
}

/// Runs one.
pub fn run(command: Command) -> Result<()> {
    match command {
        Command::Reference(a) => reference::run(&a),
        Command::Completions(a) => completions::run(&a),
    }
}
