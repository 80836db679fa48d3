//! One file a command.

mod completions;
mod reference;
mod render;

use clap::Subcommand;
use particlegs::Result;

/// The verbs.
#[derive(Subcommand)]
pub enum Command {
    /// Draw pictures of all particles: ParaView's exactly, or noise-free.
    Reference(reference::Arguments),
    /// Draw pictures of a model.
    Render(render::Arguments),
    /// Print a shell's completion script.
    Completions(completions::Arguments),
}

/// Runs one.
pub fn run(command: Command) -> Result<()> {
    match command {
        Command::Reference(a) => reference::run(&a),
        Command::Render(a) => render::run(&a),
        Command::Completions(a) => completions::run(&a),
    }
}
