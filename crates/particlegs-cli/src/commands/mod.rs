//! One file a command.

mod completions;
mod reference;

use clap::Subcommand;
use particlegs::Result;

/// The verbs.
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
