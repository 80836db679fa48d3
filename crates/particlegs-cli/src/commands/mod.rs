//! One file a command.

mod completions;

use clap::Subcommand;
use particlegs::Result;

/// The verbs.
#[derive(Subcommand)]
pub enum Command {
    /// Print a shell's completion script.
    Completions(completions::Arguments),
}

/// Runs one.
pub fn run(command: Command) -> Result<()> {
    match command {
        Command::Completions(a) => completions::run(&a),
    }
}
