//! The `particlegs` command: parses, calls the library, reports. No numerics here.

mod commands;
mod common;
mod density_args;
mod emit;
mod fit_args;
mod info_model;
mod info_snapshot;
mod job_args;
mod options;
mod picture_out;
mod pictures;
mod plots;
mod report;
mod run_args;
mod snapshot_args;
mod source;
mod stats_plots;
mod stats_tables;
mod train_args;
mod train_log;
mod view_args;

use clap::{CommandFactory, FromArgMatches, Parser};
use std::process::ExitCode;

/// Particle snapshots as files a hundred times smaller that draw the picture ParaView would draw.
#[derive(Parser)]
#[command(name = "particlegs", version, propagate_version = true, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: commands::Command,
}

/// Parses, refuses options that would do nothing, and runs.
fn run() -> particlegs::Result<()> {
    let matches = Cli::command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
    options::check(&matches)?;
    commands::run(cli.command)
}

fn main() -> ExitCode {
    // A reader that closes its end of a pipe early is no error of ours.
    let outcome = std::panic::catch_unwind(run);
    match outcome {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(error)) => report::failure(&error),
        // The panic's own message has been printed; it is a defect of the program.
        Err(_) => ExitCode::from(70),
    }
}
