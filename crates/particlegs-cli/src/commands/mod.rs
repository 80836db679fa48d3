//! One file a command.

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
mod finetune;
mod info;
mod man;
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
mod view;

use clap::Subcommand;
use particlegs_pipeline::Result;

/// The verbs.
// Parsed once: its size costs nothing.
#[allow(clippy::large_enum_variant)]
#[derive(Subcommand)]
pub enum Command {
    /// Compress a snapshot into a model file.
    Compress(compress::Arguments),
    /// Make a model smaller, without its snapshot.
    Simplify(simplify::Arguments),
    /// Merge model files, or the blocks of a job, without loss.
    Merge(merge::Arguments),
    /// Look at models in a browser.
    View(view::Arguments),
    /// Draw pictures of a model.
    Render(render::Arguments),
    /// Draw pictures of all particles of a snapshot.
    Reference(reference::Arguments),
    /// Describe a model file or a snapshot.
    Info(info::Arguments),
    /// Check a model file or a job, and measure its scores again.
    Verify(verify::Arguments),
    /// Score the pictures of a model against those of its snapshot.
    Eval(eval::Arguments),
    /// Score pictures against others: two files, or two folders.
    Compare(compare::Arguments),
    /// Compare statistics: density, P(k), xi(r), groups, neighbours.
    Stats(stats::Arguments),
    /// Compare models with other compressors: every table and figure.
    #[cfg(feature = "lab")]
    Bench(bench::Arguments),
    /// Convert a snapshot to another format; tile, crop or subsample it.
    Convert(convert::Arguments),
    /// Write a model for other viewers: splats, density grids, tables.
    Export(export::Arguments),
    /// Draw synthetic particles from a model.
    Recover(recover::Arguments),
    /// Plan a compression as a job of many tasks.
    Plan(plan::Arguments),
    /// Sort the particles of a job's snapshot by block.
    Scatter(scatter::Arguments),
    /// Fit one block of a job.
    Block(block::Arguments),
    /// Show how far a job is.
    Status(status::Arguments),
    /// Train a merged alpha-blend model on its whole snapshot.
    Finetune(finetune::Arguments),
    /// List the GPUs that can draw and train.
    Devices(devices::Arguments),
    /// Print the completion script of a shell.
    Completions(completions::Arguments),
    /// Write manual pages.
    Man(man::Arguments),
}

/// Headings in the help of the program, each with the command that it stands above.
const HEADINGS: [(&str, &str); 6] = [
    ("compress", "Make models"),
    ("view", "Look"),
    ("info", "Measure"),
    ("convert", "Convert"),
    ("plan", "Run on a cluster"),
    ("devices", "Other commands"),
];

/// The program with its commands listed by what they are for.
pub fn with_headings(program: clap::Command) -> clap::Command {
    let mut list = String::new();
    for command in program.get_subcommands() {
        if let Some((_, heading)) = HEADINGS.iter().find(|(first, _)| *first == command.get_name()) {
            list += &format!("{heading}:\n");
        }
        let about = command.get_about().expect("every command says what it does");
        list += &format!("  {:<12} {about}\n", command.get_name());
    }
    program.help_template(format!(
        "{{about}}\n\n{{usage-heading}} {{usage}}\n\n{list}\nOptions:\n{{options}}\n\n\
         `particlegs COMMAND -h` shows the main options of a command, `--help` all of them."
    ))
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
        Command::Export(a) => export::run(a),
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
