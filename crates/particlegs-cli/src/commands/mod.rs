//! One file a command.

mod compare;
mod completions;
mod compress;
mod convert;
mod eval;
mod reference;
mod render;

use clap::Subcommand;
use particlegs::Result;

/// The verbs.
#[derive(Subcommand)]
pub enum Command {
    /// Turn a snapshot into a model file.
    Compress(compress::Arguments),
    /// Score two folders of pictures against each other.
    Compare(compare::Arguments),
    /// Score a model against its snapshot.
    Eval(eval::Arguments),
    /// Write a snapshot anew: tiled, cropped, thinned, as float32.
    Convert(convert::Arguments),
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
        Command::Compress(a) => compress::run(a),
        Command::Compare(a) => compare::run(a),
        Command::Eval(a) => eval::run(a),
        Command::Convert(a) => convert::run(a),
        Command::Reference(a) => reference::run(&a),
        Command::Render(a) => render::run(&a),
        Command::Completions(a) => completions::run(&a),
    }
}
