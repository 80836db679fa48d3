//! `particlegs completions SHELL`.

use clap::{Args, CommandFactory};
use particlegs_core::Result;

#[derive(Args)]
#[command(
    after_help = "Example:\n  particlegs completions bash > ~/.local/share/bash-completion/completions/particlegs"
)]
pub struct Arguments {
    /// Shell.
    shell: clap_complete::Shell,
}

pub fn run(a: &Arguments) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(a.shell, &mut crate::Cli::command(), "particlegs", &mut script);
    crate::report::text(&script)
}
