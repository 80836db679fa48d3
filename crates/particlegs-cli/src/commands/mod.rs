//! One file per command.

#[cfg(feature = "lab")]
mod bench;
mod block;
mod compare;
mod completions;
mod compress;
mod convert;
mod devices;
mod eval;
mod export;
mod extract;
mod finetune;
mod haloes;
mod info;
mod man;
mod merge;
mod plan;
mod recover;
mod reference;
mod render;
mod scatter;
mod series;
mod simplify;
pub mod stats;
mod status;
mod verify;
mod view;

use clap::Subcommand;
use particlegs_core::Result;

/// The groups that the help lists.
pub const GROUPS: [(&str, &[&str]); 6] = [
    ("Make", &["compress", "series", "simplify", "merge"]),
    ("Look", &["view", "render", "reference"]),
    ("Measure", &["info", "verify", "eval", "compare", "stats", "haloes"]),
    ("Convert", &["convert", "export", "extract", "recover"]),
    ("Cluster", &["plan", "scatter", "block", "status", "finetune"]),
    (
        "Other",
        &[
            "devices",
            #[cfg(feature = "lab")]
            "bench",
            "man",
            "completions",
            "help",
        ],
    ),
];

/// The commands.
// It is parsed once, so its size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Subcommand)]
pub enum Command {
    /// Compress a snapshot into a model file.
    Compress(compress::Arguments),
    /// Compress the snapshots of a run into one series file.
    Series(series::Arguments),
    /// Take one frame of a series as a model file.
    Extract(extract::Arguments),
    /// Compare pictures or surface densities: two files, or two folders.
    Compare(compare::Arguments),
    /// Score the pictures of a model against those of its snapshot.
    Eval(eval::Arguments),
    /// Plan a compression as a job of many tasks, for a cluster.
    Plan(plan::Arguments),
    /// Sort the particles of a job's snapshot by block.
    Scatter(scatter::Arguments),
    /// Fit one block of a job.
    Block(block::Arguments),
    /// Show the progress of a job.
    Status(status::Arguments),
    /// Merge model files, or the blocks of a job, into one file, without loss.
    Merge(merge::Arguments),
    /// Train a merged alpha-blend model on its whole snapshot.
    Finetune(finetune::Arguments),
    /// Make a model smaller, without its snapshot.
    Simplify(simplify::Arguments),
    /// Draw synthetic particles from a model.
    Recover(recover::Arguments),
    /// Export a model: web page, splats, density grid or table.
    Export(export::Arguments),
    /// Find haloes in a snapshot or a model: a catalogue.
    #[command(alias = "halos")]
    Haloes(haloes::Arguments),
    /// Convert a snapshot to another format; tile, crop or subsample it.
    Convert(convert::Arguments),
    /// Render pictures of all particles of a snapshot.
    Reference(reference::Arguments),
    /// Render pictures of a model.
    Render(render::Arguments),
    /// List the GPUs that can render and train.
    Devices(devices::Arguments),
    /// View models in a browser.
    View(view::Arguments),
    /// Compare statistics: density, P(k), xi(r), groups, velocities.
    Stats(stats::Arguments),
    /// Describe a model file or a snapshot.
    Info(info::Arguments),
    /// Check that a model file or job is intact, and measure its scores again.
    Verify(verify::Arguments),
    /// Benchmark models against other compressors, with tables and figures.
    #[cfg(feature = "lab")]
    Bench(bench::Arguments),
    /// Print a shell completion script.
    Completions(completions::Arguments),
    /// Write manual pages.
    Man(man::Arguments),
}

pub fn run(command: Command) -> Result<()> {
    match command {
        Command::Compress(a) => compress::run(a),
        Command::Series(a) => series::run(a),
        Command::Extract(a) => extract::run(a),
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
        Command::Export(a) => export::run(a),
        Command::Haloes(a) => haloes::run(a),
        Command::Convert(a) => convert::run(a),
        Command::Reference(a) => reference::run(&a),
        Command::Render(a) => render::run(&a),
        Command::Devices(a) => devices::run(a),
        Command::View(a) => view::run(a),
        Command::Stats(a) => stats::run(a),
        Command::Info(a) => info::run(a),
        Command::Verify(a) => verify::run(a),
        #[cfg(feature = "lab")]
        Command::Bench(a) => bench::run(&a),
        Command::Completions(a) => completions::run(&a),
        Command::Man(a) => man::run(&a),
    }
}
