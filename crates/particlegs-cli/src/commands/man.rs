//! `particlegs man DIR`.

use clap::{Args, CommandFactory, ValueHint};
use clap_mangen::Man;
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_files::output::{self, Kind, Outputs};
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "\
Writes particlegs.1, and particlegs-COMMAND.1 for each command.

Examples:
  particlegs man ~/.local/share/man/man1 && man particlegs-compress
  particlegs man pages && man pages/particlegs-render.1")]
pub struct Arguments {
    /// Folder for the pages.
    #[arg(value_name = "DIR", value_hint = ValueHint::DirPath)]
    folder: PathBuf,
}

const PAGE: Kind = Kind { name: "a manual page", kept: false, is: |_, head| head.windows(4).any(|w| w == b".TH ") };

pub fn run(a: &Arguments) -> Result<()> {
    let outputs = Outputs::new(false);
    outputs.make_folder(&a.folder)?;
    // The pages also describe options that only `--help` shows.
    let with_all_options = |command: clap::Command| command.mut_args(|a| a.hide_short_help(false));
    let mut program = crate::Cli::command().mut_subcommands(with_all_options);
    program.build();
    for command in program.get_subcommands().filter(|c| c.get_name() != "help") {
        let title = format!("{}-{}", program.get_name(), command.get_name());
        page(command.clone().display_name(title.clone()), &a.folder.join(format!("{title}.1")), &outputs)?;
    }
    let path = a.folder.join(format!("{}.1", program.get_name()));
    page(program, &path, &outputs)
}

fn page(command: clap::Command, path: &Path, outputs: &Outputs) -> Result<()> {
    outputs.writes(path, &PAGE, &Context::SILENT)?;
    let mut page = Vec::new();
    let source = concat!("particlegs ", env!("CARGO_PKG_VERSION"));
    Man::new(command).source(source).render(&mut page).map_err(|e| Error::io(path, e))?;
    // clap_mangen gives the examples behind the options this unusual heading.
    let page = String::from_utf8_lossy(&page).replace(".SH EXTRA", ".SH NOTES");
    output::write_bytes(path, page.as_bytes())
}
