//! The `particlegs` command: parses, calls the library, reports. No numerics here.

mod commands;
mod common;
mod device;
mod emit;
mod fit_args;
mod info_model;
mod info_snapshot;
mod inputs;
mod options;
mod outputs;
mod page_args;
mod page_models;
mod picture_args;
mod process;
mod progress;
mod report;
mod snapshot_args;
mod train_args;

use clap::{CommandFactory, FromArgMatches, Parser};
use particlegs_core::{Error, Result};
use std::ffi::OsString;
use std::process::ExitCode;

/// Compress particle snapshots 100x and more, into models that reproduce ParaView's pictures.
#[derive(Parser)]
#[command(
    name = "particlegs",
    version,
    propagate_version = true,
    max_term_width = 100,
    mut_subcommands = subcommand
)]
struct Cli {
    #[command(subcommand)]
    command: commands::Command,
}

/// A command's `-V` says the program's name and version. Names of Gadget's blocks are `--blocks`, too, where that is not
/// a number of blocks.
fn subcommand(command: clap::Command) -> clap::Command {
    let has = |id: &str| command.get_arguments().any(|a| a.get_id() == id);
    let (names, number) = (has("gadget_blocks"), has("blocks"));
    let command = command.display_name("particlegs");
    if names && !number { command.mut_arg("gadget_blocks", |a| a.visible_alias("blocks")) } else { command }
}

/// The command, whose help lists its commands by group: clap groups options alone.
fn program() -> clap::Command {
    let mut program = Cli::command();
    // clap adds the command `help`, which a group names, only when it is built.
    program.build();
    let header = *program.get_styles().get_header();
    let mut template = String::from("{about-with-newline}\n{usage-heading} {usage}\n\n");
    for (group, names) in commands::GROUPS {
        template += &format!("{header}{group}:{header:#}\n");
        for command in names.iter().filter_map(|name| program.find_subcommand(name)) {
            let about = command.get_about().unwrap_or_default();
            template += &format!("  {:<12} {about}\n", command.get_name());
        }
    }
    program.help_template(format!("{template}{header}Options:{header:#}\n{{options}}"))
}

fn run() -> Result<()> {
    // `help -h` is `help`.
    let mut arguments: Vec<OsString> = std::env::args_os().collect();
    if arguments.get(1).is_some_and(|command| command == "help") {
        arguments.retain(|a| a != "-h" && a != "--help");
    }
    if cfg!(not(feature = "lab")) && arguments.get(1).is_some_and(|command| command == "bench") {
        let message = "this program was built without `bench`";
        return Err(Error::argument_with(
            message,
            "build it with `cargo build --release -p particlegs-cli --features lab`",
        ));
    }
    let matches = match program().try_get_matches_from(arguments) {
        Ok(matches) => matches,
        // clap gives help and versions as errors, too.
        Err(page) if !page.use_stderr() => return report::help(&page),
        Err(wrong) => wrong.exit(),
    };
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
    options::check(&matches)?;
    commands::run(cli.command)
}

fn main() -> ExitCode {
    process::end_with_message();
    process::meet_file_size_limits();
    end_on_panic();
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => report::failure(&error),
    }
}

/// Makes a panic on any thread, which is a bug, print its location and end the command.
fn end_on_panic() {
    let say = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        say(panic);
        // EX_SOFTWARE of sysexits.h (docs/guide/exit-codes.md).
        std::process::exit(70);
    }));
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_command_is_in_one_group() {
        let program = crate::program();
        let mut commands: Vec<&str> = program.get_subcommands().map(clap::Command::get_name).collect();
        let mut grouped: Vec<&str> = crate::commands::GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        commands.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(grouped, commands);
    }
}
