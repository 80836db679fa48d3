//! One file a command.

mod block;
mod compare;
mod completions;
mod compress;
mod convert;
mod eval;
mod finetune;
mod info;
mod merge;
mod plan;
mod recover;
mod reference;
mod render;
mod scatter;
mod simplify;
mod stats;
mod status;
mod verify;

use clap::Subcommand;
use particlegs::Result;

/// The verbs.
// Parsed once: its size costs nothing.
#[allow(clippy::large_enum_variant)]
#[derive(Subcommand)]
pub enum Command {
    /// Turn a snapshot into a model file.
    Compress(compress::Arguments),
    /// Score two folders of pictures against each other.
    Compare(compare::Arguments),
    /// Score a model against its snapshot.
    Eval(eval::Arguments),
    /// Plan a compression as a folder whose parts run anywhere, in any order.
    Plan(plan::Arguments),
    /// Sort a chunk of a job's snapshot into its blocks.
    Scatter(scatter::Arguments),
    /// Do one block of a job.
    Block(block::Arguments),
    /// Tell how far a job is.
    Status(status::Arguments),
    /// Join model files, or a job's blocks, into one, exactly: blocks are copied.
    Merge(merge::Arguments),
    /// Train a merged alpha-blend model on its whole snapshot, as published.
    Finetune(finetune::Arguments),
    /// Make a model smaller, without the particles.
    Simplify(simplify::Arguments),
    /// Draw synthetic particles from a model.
    Recover(recover::Arguments),
    /// Write a snapshot anew: tiled, cropped, thinned, as float32.
    Convert(convert::Arguments),
    /// Draw pictures of all particles: ParaView's exactly, or noise-free.
    Reference(reference::Arguments),
    /// Draw pictures of a model.
    Render(render::Arguments),
    /// Measure what recovered particles, or a model itself, are good for: density, P(k), xi(r), groups.
    Stats(stats::Arguments),
    /// Print what a model file or a snapshot says about itself.
    Info(info::Arguments),
    /// Check a model file wholly, and against its snapshot where that is given; or a job.
    Verify(verify::Arguments),
    /// Print a shell's completion script.
    Completions(completions::Arguments),
}

/// Does a path name a file that begins as a model does?
pub fn is_model(path: &std::path::Path) -> bool {
    info::is_model(path).unwrap_or(false)
}

/// Runs one.
pub fn run(command: Command) -> Result<()> {
    match command {
        Command::Compress(a) => compress::run(a),
        Command::Compare(a) => compare::run(a),
        Command::Eval(a) => eval::run(a),
        Command::Plan(a) => plan::run(a),
        Command::Scatter(a) => scatter::run(a),
        Command::Block(a) => block::run(a),
        Command::Status(a) => status::run(a),
        Command::Merge(a) => merge::run(a),
        Command::Finetune(a) => finetune::run(a),
        Command::Simplify(a) => simplify::run(a),
        Command::Recover(a) => recover::run(a),
        Command::Convert(a) => convert::run(a),
        Command::Reference(a) => reference::run(&a),
        Command::Render(a) => render::run(&a),
        Command::Stats(a) => stats::run(a),
        Command::Info(a) => info::run(a),
        Command::Verify(a) => verify::run(a),
        Command::Completions(a) => completions::run(&a),
    }
}
