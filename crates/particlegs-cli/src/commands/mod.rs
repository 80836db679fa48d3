//! One file a command.

mod completions;
mod info;
mod verify;

use clap::Subcommand;
use particlegs::Result;

/// The verbs.
#[derive(Subcommand)]
pub enum Command {
    /// Print what a model file says about itself and its snapshot.
    Info(info::Arguments),
    /// Check a model file wholly, and against its snapshot where that is given.
    Verify(verify::Arguments),
    /// Print a shell's completion script.
    Completions(completions::Arguments),
}

/// Runs one.
pub fn run(command: Command) -> Result<()> {
    match command {
        Command::Info(a) => info::run(a),
        Command::Verify(a) => verify::run(a),
        Command::Completions(a) => completions::run(&a),
    }
}
